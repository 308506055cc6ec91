"""What a photo's outputs were made with, and whether that is what they would be made with now.

Two makings are the same when everything that may change an answer is: cadpose's version, the library's
models, the stages and their options, the categories looked for, and what was told of objects and cameras.
Where a run computes (device, workers, threads) is no part of it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.parts import plain_json

#: Stands for the detector where objects were told in its place.
TOLD = "told"


@dataclass(frozen=True)
class Making:
    """What outputs are made with.

    Attributes:
        provenance: What the annotator says of itself, JSON's own types.
        told: Digest of the objects that were told in place of the detector; empty where it looks itself.
        categories: What it looks for.
    """

    provenance: Mapping[str, Any]
    told: str = ""
    categories: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "provenance", plain_json(dict(self.provenance)))

    @property
    def key(self) -> str:
        """16 hex digits that stand for it."""
        # A detector that is not asked does not matter, nor what it would look for.
        idle = ("detector", "categories") if self.told else ()
        provenance = {k: v for k, v in self.provenance.items() if k not in idle}
        wanted = [] if self.told else sorted(self.categories)
        text = json.dumps([provenance, self.told, wanted], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def made(self, document: AnnotationDocument) -> bool:
        """Whether a document says of itself that it was made like this.

        One without annotations says nothing of itself, so it was not; nor does one say what objects were
        told, only that they were (:data:`TOLD` in place of the detector).
        """
        return bool(document.annotations and not self.told) and all(
            part.provenance == self.provenance for part in document.annotations
        )
