from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.rotation.bins import BINS
from cadpose.training.lite.objective import Targets
from cadpose.training.lite.validate import decoded, modulo, summary

ANGLES = st.tuples(st.floats(0, 359), st.floats(-89, 89), st.floats(-179, 179))


@given(ANGLES)
def test_decoding_undoes_the_labels(angles: tuple[float, float, float]) -> None:
    azimuth, elevation, inplane = angles
    logits, offsets = [], []
    for label, n in zip((-azimuth % 360.0, elevation + 90.0, inplane + 180.0), BINS, strict=True):
        place = min(int(label // 15.0), n - 1)
        logits.append(torch.eye(n)[place][None])
        offsets.append(torch.zeros((1, n)))
        offsets[-1][0, place] = label / 15.0 - place
    found = decoded(logits, offsets)
    truth = Targets(torch.tensor([angles]), torch.tensor([1]))
    assert float(modulo(found, truth)) == pytest.approx(0.0, abs=0.1)


@given(ANGLES, ANGLES, st.sampled_from([0, 1, 2, 4]))
def test_modulo_is_the_distance_of_the_symmetry_group(
    a: tuple[float, float, float], b: tuple[float, float, float], turns: int
) -> None:
    found = float(modulo(torch.tensor([a]), Targets(torch.tensor([b]), torch.tensor([turns]))))
    if turns == 0:  # the azimuth means nothing: that of the answer stands for it
        b = (a[0], *b[1:])
    group = SymmetryGroup.cyclic(turns) if turns > 1 else SymmetryGroup.trivial()
    expected = group.geodesic_degrees(rotation_from_angles(*b), rotation_from_angles(*a))
    assert found == pytest.approx(float(expected), abs=0.1)


def test_summary_by_hand() -> None:
    told = summary(torch.tensor([5.0, 20.0, 40.0, 90.0]), torch.tensor([0, 0, 0, 2]), ("a", "b", "c"))
    assert told["acc30"] == 0.5 and told["acc10"] == 0.25 and told["mederr"] == 20.0
    assert told["acc30/a"] == pytest.approx(2 / 3) and told["acc30/c"] == 0.0 and "acc30/b" not in told
    assert told["macro30"] == pytest.approx(np.mean([2 / 3, 0.0]))
