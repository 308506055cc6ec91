"""`cadpose dataset convert`, and label files of it in `cadpose evaluate`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.labels import Label, read_labels, write_labels
from cadpose.library.catalogue import Library
from tests.cli.invoking import cadpose, one_sentence, said
from tests.datasets.trees import imagenet3d_tree, objectnet3d_tree, pix3d_tree, pose, thing, write_mat


def test_a_table_and_a_label_file(tmp_path: Path) -> None:
    root, out = objectnet3d_tree(tmp_path / "data"), tmp_path / "out" / "l.jsonl"
    result = cadpose("dataset", "convert", "objectnet3d", root, out)
    assert result.exit_code == 0, result.output
    cells = [[cell.strip() for cell in line.split("│")[1:-1]] for line in result.stdout.splitlines()]
    assert [row for row in cells if row] == [["ashtray", "3"], ["cabinet", "3"], ["all", "6"]]
    labels = read_labels(out)
    assert len(labels) == 6 and all(label.photo.is_file() for label in labels)
    assert json.loads(out.read_text().splitlines()[0])["photo"] == "../data/Images/n1_1.JPEG"


def test_json_and_split(tmp_path: Path) -> None:
    root, out = imagenet3d_tree(tmp_path / "data"), tmp_path / "l.jsonl"
    result = cadpose("dataset", "convert", "imagenet3d", root, out, "--split", "val", "--json")
    assert said(result) == {"written": 1, "bad": 0, "categories": {"bed": 1}}
    assert [label.split for label in read_labels(out)] == ["val"]
    again = cadpose("dataset", "convert", "labels", out, tmp_path / "m.jsonl", "--json")
    assert said(again)["written"] == 1
    assert read_labels(tmp_path / "m.jsonl") == read_labels(out)


def test_published(tmp_path: Path) -> None:
    root = pix3d_tree(tmp_path / "data", {}, {"occluded": True})
    for options, written in (([], 2), (["--published"], 1)):
        result = cadpose("dataset", "convert", "pix3d", root, tmp_path / "l.jsonl", "--json", *options)
        assert said(result)["written"] == written


def test_a_bad_annotation_is_told_and_the_others_are_written(tmp_path: Path) -> None:
    root, out = objectnet3d_tree(tmp_path / "data"), tmp_path / "l.jsonl"
    write_mat(root / "Annotations" / "n1_2.mat", [thing(), thing(bbox=np.array([[5.0, 5.0, 1.0, 1.0]]))])
    result = cadpose("dataset", "convert", "objectnet3d", root, out, "--json")
    one_sentence(result, "n1_2.mat: object 1", "is empty")
    assert json.loads(result.stdout) == {"written": 4, "bad": 1, "categories": {"ashtray": 2, "cabinet": 2}}
    assert len(read_labels(out)) == 4


def test_mistakes(tmp_path: Path) -> None:
    root, out = imagenet3d_tree(tmp_path / "data"), tmp_path / "l.jsonl"
    one_sentence(cadpose("dataset", "convert", "imagenet3d", tmp_path, out), tmp_path, "holds no photo")
    one_sentence(cadpose("dataset", "convert", "imagenet3d", root, out, "--split", "x"), "no split 'x'")
    one_sentence(cadpose("dataset", "convert", "imagenet3d", root, tmp_path / "l.json"), "ends in .jsonl")
    assert cadpose("dataset", "convert", "coco", root, out).exit_code == 2
    assert not out.exists()
    imagenet3d_tree(tmp_path / "data", pose(distance=0.0))
    assert said(cadpose("dataset", "convert", "imagenet3d", root, out, "--json"))["written"] == 0


def test_evaluate_takes_the_split_and_leaves_out_what_is_hidden(
    small_library: Library, tmp_path: Path
) -> None:
    file = tmp_path / "l.jsonl"
    changes: list[dict[str, Any]] = [{}, {"split": "train"}, {"occluded": True}, {"truncated": True}]
    made = dict(zip(("kept", "trained", "hidden", "cut"), changes, strict=True))
    plain = {name: Label(tmp_path / f"{name}.png", "car", azimuth=1.0, split="val") for name in made}
    write_labels(file, [replace(plain[name], **change) for name, change in made.items()])
    # None of the photos is there, so each that is tried is told.
    for options, tried in (
        ([], set(made)),
        (["--split", "val"], {"kept", "hidden", "cut"}),
        (["--unoccluded"], {"kept", "trained"}),
        (["--split", "val", "--unoccluded"], {"kept"}),
    ):
        result = cadpose("evaluate", "rotation", file, "--library", small_library.path, *options)
        assert result.exit_code == 1
        assert {name for name in made if f"{name}.png" in result.stderr} == tried
    one_sentence(cadpose("evaluate", "rotation", file, "--split", "test"), file, "no label of split 'test'")
    one_sentence(cadpose("evaluate", "retrieval", file, "--split", "test"), file, "no label of split 'test'")
