"""The table of keys in docs/review.md has every key of the page, and no other."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_NAMES = {"arrowleft": "←", "arrowright": "→", "arrowup": "↑", "arrowdown": "↓", "enter": "Enter"}


def bound() -> dict[str, str]:
    """Key as the table writes it to what it does, from the page's own table."""
    text = (ROOT / "web/src/app/keys/bindings.ts").read_text("utf-8")
    found = {}
    for row in re.findall(r"\{\s*id: .*?where: \"\w+\".*?\},?\n", text):
        what = re.search(r'what: "([^"]+)"', row)
        shown = re.search(r'shown: "([^"]+)"', row)
        assert what
        if shown:
            keys = ["`" + shown[1].replace(" + ", "+").replace(" – ", "–") + "`"]
        else:
            keys = [_written(chord) for chord in re.findall(r"\{ key: .*?\}", row)]
        found[" or ".join(keys)] = what[1]
    return found


def _written(chord: str) -> str:
    key = re.search(r'key: "([^"]+)"', chord)
    assert key
    parts = [name for name in ("Ctrl", "Alt", "Shift") if f"{name.lower()}: true" in chord]
    return "`" + "+".join([*parts, _NAMES.get(key[1], key[1].upper())]) + "`"


def test_table_is_that_of_the_page() -> None:
    guide = (ROOT / "docs/review.md").read_text("utf-8").partition("## Keys")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (`.+) \| (.+) \|$", guide, re.MULTILINE)
    assert len(bound()) > 40
    assert dict(rows) == bound()
