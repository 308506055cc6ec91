from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from cadpose.annotations.document import MAX_CHARACTERS, AnnotationDocument, document_from
from cadpose.errors import InputError
from cadpose.records import Annotation, CadModel, Candidate, Photo, Pose4Dof, Rotation, RotationHypothesis
from cadpose.schemas import PUBLISHED
from tests.annotations.factory import make_annotation, make_cad, make_document, make_failure, make_photo

finite = st.floats(allow_nan=False, allow_infinity=False)
rotations = st.builds(Rotation, st.floats(-1e6, 1e6), st.floats(-90, 90), st.floats(-1e6, 1e6))


def same(a: object, b: object) -> bool:
    """Equality through the records' arrays, without tolerance."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    if dataclasses.is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in dataclasses.fields(a)
        )
    if isinstance(a, (tuple, list)):
        return isinstance(b, type(a)) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def round_trip(photo: Photo, annotation: Annotation) -> Annotation:
    text = document_from(photo, [annotation]).to_json()
    return AnnotationDocument.from_json(text).to_annotations()[0]


def test_records_come_back_exactly() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)
    assert same(round_trip(photo, annotation), annotation)
    bare = dataclasses.replace(
        annotation,
        detection=dataclasses.replace(annotation.detection, mask=None, rotation=None, alternatives=()),
        mask_iou=None,
        refinement=None,
        pose_6dof=None,
        confidence=None,
        verdict=None,
        hypotheses=(),
        candidates=(Candidate(CadModel("id", "", "car"), -1.5, Rotation(0, 0)),),
    )
    assert same(round_trip(photo, bare), bare)
    assert not same(bare, annotation)


@settings(max_examples=60, deadline=None)
@given(
    rotations,
    rotations,
    st.floats(1e-3, 1e9),
    st.tuples(finite, finite),
    finite,
    st.floats(0.0, 180.0),
    st.text(),
)
def test_any_numbers_and_names_come_back_exactly(
    rotation: Rotation,
    other: Rotation,
    focal: float,
    principal: tuple[float, float],
    score: float,
    error: float,
    name: str,
) -> None:
    photo = make_photo()
    annotation = make_annotation(
        photo,
        pose=Pose4Dof(rotation, focal, principal),
        candidates=(Candidate(make_cad(name=name), score, other, {name: score}),),
        hypotheses=(RotationHypothesis(other, score, 1 / 3, error, error > 90.0),),
        provenance={name: [name, score, {"deep": True}]},
    )
    assert same(round_trip(photo, annotation), annotation)


def test_document_and_failures_come_back_exactly() -> None:
    document = make_document()
    again = AnnotationDocument.from_json(document.to_json())
    assert again == document
    assert again.to_json() == document.to_json()
    failure = again.to_failures()[0]
    assert (failure.reason, failure.stage) == ("the library has no zebra", "library")
    assert failure.detection.category == "zebra"


def test_json_says_what_the_docs_say() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)
    data = json.loads(document_from(photo, [annotation], [make_failure()]).to_json())
    assert data["schema"] == "cadpose.annotation/1"
    assert data["photo"] == {"name": photo.name, "sha256": photo.sha256, "size": [120, 80]}
    entry = data["annotations"][0]
    assert entry["cad"] == entry["candidates"][0]["cad"]
    assert [c["rank"] for c in entry["candidates"]] == [1, 2, 3]
    assert entry["detection"]["mask"]["size"] == [80, 120]
    # The five lines of docs/output.md: a point of the object, projected with nothing but R, t_z and K.
    pose = entry["pose"]
    point = np.array([0.1, 0.2, -0.3])
    p = np.array(pose["K"]) @ (np.array(pose["R_cv_from_s"]) @ point + [0, 0, pose["t_z"]])
    assert p[:2] / p[2] == pytest.approx(annotation.pose.project(point[None])[0], abs=1e-9)


def test_documents_of_earlier_versions_know_no_flags_of_the_detection() -> None:
    document = make_document()
    data = json.loads(document.to_json())
    flags = ("truncated", "tiny", "unsure")
    found = [entry["detection"] for entry in data["annotations"] + data["failures"]]
    assert [[d.pop(flag) for flag in flags] for d in found] == [[True, False, True]] * 2 + [
        [False, True, False]
    ]
    read = AnnotationDocument.from_json(json.dumps(data))
    records = [a.detection for a in read.to_annotations()] + [f.detection for f in read.to_failures()]
    assert not any(getattr(record, flag) for record in records for flag in flags)


def test_documents_of_earlier_versions_know_no_chance_of_the_model() -> None:
    document = make_document()
    data = json.loads(document.to_json())
    for entry in data["annotations"]:
        assert [c["probability"] for c in entry["candidates"]] == [0.5, 0.125, 0.0625]
        assert (entry.pop("none_probability"), entry.pop("cad_needs_review")) == (0.3125, True)
        for candidate in entry["candidates"]:
            del candidate["probability"]
    for old, new in zip(
        AnnotationDocument.from_json(json.dumps(data)).to_annotations(),
        document.to_annotations(),
        strict=True,
    ):
        assert {c.probability for c in old.candidates} == {None}
        assert (old.none_probability, old.none_fits, old.cad_needs_review) == (None, False, False)
        assert (new.none_probability, new.none_fits, new.cad_needs_review) == (0.3125, False, True)


def test_documents_of_earlier_versions_know_no_expected_error() -> None:
    document = make_document()
    data = json.loads(document.to_json())
    for entry in data["annotations"]:
        assert (entry["hypotheses"][0]["expected_error"], entry["hypotheses"][0]["needs_review"]) == (
            24.5,
            True,
        )
        for hypothesis in entry["hypotheses"]:
            del hypothesis["expected_error"], hypothesis["needs_review"]
        entry["cad_needs_review"] = False
    read = AnnotationDocument.from_json(json.dumps(data)).to_annotations()
    assert [[(h.expected_error, h.needs_review) for h in a.hypotheses] for a in read] == [
        [(None, False)] * 2
    ] * 2
    assert [[h.probability for h in a.hypotheses] for a in read] == [[0.6, 0.4]] * 2
    assert not any(a.needs_review for a in read)
    assert all(a.needs_review for a in document.to_annotations())


def test_lists_of_numbers_stand_on_one_line_and_text_is_left_alone() -> None:
    photo = make_photo('a [ 1,  2 ] \n [\n1,\n2\n] "x".jpg')
    text = document_from(photo, [make_annotation(photo)]).to_json()
    assert '"box": [20.25, 10.5, 100.75, 70.0]' in text
    assert json.loads(text)["photo"]["name"] == photo.name


def test_a_photo_without_digest_gets_that_of_its_pixels() -> None:
    bare = Photo(make_photo().rgb)
    digest = document_from(bare, []).photo.sha256
    assert len(digest) == 64
    assert digest == document_from(Photo(bare.rgb, "elsewhere"), []).photo.sha256
    assert digest != document_from(Photo(255 - bare.rgb), []).photo.sha256


def test_a_name_that_is_not_utf8_is_written_with_escapes() -> None:
    document = document_from(make_photo("caf\udce9.jpg"), [])
    assert AnnotationDocument.from_json(document.to_json()).photo.name == "caf\\udce9.jpg"


def test_numpy_numbers_and_tuples_become_plain() -> None:
    photo = make_photo()
    annotation = make_annotation(
        photo,
        box_iou=np.float32(0.5),
        provenance={"n": np.int64(3), "t": (1, np.float32(0.5)), "a": np.arange(2)},
    )
    entry = json.loads(document_from(photo, [annotation]).to_json())["annotations"][0]
    assert entry["provenance"] == {"n": 3, "t": [1, 0.5], "a": [0, 1]}
    assert entry["box_iou"] == 0.5


@pytest.mark.parametrize(
    "changes",
    [
        {"provenance": {"x": {"y": [float("nan")]}}},
        {"seconds": {"detection": float("inf")}},
        {"photo_sha256": "00" * 32},
        {"candidates": (Candidate(make_cad(), 0.5, Rotation(0, 0), {"sm1": float("nan")}),)},
    ],
)
def test_what_cannot_be_published_is_refused(changes: dict[str, Any]) -> None:
    photo = make_photo()
    with pytest.raises(ValueError, match=r"finite|carry|put under"):
        document_from(photo, [make_annotation(photo, **changes)])


Edit = Callable[[dict[str, Any]], Any]
edits: dict[str, Edit] = {
    "unknown key": lambda d: d.update(extra=1),
    "unknown key deep": lambda d: d["annotations"][0]["pose"].update(extra=1),
    "no schema": lambda d: d.pop("schema"),
    "later schema": lambda d: d.update(schema="cadpose.annotation/2"),
    "python name": lambda d: d.update(schema_version=d.pop("schema")),
    "nan": lambda d: d["annotations"][0].update(box_iou=float("nan")),
    "infinity": lambda d: d["annotations"][0]["candidates"][0].update(score=float("inf")),
    "nan in provenance": lambda d: d["annotations"][0]["provenance"].update(x=float("nan")),
    "text for a number": lambda d: d["annotations"][0]["pose"].update(t_z="2.0"),
    "empty box": lambda d: d["annotations"][0]["detection"].update(box=[5, 5, 5, 9]),
    "angles and matrix differ": lambda d: d["annotations"][0]["pose"].update(azimuth=1.0),
    "K and focal differ": lambda d: d["annotations"][0]["pose"].update(focal_px=1.0),
    "cad is not the first": lambda d: d["annotations"][0]["candidates"].reverse(),
    "no candidates": lambda d: d["annotations"][0].update(candidates=[]),
    "ranks": lambda d: d["annotations"][0]["candidates"][1].update(rank=7),
    "mask of another size": lambda d: d["annotations"][0]["detection"].update(
        mask={"size": [2, 2], "counts": [4]}
    ),
    "mask runs": lambda d: d["annotations"][0]["detection"]["mask"].update(counts=[3]),
    "huge mask": lambda d: d["annotations"][0]["detection"].update(
        mask={"size": [10**9, 10**9], "counts": [10**18]}
    ),
    "digest": lambda d: d["photo"].update(sha256="../../etc/passwd"),
    "none's chance": lambda d: d["annotations"][0].update(none_probability=1.1),
    "chance": lambda d: d["annotations"][0]["candidates"][1].update(probability=-0.1),
    "expected error": lambda d: d["annotations"][0]["hypotheses"][0].update(expected_error=181.0),
    "flag that is none": lambda d: d["annotations"][0]["hypotheses"][0].update(needs_review="no"),
    "huge integer": lambda d: d["annotations"][0].update(box_iou=10**400),
}


@pytest.mark.parametrize("edit", edits.values(), ids=edits.keys())
def test_a_spoilt_document_gives_one_sentence(edit: Edit) -> None:
    data = json.loads(make_document().to_json())
    edit(data)
    with pytest.raises(InputError, match=r"street\.json is not a valid cadpose\.annotation/1") as caught:
        AnnotationDocument.from_json(json.dumps(data), "street.json")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 100_000, '{"schema": "x\x00"}'])
def test_what_is_not_a_document_gives_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match="is not a valid"):
        AnnotationDocument.from_json(text)


def test_a_document_that_is_too_long_is_not_parsed() -> None:
    with pytest.raises(InputError, match="longer than"):
        AnnotationDocument.from_json(" " * (MAX_CHARACTERS + 1))


def test_models_cannot_be_changed() -> None:
    with pytest.raises(ValidationError):
        make_document().photo.name = "other"  # type: ignore[misc]


def test_a_document_has_exactly_the_keys_of_the_schema() -> None:
    schema = json.loads(PUBLISHED["annotation"].text())
    visited = set()

    def check(value: Any, rule: dict[str, Any]) -> None:
        if "$ref" in rule:
            visited.add(rule["$ref"])
            rule = schema["$defs"][rule["$ref"].rsplit("/", 1)[1]]
        if "anyOf" in rule:
            rule = next(r for r in rule["anyOf"] if (r.get("type") == "null") == (value is None))
            return check(value, rule)
        if rule.get("additionalProperties") is False:
            assert set(value) == set(rule["required"]) == set(rule["properties"])
            for key, inner in rule["properties"].items():
                check(value[key], inner)
        if rule.get("type") == "array":
            for i, item in enumerate(value):
                check(item, rule["prefixItems"][i] if "prefixItems" in rule else rule["items"])
        return None

    check(json.loads(make_document().to_json()), schema)
    assert visited == {f"#/$defs/{name}" for name in schema["$defs"]} - {"#/$defs/JsonValue"}


def test_the_docs_name_every_key() -> None:
    docs = Path(__file__).parents[2] / "docs" / "output.md"
    text = docs.read_text(encoding="utf-8")
    schema = json.loads(PUBLISHED["annotation"].text())
    keys = {key for model in (schema, *schema["$defs"].values()) for key in model.get("properties", {})}
    assert len(keys) > 40
    assert {key for key in keys if not re.search(rf"`(?:[\w{{, ]*\W)?{key}\b", text)} == set()


def test_the_five_lines_of_the_docs_project_a_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    docs = Path(__file__).parents[2] / "docs" / "output.md"
    code = docs.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    photo = make_photo()
    annotation = make_annotation(photo)
    (tmp_path / "car.json").write_text(document_from(photo, [annotation]).to_json(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    printed = [float(number) for number in re.findall(r"[-\d.]+", capsys.readouterr().out)]
    assert printed == pytest.approx(annotation.pose.project(np.array([[0, 0, -0.3]]))[0], abs=1e-5)
