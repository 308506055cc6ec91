from __future__ import annotations

import numpy as np
import pytest

from cadpose.similarity import measures
from cadpose.similarity.affine import AffineFit


def fit(inliers: int, tx: float = 0.0, ty: float = 0.0, scale: float = 1.0, total: int = 50) -> AffineFit:
    matrix = np.array([[scale, 0.0, tx], [0.0, scale, ty], [0.0, 0.0, 1.0]])
    return AffineFit(matrix, np.arange(total) < inliers)


NO_MAP = AffineFit(None, np.zeros(7, bool))


def test_epsilon_as_printed() -> None:
    assert measures.epsilon(np.eye(3)) == 0.0
    # max(A) = 10: three diagonal entries |0.1 - 1|, the translation |10/10 - 0|.
    assert measures.epsilon(fit(5, tx=10.0).matrix) == pytest.approx(3 * 0.9 + 1.0)
    # A negative translation is not the maximum: max(A) = 1.
    assert measures.epsilon(fit(5, tx=-10.0).matrix) == pytest.approx(10.0)
    # max(A) = 2: the last entry is 1/2.
    assert measures.epsilon(fit(5, scale=2.0).matrix) == pytest.approx(0.5)
    assert measures.epsilon(None) == np.inf


def test_normalised_epsilon_does_not_depend_on_the_image_size() -> None:
    small, large = fit(5, tx=10.0, ty=4.0), fit(5, tx=20.0, ty=8.0)
    assert measures.epsilon_normalised(small.matrix, 224) == pytest.approx(
        measures.epsilon_normalised(large.matrix, 448)
    )
    assert measures.epsilon(small.matrix) != pytest.approx(measures.epsilon(large.matrix))
    assert measures.epsilon_normalised(small.matrix, 224) == pytest.approx(14.0 / 224.0)


def test_sm2_counts_inliers() -> None:
    np.testing.assert_array_equal(measures.sm2([fit(3), fit(9), NO_MAP]), [3, 9, 0])


def test_sm3_weakens_by_at_most_a_third() -> None:
    scores = measures.sm3([fit(40), fit(40, tx=-1000.0), NO_MAP])
    assert scores == pytest.approx([40 * (1 - 0.35 * 0.5), 40 * 0.65, 0.0])


def test_sm1_keeps_the_five_smallest_epsilon() -> None:
    fits = [fit(10, tx=-60.0), *(fit(i, tx=-float(i)) for i in (5, 4, 3, 2, 1)), fit(30, tx=-70.0)]
    scores = measures.sm1(fits)
    np.testing.assert_array_equal(scores[1:6], [5, 4, 3, 2, 1])
    assert scores[0] < scores[6] < 0
    assert int(scores.argmax()) == 1


def test_sm1_ties_go_to_the_earlier_and_no_map_is_never_selected() -> None:
    scores = measures.sm1([fit(i + 1, tx=-5.0) for i in range(7)])
    assert (scores[:5] > 0).all()
    assert (scores[5:] < 0).all()
    few = measures.sm1([NO_MAP, fit(4), NO_MAP])
    assert few[1] == 4
    assert few[0] == few[2] < 0
    np.testing.assert_array_equal(measures.sm1([NO_MAP, NO_MAP]), [-1.0, -1.0])


def test_normalised_variants_pick_the_near_identity_map() -> None:
    # As printed, a large positive translation t shrinks the diagonal to 1/t: epsilon is about 4 however far.
    far, turned = fit(10, tx=200.0), fit(10, scale=2.5)
    assert measures.epsilon(far.matrix) > measures.epsilon(turned.matrix)
    normalised = measures.sm3_normalised([far, turned], 224)
    assert normalised[0] < 10
    np.testing.assert_array_equal(measures.sm1_normalised([far, turned], 224), [10, 10])


def test_no_renders_give_no_scores() -> None:
    for measure in (measures.sm1, measures.sm2, measures.sm3):
        assert measure([]).shape == (0,)
