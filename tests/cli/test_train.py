from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.invoking import cadpose, one_sentence, said


@pytest.fixture
def data(tmp_path: Path) -> Path:
    pytest.importorskip("torch")
    from tests.training.posecontrast.made import write_photos

    return write_photos(tmp_path / "photos")


@pytest.fixture
def _tiny(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    torch = pytest.importorskip("torch")
    from cadpose.training.posecontrast import augment, train
    from tests.training.posecontrast.made import TINY

    monkeypatch.setattr(train, "RECIPE", TINY)
    monkeypatch.setattr(augment, "SIDE", 64)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.mark.usefixtures("_tiny")
def test_train_resume_and_export(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    told = ["train", "rotation", "--data", data, "--out", out, "--init", "random", "--epochs", 1]
    report = said(cadpose(*told, "--val", data, "--json"))
    assert [row["epoch"] for row in report["epochs"]] == [1]
    assert set(report["validation"]["classes"]) == {"car", "chair"}
    assert Path(report["network"]).is_file() and report["export_difference"] <= 1e-4
    assert json.loads((out / "curves.jsonl").read_text()) == report["epochs"][0]
    one_sentence(cadpose(*told), out, "--resume")
    told[-1] = 2
    table = cadpose(*told, "--resume")
    assert table.exit_code == 0 and "contrast_loss" in table.stdout and "posecontrast.onnx" in table.stdout
    exported = said(cadpose("train", "export", out / "checkpoint.pt", "--out", tmp_path / "n.onnx", "--json"))
    assert Path(exported["network"]).is_file()


@pytest.mark.usefixtures("_tiny")
def test_weights_that_are_not_there(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "cache"))
    told = ["train", "rotation", "--data", data, "--out", tmp_path / "out"]
    one_sentence(cadpose(*told), "dl.fbaipublicfiles.com", tmp_path / "cache" / "weights")
    one_sentence(cadpose(*told, "--init", tmp_path / "none.pth"), "none.pth")
    one_sentence(cadpose("train", "export", "posecontrast-pascal3d", "--out", tmp_path / "a.onnx"), "dropbox")
    assert not (tmp_path / "out").exists()


def test_labels_that_cannot_be_used(data: Path, tmp_path: Path) -> None:
    told = ["train", "rotation", "--out", tmp_path / "out", "--init", "random", "--data"]
    one_sentence(cadpose(*told, tmp_path / "none.jsonl"), "none.jsonl")
    bare = tmp_path / "bare.json"
    bare.write_text(json.dumps([{"photo": "a.png", "category": "car"}]))
    one_sentence(cadpose(*told, bare), "bare.json", "azimuth")


def test_a_device_that_is_not_there(data: Path, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    told = ["train", "rotation", "--data", data, "--out", tmp_path / "out", "--init", "random"]
    one_sentence(cadpose(*told, "--device", "cuda"), "GPU")


def test_wrong_usage(tmp_path: Path) -> None:
    told = ["train", "rotation", "--data", tmp_path / "a.json", "--out", tmp_path]
    for wrong in (["--arch", "vgg"], ["--epochs", 0], ["--batch", 1], ["--device", "tpu"]):
        assert cadpose(*told, *wrong).exit_code == 2
    assert cadpose("train", "rotation").exit_code == 2


def test_without_torch() -> None:
    told = "import sys; sys.modules['torch'] = None; from cadpose.cli.main import main; main()"
    arguments = ["train", "rotation", "--data", "a.json", "--out", "out"]
    run = subprocess.run(
        [sys.executable, "-c", told, *arguments], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1 and run.stdout == ""
    assert run.stderr == "cadpose: training needs the package torch: pip install 'cadpose[train]'\n"
