"""Synthetic photos of held-out models, on which the fitting scripts fit; their arguments."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from cadpose.cli.output import progress_bar
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.training.lite.sources import sources
from cadpose.training.lite.stream import LEAST_SIDE, LEAST_VISIBLE, Source
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.records import SynthPhoto


@dataclass(frozen=True)
class UnseenPhotos:
    """What a fitting script is told.

    Attributes:
        out: File to write.
        source: Held-out models and backdrops.
        numbers: Of the photos.
    """

    out: Path
    source: Source
    numbers: range

    @classmethod
    def told(cls, description: str, photos: int) -> UnseenPhotos:
        """By the command line; so many photos unless told."""
        parser = argparse.ArgumentParser(
            description=description, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        parser.add_argument("library", type=Path, help="as scripts/make_training_library.py makes it")
        parser.add_argument("out", type=Path)
        parser.add_argument("--backgrounds", type=Path)
        parser.add_argument("--photos", type=int, default=photos)
        parser.add_argument("--first", type=int, default=0, help="number of the first photo")
        told = parser.parse_args()
        unseen = sources(Library.open(told.library), told.backgrounds).unseen
        if unseen is None:
            parser.error(f"{told.library} has no held-out model")
        return cls(told.out, unseen, range(told.first, told.first + told.photos))

    def drawn(self, options: SynthOptions) -> Iterator[SynthPhoto]:
        """The photos that show anything, with a bar."""
        generator = replace(self.source, options=options).generator()
        with progress_bar("photos", len(self.numbers)) as bar:
            for number in self.numbers:
                bar.advance(bar.tasks[0].id)
                photo = generator.photo(number)
                if photo.objects:
                    yield photo


def main_box(photo: SynthPhoto) -> Box | None:
    """The main object's box within the photo, None where too little of it is seen to learn from."""
    shown = photo.objects[0]
    height, width = photo.rgb.shape[:2]
    box = shown.box.clipped(width, height)
    if box is None or shown.visible < LEAST_VISIBLE or max(box.width, box.height) < LEAST_SIDE:
        return None
    return box
