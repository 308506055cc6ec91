"""The documentation tells the truth: its examples run, its figures are current, its links lead somewhere."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
DOCS = REPOSITORY / "docs"
EXAMPLE = re.compile(r"^```python\n(>>>.*?)^```$", re.MULTILINE | re.DOTALL)


def examples(page: Path) -> str:
    """The interactive examples of a page, in order, as one session."""
    return "\n".join(EXAMPLE.findall(page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("page", ["conventions.md"])
def test_the_examples_print_what_they_say(page: str) -> None:
    session = doctest.DocTestParser().get_doctest(examples(DOCS / page), {}, page, page, 0)
    assert len(session.examples) > 10
    report: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(session, out=report.append)
    assert result.failed == 0, "".join(report)


def test_the_figures_are_what_the_script_draws(tmp_path: Path) -> None:
    script = REPOSITORY / "scripts" / "draw_conventions.py"
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True)
    drawn = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    kept = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "figures").iterdir()}
    assert drawn == kept, "run python scripts/draw_conventions.py and look at the figures"


def test_links_lead_somewhere() -> None:
    pages = [REPOSITORY / "README.md", *DOCS.rglob("*.md")]
    links = [
        (page, target)
        for page in pages
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8"))
        if "://" not in target
    ]
    assert len(links) >= 5
    assert [f"{page.name}: {target}" for page, target in links if not (page.parent / target).exists()] == []


def test_every_core_dependency_is_accounted_for() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = {re.split(r"[<>=!~ \[;]", requirement)[0] for requirement in project["dependencies"]}
    headings = set(re.findall(r"^## `([^`]+)`$", (DOCS / "dependencies.md").read_text("utf-8"), re.MULTILINE))
    assert headings == names


def test_no_placeholder_is_left() -> None:
    for page in sorted((REPOSITORY / "docs").rglob("*.md")):
        assert not re.search(r"\bFIG[A-Z]+\b", page.read_text(encoding="utf-8")), page
