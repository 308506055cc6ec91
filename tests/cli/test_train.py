from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
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
    before = (out / "checkpoint.pt").read_bytes()
    over = cadpose("train", "export", out / "checkpoint.pt", "--out", out / ".." / "out" / "checkpoint.pt")
    one_sentence(over, "written over")
    assert (out / "checkpoint.pt").read_bytes() == before


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
    bare = ["train", "rotation", "--out", tmp_path / "out"]
    for wrong, words in (
        ([], "--data"),
        (["--data", "a.json", "--steps", 3], "--steps means nothing to posecontrast"),
        (["--arch", "lite0", "--data", "a.json"], "--data means nothing to lite0"),
        (["--arch", "lite0", "--photos", 3], "--photos means nothing to lite0"),
        (["--arch", "lite0-head", "--val", "a.json"], "--val means nothing to lite0-head"),
    ):
        result = cadpose(*bare, *wrong)
        assert result.exit_code == 2 and words in " ".join(result.stderr.replace("│", " ").split())
    assert not (tmp_path / "out").exists()


def test_a_head_from_a_library(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")
    from cadpose.training.lite import lite0_head, maps, sources

    held = small_library.models("car")[0].id
    monkeypatch.setattr(sources, "read_held_out", lambda lookalikes=True: {"car": frozenset({held})})
    monkeypatch.setattr(sources, "SIZE", 64)
    monkeypatch.setattr(lite0_head, "UNSEEN_PHOTOS", 3)
    for module in (maps, lite0_head):
        monkeypatch.setattr(module, "SHARD", 3)
    out = tmp_path / "out"
    told = ["train", "rotation", "--arch", "lite0-head", "--library", small_library.path, "--out", out]
    told += ["--photos", 5, "--epochs", 2, "--batch", 2, "--workers", 1]
    report = said(cadpose(*told, "--json"))
    assert report["network"] == str(out / "head.pt") and report["export_difference"] is None
    assert len(report["epochs"]) == 2 and set(report["validation"]["classes"]) == {"car"}
    one_sentence(cadpose(*told), out, "--resume")
    table = cadpose(*told, "--resume")
    assert table.exit_code == 0 and "macro30" in table.stdout and "head.pt" in table.stdout
    onnx = ["--out", tmp_path / "a.onnx"]
    one_sentence(cadpose("train", "export", out / "head.pt", "--arch", "lite0-head", *onnx), "--head")
    one_sentence(cadpose("train", "export", tmp_path / "c.pt", "--arch", "lite0", *onnx), "c.pt")
    same = ["--embedding", tmp_path / "a.onnx"]
    one_sentence(cadpose("train", "export", "c.pt", "--arch", "lite0", *onnx, *same), "two files")
    posed = cadpose("train", "export", "posecontrast-pascal3d", "--embedding", "e.onnx", *onnx)
    one_sentence(posed, "e.onnx")
    missing = cadpose(
        "train", "export", tmp_path / "c.pt", "--arch", "lite0", "--head", out / "head.pt", *onnx
    )
    one_sentence(missing, "c.pt")
    one_sentence(cadpose("train", "export", "posecontrast-pascal3d", "--head", "a.pt", *onnx), "a.pt")


def test_a_library_that_is_not_there(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    told = ["train", "rotation", "--arch", "lite0", "--library", tmp_path / "none", "--out", tmp_path / "o"]
    one_sentence(cadpose(*told), "none")
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("verb", ["rotation", "triplet"])
def test_without_torch(verb: str) -> None:
    told = "import sys; sys.modules['torch'] = None; from cadpose.cli.main import main; main()"
    arguments = ["train", verb, "--data", "a.json", "--out", "out"]
    run = subprocess.run(
        [sys.executable, "-c", told, *arguments], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1 and run.stdout == ""
    assert run.stderr == "cadpose: training needs the package torch: pip install 'cadpose[train]'\n"


def test_the_triplet_baseline(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")
    from cadpose.training.triplet import train
    from tests.training.triplet.made import TINY, write_photos

    monkeypatch.setattr(train, "RECIPE", TINY)
    labels, out = write_photos(small_library, tmp_path / "photos"), tmp_path / "out"
    told = ["train", "triplet", "--data", labels, "--library", small_library.path, "--out", out]
    report = said(cadpose(*told, "--val", labels, "--init", "random", "--epochs", 1, "--mining", "--json"))
    assert (report["initial"], report["photos"], report["unmasked"]) == ("random", 5, 0)
    assert report["validation"]["n"] == 5 and report["export_difference"] <= 1e-4
    assert json.loads((out / "curves.jsonl").read_text()) == report["epochs"][0]
    one_sentence(cadpose(*told, "--init", "random"), out, "--resume")
    one_sentence(cadpose(*told, "--resume"), "mining")
    table = cadpose(*told, "--mining", "--epochs", 2, "--resume")
    assert table.exit_code == 0 and "from random weights" in table.stdout and "violations" in table.stdout
    assert "not from ImageNet's" in table.stderr

    # What was trained ranks the models.
    monkeypatch.setenv("CADPOSE_TRIPLET", report["network"])
    photo = tmp_path / "photos" / "0-0.png"
    box = json.loads(labels.read_text().splitlines()[0])["box"]
    one = ["annotate", photo, "--library", small_library.path, "--out", tmp_path / "found", "--box"]
    one += [",".join(map(str, box)), "--category", "car", "--rotation", "25,12,3", "--similarity", "triplet"]
    (answer,) = said(cadpose(*one, "--json"))
    assert answer["error"] is None, answer
    (annotation,) = json.loads(Path(answer["document"]).read_text())["annotations"]
    assert annotation["provenance"]["similarity"] == "triplet"
    candidates = annotation["candidates"]
    assert len(candidates) == 3 and all(-2 <= c["measures"]["triplet"] <= 0 for c in candidates)


def test_what_the_triplet_baseline_needs(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")
    from dataclasses import replace

    from cadpose.training.triplet import train
    from cadpose.weights import REGISTRY
    from tests.training.triplet.made import TINY, write_photos

    monkeypatch.setattr(train, "RECIPE", TINY)
    entry = replace(REGISTRY["vgg16-imagenet"], url="http://127.0.0.1:9/vgg16-397923af.pth")
    monkeypatch.setitem(REGISTRY, entry.name, entry)
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "cache"))
    labels = write_photos(small_library, tmp_path / "photos")
    told = ["train", "triplet", "--library", small_library.path, "--out", tmp_path / "out", "--data"]
    offline = cadpose(*told, labels)
    assert offline.exit_code == 1 and str(tmp_path / "cache" / "weights" / entry.file) in offline.stderr
    one_sentence(cadpose(*told, labels, "--init", tmp_path / "none.pth"), "none.pth")
    one_sentence(cadpose(*told, tmp_path / "none.jsonl", "--init", "random"), "none.jsonl")
    for wrong in (["--trained-blocks", 6], ["--epochs", 0], ["--batch", 0], ["--renderer", "pov"]):
        assert cadpose(*told, labels, *wrong).exit_code == 2
    assert not (tmp_path / "out").exists()
    monkeypatch.delenv("CADPOSE_TRIPLET", raising=False)
    photo = tmp_path / "photos" / "0-0.png"
    missing = cadpose("annotate", photo, "--library", small_library.path, "--similarity", "triplet")
    one_sentence(missing, "cadpose train triplet")
