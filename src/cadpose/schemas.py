"""JSON Schemas of the files that cadpose writes or takes, made from the models that check them.

They are committed as ``src/cadpose/data/NAME-schema.json``. After a change of a model write them anew:
``python -m cadpose.schemas``. What raises a version is told in docs/versions.md.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from pydantic import BaseModel

from cadpose.annotations.document import SCHEMA as ANNOTATION
from cadpose.annotations.document import AnnotationDocument
from cadpose.batch.failures import SCHEMA as FAILURE
from cadpose.batch.failures import PhotoFailure
from cadpose.detection.onnx_head import Head


@dataclass(frozen=True, slots=True)
class Published:
    """One kind of file.

    Attributes:
        name: What ``cadpose schema`` calls it.
        version: What such a file says of itself, as ``cadpose.annotation/1``.
        model: What checks it.
        about: A line about it.
    """

    name: str
    version: str
    model: type[BaseModel]
    about: str

    @property
    def path(self) -> Path:
        """The committed schema."""
        return Path(str(files("cadpose") / "data" / f"{self.name}-schema.json"))

    def text(self) -> str:
        """JSON Schema (draft 2020-12) of what is written now, made from the model."""
        body = self.model.model_json_schema(by_alias=True, mode="validation")
        head = {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "$id": f"urn:{self.version.replace('.', ':').replace('/', ':')}",
        }
        return json.dumps({**head, **body}, indent=2, ensure_ascii=False) + "\n"


PUBLISHED: dict[str, Published] = {
    published.name: published
    for published in (
        Published("annotation", ANNOTATION, AnnotationDocument, "the document of a photo"),
        Published("failure", FAILURE, PhotoFailure, "why a photo failed, NAME.failed.json"),
        Published("network", "cadpose-detector/1", Head, "description of a network for --detector onnx:FILE"),
    )
}


if __name__ == "__main__":
    for published in PUBLISHED.values():
        published.path.write_text(published.text(), encoding="utf-8")
