"""docs/tutorial.md followed literally: its files are written, its commands run, what comes of them compared.

python -m tests.tutorial FOLDER            # follow it there and tell what differs
python -m tests.tutorial FOLDER --keep     # and take the new pictures into docs/pictures
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "tutorial.md"
_PARTS = re.compile(
    r"(?P<skipped><!-- not run: [^>]*-->\n)?(?:<!-- exits with (?P<exit>\d+) -->\n)?"
    r"^```(?P<kind>\w+)(?: title=\"(?P<name>[^\"]+)\")?\n(?P<text>.*?)^```$"
    r"|<!-- from: (?P<made>\S+) -->\n!\[[^\]]+\]\((?P<kept>[^)]+)\)",
    re.MULTILINE | re.DOTALL,
)
_NUMBER = re.compile(r"([-+]?\d+(?:\.\d*)?)(°| px\b)?")
#: Seconds a block of commands may take.
PATIENCE = 900


@dataclass(frozen=True)
class Part:
    """A piece of the page: ``file``, ``commands``, ``output`` of the commands before it, or ``picture``."""

    kind: str
    text: str
    name: str = ""
    exit_code: int = 0


def parts() -> list[Part]:
    """The page's pieces in order, without what it says is not run."""
    found = []
    for match in _PARTS.finditer(PAGE.read_text(encoding="utf-8")):
        if match["skipped"]:
            continue
        if match["made"]:
            found.append(Part("picture", match["kept"], match["made"]))
        elif match["kind"] == "python":
            found.append(Part("file", match["text"], match["name"] or ""))
        else:
            kind = {"sh": "commands", "text": "output"}[match["kind"]]
            found.append(Part(kind, match["text"], exit_code=int(match["exit"] or 0)))
    return found


def differences(told: str, printed: str) -> list[str]:
    """Lines of ``told`` that were not printed.

    Degrees, pixels and the cells of tables may be off by 3 or by 2 %, fractions by 0.1; all other whole
    numbers are counts.
    """
    lines = printed.splitlines()
    return [line for line in told.splitlines() if not any(_alike(line, other) for other in lines)]


def _alike(a: str, b: str) -> bool:
    cells = a.lstrip().startswith("│")

    def near(x: str, unit: str, y: str) -> bool:
        off = abs(float(x) - float(y))
        if "." in x.rstrip("."):
            return off <= 0.1
        # NumPy ends a rounded number with a point.
        return off <= max(3.0, 0.02 * abs(float(x))) if unit or cells or x.endswith(".") else off == 0.0

    numbers = zip(_NUMBER.findall(a), _NUMBER.findall(b), strict=False)
    return _worded(a) == _worded(b) and all(near(x, unit, y) for (x, unit), (y, _) in numbers)


def _worded(line: str) -> str:
    return " ".join(_NUMBER.sub(r"#\2", line).split())


def picture_difference(kept: Path, made: Path) -> float:
    """Mean difference of two pictures in grey levels, 255 where they differ in size."""
    with Image.open(kept) as a, Image.open(made) as b:
        if a.size != b.size:
            return 255.0
        pair = [np.asarray(image.convert("RGB"), np.float64) for image in (a, b)]
    return float(np.abs(pair[0] - pair[1]).mean())


def follow(folder: Path, keep: bool = False) -> list[str]:
    """Do in an empty folder what the page says; what went otherwise, a sentence each.

    Args:
        folder: Where; the program is the one beside the Python that runs this.
        keep: Take the pictures into docs/pictures instead of comparing them.
    """
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "CADPOSE_LIBRARY": str(folder / "no-library"),
        "CADPOSE_CACHE": str(folder / "cache"),
        "COLUMNS": "200",
    }
    wrong: list[str] = []
    printed = ""
    for part in parts():
        if part.kind == "file":
            (folder / part.name).write_text(part.text, encoding="utf-8")
        elif part.kind == "commands":
            command = ["bash", "-euo", "pipefail", "-c", part.text]
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE
            )
            printed = done.stdout
            if done.returncode != part.exit_code:
                return [*wrong, f"{part.text}exits with {done.returncode}: {done.stderr[-2000:]}"]
        elif part.kind == "output":
            wrong += [f"not printed: {line}\nbut:\n{printed}" for line in differences(part.text, printed)]
        elif keep:
            with Image.open(folder / part.name) as image:
                image.convert("RGB").save(DOCS / part.text, quality=88)
        else:
            off = picture_difference(DOCS / part.text, folder / part.name)
            if off > 4.0:
                wrong.append(f"{part.text} differs from {part.name} by {off:.1f} grey levels")
    return wrong


if __name__ == "__main__":
    where = Path(sys.argv[1])
    where.mkdir(parents=True, exist_ok=True)
    problems = follow(where.resolve(), "--keep" in sys.argv)
    sys.stdout.write("\n".join(problems or ["as the page says"]) + "\n")
    sys.exit(bool(problems))
