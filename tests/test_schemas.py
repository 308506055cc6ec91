"""The published JSON Schemas, and documents of earlier checkouts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from cadpose.annotations.document import AnnotationDocument
from cadpose.batch.failures import PhotoFailure
from cadpose.errors import InputError
from cadpose.schemas import PUBLISHED
from tests.annotations.factory import make_document
from tests.cli.invoking import cadpose

EARLIER = Path(__file__).parent / "annotations" / "earlier"


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_committed_schema_is_the_generated_one(name: str) -> None:
    published = PUBLISHED[name]
    assert published.path.read_text(encoding="utf-8") == published.text(), (
        "the models changed: run python -m cadpose.schemas"
    )
    Draft202012Validator.check_schema(json.loads(published.text()))


def test_what_is_written_is_what_the_schemas_describe() -> None:
    failure = PhotoFailure(
        schema="cadpose.failure/1", photo="a.jpg", sha256="", stage="photo", reason="a.jpg: no", made_with="x"
    )
    written = {
        "annotation": make_document().to_json(),
        "failure": failure.model_dump_json(by_alias=True),
    }
    for name, text in written.items():
        Draft202012Validator(json.loads(PUBLISHED[name].text())).validate(json.loads(text))
    spoilt = json.loads(written["annotation"])
    del spoilt["annotations"][0]["pose"]["t_z"]
    assert not Draft202012Validator(json.loads(PUBLISHED["annotation"].text())).is_valid(spoilt)


def test_the_command_lists_and_prints_them() -> None:
    listed = cadpose("schema")
    assert listed.exit_code == 0
    for name, published in PUBLISHED.items():
        assert name in listed.stdout and published.version in listed.stdout
        printed = cadpose("schema", name)
        assert (printed.exit_code, printed.stdout) == (0, published.text())
    assert cadpose("schema", "other").exit_code == 2


@pytest.mark.parametrize("path", sorted(EARLIER.glob("*.json")), ids=lambda path: path.stem)
def test_documents_of_earlier_checkouts_are_read(path: Path) -> None:
    document = AnnotationDocument.read(path)
    first, second = document.to_annotations()
    assert first.cad.name and second.pose.focal_px > 0
    again = AnnotationDocument.from_json(document.to_json())
    assert again == document
    # What is written again has all keys.
    schema = json.loads(PUBLISHED["annotation"].text())
    Draft202012Validator(schema).validate(json.loads(document.to_json()))


def keys(value: object) -> frozenset[str]:
    """All paths of keys in a JSON value, lists' entries as one."""
    if isinstance(value, dict):
        return frozenset(f"{k}.{below}" for k, inner in value.items() for below in ("", *keys(inner)))
    if isinstance(value, list):
        return frozenset().union(*map(keys, value))
    return frozenset()


def test_there_is_one_of_each_form() -> None:
    documents = [json.loads(path.read_text(encoding="utf-8")) for path in EARLIER.glob("*.json")]
    assert len({keys(document) for document in documents}) == len(documents) >= 6


def test_another_version_is_refused_with_what_to_do() -> None:
    data = json.loads(make_document().to_json())
    data["schema"] = "cadpose.annotation/2"
    with pytest.raises(
        InputError, match="another version of cadpose wrote it, read it with that one"
    ) as told:
        AnnotationDocument.from_json(json.dumps(data), "car.json")
    assert "\n" not in str(told.value) and str(told.value).startswith("car.json ")


@pytest.mark.parametrize(
    "value", ["foo", "cadpose.failure/1", "cadpose.annotation/", "cadpose.annotation/x", 1]
)
def test_another_file_is_not_blamed_on_another_version(value: object) -> None:
    data = {**json.loads(make_document().to_json()), "schema": value}
    with pytest.raises(InputError) as told:
        AnnotationDocument.from_json(json.dumps(data), "car.json")
    assert str(told.value) == "car.json is no annotation document: its schema is not cadpose.annotation/1"
