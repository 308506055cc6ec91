from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cadpose.datasets.labels import read_labels
from cadpose.errors import InputError
from cadpose.geometry.boxes import mask_iou
from cadpose.library.catalogue import Library
from cadpose.rendering.raster import Rasteriser
from cadpose.similarity.triplet_framing import Framing
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.writer import write_photos as write_synthetic
from cadpose.training.triplet.data import Pictures, digest, shown, training_examples, validation_examples
from tests.training.triplet.made import write_photos


@pytest.fixture(scope="module")
def labels(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_photos(small_library, tmp_path_factory.mktemp("photos"))


@pytest.fixture(scope="module")
def pictures(small_library: Library) -> Pictures:
    return Pictures(Library.open(small_library.path), Rasteriser(), Framing(side=80, longer=60))


def test_photo_and_positive_show_the_same(labels: Path, pictures: Pictures) -> None:
    """At the true rotation the render lies over the masked photo; the other models' do not as well."""
    examples = training_examples(labels, pictures.library)
    models = pictures.library.models()
    everything = list(range(len(models)))
    for seen in shown(examples, range(5), [everything] * 5, models, pictures, 2):
        assert seen.photo.shape == (1, 80, 80, 3) and seen.renders.shape == (6, 80, 80, 3)
        own = everything.index([m.id for m in models].index(examples[seen.index].cad.id))
        np.testing.assert_array_equal(seen.renders[0], seen.renders[1 + own])
        apart = np.abs(seen.photo.astype(int) - seen.renders[1:]).mean(axis=(1, 2, 3))
        assert apart.argmin() == own and apart[own] < 5
        # Masked: where the render shows nothing, neither does the photo.
        outside = seen.renders[0].max(axis=2) == 0
        assert (seen.photo[0][outside] > 40).mean() < 0.01
        assert not seen.photo[0, :9].any() and not seen.photo[0, :, :9].any()


def test_without_a_mask_the_background_stays(labels: Path, pictures: Pictures, tmp_path: Path) -> None:
    label = read_labels(labels)[0]
    bare = labels.with_name("bare.jsonl")
    entry = json.loads(labels.read_text().splitlines()[0])
    del entry["mask"]
    bare.write_text(json.dumps(entry))
    masked, whole = pictures.photo(label), pictures.photo(read_labels(bare)[0])
    assert (masked.max(axis=2) == 0).sum() > (whole.max(axis=2) == 0).sum() + 100
    unmasked = Pictures(pictures.library, pictures.renderer, Framing(side=80, longer=60, masked=False))
    np.testing.assert_array_equal(unmasked.photo(label), whole)


def test_order_and_negatives_are_as_told(labels: Path, pictures: Pictures) -> None:
    examples = training_examples(labels, pictures.library)
    models = pictures.library.models()
    negatives = [[(i + 1) % 5, (i + 2) % 5] for i in range(5)]
    for workers in (1, 3):
        found = list(shown(examples, [4, 0, 2], negatives, models, pictures, workers))
        assert [seen.index for seen in found] == [4, 0, 2]
        assert [seen.models for seen in found] == [(0, 1), (1, 2), (3, 4)]


def test_which_labels_are_used(labels: Path, small_library: Library, tmp_path: Path) -> None:
    base = json.loads(labels.read_text().splitlines()[0])
    path = labels.with_name("some.json")

    def write(*changes: dict[str, object]) -> Path:
        path.write_text(json.dumps([base | change for change in changes]))
        return path

    odd: tuple[dict[str, object], ...] = ({"cad": None}, {"azimuth": None}, {"difficult": True})
    used = training_examples(
        write({}, *odd, {"split": "train"}, {"split": "test"}, {"occluded": True}), small_library
    )
    assert [(x.label.split, x.label.occluded) for x in used] == [
        (None, False), ("train", False), (None, True),
    ]  # fmt: skip
    measured = validation_examples(
        write({}, *odd, {"split": "train"}, {"split": "test"}, {"occluded": True}, {"truncated": True}),
        small_library,
    )
    assert [x.label.split for x in measured] == [None, "test"]
    with pytest.raises(InputError, match="nothing that can be trained on"):
        training_examples(write(*odd), small_library)
    with pytest.raises(InputError, match="nothing that can be measured on"):
        validation_examples(write({"split": "train"}), small_library)
    with pytest.raises(InputError, match=r"names 2 CAD models that the library .* lacks, as 'car/1'"):
        training_examples(write({}, {"cad": "car/2"}, {"cad": "car/1"}, {"cad": "car/2"}), small_library)


def test_the_digest_tells_sets_apart(labels: Path, small_library: Library) -> None:
    examples = training_examples(labels, small_library)
    assert digest(examples) == digest(training_examples(labels, small_library))
    assert digest(examples) != digest(examples[1:])


def test_only_the_rasteriser_draws_in_several_threads(pictures: Pictures) -> None:
    class Slow(Rasteriser):
        def __init__(self) -> None:
            super().__init__()
            self.name = "slow"

    assert pictures.workers(3) == 3 and pictures.workers(0) >= 1
    assert Pictures(pictures.library, Slow(), pictures.framing).workers(3) == 1


def test_synthetic_photos_are_labelled_as_wanted(small_library: Library, tmp_path: Path) -> None:
    """What `cadpose synth --warp 0` writes: the masked photo and the positive have one outline."""
    options = SynthOptions(size=128, warp=0.0, redress=0.0, company=0.0, occluder=0.0, truncate=0.0)
    recipe = Recipe.from_library(small_library, options=options, seed=3)
    write_synthetic(recipe, tmp_path, 8, format="png")
    examples = training_examples(tmp_path / "labels.jsonl", small_library)
    assert len(examples) == 8
    pictures = Pictures(Library.open(small_library.path), Rasteriser(), Framing(side=80, longer=60))
    models = pictures.library.models()
    for seen in shown(examples, range(8), [[]] * 8, models, pictures, 1):
        inside, drawn = (picture[0].max(axis=2) > 0 for picture in (seen.photo, seen.renders))
        assert mask_iou(inside, drawn) > 0.9
