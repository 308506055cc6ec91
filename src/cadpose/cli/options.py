"""Options that several verbs share, and what they become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from cadpose.pipeline import Annotator
    from cadpose.similarity.index.library_index import LibraryIndex

Json = Annotated[bool, typer.Option("--json", help="Print JSON on stdout instead of tables.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")]
Device = Annotated[Literal["cpu", "cuda"], typer.Option("--device", help="Where networks run.")]
LibraryFolder = Annotated[
    Path | None,
    typer.Option(
        "--library", help="CAD library folder; $CADPOSE_LIBRARY or the user's data folder unless told."
    ),
]
Backgrounds = Annotated[
    Path | None,
    typer.Option("--backgrounds", help="Folder of photos to cut backdrops from; made up without."),
]
Panoramas = Annotated[
    Path | None,
    typer.Option("--hdri", help="Folder of .hdr or .exr panoramas that light Blender's photos."),
]
PhotoSide = Annotated[int, typer.Option("--size", min=32, max=4096, help="Side of a photo in pixels.")]
Samples = Annotated[int, typer.Option("--samples", min=1, max=4096, help="Blender's rays a pixel.")]
Candidates = Annotated[int, typer.Option("--candidates", min=1, help="CAD models compared a category.")]


def _library_categories(names: list[str] | None) -> list[str] | None:
    from cadpose.library.class_map import category_or_word

    return names and [category_or_word(name) for name in names]


Categories = Annotated[
    list[str] | None,
    typer.Option("--category", callback=_library_categories, help="Only these library categories."),
]


def _known_similarity(name: str) -> str:
    from cadpose.encoder import lite0
    from cadpose.similarity.registry import measures

    known = ("joint", *measures(lite0(), 0))
    if name not in known:
        raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}")
    return name


Similarity = Annotated[
    str,
    typer.Option(
        "--similarity",
        callback=_known_similarity,
        help="What ranks the models: joint, or a measure: aligned, fused, sm1, sm2, sm3, sift-sm1 ...",
    ),
]
RendererName = Annotated[
    Literal["raster", "blender"], typer.Option("--renderer", help="What draws the models.")
]
Estimator = Annotated[
    Literal["embedded", "render-and-compare", "posecontrast"],
    typer.Option("--estimator", help="What estimates the rotation."),
]


def _known_detector(name: str) -> str:
    from cadpose.backends import detector_kind
    from cadpose.errors import CadposeError

    try:
        detector_kind(name)
    except CadposeError as error:
        raise typer.BadParameter(str(error)) from None
    return name


def _known_detectors(names: list[str] | None) -> list[str] | None:
    return names and list(dict.fromkeys(_known_detector(name) for name in names))


_DETECTOR_HELP = "What finds the objects: embedded, ssd, detectors, rfdetr, onnx:FILE.json"
DetectorName = Annotated[str, typer.Option("--detector", callback=_known_detector, help=f"{_DETECTOR_HELP}.")]
DetectorNames = Annotated[
    list[str] | None,
    typer.Option("--detector", callback=_known_detectors, help=f"{_DETECTOR_HELP}; repeatable."),
]
MasksName = Annotated[
    Literal["grabcut", "network", "none"],
    typer.Option("--masks", help="What finds an object's pixels in its box; none takes the whole box."),
]
AlignTo = Annotated[
    Literal["box", "paper", "mask"],
    typer.Option(
        "--align", help="Fit the focal length to the box, to the box the paper's way, or to the mask."
    ),
]

Refine = Annotated[
    Literal["off", "fast", "full"],
    typer.Option("--refine", help="Render and compare about the fitted pose: full takes longer."),
]


def _known_intrinsics(text: str) -> str:
    from cadpose.errors import InputError
    from cadpose.intrinsics import Intrinsics

    try:
        Intrinsics.from_text(text)
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    return text


IntrinsicsText = Annotated[
    str,
    typer.Option(
        "--intrinsics",
        callback=_known_intrinsics,
        help="The photos' camera: off, exif, FOCAL or FOCAL,X,Y in pixels, or a JSON file by photo.",
    ),
]


def make_annotator(
    library: Path | None,
    *,
    device: str = "cpu",
    seed: int = 0,
    candidates: int = 10,
    index: LibraryIndex | None = None,
    similarity: str = "joint",
    renderer: str = "raster",
    align_to: str = "box",
    estimator: str = "embedded",
    categories: list[str] | None = None,
    detector: str = "embedded",
    masks: str = "network",
) -> Annotator:
    """The annotator that the options ask for; imported here, so that ``--help`` is quick."""
    from cadpose.pipeline import Annotator

    return Annotator(
        library,
        device=device,
        seed=seed,
        candidates=candidates,
        index=index,
        similarity=similarity,
        renderer=renderer,
        align_to=align_to,
        rotation=estimator,
        categories=categories,
        detector=detector,
        masks=masks,
    )
