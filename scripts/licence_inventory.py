"""The licences of all that cadpose is made of or may use: `make licences`.

    python scripts/licence_inventory.py [--page docs/licences.md] [--spdx dist/cadpose.spdx.json]

Writes the page of the documentation and an SPDX 2.3 document. It reads what is installed, so all extras have
to be; a package that is not there is an error. The page has no versions, so that it changes only where a
licence or a dependency does; the SPDX document has them.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from licence_names import LICENSING, LOOKED_UP, UNKNOWN
from licence_sources import ROOT, TOOLS, Component, Inventory, collect
from spdx_tools.spdx.model.actor import Actor, ActorType
from spdx_tools.spdx.model.document import CreationInfo, Document
from spdx_tools.spdx.model.extracted_licensing_info import ExtractedLicensingInfo
from spdx_tools.spdx.model.package import Package
from spdx_tools.spdx.model.relationship import Relationship, RelationshipType
from spdx_tools.spdx.model.spdx_no_assertion import SpdxNoAssertion
from spdx_tools.spdx.validation.document_validator import validate_full_spdx_document
from spdx_tools.spdx.writer.write_anything import write_file

import cadpose
from cadpose.errors import LibraryError
from cadpose.library.catalogue import Library

OWN = {
    "LicenseRef-ShapeNet": "ShapeNet's terms of use: research and education, not commerce",
    "LicenseRef-TOST-1.0": "Tomorrow Open Source Technology License 1.0, in the package usd-core",
    "LicenseRef-matplotlib": "matplotlib's licence, after that of Python, in the package matplotlib",
    "LicenseRef-public-domain": "Given to the public domain by its authors",
}


def shown(licence: str) -> str:
    """A licence for people, each name of SPDX's list with a link to it."""
    if licence == UNKNOWN:
        return "**not stated**"
    words = re.split(r"( |\(|\))", licence)
    listed = [word for word in words if word not in {"AND", "OR", "WITH"} and re.match(r"[A-Z0-9]", word)]
    own = {word for word in listed if word.startswith("LicenseRef-")}
    return "".join(f"[{w}](https://spdx.org/licenses/{w}.html)" if w in {*listed} - own else w for w in words)


def table(head: str, rows: Iterable[str]) -> str:
    return "\n".join([head, "|" + "---|" * (head.count("|") - 1), *rows])


def package_row(component: Component) -> str:
    return f"| {component.name} | {shown(component.licence)} | {component.note} |"


def page(found: Inventory) -> str:
    """docs/licences.md."""
    parts = [HEAD + summary(found), ADVICE, "## Python packages"]
    core = found.brought(found.extras[""])
    for extra, direct in found.extras.items():
        if extra in TOOLS:
            continue
        title = "The core: `pip install cadpose`" if not extra else f"Extra `{extra}`"
        rows = [package_row(found.packages[name]) for name in direct]
        parts.append(f"### {title}\n\n" + table("| package | licence | |", rows))
        below = found.brought(direct) - set(direct) - (core if extra else set())
        if below:
            parts.append("Brings " + by_licence(found, below) + ".")
    direct_of = [found.extras[extra] for extra in found.extras if extra not in TOOLS]
    told = {name for direct in direct_of for name in direct}
    names = {name for extra in TOOLS for name in found.extras.get(extra, ())} - told
    rows = [package_row(found.packages[name]) for name in sorted(names)]
    parts.append("### Tools: extras " + ", ".join(f"`{e}`" for e in TOOLS))
    parts.append("What developers install besides; nothing of it is imported by cadpose.")
    parts.append(table("| package | licence | |", rows))
    rest = found.brought(names) - names - found.brought(told)
    parts.append("Bring " + by_licence(found, rest) + ".")
    parts.append("### Set up apart\n\nIn virtualenvs or folders of their own, only when asked for.")
    parts.append(table("| package | licence | |", map(package_row, found.apart)))
    parts.append("## Networks")
    rows = [f"| {c.name} | {shown(c.licence)} | {c.note} |" for c in found.networks]
    parts.append(table("| weights | licence | where |", rows))
    parts.append(NETWORKS)
    parts.append("## The review page")
    parts.append("Bundled in `src/cadpose/review/static`, with their texts in `licenses.md` there.")
    rows = [f"| {c.name} | {shown(c.licence)} |" for c in found.page]
    parts.append(table("| npm package | licence |", rows))
    parts.append("## CAD models\n\nNone is shipped.")
    rows = [f"| {c.name} | {shown(c.licence)} | {c.note} |" for c in found.models]
    parts.append(table("| source | licence | |", rows))
    parts.append(MODELS)
    return "\n\n".join(parts) + "\n"


def by_licence(found: Inventory, names: Iterable[str]) -> str:
    """Packages that others bring, gathered by licence."""
    groups: dict[str, list[str]] = {}
    for name in sorted(names):
        groups.setdefault(found.packages[name].licence, []).append(found.packages[name].name)
    return "; ".join(f"{shown(licence)}: {', '.join(group)}" for licence, group in sorted(groups.items()))


HEAD = """# Licences

What cadpose is made of, what it installs and what it may use, each with its licence as an
[SPDX expression](https://spdx.org/licenses/). This page is written by `make licences` from the metadata and
licence files of the installed packages, from cadpose's registry of weights and from npm's lock file; the same
as an SPDX 2.3 document, with versions, goes to `dist/`. It is an inventory, no legal advice. "Not stated"
means that whoever published it names no licence.

cadpose itself: Apache-2.0 ([LICENSE](../LICENSE), [NOTICE](../NOTICE)).

What binds whoever uses it, or is open, with the core, the extras or the place that it comes from:

"""

#: Kinds of licences that bind whoever uses what is under them, or that leave it open.
BINDING: tuple[tuple[str, str], ...] = (
    ("AGPL", r"AGPL-"),
    ("GPL", r"(?<![AL])GPL-[\d.]+(-only|-or-later)(?! WITH GCC-exception)"),
    ("LGPL", r"LGPL-"),
    ("MPL", r"MPL-"),
    ("CC-BY-NC, or terms without commerce as well", r"-NC-|LicenseRef-ShapeNet"),
    ("Terms of their own", r"LicenseRef-(?!public-domain|ShapeNet)"),
    ("Not stated", UNKNOWN),
)


def where(found: Inventory) -> dict[str, str]:
    """What each package comes with: the core, else extras, else developers' tools."""
    brought = {extra: found.brought(direct) for extra, direct in found.extras.items()}
    places = {}
    for name in found.packages:
        extras = [extra for extra in brought if name in brought[extra]]
        used = [f"`{extra}`" for extra in extras if extra not in TOOLS]
        places[name] = "core" if "" in extras else ", ".join(used) if used else "tools"
    return places


def summary(found: Inventory) -> str:
    """What binds or is open, gathered from all the tables."""
    places = where(found)
    for name in LOOKED_UP.keys() & places.keys():
        places[name] += f"; {LOOKED_UP[name][1]}"
    things = [
        *((component, places[name]) for name, component in sorted(found.packages.items())),
        *((component, "set up apart") for component in found.apart),
        *((component, f"weights, {component.note.partition(';')[0]}") for component in found.networks),
        *((component, "review page") for component in found.page),
        *((component, "CAD models") for component in found.models),
    ]
    lines = []
    for title, pattern in BINDING:
        named = [
            f"{component.name} ({place}{'' if re.search(pattern, component.licence) else ', in part'})"
            for component, place in things
            if re.search(pattern, f"{component.licence} {component.note}")
        ]
        lines.append(f"- {title}: {', '.join(named) or 'none'}.")
    return "\n".join(lines)


ADVICE = """Whoever needs certainty about the embedded detector's weights takes another detector
([detection](detection.md)) or gives boxes. Blender runs as a process of its own."""

NETWORKS = """Those in the package were trained by the cadpose authors, from EfficientNet-Lite0's ImageNet
weights, on synthetic photos of the models that the [model card](model-card.md) names."""

MODELS = """Every model's licence and creator stand in the library, in each document and in exports:
`cadpose library list --category NAME`. Whoever publishes a picture of a CC BY model owes its creator the
credit."""


def identifier(kind: str, name: str) -> str:
    return f"SPDXRef-{kind}-" + re.sub(r"[^A-Za-z0-9.-]+", "-", name)


def spdx_package(kind: str, component: Component) -> Package:
    known = component.licence != UNKNOWN
    stated = LICENSING.parse(component.licence) if known else SpdxNoAssertion()
    return Package(
        spdx_id=identifier(kind, component.name),
        name=component.name,
        download_location=SpdxNoAssertion(),
        version=component.version or None,
        files_analyzed=False,
        license_concluded=SpdxNoAssertion(),
        license_declared=stated,
        copyright_text=SpdxNoAssertion(),
        comment="; ".join(filter(None, (component.source, component.note))) or None,
    )


def spdx_document(found: Inventory, stamp: datetime) -> Document:
    """The same as SPDX 2.3."""
    itself = Component(
        "cadpose", cadpose.__version__, "Apache-2.0", f"pkg:pypi/cadpose@{cadpose.__version__}"
    )
    packages = {"": spdx_package("package", itself)}
    relations = [Relationship("SPDXRef-DOCUMENT", RelationshipType.DESCRIBES, packages[""].spdx_id)]
    inside = [c for c in found.networks if c.note == "in the package"]
    optional = RelationshipType.OPTIONAL_COMPONENT_OF
    kinds: tuple[tuple[str, Iterable[Component], RelationshipType | None], ...] = (
        ("python", found.packages.values(), None),
        ("apart", found.apart, RelationshipType.OPTIONAL_DEPENDENCY_OF),
        ("weights", inside, RelationshipType.CONTAINED_BY),
        ("weights", [c for c in found.networks if c not in inside], optional),
        ("npm", found.page, RelationshipType.CONTAINED_BY),
        ("models", found.models, optional),
    )
    for kind, components, relation in kinds:
        for component in components:
            made = spdx_package(kind, component)
            packages[made.spdx_id] = made
            if relation is not None:
                relations.append(Relationship(made.spdx_id, relation, packages[""].spdx_id))
    ids = {name: identifier("python", c.name) for name, c in found.packages.items()}
    for name, component in found.packages.items():
        relations += [
            Relationship(ids[name], RelationshipType.DEPENDS_ON, ids[below])
            for below in component.needs
            if below in ids
        ]
    for extra, direct in found.extras.items():
        for name in direct:
            if not extra:
                relations.append(Relationship(packages[""].spdx_id, RelationshipType.DEPENDS_ON, ids[name]))
                continue
            role = RelationshipType.OPTIONAL_DEPENDENCY_OF
            if extra in TOOLS:
                role = RelationshipType.DEV_DEPENDENCY_OF
            relations.append(Relationship(ids[name], role, packages[""].spdx_id, f"extra {extra}"))
    texts = " ".join(str(package.license_declared) for package in packages.values())
    digest = hashlib.sha256("\n".join(sorted(packages)).encode()).hexdigest()[:16]
    return Document(
        CreationInfo(
            spdx_version="SPDX-2.3",
            spdx_id="SPDXRef-DOCUMENT",
            name=f"cadpose-{cadpose.__version__}",
            document_namespace=f"https://spdx.org/spdxdocs/cadpose-{cadpose.__version__}-{digest}",
            creators=[Actor(ActorType.TOOL, "cadpose-licence_inventory")],
            created=stamp,
        ),
        packages=list(packages.values()),
        relationships=relations,
        extracted_licensing_info=[
            ExtractedLicensingInfo(license_id=name, extracted_text=text, license_name=name)
            for name, text in OWN.items()
            if name in texts
        ],
    )


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "licences.md")
    parser.add_argument(
        "--spdx", type=Path, default=ROOT / "dist" / f"cadpose-{cadpose.__version__}.spdx.json"
    )
    options = parser.parse_args()
    try:
        library = Library.open()
    except LibraryError:
        library = None
    found = collect(library)
    if found.missing:
        sys.exit(f"not installed, so their licences cannot be read: {', '.join(found.missing)}")
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    stamp = datetime.fromtimestamp(int(epoch), UTC) if epoch else datetime.now(UTC)
    document = spdx_document(found, stamp.replace(microsecond=0, tzinfo=None))
    faults = validate_full_spdx_document(document)
    if faults:
        sys.exit("\n".join(f"{fault.context.spdx_id}: {fault.validation_message}" for fault in faults[:10]))
    options.page.write_text(page(found), encoding="utf-8")
    options.spdx.parent.mkdir(parents=True, exist_ok=True)
    write_file(document, str(options.spdx), validate=False)
    stated = sum(c.licence != UNKNOWN for c in found.packages.values())
    print(f"{len(found.packages)} packages, {stated} with a licence; {options.page}, {options.spdx}")


if __name__ == "__main__":
    main()
