"""Milliseconds a stage, warm, on given photographs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.errors import LibraryError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.pipeline import Annotator
from cadpose.records import Photo

#: Meshes that the renderers are timed on.
_MESHES = 9
_SMALLEST, _LARGEST = 1_000, 125_000


def bench_stages(annotator: Annotator, photos: Sequence[Photo], repeats: int) -> dict[str, float]:
    """Median milliseconds a photo by stage, summed over its objects; a warm-up run a photo is not counted."""
    runs: dict[str, list[float]] = {}
    for photo in photos:
        annotator.run(photo)
        for _ in range(repeats):
            for stage, seconds in annotator.run(photo).seconds.items():
                runs.setdefault(stage, []).append(1000.0 * seconds)
    return {stage: float(np.median(times)) for stage, times in runs.items() if stage != "read"}


def bench_meshes(library: Library) -> dict[str, Mesh]:
    """Nine models of the library, from about 1k to 120k faces, evenly spread on a log scale.

    Raises:
        LibraryError: the library has no model of that size.
    """
    models = [m for m in library.models() if _SMALLEST <= m.face_count <= _LARGEST]
    if not models:
        raise LibraryError(f"{library.path} has no model of {_SMALLEST} to {_LARGEST} faces to time with")
    wanted = np.geomspace(_SMALLEST, _LARGEST, _MESHES)
    counts = np.log([m.face_count for m in models])
    chosen = {models[int(np.abs(counts - np.log(w)).argmin())].id for w in wanted}
    return {f"{i} ({library.get(i).face_count} faces)": library.mesh(i) for i in sorted(chosen)}


#: Where :func:`stand_in_photo` shows its object.
STAND_IN_BOX = Box(80, 0, 560, 480)


def bench_category(library: Library) -> str:
    """What is measured with: cars, or the library's first category."""
    return "car" if "car" in library.categories() else next(iter(library.categories()))


def stand_in_photo(annotator: Annotator) -> Photo:
    """A 640 x 480 render of a car, or of the library's first model, for timing without a photograph."""
    library = annotator.library
    category = bench_category(library)
    mesh = library.mesh(library.representatives(category, 1)[0])
    framed = Cameras.framing(rotation_from_angles(40.0, 12.0), mesh.hull, size=480, margin=0.1)
    view = annotator.renderer.render(mesh, framed).over(170)[0]
    canvas = np.full((480, 640, 3), 170, np.uint8)
    canvas[:, 80:560] = view
    return Photo(canvas, name="stand-in")
