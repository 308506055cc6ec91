"""All that decides what synthetic photos look like, small enough to be sent to worker processes."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from cadpose.errors import InputError, LibraryError
from cadpose.library.catalogue import Library
from cadpose.photos import find_photos
from cadpose.rendering.blender import blender_python
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.drawers import BlenderDrawer, RasterDrawer
from cadpose.training.synth.environments import hdri_files
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.options import SynthOptions

Renderer = Literal["raster", "blender"]
#: Changes when the same recipe draws other photos than before.
DRAWING = 1


@dataclass(frozen=True)
class Recipe:
    """What photos are drawn from, and how.

    Attributes:
        library: Folder of the CAD library.
        models: Ids of the models to draw.
        backdrops: Folder of photos, None for made-up backdrops.
        options: Chances and ranges.
        seed: With a photo's number it decides everything.
        renderer: ``"raster"`` or ``"blender"``.
        hdri: Folder of panoramas that light Blender's photos, None for made-up light.
        samples: Blender's camera rays a pixel.
    """

    library: Path
    models: tuple[str, ...]
    backdrops: Path | None = None
    options: SynthOptions = SynthOptions()
    seed: int = 0
    renderer: Renderer = "raster"
    hdri: Path | None = None
    samples: int = 16

    #: What :meth:`generator` makes; a recipe that draws in another way names its own.
    _made: ClassVar[type[SynthGenerator]] = SynthGenerator

    @classmethod
    def from_library(
        cls,
        library: Library,
        categories: Sequence[str] | None = None,
        *,
        only: Collection[str] | None = None,
        backdrops: Path | None = None,
        options: SynthOptions | None = None,
        seed: int = 0,
        renderer: Renderer = "raster",
        hdri: Path | None = None,
        samples: int = 16,
    ) -> Recipe:
        """Every model of some categories, or of all; with ``only`` those of these ids.

        Raises:
            LibraryError: the library has no model of a category, or none of ``only``.
            InputError: ``backdrops`` is no folder with photos in it, or ``hdri`` none with panoramas, or
                panoramas are given for the rasteriser.
            DependencyError: Blender is not set up.
        """
        known = library.categories()
        wanted = list(dict.fromkeys(categories)) if categories else list(known)
        for name in wanted:
            if name not in known:
                raise LibraryError(
                    f"the library has no model of category {name!r} to draw, it has {', '.join(known)}"
                )
        if backdrops is not None:
            if not backdrops.is_dir():
                raise InputError(f"there is no folder {backdrops}: name one with photos for backdrops")
            find_photos([backdrops])
        if renderer == "blender":
            blender_python()
            if hdri is not None:
                hdri_files(hdri)
        elif hdri is not None:
            raise InputError(f"{hdri}: panoramas light Blender's photos only, add --renderer blender")
        models = tuple(
            m.id for m in library.models() if m.category in wanted and (only is None or m.id in only)
        )
        if not models:
            raise LibraryError(f"the library has none of the models asked for in {', '.join(wanted)}")
        options = options or SynthOptions()
        return cls(library.path, models, backdrops, options, seed, renderer, hdri, samples)

    def generator(self) -> SynthGenerator:
        """One generator, for one process.

        Raises:
            LibraryError: the library cannot be read any more.
            InputError: no photo of ``backdrops`` can be read, or a panorama is not there.
            DependencyError: Blender is not set up.
        """
        library = Library.open(self.library)
        return self._made(
            [library.get(i) for i in self.models],
            library.mesh,
            library.symmetry,
            Backdrops(self.backdrops),
            self.options,
            self.seed,
            BlenderDrawer(self.hdri, self.samples) if self.renderer == "blender" else RasterDrawer(),
        )

    def to_json(self) -> dict[str, Any]:
        """What decides the photos' bytes: the same wherever library and backdrops lie.

        Raises:
            LibraryError: the library cannot be read.
            InputError: ``backdrops`` holds no photo.
        """
        library = Library.open(self.library)
        told = "\n".join(f"{m.id}\t{m.category}\t{m.sha256}" for m in map(library.get, self.models))
        # Sizes stand for contents: reading thousands of photos for a digest would take longer than drawing.
        backdrops = (
            None
            if self.backdrops is None
            else _digest("\n".join(f"{p.name}\t{p.stat().st_size}" for p in find_photos([self.backdrops])))
        )
        blender = {
            "samples": self.samples,
            "hdri": None
            if self.hdri is None
            else _digest("\n".join(f"{p.name}\t{p.stat().st_size}" for p in hdri_files(self.hdri))),
        }
        return {
            "drawing": DRAWING,
            "renderer": self.renderer,
            "blender": blender if self.renderer == "blender" else None,
            "seed": self.seed,
            "models": _digest(told),
            "backdrops": backdrops,
            "options": {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self.options).items()},
        }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()
