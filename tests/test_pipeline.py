from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cadpose
from cadpose.alignment.trust import Trust
from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.pipeline import Annotator, PhotoResult
from cadpose.records import CadModel, Detection, Photo, Rotation
from cadpose.similarity.joint.ranker import JointRanker, JointRanking
from cadpose.stopwatch import Stopwatch
from cadpose.weights import REGISTRY
from tests.batch.fakes import FakeDetector, fake_annotator
from tests.small_library import Shot, save, shoot

ROTATION = Rotation(35, 12, 4)


@pytest.fixture(scope="module")
def annotator(small_library: Library) -> Annotator:
    return Annotator(small_library)


@pytest.fixture(scope="module")
def hatch(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", ROTATION)


def seen(shot: Shot, **changes: Any) -> Detection:
    return replace(Detection(shot.box, shot.cad.category, mask=shot.mask, rotation=shot.rotation), **changes)


# -- one object ------------------------------------------------------------------------------------


@pytest.mark.parametrize("cad_id", ["made/car/hatch.obj", "made/car/pickup.obj", "made/car/van.glb"])
def test_the_right_model_and_focal_length_at_a_known_rotation(
    annotator: Annotator, small_library: Library, cad_id: str
) -> None:
    shot = shoot(small_library, cad_id, ROTATION)
    (found,) = annotator.annotate(shot.photo, [seen(shot, mask=None)])
    assert found.cad == shot.cad and len(found.candidates) == 3
    scores = [c.score for c in found.candidates]
    assert scores == sorted(scores, reverse=True) and scores[0] > scores[1] + 0.2
    chances = [c.probability for c in found.candidates]
    assert None not in chances and found.none_probability is not None
    assert sum(p or 0.0 for p in chances) + found.none_probability == pytest.approx(1.0)
    assert found.pose.rotation == shot.rotation and found.hypotheses[0].rotation == shot.rotation
    assert found.pose.focal_px == pytest.approx(shot.focal_px, rel=0.01)
    assert found.pose.principal_px == pytest.approx((210.0, 140.0), abs=1.0)
    assert found.box_iou > 0.98
    # GrabCut's mask, on a plain background.
    assert found.mask_iou is not None and found.mask_iou > 0.9
    assert found.detection.mask is not None and found.detection.mask.shape == shot.mask.shape


def test_a_given_mask_is_kept_and_compared(annotator: Annotator, hatch: Shot) -> None:
    (found,) = annotator.annotate(hatch.photo, [seen(hatch)])
    assert found.detection.mask is hatch.mask
    assert found.mask_iou is not None and found.mask_iou > 0.98
    wrong = np.roll(hatch.mask, 40, axis=1)
    (found,) = annotator.annotate(hatch.photo, [seen(hatch, mask=wrong)])
    assert found.mask_iou is not None and found.mask_iou < 0.8


def test_rotation_and_model_are_found_from_the_box_alone(small_library: Library) -> None:
    """Everything real but the detector; two chairs, so that galleries are made in seconds."""
    shot = shoot(small_library, "made/chair/throne.glb", Rotation(25, 12, 3), focal_px=380.0)
    annotator = Annotator(small_library, categories=["Chairs"])
    assert annotator.categories == ("chair",)
    result = annotator.run(shot.photo, [Detection(shot.box, "chair")])
    (found,) = result.annotations
    assert found.cad == shot.cad
    assert found.pose.rotation.error_to(shot.rotation) < 12.0
    assert found.pose.focal_px == pytest.approx(shot.focal_px, rel=0.06)
    assert found.box_iou > 0.9 and found.mask_iou is not None and found.mask_iou > 0.8
    assert len(found.hypotheses) > 1
    assert set(result.seconds) == {"read", "library", "mask", "rotation", "similarity", "alignment"}
    assert set(found.seconds) <= set(result.seconds)
    again = annotator.run(shot.photo, [Detection(shot.box, "chair")])
    assert untimed(again) == untimed(result)


@pytest.mark.parametrize("align_to", ["box", "paper", "mask"])
def test_ways_to_align(small_library: Library, align_to: str) -> None:
    # Off the axis the rectangle's middle is not where the origin appears.
    shot = shoot(small_library, "made/car/pickup.obj", Rotation(140, 25, 0))
    annotator = Annotator(small_library, align_to=align_to)
    (found,) = annotator.annotate(shot.photo, [seen(shot)])
    assert found.provenance["align_to"] == align_to
    # With the principal point off, no focal length is right; the paper's way pays for that.
    assert found.pose.focal_px == pytest.approx(shot.focal_px, rel=0.15 if align_to == "paper" else 0.02)
    distance = np.hypot(*np.subtract(shot.box.centre, (210.0, 140.0)))
    assert distance > 3
    if align_to == "paper":
        assert found.pose.principal_px == shot.box.centre
        assert 0.6 < found.box_iou < 0.95
    else:
        assert found.pose.principal_px == pytest.approx((210.0, 140.0), abs=1.5)
        assert found.box_iou > 0.98
    if align_to == "mask":
        assert found.mask_iou is not None and found.mask_iou > 0.97


def test_provenance_names_everything_that_took_part(annotator: Annotator, hatch: Shot) -> None:
    (found,) = annotator.annotate(hatch.photo, [seen(hatch)])
    assert found.provenance == {
        "cadpose": cadpose.__version__,
        "library": annotator.library.digest,
        "detector": "embedded",
        "masks": "network",
        "rotation": "embedded",
        "similarity": annotator.similarity.name,
        "renderer": "raster-2x2",
        "align_to": "box",
        "refine": "fast",
        "refinement": REGISTRY["refinement"].sha256[:12],
        "trust": Trust.shipped().digest,
        "intrinsics": "exif",
        "categories": None,
        "candidates": 10,
        "index": None,
        "seed": 0,
    }


def test_provenance_tells_what_was_looked_for_and_leaves_out_what_took_no_part(
    small_library: Library,
) -> None:
    told = Annotator(small_library, refine="off", categories=["chair"]).provenance()
    assert told["categories"] == ["chair"] and told["refinement"] is None and told["trust"] is None


def untimed(result: PhotoResult) -> dict[str, Any]:
    document = document_from(result.photo, result.annotations, result.failures)
    told = AnnotationDocument.from_json(document.to_json()).model_dump(mode="json")
    for part in told["annotations"]:
        assert part.pop("seconds")
    return told


@pytest.mark.parametrize("similarity", ["joint", "aligned", "sift-sm1", "fused"])
def test_the_same_input_gives_the_same_document(small_library: Library, hatch: Shot, similarity: str) -> None:
    found = [Detection(hatch.box, "car", rotation=hatch.rotation)]
    first, second = (
        untimed(Annotator(small_library, similarity=similarity, seed=7).run(hatch.photo, found))
        for _ in range(2)
    )
    assert first == second and len(first["annotations"]) == 1


def test_a_joint_ranker_of_ones_own_ranks(
    small_library: Library, annotator: Annotator, hatch: Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    default = annotator.joint
    own = JointRanker(default.source, default.render)
    asked: list[JointRanking] = []

    def rank(*told: Any, **more: Any) -> JointRanking:
        asked.append(JointRanker.rank(own, *told, **more))
        return asked[-1]

    monkeypatch.setattr(own, "rank", rank)
    using = Annotator(small_library, similarity=own)
    (found,) = using.annotate(hatch.photo, [seen(hatch)])
    assert using.joint is own is using.similarity and len(asked) == 1
    assert found.candidates == asked[0].candidates and found.cad == hatch.cad
    assert Annotator(small_library, similarity="aligned").joint is not own


# -- objects that fail -----------------------------------------------------------------------------


def test_a_category_without_model_fails_and_the_others_go_on(annotator: Annotator, hatch: Shot) -> None:
    zebra = Detection(Box(5, 5, 60, 60), "zebra", 0.7)
    result = annotator.run(hatch.photo, [zebra, seen(hatch)])
    assert [a.cad.name for a in result.annotations] == ["hatch"]
    (failure,) = result.failures
    assert failure.detection is zebra and failure.stage == "library"
    assert "'zebra'" in failure.reason and "cadpose library add" in failure.reason


def test_flags_are_set_whoever_found_the_object(annotator: Annotator, hatch: Shot) -> None:
    cut = Box(0.0, hatch.box.y0, hatch.box.x1, hatch.box.y1)
    result = annotator.run(
        hatch.photo, [seen(hatch), seen(hatch, box=cut), Detection(Box(9, 9, 20, 20), "zebra")]
    )
    assert [a.detection.truncated for a in result.annotations] == [False, True]
    assert not any(a.detection.tiny for a in result.annotations)
    assert [(f.detection.truncated, f.detection.tiny) for f in result.failures] == [(False, True)]


def test_a_box_outside_the_photo_fails(annotator: Annotator, hatch: Shot) -> None:
    result = annotator.run(hatch.photo, [seen(hatch, box=Box(500, 10, 600, 90))])
    (failure,) = result.failures
    assert not result.annotations and failure.stage == "detect"
    assert "(500, 10, 600, 90) lies outside the photo" in failure.reason


def test_a_mask_of_another_photo_fails(annotator: Annotator, hatch: Shot) -> None:
    result = annotator.run(hatch.photo, [seen(hatch, mask=hatch.mask[:-1])])
    (failure,) = result.failures
    assert "400 x 299" in failure.reason and "400 x 300" in failure.reason


def test_a_box_that_reaches_outside_is_clipped(annotator: Annotator, hatch: Shot) -> None:
    (found,) = annotator.annotate(hatch.photo, [seen(hatch, box=Box(-50, -20, 405, 310))])
    assert found.detection.box == Box(0, 0, 400, 300)


def test_annotate_logs_what_was_left_out(
    annotator: Annotator, hatch: Shot, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert len(annotator.annotate(hatch.photo, [Detection(hatch.box, "zebra"), seen(hatch)])) == 1
    (record,) = [r for r in caplog.records if r.name == "cadpose.pipeline"]
    assert "street.png: zebra left out: " in record.getMessage()


def test_what_every_object_needs_stops_the_photo(small_library: Library, hatch: Shot) -> None:
    class Missing:
        name = "missing"

        def mask(self, photo: Photo, box: Box) -> None:
            raise DependencyError("the weights are missing")

    with pytest.raises(DependencyError, match="weights are missing"):
        Annotator(small_library, masks=Missing()).run(hatch.photo, [seen(hatch, mask=None)])


@settings(max_examples=30)
@given(
    x=st.floats(-20, 119),
    y=st.floats(-20, 79),
    width=st.sampled_from([1e-9, 0.3, 1.0, 2.5, 40.0, 500.0]),
    height=st.sampled_from([1e-9, 0.3, 1.0, 2.5, 40.0, 500.0]),
    azimuth=st.sampled_from([0.0, 90.0, 33.0]),
    elevation=st.sampled_from([-90.0, 0.0, 90.0]),
    align_to=st.sampled_from(["box", "paper", "mask"]),
)
def test_no_box_ends_in_anything_but_an_annotation_or_a_reason(
    small_library: Library,
    x: float,
    y: float,
    width: float,
    height: float,
    azimuth: float,
    elevation: float,
    align_to: str,
) -> None:
    if x + width <= x or y + height <= y:
        return
    photo = Photo(np.random.default_rng(0).integers(0, 255, (80, 120, 3), np.uint8))
    annotator = Annotator(small_library, align_to=align_to, candidates=1)
    detection = Detection(Box(x, y, x + width, y + height), "chair", rotation=Rotation(azimuth, elevation))
    result = annotator.run(photo, [detection])
    assert len(result.annotations) + len(result.failures) == 1
    document_from(result.photo, result.annotations, result.failures)


# -- photos and names ------------------------------------------------------------------------------


def test_photos_in_every_form(small_library: Library, hatch: Shot, tmp_path: Path) -> None:
    annotator = fake_annotator(small_library)
    path = save(tmp_path / "street.png", hatch.photo.rgb)
    from_path, from_text, from_pixels = (
        annotator.annotate(photo) for photo in (path, str(path), hatch.photo.rgb)
    )
    assert from_path[0].photo_name == from_text[0].photo_name == str(path)
    assert from_path[0].photo_sha256 == from_text[0].photo_sha256 != ""
    assert from_pixels[0].photo_name == "photo"
    assert from_path[0].pose == from_pixels[0].pose
    with pytest.raises(InputError, match=r"nothing\.png"):
        annotator.annotate(tmp_path / "nothing.png")


@pytest.mark.parametrize("size", [(1, 1), (1, 400), (400, 1), (9, 7)])
def test_the_smallest_photos(small_library: Library, size: tuple[int, int]) -> None:
    photo = Photo(np.full((size[1], size[0], 3), 90, np.uint8))
    (found,) = fake_annotator(small_library).annotate(photo)
    assert found.photo_size == size


def test_the_detector_runs_only_when_nothing_is_given(small_library: Library, hatch: Shot) -> None:
    detector = FakeDetector()
    annotator = fake_annotator(small_library, detector=detector)
    assert annotator.annotate(hatch.photo, []) == []
    assert detector.seen == []
    assert "detect" in annotator.run(hatch.photo).seconds
    assert detector.seen == ["street.png"]


@pytest.mark.parametrize(
    ("stage", "known"),
    [
        ("detector", "embedded"),
        ("masks", "network, grabcut, none"),
        ("rotation", "embedded"),
        ("similarity", "joint, aligned, fused, sm1"),
        ("renderer", "raster, blender"),
        ("device", "cpu, cuda"),
    ],
)
def test_unknown_names_list_the_known_ones(small_library: Library, stage: str, known: str) -> None:
    with pytest.raises(CadposeError, match=rf"^unknown {stage} 'nonsense', choose one of: {known}"):
        Annotator(small_library, **{stage: "nonsense"})  # type: ignore[arg-type]


def test_arguments_that_make_no_sense(small_library: Library, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="candidates"):
        Annotator(small_library, candidates=0)
    with pytest.raises(ValueError, match="align_to"):
        Annotator(small_library, align_to="sideways")
    with pytest.raises(LibraryError, match="'zebra'"):
        Annotator(small_library, categories=["car", "zebra"])
    with pytest.raises(LibraryError, match="no CAD library"):
        Annotator(tmp_path / "none")


def test_candidates_bounds_the_pool(small_library: Library, hatch: Shot) -> None:
    (found,) = fake_annotator(small_library, candidates=2).annotate(hatch.photo, [seen(hatch)])
    assert len(found.candidates) == 2


def test_the_stopwatch_adds_up_and_knows_the_last_stage() -> None:
    clock = Stopwatch()
    with clock.time("a"):
        pass
    first = clock.seconds["a"]
    with pytest.raises(KeyError), clock.time("a"):
        raise KeyError
    assert clock.seconds["a"] > first and clock.stage == "a"


def test_a_damaged_candidate_is_passed_over(
    annotator: Annotator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    whole = annotator.library.mesh
    bad = annotator.library.representatives("car", 10)[0]

    def mesh(cad: CadModel | str) -> Mesh:
        if (cad if isinstance(cad, str) else cad.id) == bad.id:
            raise LibraryError("its file is damaged")
        return whole(cad)

    monkeypatch.setattr(annotator.library, "mesh", mesh)
    photo = Photo(np.full((60, 90, 3), 120, np.uint8))
    car = Detection(Box(10, 10, 80, 50), "car", rotation=Rotation(30, 10))
    (annotation,) = annotator.annotate(photo, [car])
    assert bad.id not in [c.cad.id for c in annotation.candidates]
    assert bad.id in caplog.text


def test_the_mask_counts_wherever_it_lies(annotator: Annotator) -> None:
    photo = Photo(np.full((300, 400, 3), 120, np.uint8))
    everywhere = np.ones((300, 400), np.bool_)
    box = Box(150, 120, 210, 160)
    (annotation,) = annotator.annotate(
        photo, [Detection(box, "car", mask=everywhere, rotation=Rotation(30, 10))]
    )
    assert annotation.mask_iou is not None and annotation.mask_iou < 2 * box.area / (300 * 400)


def test_a_photo_made_of_an_array_leaves_it_writable() -> None:
    frame = np.zeros((4, 5, 3), np.uint8)
    photo = Photo(frame)
    frame[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        photo.rgb[0] = 2
