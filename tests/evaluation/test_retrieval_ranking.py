"""Which models are compared for a label, and at which rotation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.datasets.labels import Label, read_labels
from cadpose.errors import InputError, LibraryError
from cadpose.evaluation.retrieval import retrieval_ranking
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Candidate, Mask, Photo, Rotation, RotationHypothesis
from tests.batch.fakes import FakeDetector, FakeMasks, FakeRotation, FakeSimilarity
from tests.small_library import save


class Watched(FakeRotation):
    """Remembers what it chose among."""

    def __init__(self) -> None:
        self.pools: list[list[str]] = []

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> list[RotationHypothesis]:
        self.pools.append([cad.id for cad in cads])
        return super().estimate(crop, cads)


class Watching(Annotator):
    """Remembers at which rotations it ranked."""

    turned: tuple[Rotation, ...] = ()

    def rank(
        self,
        photo: Photo,
        box: Box,
        cads: Sequence[CadModel],
        rotations: Sequence[Rotation],
        mask: Mask | None = None,
    ) -> list[Candidate]:
        self.turned += tuple(rotations)
        return super().rank(photo, box, cads, rotations, mask)


@pytest.fixture
def rotation() -> Watched:
    return Watched()


@pytest.fixture
def annotator(small_library: Library, rotation: Watched) -> Watching:
    return Watching(
        small_library,
        detector=FakeDetector(),
        masks=FakeMasks(),
        rotation=rotation,
        similarity=FakeSimilarity(),
        candidates=2,
    )


@pytest.fixture
def label(tmp_path: Path) -> Label:
    save(tmp_path / "a.png", np.full((60, 80, 3), 90, np.uint8))
    entry = {"photo": "a.png", "category": "Chairs", "azimuth": 80, "elevation": 5}
    (tmp_path / "labels.json").write_text(json.dumps([entry]))
    (found,) = read_labels(tmp_path / "labels.json")
    return found


def test_without_a_gallery_the_representatives_are_the_choice(
    annotator: Watching, rotation: Watched, label: Label
) -> None:
    ranking = retrieval_ranking(annotator, None, "estimated")(label)
    pool = [cad.id for cad in annotator.library.representatives("chair", 2)]
    assert sorted(ranking) == sorted(pool) and rotation.pools == [pool]
    assert annotator.turned == (Rotation(35, 12),)


def test_a_gallery_is_cut_to_the_category_and_a_word_for_it_will_do(
    annotator: Watching, rotation: Watched, label: Label
) -> None:
    everything = [cad.id for cad in annotator.library.models()]
    ranking = retrieval_ranking(annotator, everything, "true")(label)
    assert sorted(ranking) == ["made/chair/plain.obj", "made/chair/throne.glb"]
    assert annotator.turned == (Rotation(80, 5),) and not rotation.pools


def test_what_cannot_be_ranked(annotator: Watching, label: Label) -> None:
    with pytest.raises(LibraryError, match="nonsense"):
        retrieval_ranking(annotator, ["nonsense"], "true")
    with pytest.raises(InputError, match=r"a\.png: the gallery has no CAD model of category 'chair'"):
        retrieval_ranking(annotator, ["made/car/hatch.obj"], "true")(label)
    with pytest.raises(InputError, match=r"a\.png: has no labelled rotation"):
        retrieval_ranking(annotator, None, "true")(Label(label.photo, "chair", azimuth=80))
