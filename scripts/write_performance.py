"""Write the tables of docs/performance.md from docs/performance.json, one run of `cadpose bench --json`.

python scripts/write_performance.py [--check]
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent.parent / "docs"


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def stages(told: dict[str, Any]) -> str:
    rows = []
    for stage, ms in told["stages"].items():
        floor = told["floors"].get(stage)
        least = (
            [f"{floor['gflop']:.1f}", f"{floor['mbytes']:.0f}", f"{floor['ms']:.0f}"] if floor else [""] * 3
        )
        times = f"{ms / floor['ms']:.1f}" if floor and floor["ms"] else ""
        rows.append([stage, f"{ms:.0f}", *least, times])
    total, least_ms = sum(told["stages"].values()), sum(f["ms"] for f in told["floors"].values())
    rows.append(["**all**", f"**{total:.0f}**", "", "", f"**{least_ms:.0f}**", f"**{total / least_ms:.1f}**"])
    machine = told["machine"]
    speed = f"{machine['gflops']:.0f} GFLOP/s, {machine['gbytes']:.0f} GB/s"
    return table(["stage", "ms", "GFLOP", "MB", f"floor, ms, at {speed}", "times the floor"], rows)


def parts(told: dict[str, Any]) -> str:
    rows = [
        [title, name, f"{ms:.0f}"]
        for title, part in (("rotation estimate", "rotation"), ("joint ranking", "ranking"))
        for name, ms in told[part].items()
    ]
    return table(["work", "part", "ms"], rows)


def drawing(told: dict[str, Any], part: str, key: str) -> str:
    rows = [
        [row["name"], f"{row[key]:.1f}", f"{row['ratio']:.1f}"]
        if row[key] is not None
        else [row["name"], "not here", ""]
        for row in told[part]
    ]
    return table(["renderer", "ms", "times the first"], rows)


def galleries(told: dict[str, Any]) -> str:
    made = told["galleries"]
    return (
        f"{made['models']} models, {made['views']} views each: **{made['per_minute']:.0f} models a minute of "
        f"one core's time**, {made['encoding']:.0%} of it in the encoder."
    )


def promises(told: dict[str, Any]) -> str:
    total = sum(told["stages"].values()) / 1000.0
    ratios = {row["name"]: row["ratio"] for row in told["candidates"]}
    cycles = ratios["Blender Cycles, 1 sample, denoised"]
    made = told["galleries"]["per_minute"]
    told_of = [
        ("one photo, one object, ten candidates, two cores: 0.7 s or less", f"{total:.2f} s", total <= 0.7),
        (
            "ten candidates at least 50 times quicker than Cycles' fastest useful setting",
            f"{cycles:.0f} times",
            cycles >= 50.0,
        ),
        ("galleries: 30 models a minute of one core", f"{made:.0f}", made >= 30.0),
    ]
    rows = [[what, measured, "yes" if kept else "no"] for what, measured, kept in told_of]
    return table(["promise", "measured", "kept"], rows)


def written(page: str, told: dict[str, Any]) -> str:
    """The page with its tables made anew."""
    made = {
        "stages": stages(told),
        "parts": parts(told),
        "candidates": drawing(told, "candidates", "ms"),
        "renderers": drawing(told, "renderers", "ms_per_view"),
        "galleries": galleries(told),
        "promises": promises(told),
    }
    for name, text in made.items():
        page, found = re.subn(
            rf"<!-- {name} -->.*?<!-- end -->",
            lambda _, name=name, text=text: f"<!-- {name} -->\n\n{text}\n\n<!-- end -->",
            page,
            flags=re.DOTALL,
        )
        if found != 1:
            sys.exit(f"docs/performance.md has no place for {name}")
    return page


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="only tell whether the page is up to date")
    asked = parser.parse_args()
    path = DOCS / "performance.md"
    page = path.read_text(encoding="utf-8")
    told = json.loads((DOCS / "performance.json").read_text(encoding="utf-8"))
    made = written(page, told)
    if asked.check:
        sys.exit(0 if made == page else "docs/performance.md is not what docs/performance.json says")
    path.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main()
