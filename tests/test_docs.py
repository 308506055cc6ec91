"""The documentation tells the truth: its examples run, its figures are current, its links lead somewhere."""

from __future__ import annotations

import ast
import doctest
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
DOCS = REPOSITORY / "docs"
EXAMPLE = re.compile(r"^```python\n(>>>.*?)^```$", re.MULTILINE | re.DOTALL)


def examples(page: Path) -> str:
    """The interactive examples of a page, in order, as one session."""
    return "\n".join(EXAMPLE.findall(page.read_text(encoding="utf-8")))


PAGES = [REPOSITORY / "README.md", *sorted(DOCS.rglob("*.md"))]
BLOCK = re.compile(r"^(<!-- runs -->\n)?```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: (page, whether it says that it runs, code) of every block of Python that is not a session.
BLOCKS = [
    pytest.param(bool(runs), code, id=f"{page.relative_to(REPOSITORY)}-{i}")
    for page in PAGES
    for i, (runs, code) in enumerate(BLOCK.findall(page.read_text(encoding="utf-8")))
    if not code.startswith(">>>")
]


SESSIONS = [page for page in PAGES if EXAMPLE.search(page.read_text(encoding="utf-8"))]


def test_blocks_and_sessions_are_found() -> None:
    assert len(BLOCKS) >= 10
    assert any(block.values[0] for block in BLOCKS)
    assert DOCS / "conventions.md" in SESSIONS


@pytest.mark.parametrize(("runs", "code"), BLOCKS)
def test_python_on_a_page_is_python_and_imports_what_is_there(runs: bool, code: str) -> None:
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "cadpose":
            module = import_module(node.module)
            missing = [name.name for name in node.names if not hasattr(module, name.name)]
            assert missing == [], f"{node.module} has no {missing}"
        elif isinstance(node, ast.Import):
            for name in node.names:
                if name.name.partition(".")[0] == "cadpose":
                    import_module(name.name)


@pytest.mark.slow
@pytest.mark.parametrize(("runs", "code"), [block for block in BLOCKS if block.values[0]])
def test_python_that_says_so_runs(runs: bool, code: str, tmp_path: Path) -> None:
    script = tmp_path / "page.py"
    script.write_text(code, encoding="utf-8")
    subprocess.run([sys.executable, str(script)], check=True, cwd=tmp_path, timeout=300)


@pytest.mark.parametrize("page", SESSIONS, ids=lambda page: page.name)
def test_the_examples_print_what_they_say(page: Path) -> None:
    session = doctest.DocTestParser().get_doctest(examples(page), {}, page.name, page.name, 0)
    assert session.examples
    report: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(session, out=report.append)
    assert result.failed == 0, "".join(report)


def test_the_figures_are_what_the_scripts_draw(tmp_path: Path) -> None:
    for script in ("draw_conventions.py", "draw_concepts.py"):
        subprocess.run([sys.executable, str(REPOSITORY / "scripts" / script), str(tmp_path)], check=True)
    drawn = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    kept = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "figures").iterdir()}
    assert drawn == kept, "run the scripts and look at the figures"


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


def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    """As `make docs` does; and nothing in it is fetched from elsewhere."""
    pytest.importorskip("mkdocs", reason="mkdocs is not installed: pip install -e '.[docs]'")
    pytest.importorskip("mkdocstrings", reason="mkdocstrings is not installed: pip install -e '.[docs]'")
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) >= 25
    for page in pages:
        html = page.read_text(encoding="utf-8")
        fetched = re.findall(
            r"<(?:script|img|iframe|link rel=\"?stylesheet)[^>]*(?:src|href)=\"?(https?:[^\s\">]*)", html
        )
        assert fetched == [], page.name


def test_the_index_and_the_site_name_the_same_pages() -> None:
    """mkdocs itself tells a page that the navigation lacks, or names and that is not there."""
    text = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    nav = set(re.findall(r": (\S+\.md)$", text, re.MULTILINE))
    outside = {"../README.md": "readme.md", "../CHANGELOG.md": "changelog.md"}
    linked = re.findall(r"\]\(([^)#]+\.md)", (DOCS / "index.md").read_text(encoding="utf-8"))
    assert nav - {"index.md"} == {outside.get(target, target) for target in linked}


@pytest.mark.parametrize("page", [REPOSITORY / "README.md", DOCS / "index.md", DOCS / "tutorial.md"])
def test_readers_are_told_at_once_that_nothing_is_published(page: Path) -> None:
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert "Until the first release, where a page says `pip install 'cadpose[x]'`, write" in text


def test_no_placeholder_is_left() -> None:
    for page in sorted((REPOSITORY / "docs").rglob("*.md")):
        assert not re.search(r"\bFIG[A-Z]+\b", page.read_text(encoding="utf-8")), page


def test_the_tables_of_performance_are_those_of_its_run() -> None:
    command = [sys.executable, str(REPOSITORY / "scripts" / "write_performance.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
