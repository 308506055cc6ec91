from __future__ import annotations

import numpy as np

from cadpose.detection.ssd_boxes import MOST, decode

PRIORS = np.array([[0.5, 0.5, 0.2, 0.4], [0.5, 0.5, 0.2, 0.4], [0.2, 0.2, 0.1, 0.1]])
VARIANCE = np.array([0.1, 0.1, 0.2, 0.2])


def rows(scores: list[list[float]], floor: float = 0.3, encodings: object = None) -> np.ndarray:
    given = np.zeros((3, 4)) if encodings is None else np.asarray(encodings)
    return decode(given.astype(np.float32), np.array(scores, np.float32), PRIORS, VARIANCE, floor)


def test_an_encoding_of_nothing_is_its_prior() -> None:
    found = rows([[0, 0.9, 0], [0, 0, 0], [0, 0, 0.5]])
    np.testing.assert_allclose(
        found, [[1, 0.9, 0.4, 0.3, 0.6, 0.7], [2, 0.5, 0.15, 0.15, 0.25, 0.25]], atol=1e-6
    )


def test_encodings_are_y_x_height_width() -> None:
    moved = np.zeros((3, 4))
    moved[0] = [1.0, 2.0, 5.0 * np.log(2.0), 0.0]  # down by 0.1 of the height, right by 0.2 of the width
    found = rows([[0, 0.9, 0], [0, 0, 0], [0, 0, 0]], encodings=moved)
    np.testing.assert_allclose(found[0, 2:], [0.54 - 0.1, 0.54 - 0.4, 0.54 + 0.1, 0.54 + 0.4], atol=1e-6)


def test_only_boxes_of_one_class_suppress_each_other() -> None:
    assert len(rows([[0, 0.9, 0], [0, 0.8, 0], [0, 0, 0]])) == 1
    assert len(rows([[0, 0.9, 0], [0, 0, 0.8], [0, 0, 0]])) == 2


def test_no_class_scores_below_the_floor_and_broken_numbers_give_nothing() -> None:
    assert rows([[0.99, 0.1, 0.29], [0.9, 0, 0], [0, 0, 0]]).shape == (0, 6)
    broken = np.full((3, 4), np.nan)
    assert len(rows([[0, 0.9, 0], [0, 0, 0], [0, 0, 0]], encodings=broken)) == 0


def test_so_many_boxes_at_most() -> None:
    n = 300
    priors = np.column_stack([np.linspace(0, 1, n), np.full(n, 0.5), np.full((n, 2), 1e-4)])
    scores = np.zeros((n, 3), np.float32)
    scores[:, 1] = np.linspace(0.5, 0.9, n)
    scores[:, 2] = 0.4
    found = decode(np.zeros((n, 4), np.float32), scores, priors, VARIANCE, 0.1)
    assert len(found) == MOST
    assert (np.diff(found[:, 1]) <= 0).all()
    assert found[0, 1] == np.float32(0.9)
