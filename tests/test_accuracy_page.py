"""docs/accuracy.md quotes: each of its figures stands in the place that its row links to."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest

from tests.test_docs_cli import VERBS, documented

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = (DOCS / "accuracy.md").read_text(encoding="utf-8")
LINK = re.compile(r'^\[[^\]]+\]\(([\w-]+\.md)#([\w-]+) "([^"]+)"\)$')
#: What a promise without a figure says instead.
NONE = re.compile(r"^not (measured|told on any page)")


def tables(page: str) -> list[tuple[str, list[dict[str, str]]]]:
    """(nearest heading above, rows by column) of each table."""
    found: list[tuple[str, list[dict[str, str]]]] = []
    heading, head = "", None
    for line in page.splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if not line.startswith("|"):
            head = None
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if head is None:
            head = cells
            found.append((heading, []))
        elif not set(line) <= set("|-: "):
            found[-1][1].append(dict(zip(head, cells, strict=True)))
    return [(heading, rows) for heading, rows in found if rows and "figure" in rows[0]]


def plain(text: str) -> str:
    """Without marks of Markdown, blanks alike."""
    return re.sub(r"\s+", " ", re.sub(r"[`*]", "", html.unescape(text))).strip()


def section(page: str, anchor: str) -> str:
    """A page's text under a heading, up to the next heading of its level or above."""
    lines = page.splitlines()
    for start, line in enumerate(lines):
        title = line.lstrip("#")
        slug = re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")
        if line.startswith("#") and slug == anchor:
            level = len(line) - len(title)
            for end in range(start + 1, len(lines)):
                if re.match(rf"#{{1,{level}}} ", lines[end]):
                    return "\n".join(lines[start + 1 : end])
            return "\n".join(lines[start + 1 :])
    raise AssertionError(f"no heading for #{anchor}")


def blocks(text: str) -> list[str]:
    """Paragraphs and rows of tables."""
    parts = re.split(r"\n\s*\n|\n(?=[|])", text)
    return [plain(part.strip().strip("|")) for part in parts if part.strip()]


def missing(figures: str, place: str, words: str) -> list[str]:
    """Those of the figures that no paragraph or row with these words holds; all where there is none."""
    wanted = [plain(figure) for figure in figures.split(";")]
    lacking = wanted
    for block in blocks(place):
        if plain(words) in block:
            here = [
                f for f in wanted if not re.search(rf"(?<![\w.,]){re.escape(f)}(?![\w]|[.,]\d)", block, re.I)
            ]
            lacking = min(lacking, here, key=len)
    return lacking


ROWS = [row for _, rows in tables(PAGE) for row in rows]


def test_the_rows_are_found() -> None:
    assert len(ROWS) >= 60
    assert sum(bool(LINK.match(row["from"])) for row in ROWS) >= 55


@pytest.mark.parametrize("row", ROWS, ids=lambda row: next(iter(row.values()))[:60])
def test_a_figure_stands_where_its_row_links_to(row: dict[str, str]) -> None:
    link = LINK.match(row["from"])
    if link is None:
        assert row["from"] == "" and NONE.match(row["figure"]) and row["kept"] == "**no**"
        return
    page, anchor, words = link.groups()
    place = section((DOCS / page).read_text(encoding="utf-8"), anchor)
    assert missing(row["figure"], place, words) == []
    also = re.findall(r"\d+\.\d+(?: %|°)?", row.get("kept", ""))
    assert [figure for figure in also if figure not in plain(place)] == []


def test_another_figure_would_be_noticed() -> None:
    place = section((DOCS / "evaluation.md").read_text(encoding="utf-8"), "measured-figures")
    words = "600 real cars, rotation"
    assert missing("96.5 % [94.7, 97.7]; 5.5°", place, words) == []
    assert missing("96.6 % [94.7, 97.7]; 5.5°", place, words) == ["96.6 % [94.7, 97.7]"]
    assert missing("6.5 %", place, words) == ["6.5 %"]
    assert missing("94.2 % [92.0, 95.8]", place, words) == ["94.2 % [92.0, 95.8]"]  # of another row
    assert missing("5.5°", place, "700 real cars") == ["5.5°"]


def test_real_and_synthetic_photos_share_no_table() -> None:
    assert {heading for heading, _ in tables(PAGE)} == {"Real photos", "Synthetic photos"}


def test_every_command_is_one_that_cadpose_takes() -> None:
    code = "\n".join(re.findall(r"^    (.*)$", PAGE, re.MULTILINE)).replace("\\\n", " ")
    commands = [line.partition("#")[0].split() for line in code.splitlines() if line.startswith("cadpose ")]
    assert len(commands) >= 20
    for words in commands:
        verb = max((v for v in VERBS if words[: len(v.split())] == v.split()), key=len)
        known = {spelling for spellings in documented(VERBS[verb]) for spelling in spellings}
        assert {word for word in words if word.startswith("--")} <= known, words
    for script in re.findall(r"^python (\S+)", code, re.MULTILINE):
        assert (DOCS.parent / script).is_file(), script
