from __future__ import annotations

import numpy as np
import torch

from cadpose.alignment.refinement.steps import stepped
from cadpose.geometry.boxes import Box
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.training.drawn import DrawnStream
from cadpose.training.refinement.pairs import PairMaker, step_between
from cadpose.training.refinement.train import pair_sources
from cadpose.training.synth.records import SynthObject


def shown(rotation: Rotation, symmetry: SymmetryGroup) -> SynthObject:
    box = Box(10.0, 20.0, 110.0, 90.0)
    return SynthObject(
        cad="made/car/hatch.obj", category="car", rotation=rotation, focal_px=900.0,
        principal_px=(60.0, 52.0), t_z=3.0, box=box, visible_box=box, mask=np.ones((128, 128), np.bool_),
        visible=1.0, hidden=0.0, truncated=False, symmetry=symmetry,
    )  # fmt: skip


def test_the_step_leads_to_the_true_pose() -> None:
    start = Pose4Dof(Rotation(50.0, 20.0, -4.0), 500.0, (66.0, 49.0))
    step = step_between(start, shown(Rotation(30.0, 10.0), SymmetryGroup.trivial()), 130.0)
    there = stepped(start, step.astype(np.float64), 130.0)
    assert there.rotation.error_to(Rotation(30.0, 10.0)) < 1e-3
    np.testing.assert_allclose(there.focal_px, 900.0 * 2.0 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(there.principal_px, (60.0, 52.0), atol=1e-4)


def test_the_way_back_is_the_shortest_that_looks_the_same() -> None:
    start = Pose4Dof(Rotation(200.0, 10.0), 600.0, (60.0, 52.0))
    step = step_between(start, shown(Rotation(30.0, 10.0), SymmetryGroup.cyclic(2)), 130.0)
    assert (
        np.degrees(np.linalg.norm(step[:3])) == np.float32(10.0)
        or abs(np.degrees(np.linalg.norm(step[:3])) - 10.0) < 0.3
    )
    bottle = step_between(start, shown(Rotation(30.0, 10.0), SymmetryGroup.revolution()), 130.0)
    assert np.linalg.norm(bottle[:3]) < 1e-4


def test_pairs_are_the_same_again_and_off_by_what_is_told(small_library: Library) -> None:
    source = pair_sources(small_library, None, 0).train
    chunks = list(DrawnStream(source, PairMaker(), photos=24))
    again = list(DrawnStream(source, PairMaker(), photos=24))
    assert all(
        torch.equal(a, b)
        for one, other in zip(chunks, again, strict=True)
        for a, b in zip(one.fields(), other.fields(), strict=True)
    )
    pairs = chunks[0]
    assert pairs.photo.shape[1:] == pairs.view.shape[1:] == (196, 112)
    assert pairs.photo.dtype == torch.int8
    turns = torch.rad2deg(pairs.step[:, :3].norm(dim=1))
    assert 2.0 < float(turns.median()) < 20.0
    assert float(pairs.step[:, 3].abs().median()) < 0.3
    assert float(pairs.step[:, 4:].abs().max()) < 0.5
    # The drawn model fills a good part of its crop.
    assert 0.1 < float(pairs.cover.float().mean() / 255.0) < 0.9
