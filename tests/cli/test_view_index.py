from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("onnx", reason="needs cadpose[train]")
pytest.importorskip("faiss", reason="needs cadpose[index]")
from cadpose.datasets.labels import Label, write_labels
from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from tests.cli.invoking import cadpose, given, one_sentence, said
from tests.similarity.index.made import network
from tests.small_library import save, shoot


@pytest.fixture(scope="module")
def made(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The options of an index that is there."""
    folder = tmp_path_factory.mktemp("cli-index")
    (folder / "net.onnx").write_bytes(network())
    options = ["--library", str(small_library.path), "--index", str(folder / "index")]
    options += ["--embedding", str(folder / "net.onnx")]
    told = said(cadpose("library", "index", *options, "--json"))
    assert len(told["added"]) == told["models"] == 5 and told["index"] == str(folder / "index")
    return options


def test_indexing_again_finds_nothing_to_do(made: list[str]) -> None:
    result = cadpose("library", "index", *made)
    assert result.exit_code == 0 and result.stdout.startswith("0 added, 0 removed, 5 unchanged, 0 failed")
    one_sentence(cadpose("library", "index", *made, "--azimuths", 3), "other settings (azimuths)")
    one_sentence(cadpose("library", "index", *made, "--category", "sofa"), "sofa")


def test_searching(made: list[str], small_library: Library, tmp_path: Path) -> None:
    shot = shoot(small_library, small_library.models("car")[0].id, Rotation(40.0, 12.0))
    photo = save(tmp_path / "street.png", shot.photo.rgb)
    told = said(cadpose("library", "search", photo, *given(shot), *made, "--json"))
    assert told["models"] == 5 and told["rotations"] == [[40.0, 12.0, 0.0]] and told["category"] == "car"
    assert {m["category"] for m in told["found"]} == {"car"} and len(told["found"]) == 3
    box = given(shot)[:2]
    assert len(said(cadpose("library", "search", photo, *box, *made, "--json", "--top", 4))["found"]) == 4
    shown = cadpose("library", "search", photo, *box, *made)
    assert "5 of 5 models" in shown.stdout and shot.cad.id in shown.stdout
    one_sentence(cadpose("library", "search", photo, *box, *made, "--category", "sofa"), "sofa", "car, chair")
    one_sentence(cadpose("library", "search", photo, *box, *made[:2], *made[4:]), "library index")
    assert cadpose("library", "search", photo, "--box", "1,2", *made).exit_code == 2


def test_evaluating(made: list[str], small_library: Library, tmp_path: Path) -> None:
    labels = []
    for i, model in enumerate(small_library.models()):
        shot = shoot(small_library, model.id, Rotation(40.0, 12.0))
        photo = save(tmp_path / f"{i}.png", shot.photo.rgb)
        labels.append(Label(photo, model.category, shot.box, model.id, 40.0, 12.0, 0.0))
    write_labels(tmp_path / "labels.jsonl", labels)
    arguments = ("evaluate", "library", tmp_path / "labels.jsonl", "--rotation", "true", *made)
    told = said(cadpose(*arguments, "--json"))
    assert told["all"]["photos"] == 5 and told["all"]["top10"] == 1.0 and told["fscore_threshold"] == 0.02
    assert "chair" in cadpose(*arguments).stdout
    only = said(cadpose(*arguments, "--category", "chair", "--json"))
    assert set(only["categories"]) == {"chair"}
    (tmp_path / "0.png").unlink()
    assert cadpose(*arguments).exit_code == 1


def test_a_box_is_cut_to_the_photo(made: list[str], small_library: Library, tmp_path: Path) -> None:
    shot = shoot(small_library, small_library.models("car")[0].id, Rotation(40.0, 12.0))
    photo = save(tmp_path / "street.png", shot.photo.rgb)
    far = ("--box", "99000,99000,99100,99100", "--category", "car")
    one_sentence(cadpose("library", "search", photo, *far, *made), "lies outside", photo)
    wide = ("--box", "-9000,0,99000,99000", "--rotation", "40,12", *made, "--json")
    told = said(cadpose("library", "search", photo, *wide))
    assert told["box"] == [0.0, 0.0, shot.photo.width, shot.photo.height] and told["found"]


def test_a_category_without_labels_is_told(made: list[str], small_library: Library, tmp_path: Path) -> None:
    shot = shoot(small_library, small_library.models("car")[0].id, Rotation(40.0, 12.0))
    photo = save(tmp_path / "street.png", shot.photo.rgb)
    write_labels(tmp_path / "labels.jsonl", [Label(photo, "car", shot.box, shot.cad.id, 40.0, 12.0, 0.0)])
    arguments = ("evaluate", "library", tmp_path / "labels.jsonl", "--category", "typo", *made)
    one_sentence(cadpose(*arguments), "typo", "it has car")


def test_a_device_that_is_not_there_is_refused(
    made: list[str], small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import onnxruntime

    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    shot = shoot(small_library, small_library.models("car")[0].id, Rotation(40.0, 12.0))
    photo = save(tmp_path / "street.png", shot.photo.rgb)
    cuda = ("--device", "cuda")
    one_sentence(cadpose("library", "index", *made, *cuda), "onnxruntime-gpu")
    one_sentence(cadpose("library", "search", photo, *given(shot), *made, *cuda), "onnxruntime-gpu")
    scale = ("experiment", "scale", tmp_path / "out", "--models", 5, *made[:2], *made[4:], *cuda)
    one_sentence(cadpose(*scale), "onnxruntime-gpu")
    assert not (tmp_path / "out").exists()


def test_an_embedding_belongs_to_an_index(made: list[str], tmp_path: Path) -> None:
    result = cadpose("annotate", tmp_path / "none.png", *made[:2], *made[4:])
    assert result.exit_code == 2 and "--index" in result.stderr


def test_scale_wants_numbers(made: list[str], tmp_path: Path) -> None:
    assert cadpose("experiment", "scale", tmp_path / "out", "--models", "many", *made[:2]).exit_code == 2


def test_annotating_with_candidates_of_the_index(
    made: list[str], small_library: Library, tmp_path: Path
) -> None:
    shot = shoot(small_library, small_library.models("car")[0].id, Rotation(40.0, 12.0))
    photo = save(tmp_path / "street.png", shot.photo.rgb)
    arguments = (
        "annotate",
        photo,
        *given(shot),
        *made,
        "--candidates",
        1,
        "--similarity",
        "aligned",
        "--out",
        tmp_path / "out",
        "--json",
    )
    (told,) = said(cadpose(*arguments))
    found = said(cadpose("library", "search", photo, *given(shot), *made, "--draw", 0, "--json"))["found"]
    (annotation,) = told["annotations"]
    assert annotation["cad"] == found[0]["cad"]
