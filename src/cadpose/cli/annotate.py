"""``cadpose annotate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cadpose.cli.options import (
    AlignTo,
    Candidates,
    Categories,
    DetectorName,
    Device,
    Estimator,
    Json,
    LibraryFolder,
    MasksName,
    RendererName,
    Seed,
    Similarity,
    make_annotator,
)
from cadpose.cli.output import complain, print_json, print_table, progress_bar
from cadpose.cli.view_index import Embedding, open_index

if TYPE_CHECKING:
    from cadpose.annotations.parts import AnnotationPart
    from cadpose.batch.run import DetectionsOf, PhotoOutcome
    from cadpose.records import Detection, Photo


def annotate(
    photos: Annotated[list[str], typer.Argument(metavar="PHOTO|DIR|GLOB...", help="Photographs.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the outputs.")] = Path("runs/annotate"),
    store: Annotated[str | None, typer.Option("--store", help="Also keep them in sqlite:///file.db.")] = None,
    box: Annotated[
        list[str] | None, typer.Option("--box", help="x0,y0,x1,y1 in pixels, instead of the detector.")
    ] = None,
    category: Categories = None,
    rotation: Annotated[
        list[str] | None,
        typer.Option("--rotation", help="azimuth,elevation,inplane of the boxes, in degrees."),
    ] = None,
    detections: Annotated[
        Path | None, typer.Option("--detections", help="COCO JSON with boxes, masks, rotations.")
    ] = None,
    detector: DetectorName = "embedded",
    masks: MasksName = "grabcut",
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    index: Annotated[
        Path | None,
        typer.Option("--index", help="Choose the candidates by this view index, see `library index`."),
    ] = None,
    embedding: Embedding = None,
    similarity: Similarity = "joint",
    renderer: RendererName = "raster",
    align_to: AlignTo = "box",
    estimator: Estimator = "embedded",
    resume: Annotated[bool, typer.Option("--resume", help="Leave finished photos alone.")] = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Find the objects, name their CAD models and poses, draw them over the photos.

    Exit code 1: a photo, or an object that was found or given, could not be annotated; the others were.
    """
    if detections is not None and (box or rotation):
        raise typer.BadParameter("give either --detections or --box and --rotation, not both")
    if rotation and not box:
        raise typer.BadParameter("--rotation belongs to --box: give the box of the object too")
    if embedding is not None and index is None:
        raise typer.BadParameter("--embedding belongs to --index: name the view index too")
    for option, given in (("--category", category), ("--rotation", rotation)):
        if box and given and len(given) not in (1, len(box)):
            raise typer.BadParameter(f"{option} was given {len(given)} times for {len(box)} boxes")
    from cadpose.annotations.store import Store
    from cadpose.batch.run import annotate_photos
    from cadpose.photos import find_photos

    known = _given(box or [], category or [], rotation or [], detections)
    paths = find_photos(photos)
    annotator = make_annotator(
        library,
        device=device,
        seed=seed,
        candidates=candidates,
        index=None if index is None else open_index(library, index, embedding, device),
        similarity=similarity,
        renderer=renderer,
        align_to=align_to,
        estimator=estimator,
        categories=None if known else category,
        detector=detector,
        masks=masks,
    )
    outcomes: list[PhotoOutcome] = []
    keep = None if store is None else Store(store)
    try:
        with progress_bar("annotate", len(paths)) as bar:
            for outcome in annotate_photos(
                annotator, paths, out, detections=known, store=keep, resume=resume
            ):
                outcomes.append(outcome)
                for sentence in _complaints(outcome):
                    complain(sentence)
                bar.advance(bar.tasks[0].id)
    finally:
        if keep is not None:
            keep.close()
    if json:
        print_json([_told(outcome) for outcome in outcomes])
    else:
        _print(outcomes, out)
    if any(_complaints(outcome) for outcome in outcomes):
        raise typer.Exit(1)


def _given(
    boxes: list[str], categories: list[str], rotations: list[str], file: Path | None
) -> DetectionsOf | None:
    from cadpose.detection.coco_json import FileDetector
    from cadpose.detection.given import given_detections, parse_box, parse_rotation
    from cadpose.errors import InputError

    if file is not None:
        return FileDetector(file, categories or None).detect
    if not boxes:
        return None
    try:
        parsed = [parse_box(text) for text in boxes]
        turned = [parse_rotation(text) for text in rotations]
    except InputError as error:
        raise typer.BadParameter(str(error)) from None

    def given(photo: Photo) -> list[Detection]:
        return given_detections(photo, parsed, categories, turned)

    return given


def _complaints(outcome: PhotoOutcome) -> list[str]:
    """A sentence for the photo if it failed, or for each of its objects that did."""
    if outcome.document is None:
        return [outcome.error]
    return [
        f"{outcome.photo}: {failure.detection.category} left out: {failure.reason}"
        for failure in outcome.document.failures
    ]


def _told(outcome: PhotoOutcome) -> dict[str, Any]:
    told: dict[str, Any] = {"photo": str(outcome.photo), "error": outcome.error or None}
    if outcome.document is not None:
        told |= {
            "document": str(outcome.paths.json),
            "overlay": str(outcome.paths.overlay),
            "resumed": outcome.resumed,
            "annotations": [
                {
                    "category": part.detection.category,
                    "cad": part.cad.id,
                    "azimuth": part.pose.azimuth,
                    "elevation": part.pose.elevation,
                    "inplane": part.pose.inplane,
                    "focal_px": part.pose.focal_px,
                    **_confidence(part),
                    "cad_probability": part.candidates[0].probability,
                    "none_probability": part.none_probability,
                    "cad_needs_review": part.cad_needs_review,
                    "box": part.detection.box,
                    "box_iou": part.box_iou,
                    "mask_iou": part.mask_iou,
                }
                for part in outcome.document.annotations
            ],
            "failures": [
                {"category": f.detection.category, "reason": f.reason} for f in outcome.document.failures
            ],
        }
    return told


def _confidence(part: AnnotationPart) -> dict[str, Any]:
    """What the estimator says of the rotation that was taken."""
    if not part.hypotheses:
        return {"probability": None, "expected_error": None, "needs_review": False}
    first = part.hypotheses[0]
    return {
        "probability": first.probability,
        "expected_error": first.expected_error,
        "needs_review": first.needs_review,
    }


def _chance(part: AnnotationPart) -> str:
    """The first model's chance, or that none of the candidates is the object's."""
    chance, none = part.candidates[0].probability, part.none_probability
    if chance is None or none is None:
        return ""
    if none > 0.5:
        return f"none fits {none:.2f}"
    return f"needs review {chance:.2f}" if part.cad_needs_review else f"{chance:.2f}"


def _print(outcomes: list[PhotoOutcome], out: Path) -> None:
    columns = [
        "category",
        "CAD model",
        "chance",
        "azimuth elevation in-plane",
        "probability",
        "focal length",
        "box IoU",
    ]
    empty = [""] * len(columns)
    rows = []
    for outcome in outcomes:
        name = outcome.photo.name
        if outcome.document is None:
            rows.append([name, "failed", *empty[1:]])
            continue
        parts = outcome.document.annotations
        if not parts and not outcome.document.failures:
            rows.append([name, "no object found", *empty[1:]])
        for part in parts:
            pose = part.pose
            # 359.7° is 0°, not 360°.
            azimuth = round(pose.azimuth) % 360
            sure = _confidence(part)
            probability = "" if sure["probability"] is None else f"{sure['probability']:.2f}"
            angles = f"{azimuth}° {round(pose.elevation):+d}° {round(pose.inplane):+d}°"
            rows.append(
                [
                    name,
                    part.detection.category,
                    part.cad.name,
                    _chance(part),
                    angles,
                    f"needs review {probability}" if sure["needs_review"] else probability,
                    f"{pose.focal_px:.0f} px",
                    f"{part.box_iou:.2f}",
                ]
            )
        rows += [
            [name, failure.detection.category, "left out", *empty[2:]]
            for failure in outcome.document.failures
        ]
    print_table(f"{len(outcomes)} photos", ["photo", *columns], rows)
    typer.echo(f"Pictures and documents: {out / 'index.html'}")
