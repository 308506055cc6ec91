from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import Any

import pytest

from cadpose.detection import onnx_head
from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.onnx_head import (
    Boxes,
    Head,
    HeadInput,
    Scores,
    network_path,
    read_head,
    read_network,
)
from cadpose.detection.rfdetr.sizes import head_of
from cadpose.errors import InputError
from tests.detection.heads import described, write


def told(caught: pytest.ExceptionInfo[InputError]) -> str:
    message = str(caught.value)
    assert "\n" not in message and len(message) < 500
    return message


def test_a_whole_description(tmp_path: Path) -> None:
    head = read_head(write(tmp_path, described()))
    assert head.outputs == ("boxes", "scores", "masks") and head.class_names == ("person", "chair", "table")
    assert head.min_score == 0.3 and head.suppression is not None and head.suppression.across_classes
    assert Head.model_validate_json(head.model_dump_json()) == head
    none = Head.model_validate({**described(), "suppression": None})
    assert Head.model_validate_json(none.model_dump_json(exclude_defaults=True)) == none != head


def test_outputs_of_all_parts_are_asked_for_once() -> None:
    yolo = described(
        boxes={"output": "a", "transposed": True, "count": 4, "form": "cxcywh", "unit": "pixels"},
        scores={"output": "a", "transposed": True, "first": 4, "count": 3, "form": "probability"},
        masks={
            "kind": "prototypes",
            "output": "b",
            "coefficients": {"output": "a", "transposed": True, "first": 7},
        },
    )
    assert Head.model_validate(yolo).outputs == ("a", "b")


def test_coco_tables() -> None:
    eighty = Head.model_validate(described(classes="coco-80")).class_names
    assert len(eighty) == 80 and (eighty[0], eighty[56], eighty[79]) == ("person", "chair", "toothbrush")
    by_id = Head.model_validate(described(classes="coco-91")).class_names
    assert (
        len(by_id) == 91 and by_id[0] == by_id[12] == "" and all(by_id[i] == n for i, n in COCO_NAMES.items())
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"version": 2}, "version"),
        ({"format": "other"}, "format"),
        ({"classses": ["a"]}, "classses"),
        ({"boxes": None}, "boxes"),
        ({"sha256": "12"}, "sha256"),
        ({"min_score": 2}, "min_score"),
        ({"classes": []}, "classes"),
        ({"classes": "coco-90"}, "classes"),
        ({"network": "../net.onnx"}, "inside its folder"),
        ({"network": "/etc/net.onnx"}, "inside its folder"),
        ({"network": "C:\\net.onnx"}, "inside its folder"),
        ({"network": "a\\..\\..\\net.onnx"}, "inside its folder"),
        ({"input": {"name": "x", "resize": "stretch"}}, "one of size and longest"),
        (
            {"input": {"name": "x", "resize": "stretch", "size": [8, 8], "longest": 8}},
            "one of size and longest",
        ),
        ({"input": {"name": "x", "resize": "stretch", "size": [8, 8], "multiple": 8}}, "multiple"),
        ({"input": {"name": "x", "resize": "stretch", "size": [8, 99999]}}, "size"),
        ({"input": {"name": "x", "resize": "stretch", "size": [8, 8], "std": [1, 0, 1]}}, "std"),
        ({"masks": {"kind": "polygons", "output": "m"}}, "masks"),
        (
            {"scores": {"output": "s", "form": "softmax", "labels": {"output": "l"}}},
            "labels",
        ),
    ],
    ids=str,
)
def test_what_is_no_description_is_told_in_a_sentence(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    path = write(tmp_path, described(**changes))
    with pytest.raises(InputError) as caught:
        read_head(path)
    assert said in told(caught) and str(path) in told(caught)


def test_files_that_cannot_be_descriptions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "net.json"
    for content in (b"", b"[]", b"\xff\xfe", b"[" * 100_000):
        path.write_bytes(content)
        with pytest.raises(InputError, match="does not describe a detector"):
            read_head(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_head(tmp_path / "none.json")
    monkeypatch.setattr(onnx_head, "MAX_DESCRIPTION", 10)
    path.write_bytes(b" " * 11)
    with pytest.raises(InputError, match="larger than"):
        read_head(path)


def test_the_network_is_checked_against_its_digest(tmp_path: Path) -> None:
    right = hashlib.sha256(b"a network").hexdigest()
    path = write(tmp_path, described(sha256=right.upper()), b"a network")
    assert read_network(path, read_head(path)) == b"a network"
    (tmp_path / "net.onnx").write_bytes(b"another")
    with pytest.raises(InputError, match="SHA-256 differs") as caught:
        read_network(path, read_head(path))
    assert "net.onnx" in told(caught)


def test_the_network_may_not_be_missing_large_or_in_two_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    onnx = pytest.importorskip("onnx")
    path = write(tmp_path, described())
    head = read_head(path)
    tensor = onnx.TensorProto(name="w", data_type=1, dims=[1], data_location=onnx.TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value="../elsewhere.bin")
    (tmp_path / "net.onnx").write_bytes(tensor.SerializeToString())
    with pytest.raises(InputError, match="in another file"):
        read_network(path, head)
    monkeypatch.setattr(onnx_head, "MAX_NETWORK", 4)
    with pytest.raises(InputError, match="larger than"):
        read_network(path, head)
    (tmp_path / "net.onnx").unlink()
    with pytest.raises(InputError, match="cannot be read"):
        read_network(path, head)


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links here")
def test_a_link_may_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    inside = tmp_path / "in"
    inside.mkdir()
    (tmp_path / "net.onnx").write_bytes(b"secret")
    path = write(inside, described())
    (inside / "net.onnx").unlink()
    (inside / "net.onnx").symlink_to(tmp_path / "net.onnx")
    with pytest.raises(InputError, match="leads out of its folder"):
        network_path(path, read_head(path))


PAGE = (Path(__file__).resolve().parents[2] / "docs" / "detection.md").read_text(encoding="utf-8")


def test_the_examples_of_the_documentation_are_descriptions() -> None:
    blocks = [b for b in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL) if "cadpose-detector" in b]
    rfdetr, yolo = (Head.model_validate_json(b) for b in blocks)
    # Roboflow's export, and what we export ourselves, differ in names of files only.
    assert rfdetr == head_of(384, rfdetr.network)
    assert yolo.outputs == ("output0", "output1") and len(yolo.class_names) == 80


def test_every_key_is_in_the_documentation_with_its_default() -> None:
    table = PAGE.split("| key | meaning | where it is missing |")[1].split("\n\n")[0]
    keys = set(re.findall(r"`([a-z_0-9]+(?:\.[a-z_]+)?)`", table))
    for prefix, model in (("", Head), ("input.", HeadInput)):
        for name in set(model.model_fields) - {"input"}:
            assert prefix + name in keys, name
    for name in {*Boxes.model_fields, *Scores.model_fields} - {"output", "transposed", "first", "count"}:
        assert {name, f"boxes.{name}", f"scores.{name}"} & keys, name
    defaults = Head.model_fields
    for name in ("min_score", "most"):
        (row,) = re.findall(rf"^\| `{name}` \|.*\| ([0-9.]+) \|$", table, re.MULTILINE)
        assert float(row) == defaults[name].default
