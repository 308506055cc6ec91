"""The JSON Schema of the document, committed as src/cadpose/data/annotation-schema.json.

After a change of document.py write it anew: ``python -m cadpose.annotations.schema``.
"""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

from cadpose.annotations.document import SCHEMA, AnnotationDocument


def schema_path() -> Path:
    """The committed file."""
    return Path(str(files("cadpose") / "data" / "annotation-schema.json"))


def schema_text() -> str:
    """JSON Schema (draft 2020-12) made from the models."""
    body = AnnotationDocument.model_json_schema(by_alias=True, mode="validation")
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:{SCHEMA.replace('.', ':').replace('/', ':')}",
    }
    return json.dumps({**head, **body}, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    schema_path().write_text(schema_text(), encoding="utf-8")
