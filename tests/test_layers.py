"""What of the house's order import-linter cannot say; its contracts stand in pyproject.toml.

It does not tell an import at the head of a module from one inside a function, and knows neither "at most
one of these" nor "nothing but these".
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "src" / "cadpose"

STAGES = {"detection", "rotation", "similarity", "alignment"}
# Where stages meet: the story of a photo, and the names that a user may choose stages by.
JOINERS = {"pipeline", "backends"}
# Optional, heavy or under another licence: only inside a function, when asked for.
NEVER_AT_MODULE_LEVEL = {"torch", "torchvision", "bpy", "ray", "matplotlib"}
MOST_PUBLIC_NAMES = 15
MOST_LINES = 400
# The examples of a docstring are not counted: they tell a public name's use, not what the file is made of.
EXAMPLES = re.compile(r"^( *)Examples:\n(?:\1 {4}.*\n|\n)+", re.MULTILINE)
# Files that may be longer, each with its reason.
LONGER: dict[str, str] = {}


@dataclass(frozen=True)
class Import:
    """One imported module, and whether it is imported when the importing file is."""

    source: str
    target: str
    line: int
    at_module_level: bool

    def __str__(self) -> str:
        return f"{self.source}:{self.line} imports {self.target}"


def imports_of(tree: ast.Module, source: str, is_package: bool, modules: set[str]) -> Iterator[Import]:
    """Every import of a file, resolved to a module where ``from package import module`` names one."""

    def visit(node: ast.AST, at_module_level: bool) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(source, alias.name, node.lineno, at_module_level)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = source.split(".")
                parts = parts[: len(parts) - node.level + is_package]
                base = ".".join([*parts, *base.split(".")] if base else parts)
            for alias in node.names:
                full = f"{base}.{alias.name}"
                name = full if full in modules or base == "cadpose" else base
                yield Import(source, name, node.lineno, at_module_level)
        inside = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        typing_only = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for child in ast.iter_child_nodes(node):
            yield from visit(child, at_module_level and not inside and not typing_only)

    yield from visit(tree, True)


def read_package(package: Path) -> list[Import]:
    """Every import of every file of a package."""
    files: dict[str, Path] = {}
    for path in sorted(package.rglob("*.py")):
        parts = [package.name, *path.relative_to(package).with_suffix("").parts]
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found: list[Import] = []
    for name, path in files.items():
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        found += imports_of(tree, name, path.name == "__init__.py", set(files))
    return found


def part(module: str) -> str:
    """``cadpose.rotation.grid`` -> ``rotation``; the package itself -> empty."""
    return module.partition(".")[2].partition(".")[0]


def inside(imports: list[Import]) -> list[Import]:
    """Imports of the package by its parts; its own __init__ only lists names, and all may ask its version."""
    return [
        i
        for i in imports
        if i.source != "cadpose"
        and i.target.partition(".")[0] == "cadpose"
        and i.target not in {"cadpose", "cadpose.__version__"}
    ]


def stages_that_meet(imports: list[Import]) -> list[str]:
    """Files other than the joiners that know a stage which is not theirs, or more than one."""
    known: dict[str, set[str]] = {}
    for i in inside(imports):
        own = {part(i.source)} & STAGES
        known.setdefault(i.source, own)
        known[i.source] = known[i.source] | ({part(i.target)} & STAGES)
    return [
        f"{source} knows {sorted(stages)}"
        for source, stages in known.items()
        if len(stages) > 1 and part(source) not in JOINERS
    ]


def heavy(imports: list[Import]) -> list[str]:
    """What the core does without, imported at the head of a module."""
    return [
        str(i)
        for i in imports
        if i.at_module_level
        and i.target.partition(".")[0] in NEVER_AT_MODULE_LEVEL
        # Networks are classes of torch's; nothing but training imports training.
        and not (part(i.source) == "training" and i.target.partition(".")[0] == "torch")
    ]


def early_server(imports: list[Import]) -> list[str]:
    """Imports of the review page's server at the head of a module of others."""
    return [
        str(i)
        for i in imports
        if part(i.source) != "review" and i.at_module_level and i.target.startswith("cadpose.review")
    ]


def cycle(imports: list[Import]) -> list[str]:
    """A ring of modules that import each other when imported, or nothing."""
    graph: dict[str, set[str]] = {}
    for i in inside(imports):
        if i.at_module_level and i.source != i.target:
            graph.setdefault(i.source, set()).add(i.target)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return [str(module) for module in error.args[1]]
    return []


@pytest.fixture(scope="module")
def imports() -> list[Import]:
    return read_package(PACKAGE)


def test_only_the_pipeline_joins_stages(imports: list[Import]) -> None:
    assert stages_that_meet(imports) == []


def test_nothing_heavy_is_imported_with_a_module(imports: list[Import]) -> None:
    assert heavy(imports) == []


def test_the_review_server_is_imported_when_asked_for(imports: list[Import]) -> None:
    assert early_server(imports) == []


def test_no_ring_of_imports(imports: list[Import]) -> None:
    assert cycle(imports) == []


def test_geometry_needs_numpy_only(imports: list[Import]) -> None:
    for i in imports:
        if part(i.source) == "geometry":
            top = i.target.partition(".")[0]
            assert top in {"numpy", "cadpose"} or top in sys.stdlib_module_names, str(i)


def test_the_public_top_level_is_small() -> None:
    listing = (
        "import cadpose, types, __future__\n"
        "names = {n for n in dir(cadpose) if not n.startswith('_')} | set(cadpose.__all__)\n"
        "plumbing = (types.ModuleType, __future__._Feature)\n"
        "print(*sorted(n for n in names if not isinstance(vars(cadpose).get(n), plumbing)))"
    )
    run = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    names = set(run.stdout.split())
    # What importlib and typing leave behind is not ours to offer.
    names -= {"TYPE_CHECKING", "import_module"}
    assert 1 <= len(names) <= MOST_PUBLIC_NAMES, sorted(names)


def test_files_hold_one_idea_each() -> None:
    lengths = {
        str(path.relative_to(REPOSITORY)): len(
            EXAMPLES.sub("", path.read_text(encoding="utf-8")).splitlines()
        )
        for folder in ("src", "tests", "scripts")
        for path in (REPOSITORY / folder).rglob("*.py")
    }
    long = {name: lines for name, lines in lengths.items() if lines > MOST_LINES}
    assert {name: lines for name, lines in long.items() if name not in LONGER} == {}
    assert set(LONGER) <= set(long), "a file listed as longer no longer is: take it off the list"
    assert all(LONGER.values()), "every longer file has a reason"


def test_the_checks_find_what_they_look_for(tmp_path: Path) -> None:
    """Each rule is broken once in a made-up package of the same layout."""
    package = tmp_path / "cadpose"
    broken = {
        "__init__.py": "from cadpose.pipeline import Annotator",
        "errors.py": "",
        "records.py": "from cadpose import __version__\nfrom .errors import CadposeError",
        "pipeline.py": "from cadpose.rotation import a\nfrom cadpose.detection import b",
        "geometry/__init__.py": "",
        "geometry/angles.py": "",
        "detection/__init__.py": "",
        "detection/ssd.py": "import torch.nn\nfrom cadpose.library import mesh",
        "library/__init__.py": "",
        "library/mesh.py": "from . import shapes",
        "library/shapes.py": "from .mesh import Mesh\nfrom ..errors import CadposeError",
        "rotation/__init__.py": "def f() -> None:\n    import torch",
        "rotation/vote.py": "from cadpose.detection.ssd import Ssd",
        "evaluation/__init__.py": "from cadpose import rotation\nimport cadpose.alignment",
        "alignment/__init__.py": "",
        "review/__init__.py": "import fastapi",
        "cli/__init__.py": "",
        "cli/review.py": "import cadpose.review\ndef f() -> None:\n    import cadpose.review",
    }
    for name, text in broken.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text, encoding="utf-8")
    found = read_package(package)
    assert sorted(stages_that_meet(found)) == [
        "cadpose.evaluation knows ['alignment', 'rotation']",
        "cadpose.rotation.vote knows ['detection', 'rotation']",
    ]
    assert heavy(found) == ["cadpose.detection.ssd:1 imports torch.nn"]
    assert early_server(found) == ["cadpose.cli.review:1 imports cadpose.review"]
    assert set(cycle(found)) == {"cadpose.library.mesh", "cadpose.library.shapes"}
