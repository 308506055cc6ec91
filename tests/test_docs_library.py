"""docs/library.md says what the class map, the importers and the limits are."""

from __future__ import annotations

import re
from pathlib import Path

from cadpose.library.class_map import CATEGORIES
from cadpose.library.folder import COLUMNS
from cadpose.library.limits import DEFAULT_LIMITS, MIB

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "library.md").read_text(encoding="utf-8")


def section(title: str) -> list[list[str]]:
    """The cells of the table below a heading, without its header and rule."""
    text = PAGE.split(f"# {title}\n", 1)[1].split("\n#", 1)[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_categories_are_those_of_the_class_map() -> None:
    assert section("Categories") == [
        [c.name, c.display, ", ".join(c.coco), " ".join(c.synsets), "yes" if c.paper else ""]
        for c in CATEGORIES.values()
    ]


def test_the_columns_are_those_of_the_importer() -> None:
    assert [row[0].strip("`") for row in section("Any folder of meshes")] == list(COLUMNS)


def test_the_limits_are_those_of_the_program() -> None:
    limits = DEFAULT_LIMITS
    told = [row[1] for row in section("Hostile files")]
    assert told == [
        f"{limits.file_bytes // MIB} MiB",
        f"{limits.faces:,}",
        f"{limits.vertices:,}",
        f"{limits.materials:,}",
        f"{limits.textures}",
        f"{limits.texture_bytes // MIB} MiB",
        f"{limits.texture_pixels:,}",
        f"{limits.total_pixels:,}",
        f"{limits.archive_entries:,}",
        f"{limits.archive_bytes // MIB} MiB",
        f"{limits.archive_ratio}",
    ]
    assert re.search(rf"at most {limits.texture_side} pixels a side", PAGE)
