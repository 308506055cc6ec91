"""docs/gallery.md shows what scripts/gallery.py made, all of it, and credits every model in it."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")
MADE = sorted((DOCS / "pictures").glob("gallery-*.jpg"))


def rows(name: str) -> list[list[str]]:
    """Cells of the table that the script put between a pair of marks, without its head."""
    (table,) = re.findall(rf"<!-- {name} -->(.*?)<!-- end -->", PAGE, re.DOTALL)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.split("\n") if line][2:]


def test_every_picture_is_shown_and_all_are_small() -> None:
    shown = re.findall(r"!\[[^\]]+\]\(pictures/(gallery-[\w-]+\.jpg)\)", PAGE)
    assert sorted(shown) == [path.name for path in MADE]
    assert len(shown) == len(set(shown)) >= 14
    assert sum(path.stat().st_size for path in MADE) < 1_500_000


def test_every_category_has_a_photo_with_and_one_without_its_model() -> None:
    photos = [row[0] for row in rows("synthetic")]
    categories = list(dict.fromkeys(photo.rsplit(" ", 1)[0] for photo in photos))
    assert len(categories) >= 8
    assert photos == [f"{category} {number}" for category in categories for number in (1, 2)]
    assert {f"gallery-{category}.jpg" for category in categories} <= {path.name for path in MADE}


def test_the_page_counts_right_ones_as_its_table_does() -> None:
    table = rows("synthetic")
    right = sum(row[6] == "yes" for row in table)
    assert f"{right} of the {len(table)} are right" in PAGE


def test_every_model_that_is_named_is_credited() -> None:
    credited = {name.strip() for row in rows("credits") for name in row[2].split(",")}
    named = {row[1].split(" (")[0] for row in rows("synthetic")}
    named |= {row[2].rsplit(", chance", 1)[0] for row in rows("real") if row[2]}
    assert named - credited == set()
    licences = {row[0] for row in rows("credits")}
    assert licences and all(licence.startswith("CC") for licence in licences)
