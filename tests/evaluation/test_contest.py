"""Who ranks: measures at one rotation, rankers, and how they are chosen by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.backends import Backends
from cadpose.encoder import lite0
from cadpose.errors import CadposeError, DependencyError
from cadpose.evaluation import contest as contest_module
from cadpose.evaluation.contest import (
    ALL,
    RANKERS,
    Contest,
    Ranking,
    known_names,
    make_contest,
    scores_together,
)
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Candidate, Mask, Photo, Rotation, Views
from cadpose.similarity import local_affine
from cadpose.similarity.local_affine import AffineComparison, LocalAffine
from cadpose.similarity.local_features import Sift
from cadpose.similarity.registry import measures
from tests.batch.fakes import FakeSimilarity, fake_annotator
from tests.evaluation.retrieving import ranking
from tests.small_library import shoot

TRUE = Rotation(35, 12, 4)


class Joint:
    """Ranks by id, sure of itself."""

    name = "joint"

    def __init__(self, annotator: Annotator) -> None:
        self.annotator = annotator

    def rank(self, photo: Photo, box: Box, category: str, candidates: Sequence[CadModel]) -> Ranking:
        ordered = sorted(candidates, key=lambda cad: cad.id)
        return Ranking(tuple(Candidate(cad, -float(i), TRUE) for i, cad in enumerate(ordered)), 0.8)


def test_a_ranking_knows_the_true_models_place() -> None:
    one = ranking("bca")
    assert [one.place(cad) for cad in ("a", "b", "z", None)] == [3, 1, None, None]


@pytest.mark.parametrize(
    ("probability", "needs_review", "accepted"),
    [(None, None, None), (0.95, None, True), (0.5, None, False), (0.5, False, True), (0.99, True, False)],
)
def test_what_is_accepted(
    probability: float | None, needs_review: bool | None, accepted: bool | None
) -> None:
    assert ranking("ab", probability=probability, needs_review=needs_review).accepted(0.9) is accepted


def test_rankings_that_cannot_be() -> None:
    with pytest.raises(ValueError, match="at least one candidate"):
        Ranking(())
    with pytest.raises(ValueError, match="each once"):
        ranking("aa")
    with pytest.raises(ValueError, match="outside"):
        ranking("ab", probability=1.1)


def test_a_contest_needs_names_of_its_own(small_library: Library) -> None:
    with pytest.raises(ValueError, match="at least one"):
        Contest()
    with pytest.raises(ValueError, match="each once"):
        Contest({"x": FakeSimilarity()}, {"x": Joint(fake_annotator(small_library))})


def test_measures_score_what_the_annotator_scores(small_library: Library) -> None:
    """The same order and scores as the pipeline's own ranking, for a quick and for a matching measure."""
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    cads = small_library.models("car")
    for name in ("aligned", "sm2"):
        annotator = fake_annotator(small_library, similarity=name)
        contest = make_contest(annotator, [name])
        (found,) = contest.at_rotation(annotator, shot.photo, shot.box, cads, TRUE).values()
        mask = annotator.masks.mask(shot.photo, shot.box)
        expected = annotator.rank(shot.photo, shot.box, cads, [TRUE], mask)
        assert [c.cad.id for c in found.candidates] == [c.cad.id for c in expected]
        assert [c.score for c in found.candidates] == pytest.approx([c.score for c in expected])
        assert found.place("made/car/hatch.obj") == 1 and found.candidates[0].rotation == TRUE


class Watching(FakeSimilarity):
    """Keeps the masks that it is shown."""

    def __init__(self) -> None:
        self.masks: list[Mask | None] = []

    def score(self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, **more: Any) -> Any:
        self.masks.append(mask)
        return super().score(crop, mask, views)


def test_measures_are_shown_the_mask_in_the_crop(small_library: Library) -> None:
    """As the pipeline shows it, found at the box where none is given."""
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    cads = small_library.models("car")
    measure = Watching()
    annotator = fake_annotator(small_library, similarity=measure)
    given = np.zeros((shot.photo.height, shot.photo.width), np.bool_)
    given[:, : shot.photo.width // 2] = True
    for mask in (None, given):
        Contest({"watching": measure}).at_rotation(annotator, shot.photo, shot.box, cads, TRUE, mask)
        told = annotator.masks.mask(shot.photo, shot.box) if mask is None else mask
        annotator.rank(shot.photo, shot.box, cads, [TRUE], told)
    seen = [mask for mask in measure.masks if mask is not None]
    assert len(seen) == 4 and not np.array_equal(seen[0], seen[2])
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[2], seen[3])


def test_no_mask_is_sought_for_measures_that_ignore_it(small_library: Library) -> None:
    class Never:
        name = "never"

        def mask(self, photo: Photo, box: Box) -> Mask:
            raise AssertionError("sought")

    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    annotator = fake_annotator(small_library, masks=Never())
    contest = make_contest(annotator, ["aligned", "fused"])
    assert not contest.uses_masks and make_contest(annotator, ["aligned", "sm2"]).uses_masks
    assert contest.at_rotation(annotator, shot.photo, shot.box, small_library.models("car"), TRUE)


@pytest.fixture
def made_up_delf(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Where a network was loaded to; SIFT's features stand for DELF's."""
    loads: list[str] = []

    class MadeUp(Sift):
        name = "delf"
        side = 512

        def __init__(self, *, device: str) -> None:
            super().__init__()
            loads.append(device)

    local_affine._delf.cache_clear()
    monkeypatch.setattr(local_affine, "Delf", MadeUp)
    yield loads
    local_affine._delf.cache_clear()


@pytest.mark.parametrize("masked", [False, True])
def test_shared_matches_change_no_score(
    masked: bool, small_library: Library, monkeypatch: pytest.MonkeyPatch, made_up_delf: list[str]
) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    annotator = fake_annotator(small_library)
    views = Views.joined(
        [annotator.render_framed(cad, TRUE.to_matrix()[None]) for cad in small_library.models("car")]
    )
    crop = np.array(shot.photo.rgb[:224, :224])
    mask = None
    if masked:
        mask = np.zeros((224, 224), np.bool_)
        mask[30:150, 20:200] = True
    backends = Backends("cpu", 0, None, annotator.render_framed)
    names = ("aligned", "fused", "sm1", "sm2", "sift-sm2", "sift-sm3", "delf-sm1", "delf-sm2")
    some = {name: backends.similarity(name) for name in names}
    assert made_up_delf == ["cpu"]
    alone = {name: measure.score(crop, mask, views, aspect=1.3) for name, measure in some.items()}
    calls: list[tuple[str, bool]] = []
    real = LocalAffine.compare

    def counted(
        self: LocalAffine, crop: NDArray[np.uint8], mask: Mask | None, views: Views
    ) -> AffineComparison:
        calls.append((self.features.name, mask is None))
        return real(self, crop, mask, views)

    monkeypatch.setattr(LocalAffine, "compare", counted)
    together = scores_together(some, crop, mask, views, 1.3)
    assert set(together) == set(alone)
    for name, scores in together.items():
        np.testing.assert_array_equal(scores, alone[name], err_msg=name)
    # The fused measure matches without a mask whatever the others do.
    assert len(calls) == len(set(calls)) == (4 if masked else 3)


def test_names(small_library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    annotator = fake_annotator(small_library)
    assert known_names() == (*measures(lite0(), 0), "joint")
    monkeypatch.setitem(RANKERS, "joint", Joint)
    contest = make_contest(annotator, ["joint", "sm2", "joint", "aligned"], seed=3)
    assert contest.names == ("sm2", "aligned", "joint")
    assert isinstance(ranker := contest.rankers["joint"], Joint) and ranker.annotator is annotator
    with pytest.raises(CadposeError, match="unknown measure 'sm9', choose one of: aligned"):
        make_contest(annotator, ["sm9"])


def test_all_leaves_out_what_cannot_be_had(small_library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    class Missing(FakeSimilarity):
        def __init__(self) -> None:
            raise DependencyError("no weights")

    annotator = fake_annotator(small_library)
    table = {"quick": FakeSimilarity, "missing": Missing, "too": Missing}
    monkeypatch.setattr(contest_module, "registered", lambda encoder, seed: table)
    monkeypatch.setattr("cadpose.similarity.registry.measures", lambda encoder, seed: table)
    monkeypatch.delitem(RANKERS, "joint")
    reasons: list[str] = []
    assert make_contest(annotator, [ALL], left_out=reasons.append).names == ("quick",)
    assert reasons == ["left out: missing, too: no weights"]
    with pytest.raises(DependencyError, match="no weights"):
        make_contest(annotator, ["missing"])
