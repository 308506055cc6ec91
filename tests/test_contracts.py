"""The contracts of import-linter in pyproject.toml, each broken once in a made-up package."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
PYPROJECT = REPOSITORY / "pyproject.toml"
CONTRACTS = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]

# A file and what is written into it, by the contract that forbids it.
BROKEN = {
    "tiers": ("geometry/angles.py", "def f() -> None:\n    from cadpose.records import Photo"),
    "stages": ("alignment/vote.py", "from cadpose.detection import ssd"),
    "training": ("library/mesh.py", "def f() -> None:\n    import cadpose.training"),
    "review": ("cli/annotate.py", "def f() -> None:\n    import cadpose.review"),
    "web": ("cli/serve.py", "import uvicorn"),
    "torch": ("rendering/gpu.py", "def f() -> None:\n    import torch.nn"),
    "unwanted": ("detection/yolo.py", "def f() -> None:\n    import ultralytics"),
}
LINT = "import sys; from importlinter.cli import lint_imports_command; sys.exit(lint_imports_command())"


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter over the made-up package, which comes before the installed one."""
    return subprocess.run(
        [sys.executable, "-c", LINT, "--no-logo", "--no-cache", str(PYPROJECT)],
        cwd=folder,
        env={"PYTHONPATH": str(folder), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with the parts of the real one and nothing in them."""
    real = REPOSITORY / "src" / "cadpose"
    made = tmp_path / "cadpose"
    for file in [*real.glob("*.py"), *real.glob("*/__init__.py")]:
        copy = made / file.relative_to(real)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.touch()
    # Allowed: the package lists names of all tiers.
    (made / "__init__.py").write_text("from cadpose.cli import main", encoding="utf-8")
    (made / "review" / "server.py").write_text("import fastapi, starlette, uvicorn", encoding="utf-8")
    (made / "cli" / "review.py").write_text("def f() -> None:\n    import cadpose.review", encoding="utf-8")
    (made / "training" / "network.py").write_text("import torch", encoding="utf-8")
    for module in ("detection/ssd", "torch_files", "similarity/xfeat"):
        (made / f"{module}.py").touch()
    for package in ("detection/mmdet", "detection/rfdetr", "similarity/delf"):
        (made / package).mkdir()
        (made / package / "__init__.py").touch()
    return made


def test_the_made_up_package_is_in_order(package: Path) -> None:
    run = lint(package.parent)
    assert run.returncode == 0, run.stdout + run.stderr
    assert f"{len(CONTRACTS)} kept" in run.stdout


@pytest.mark.parametrize("contract", CONTRACTS, ids=lambda contract: str(contract["id"]))
def test_each_contract_can_be_broken(contract: dict[str, str], package: Path) -> None:
    name, text = BROKEN[contract["id"]]
    (package / name).write_text(text, encoding="utf-8")
    run = lint(package.parent)
    assert run.returncode == 1, run.stdout + run.stderr
    assert f"{contract['name']} BROKEN" in run.stdout


def test_a_part_without_a_tier_is_told(package: Path) -> None:
    (package / "stray.py").touch()
    run = lint(package.parent)
    assert run.returncode == 1
    assert "stray" in run.stdout
