from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.detection.canvas import Canvas
from cadpose.detection.decode import OutputError, instances
from cadpose.detection.onnx_head import Head
from tests.detection.heads import SIDE, described

CANVAS = Canvas((SIDE, SIDE), (SIDE, SIDE), (0, 0, SIDE, SIDE))
#: Two objects as x0, y0, x1, y1 in input pixels, and what the three classes score.
CORNERS = np.array([[8.0, 16.0, 40.0, 56.0], [0.0, 0.0, 32.0, 8.0]], np.float32)
SCORES = np.array([[0.1, 0.9, 0.2], [0.0, 0.05, 0.6]], np.float32)
CENTRES = np.array([[24.0, 36.0, 32.0, 40.0], [16.0, 4.0, 32.0, 8.0]], np.float32)


def head(**changes: Any) -> Head:
    return Head.model_validate(described(**{"masks": None, **changes}))


def logit(p: NDArray[np.float32]) -> NDArray[np.float32]:
    p = np.clip(p, 1e-6, 1 - 1e-6)
    return np.asarray(np.log(p / (1 - p)), np.float32)


@pytest.mark.parametrize(
    ("form", "values"),
    [
        ("xyxy", CORNERS),
        ("cxcywh", CENTRES),
        ("xywh", np.hstack([CORNERS[:, :2], CENTRES[:, 2:]])),
    ],
)
@pytest.mark.parametrize("unit", ["pixels", "normalised"])
@pytest.mark.parametrize("batch", [True, False])
def test_boxes_of_every_form(form: str, values: NDArray[np.float32], unit: str, batch: bool) -> None:
    given = values / SIDE if unit == "normalised" else values
    outputs = {"boxes": given[None] if batch else given, "scores": SCORES[None] if batch else SCORES}
    told = head(boxes={"output": "boxes", "form": form, "unit": unit})
    found = instances(told, outputs, CANVAS, 0.3)
    np.testing.assert_allclose(found.boxes, CORNERS, atol=1e-4)
    np.testing.assert_allclose(found.scores, SCORES, atol=1e-6)
    assert found.mask_of is None


def test_scores_by_sigmoid_and_the_threshold() -> None:
    told = head(scores={"output": "scores", "form": "sigmoid"})
    found = instances(told, {"boxes": CORNERS, "scores": logit(SCORES)}, CANVAS, 0.7)
    np.testing.assert_allclose(found.boxes, CORNERS[:1])
    np.testing.assert_allclose(found.scores, SCORES[:1], atol=1e-5)
    infinite = np.array([[np.inf, -np.inf, 0.0]] * 2, np.float32)
    found = instances(told, {"boxes": CORNERS, "scores": infinite}, CANVAS, 0.3)
    np.testing.assert_allclose(found.scores, [[1.0, 0.0, 0.5]] * 2, atol=1e-6)


@pytest.mark.parametrize("where", ["first", "last"])
def test_softmax_with_a_class_for_nothing(where: str) -> None:
    shares = np.array([[0.1, 0.5, 0.1, 0.3], [0.02, 0.01, 0.02, 0.95]], np.float32)  # the last for nothing
    values = np.log(shares) + 7.0
    if where == "first":
        values = np.roll(values, 1, axis=1)
    told = head(scores={"output": "scores", "form": "softmax", "no_object": where})
    found = instances(told, {"boxes": CORNERS, "scores": values}, CANVAS, 0.3)
    np.testing.assert_allclose(found.scores, [[0.1, 0.5, 0.1]], atol=1e-5)
    np.testing.assert_allclose(found.boxes, CORNERS[:1])


def test_one_score_and_one_label_a_query() -> None:
    told = head(
        scores={"output": "scores", "form": "probability", "labels": {"output": "labels"}},
    )
    boxes = np.concatenate([CORNERS, np.zeros((1, 4), np.float32)])
    for shape in ((3,), (1, 3), (1, 3, 1)):
        outputs: dict[str, NDArray[Any]] = {
            "boxes": boxes[None],
            "scores": np.array([0.9, 0.4, 0.0], np.float32).reshape(shape),
            "labels": np.array([1, 2, -1]).reshape(shape),
        }
        found = instances(told, outputs, CANVAS, 0.3)
        np.testing.assert_allclose(found.scores, [[0, 0.9, 0], [0, 0, 0.4]], atol=1e-6)
    outputs["labels"] = np.array([1, 3, -1])
    with pytest.raises(OutputError, match="labels outside 0 to 2"):
        instances(told, outputs, CANVAS, 0.3)
    outputs["labels"] = np.array([1, 2])
    with pytest.raises(OutputError, match="2 labels for 3 scores"):
        instances(told, outputs, CANVAS, 0.3)


def yolo(objectness: bool = False) -> tuple[Head, dict[str, NDArray[Any]], NDArray[np.float32]]:
    """(1, 4 + 3 + 2, N) as YOLO's segmentation exports, or (1, N, 4 + 1 + 3 + 2) as its older ones."""
    weights = np.array([[1.0, -1.0], [0.0, 2.0]], np.float32)
    prototypes = np.random.default_rng(3).normal(size=(2, 16, 16)).astype(np.float32)
    columns = [CENTRES, np.full((2, 1), 0.5, np.float32)] if objectness else [CENTRES]
    table = np.hstack([*columns, SCORES, weights])
    first = 5 if objectness else 4
    part = {"output": "output0", "transposed": not objectness}
    told = head(
        boxes={**part, "count": 4, "form": "cxcywh", "unit": "pixels"},
        scores={
            **part,
            "first": first,
            "count": 3,
            "form": "probability",
            **({"objectness": {**part, "first": 4, "count": 1}} if objectness else {}),
        },
        masks={"kind": "prototypes", "output": "output1", "coefficients": {**part, "first": first + 3}},
    )
    outputs = {"output0": (table if objectness else table.T)[None], "output1": prototypes[None]}
    return told, outputs, np.einsum("nk,khw->nhw", weights, prototypes)


def test_prototypes_and_coefficients_in_one_output() -> None:
    told, outputs, maps = yolo()
    found = instances(told, outputs, CANVAS, 0.3)
    np.testing.assert_allclose(found.boxes, CORNERS)
    assert found.mask_of is not None and found.crop
    for i in range(2):
        np.testing.assert_allclose(found.mask_of(i), maps[i], atol=1e-5)


def test_objectness_multiplies_and_masks_follow_their_queries() -> None:
    told, outputs, maps = yolo(objectness=True)
    outputs["output0"] = outputs["output0"][:, ::-1]  # the sure object comes second now
    found = instances(told, outputs, CANVAS, 0.4)
    np.testing.assert_allclose(found.scores, SCORES[:1] / 2, atol=1e-6)
    np.testing.assert_allclose(found.boxes, CORNERS[:1])
    assert found.mask_of is not None
    np.testing.assert_allclose(found.mask_of(0), maps[0], atol=1e-5)


def test_masks_of_queries() -> None:
    maps = np.random.default_rng(0).uniform(size=(1, 2, 5, 7)).astype(np.float16)
    outputs: dict[str, NDArray[Any]] = {"boxes": CORNERS, "scores": SCORES, "masks": maps}
    told = head(masks={"kind": "queries", "output": "masks", "form": "probability", "crop": True})
    found = instances(told, outputs, CANVAS, 0.7)
    assert found.mask_of is not None and found.crop
    np.testing.assert_array_equal(found.mask_of(0) > 0, maps[0, 0] > 0.5)
    steep = {**outputs, "masks": np.full((2, 3, 3), -np.inf, np.float32)}
    found = instances(head(masks={"kind": "queries", "output": "masks"}), steep, CANVAS, 0.3)
    assert found.mask_of is not None and np.isfinite(found.mask_of(1)).all()


def test_no_query_at_all() -> None:
    outputs = {"boxes": np.zeros((1, 0, 4), np.float32), "scores": np.zeros((1, 0, 3), np.float32)}
    assert instances(head(), outputs, CANVAS, 0.3).boxes.shape == (0, 4)
    softmax = head(scores={"output": "scores", "form": "softmax"})
    assert instances(softmax, outputs, CANVAS, 0.3).scores.shape == (0, 3)


@pytest.mark.parametrize(
    ("outputs", "changes", "said"),
    [
        ({"scores": SCORES * np.nan}, {}, "scores that are no numbers"),
        ({"scores": logit(SCORES)}, {}, "should be sigmoid or softmax"),
        ({"scores": SCORES[:, :2]}, {}, "scores 2 classes, but the description has 3"),
        ({"scores": SCORES[:1]}, {}, "2 x 4 boxes for 1 scores"),
        ({"scores": SCORES[0]}, {}, "not numbers with 2 axes"),
        ({"scores": np.array([["a", "b"]])}, {}, "not numbers"),
        ({"scores": np.stack([SCORES, SCORES])}, {}, "batch of one"),
        ({"boxes": CORNERS[:, :3]}, {}, "2 x 3 boxes"),
        ({"boxes": CORNERS * np.nan}, {}, "boxes that are no numbers"),
        ({"boxes": CORNERS / SIDE}, {}, "boxes.unit should be normalised"),
        (
            {},
            {"boxes": {"output": "boxes", "form": "xyxy", "unit": "normalised"}},
            "boxes.unit should be pixels",
        ),
        (
            {},
            {"boxes": {"output": "boxes", "form": "xyxy", "unit": "pixels", "first": 2, "count": 4}},
            "asks for columns 2 to 5",
        ),
        (
            {"masks": np.zeros((3, 4, 4), np.float32)},
            {"masks": {"kind": "queries", "output": "masks"}},
            "masks",
        ),
        (
            {"masks": np.zeros((2, 4), np.float32)},
            {"masks": {"kind": "queries", "output": "masks"}},
            "3 axes",
        ),
        (
            {"masks": np.zeros((3, 4, 4), np.float32), "c": np.zeros((2, 2), np.float32)},
            {"masks": {"kind": "prototypes", "output": "masks", "coefficients": {"output": "c"}}},
            "2 x 2 coefficients for 2 boxes and 3 prototypes",
        ),
    ],
)
def test_outputs_that_are_not_as_described(
    outputs: dict[str, NDArray[Any]], changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(OutputError, match=said):
        instances(head(**changes), {"boxes": CORNERS, "scores": SCORES, **outputs}, CANVAS, 0.3)


def test_masks_that_are_no_numbers_are_told_when_asked_for() -> None:
    maps = np.full((2, 4, 4), np.nan, np.float32)
    told = head(masks={"kind": "queries", "output": "masks"})
    found = instances(told, {"boxes": CORNERS, "scores": SCORES, "masks": maps}, CANVAS, 0.3)
    assert found.mask_of is not None
    with pytest.raises(OutputError, match="masks that are no numbers"):
        found.mask_of(0)


def test_one_wild_box_is_let_through() -> None:
    boxes = np.concatenate([CORNERS, CORNERS]) / SIDE
    boxes[3] = 50.0
    told = head(boxes={"output": "boxes", "form": "xyxy", "unit": "normalised"})
    found = instances(told, {"boxes": boxes, "scores": np.concatenate([SCORES, SCORES])}, CANVAS, 0.3)
    np.testing.assert_allclose(found.boxes[:2], CORNERS, atol=1e-4)


def test_unsure_queries_may_hold_anything() -> None:
    boxes = CORNERS.copy()
    boxes[1] = np.nan
    scores = SCORES.copy()
    scores[1] = 0.0
    assert len(instances(head(), {"boxes": boxes, "scores": scores}, CANVAS, 0.3).boxes) == 1
