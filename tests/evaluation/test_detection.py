from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.datasets.scene_sets import open_scenes
from cadpose.datasets.scenes import TrueObject
from cadpose.detection.box_masks import BoxMasks
from cadpose.errors import DependencyError, InputError
from cadpose.evaluation.coco_metrics import average_precision, require_pycocotools
from cadpose.evaluation.detection import Answer, Counts, Found, PhotoOutcome, Truth, match, size_of
from cadpose.evaluation.detection_report import report_files, write_detection_report
from cadpose.evaluation.detection_run import (
    LIVING,
    Contestant,
    counted_categories,
    evaluate_detection,
    truth_of,
)
from cadpose.evaluation.detection_sheet import MISSED, draw_sheet, worst_photos
from cadpose.evaluation.detection_tables import DetectionTables, detection_tables
from cadpose.geometry.boxes import Box
from cadpose.records import Detection, Photo
from tests.evaluation.detecting import Says, perfect, shifted, write_coco

CAR = Truth(Box(0, 0, 100, 100), "car", 10_000)
SMALL = Truth(Box(0, 0, 10, 10), "car", 100)


def found(box: tuple[float, float, float, float], category: str = "car", score: float = 0.9) -> Found:
    return Found(Box(*box), category, score)


def tables(
    coco: Path, *contestants: Contestant, smallest: float = 1024.0, asked_for: list[str] | None = None
) -> tuple[DetectionTables, list[PhotoOutcome]]:
    scenes = open_scenes(coco)
    categories = counted_categories(scenes, asked_for)
    outcomes, failed = evaluate_detection(scenes.scenes, contestants, categories)
    assert failed == []
    made = detection_tables(outcomes, contestants, categories, dataset=scenes.name, smallest=smallest)
    return made, outcomes


def test_an_object_is_found_once_by_the_surest() -> None:
    twice = [found((0, 0, 100, 90), score=0.5), found((0, 0, 90, 90), score=0.8)]
    matching = match([CAR], twice)
    assert matching.hits == {1: 0} and matching.false == (0,) and matching.missed == ()


def test_category_and_overlap_decide() -> None:
    other, half = found((0, 0, 100, 100), "chair"), found((0, 0, 100, 49))
    matching = match([CAR], [other, half])
    assert matching.false == (0, 1) and matching.missed == (0,) and matching.placed == {0}
    assert match([CAR], [half]).placed == frozenset()
    assert match([CAR], [], foreign=[other]).placed == {0}


def test_what_is_too_small_counts_neither_way() -> None:
    on_it, beside, large = found((0, 0, 10, 10)), found((50, 50, 60, 60)), found((50, 50, 150, 150))
    matching = match([SMALL], [on_it, beside, large], smallest=1024)
    assert (matching.aside, matching.false, matching.missed) == ((0, 1), (2,), ())
    assert match([SMALL], [beside]).missed == (0,) and match([SMALL], [beside]).false == (0,)


def test_a_crowd_forgives_all_that_lie_in_it() -> None:
    crowd = Truth(Box(0, 0, 300, 300), "car", 90_000, crowd=True)
    inside = [found((0, 0, 40, 40)), found((50, 50, 90, 90)), found((290, 290, 390, 390))]
    matching = match([crowd], inside)
    assert (matching.aside, matching.false, matching.missed) == ((0, 1), (2,), ())
    # A real object is taken before the crowd that it stands in.
    assert match([crowd, CAR], [found((0, 0, 100, 100))]).hits == {0: 1}


def test_a_difficult_object_forgives_one_that_fits() -> None:
    difficult = Truth(Box(0, 0, 100, 100), "car", 10_000, ignored=True)
    twice = [found((0, 0, 100, 90)), found((0, 0, 100, 80), score=0.8), found((0, 0, 40, 40), score=0.7)]
    matching = match([difficult], twice)
    assert (matching.aside, matching.false, matching.missed) == ((0,), (1, 2), ())
    assert matching.hits == {} and matching.placed == frozenset()


def test_ap_forgives_one_on_a_difficult_object_and_many_in_a_crowd() -> None:
    there = tuple(found((x, 0, x + 100, 100), score=0.9) for x in (0, 5, 10))
    right = found((300, 300, 400, 400), score=0.5)

    def ap50(crowd: bool = False, ignored: bool = False) -> float | None:
        truth = (
            Truth(Box(0, 0, 100, 100), "car", 10_000, crowd, ignored),
            Truth(right.box, "car", 10_000),
        )
        answers = {"x": Answer((), (*there, right), (), 0.0)}
        outcome = PhotoOutcome(Path("a.png"), (500, 500), truth, answers)
        return average_precision([outcome], "x", ["car"]).ap50

    assert ap50(crowd=True) == 1.0
    assert ap50(ignored=True) == pytest.approx(1 / 3)  # two false ones before the right one


def test_labels_keep_crowds_and_difficult_objects_apart() -> None:
    photo = Photo(np.zeros((50, 60, 3), np.uint8))
    for crowd, ignored in ((True, False), (False, True), (False, False)):
        one = truth_of(TrueObject(Box(0, 0, 9, 9), "car", 81, ignored=ignored, crowd=crowd), photo)
        assert (one.crowd, one.ignored) == (crowd, ignored)


def test_counts() -> None:
    total = Counts(4, 3, 1, 4) + Counts(0, 0, 2, 0)
    assert total == Counts(4, 3, 3, 4) and total.recall == 0.75 and total.precision == 0.5
    assert Counts().recall is None and Counts().precision is None
    low, high = total.recall_interval
    assert 0.3 < low < 0.75 < high < 0.96
    assert [size_of(area) for area in (10, 1024, 9216, 1e12)] == ["small", "medium", "large", "large"]


def test_a_perfect_detector_and_one_whose_boxes_are_aside(tmp_path: Path) -> None:
    right, wrong = Contestant("right", Says(perfect())), Contestant("wrong", Says(shifted()))
    made, _ = tables(write_coco(tmp_path), right, wrong)
    assert made.categories == {"car": 2, "chair": 1, "cup": 0} and made.aside == 1
    first, second = made.rows
    assert (first.boxes.ap, first.boxes.ap50) == (1.0, 1.0)
    assert first.total == Counts(3, 3, 0, 3) and first.total.precision == 1.0
    assert first.boxes.by_size == {"medium": (1.0, 1.0), "large": (None, None)}
    assert first.boxes.by_category["cup"] == (None, None)
    assert second.boxes.ap == 0.0 and second.total == Counts(3, 0, 3, 0)
    assert second.by_category["car"] == Counts(2, 0, 2, 0)
    # The cup counts once nothing is too small.
    assert tables(write_coco(tmp_path), right, smallest=0)[0].rows[0].total.objects == 4


def test_ap_by_hand(tmp_path: Path) -> None:
    """One of two cars is found, after a false one: precision 1/2 up to recall 1/2, then 0."""
    answers = {
        "a.png": [Detection(Box(10, 10, 60, 60), "car", 0.6)],
        "c.png": [Detection(Box(0, 0, 90, 90), "car", 0.7)],
    }
    made, _ = tables(write_coco(tmp_path), Contestant("some", Says(answers)), asked_for=["car"])
    (row,) = made.rows
    # 51 of COCO's 101 recall steps from 0 to 1 lie at or below 1/2.
    assert row.boxes.ap50 == pytest.approx(0.5 * 51 / 101)
    assert row.total == Counts(2, 1, 1, 1)


def test_faint_detections_count_for_ap_alone(tmp_path: Path) -> None:
    says = Says(perfect(0.1))
    made, outcomes = tables(write_coco(tmp_path), Contestant("faint", says))
    assert made.rows[0].boxes.ap == 1.0 and made.rows[0].total == Counts(3, 0, 0, 0)
    assert made.rows[0].threshold == says.min_score == 0.3
    assert set(says.asked) == {(name, s) for name in ("a.png", "b.png", "c.png") for s in (0.3, 0.05)}
    assert len(outcomes) == 3
    once = Says(perfect())
    tables(write_coco(tmp_path), Contestant("once", once, floor=1.0))
    assert len(once.asked) == 1 + 3, "the first photo once before, then each once"


def test_what_the_data_set_does_not_label_is_not_false(tmp_path: Path) -> None:
    answers = perfect()
    answers["b.png"] = [
        *answers["b.png"],
        *(Detection(Box(0, 0, 90, 90), c, 0.9) for c in ("lamp", "person")),
    ]
    answers["c.png"] = [Detection(Box(0, 0, 90, 90), "kite", 0.9)]
    made, _ = tables(write_coco(tmp_path), Contestant("more", Says(answers)))
    assert made.rows[0].total == Counts(3, 3, 0, 3) and made.rows[0].foreign == 3
    assert "more 3" in made.to_text()
    # People are labelled, and count where they are asked for.
    (row,) = tables(write_coco(tmp_path), Contestant("more", Says(answers)), asked_for=["person"])[0].rows
    assert row.total == Counts(0, 0, 1, 0) and row.boxes.ap is None


def test_crowds_are_forgiven_by_ap_too(tmp_path: Path) -> None:
    crowd = {"category_id": 1, "bbox": [100, 62, 90, 50], "iscrowd": 1}
    answers = perfect(0.5)
    answers["a.png"] = [
        *answers["a.png"],
        *(Detection(Box(x, 65, x + 35, 105), "car", 0.9) for x in (105, 150)),
    ]
    (row,) = tables(write_coco(tmp_path, [crowd]), Contestant("all", Says(answers)))[0].rows
    assert row.boxes.ap == 1.0 and row.total == Counts(3, 3, 0, 3)
    (row,) = tables(write_coco(tmp_path), Contestant("all", Says(answers)))[0].rows
    assert row.boxes.ap is not None and row.boxes.ap < 1.0 and row.total.false == 2


def test_masks_have_an_ap_where_both_sides_have_them(tmp_path: Path) -> None:
    coco = write_coco(tmp_path)
    plain, boxed = (
        Contestant("plain", Says(perfect())),
        Contestant("boxed", Says(perfect()), masks=BoxMasks()),
    )
    made, _ = tables(coco, plain, boxed)
    assert made.rows[0].masks is None
    assert made.rows[1].masks is not None and made.rows[1].masks.ap == 1.0
    # A mask of its own is kept: half of the object is not the object.
    own = perfect()
    for name, some in own.items():
        own[name] = [
            Detection(d.box, d.category, 0.9, mask=BoxMasks().mask(photo(), half(d.box))) for d in some
        ]
    made, _ = tables(coco, Contestant("own", Says(own), masks=BoxMasks()))
    assert made.rows[0].boxes.ap == 1.0
    assert made.rows[0].masks is not None and made.rows[0].masks.ap50 == 0.0


def photo() -> Photo:
    return Photo(np.zeros((120, 200, 3), np.uint8))


def half(box: Box) -> Box:
    return Box(box.x0, box.y0, box.x0 + 0.4 * box.width, box.y1)


BOXES = st.tuples(st.integers(0, 30), st.integers(0, 30), st.integers(8, 30), st.integers(8, 30)).map(
    lambda b: Box.from_xywh(*map(float, b))
)


@given(st.lists(BOXES, max_size=4), st.lists(BOXES, max_size=4), st.sampled_from([0.0, 200.0]))
def test_found_ones_are_those_that_coco_counts(true: list[Box], seen: list[Box], smallest: float) -> None:
    """At one threshold our recall is the recall that pycocotools reaches at IoU 0.5."""
    truth = tuple(Truth(box, "car", box.area) for box in true)
    some = tuple(Found(box, "car", 0.9 - 0.1 * i) for i, box in enumerate(seen))
    outcome = PhotoOutcome(Path("a"), (100, 100), truth, {"x": Answer(some, some, (), 0.0)})
    matching = match(truth, some, smallest)
    wanted = [one for one in truth if one.area >= smallest]
    ap50 = average_precision([outcome], "x", ["car"], smallest).ap50
    if not wanted:
        assert ap50 is None
    elif not matching.hits:
        assert ap50 == 0.0
    elif not matching.missed and not matching.false:
        assert ap50 == 1.0
    else:
        # Precision is at most 1 up to the recall that is reached, and 0 beyond.
        recall = len(matching.hits) / len(wanted)
        assert ap50 is not None and 0.0 < ap50 <= (np.floor(recall * 100 + 1e-6) + 1) / 101 + 1e-9


def test_text_csv_and_json_say_the_same(tmp_path: Path) -> None:
    made, _ = tables(write_coco(tmp_path), Contestant("right", Says(perfect())), Contestant("none", Says({})))
    text = made.to_text()
    assert (
        text.startswith("Detection, real photos: ") and "3 of 2 categories, and 1 without an object" in text
    )
    assert "100.0 [43.9, 100.0]" in text
    rows = list(csv.DictReader(io.StringIO(made.to_csv())))
    assert {row["row"] for row in rows} == {"total", "size", "category"} and len(rows) == 2 * (1 + 3 + 3)
    assert (rows[0]["ap50_%"], rows[0]["recall_%"], rows[0]["found"]) == ("100.000", "100.000", "3")
    told = made.to_json()
    assert told["objects"] == 3 and told["detectors"]["right"]["ap"] == 1.0
    assert told["detectors"]["none"]["precision"] is None and told["detectors"]["none"]["recall"] == 0.0
    assert told["detectors"]["right"]["classes"]["car"]["found"] == 2
    assert told["detectors"]["right"]["sizes"]["medium"]["objects"] == 3


def test_which_categories_count(tmp_path: Path) -> None:
    scenes = open_scenes(write_coco(tmp_path))
    assert counted_categories(scenes) == ("car", "chair", "cup")
    assert sorted(LIVING) == ["cat", "dog", "horse", "person"]
    with pytest.raises(InputError, match="labels no category that was asked for; it labels car"):
        counted_categories(scenes, ["sofa"])


def test_a_photo_that_is_gone_is_left_out_for_all(tmp_path: Path) -> None:
    scenes = open_scenes(write_coco(tmp_path))
    (tmp_path / "b.png").unlink()
    outcomes, failed = evaluate_detection(scenes.scenes, [Contestant("x", Says(perfect()))], ["car"])
    assert [o.photo.name for o in outcomes] == ["a.png", "c.png"]
    assert len(failed) == 1 and "b.png" in failed[0][0]


def test_the_sheet_shows_the_worst_first_in_three_colours(tmp_path: Path) -> None:
    answers = {"a.png": perfect()["a.png"][:1], "c.png": [Detection(Box(10, 10, 90, 90), "car", 0.9)]}
    _, outcomes = tables(write_coco(tmp_path), Contestant("some", Says(answers)))
    worst = worst_photos(outcomes, "some", 1024.0)
    assert [o.photo.name for o in worst] == ["a.png", "b.png", "c.png"]
    assert [o.photo.name for o in worst_photos(outcomes, "some", 1024.0, most=2)] == ["a.png", "b.png"]
    colours = [
        set(map(tuple, np.asarray(draw_sheet([o], "some", 1024.0))[50:].reshape(-1, 3))) for o in worst
    ]
    for colour, seen in (((32, 140, 60), "100"), (MISSED, "110"), ((214, 48, 48), "001")):
        assert [colour in one for one in colours] == [c == "1" for c in seen]


def test_the_report(tmp_path: Path) -> None:
    coco = write_coco(tmp_path)
    made, outcomes = tables(coco, Contestant("onnx:My/head.json", Says(perfect())))
    files = report_files(tmp_path / "report", ["onnx:My/head.json"])
    assert files[-1].name == "sheet-1-onnx-my-head-json.jpg"
    (tmp_path / "b.png").unlink()  # a photo that is gone since makes a grey tile
    page = write_detection_report(tmp_path / "report", made, outcomes, {"Device": "cpu"})
    assert sorted(p.name for p in (tmp_path / "report").iterdir()) == sorted(p.name for p in files)
    assert "<script" not in page.read_text() and "Recall" in page.read_text()
    assert (tmp_path / "report" / "results.jsonl").read_text().count("\n") == 3


def test_without_pycocotools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pycocotools.cocoeval", None)
    with pytest.raises(DependencyError, match=r"pip install 'pycocotools.*cadpose\[coco\]"):
        require_pycocotools()
