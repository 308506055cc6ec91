"""``cadpose annotate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cadpose.cli.given import Boxes, DetectionsFile, MaskFiles, Polygons, Rotations, objects_told
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
    from cadpose.annotations.annotation_part import AnnotationPart
    from cadpose.annotations.parts import DetectionPart
    from cadpose.batch.run import PhotoOutcome


def annotate(
    photos: Annotated[list[str], typer.Argument(metavar="PHOTO|DIR|GLOB...", help="Photographs.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the outputs.")] = Path("runs/annotate"),
    store: Annotated[str | None, typer.Option("--store", help="Also keep them in sqlite:///file.db.")] = None,
    box: Boxes = None,
    polygon: Polygons = None,
    mask: MaskFiles = None,
    category: Categories = None,
    rotation: Rotations = None,
    detections: DetectionsFile = None,
    detector: DetectorName = "embedded",
    masks: MasksName = "network",
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
    if embedding is not None and index is None:
        raise typer.BadParameter("--embedding belongs to --index: name the view index too")
    from cadpose.annotations.store import Store
    from cadpose.batch.run import annotate_photos
    from cadpose.photos import find_photos

    known = objects_told(box, polygon, mask, category, rotation, detections)
    paths = find_photos(photos)
    if (polygon or mask) and len(paths) > 1:
        raise typer.BadParameter(f"--polygon and --mask belong to one photo, {len(paths)} were named")
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
                annotator,
                paths,
                out,
                detections=None if known is None else known.detect,
                store=keep,
                resume=resume,
            ):
                outcomes.append(outcome)
                for sentence in _complaints(outcome):
                    complain(sentence)
                bar.advance(bar.tasks[0].id)
    finally:
        if keep is not None:
            keep.close()
    unnamed = {o.photo for o in outcomes if known is not None and not known.knows(str(o.photo))}
    if json:
        print_json([_told(o) | {"named": o.photo not in unnamed} for o in outcomes])
    else:
        _print(outcomes, out, unnamed)
    if any(_complaints(outcome) for outcome in outcomes):
        raise typer.Exit(1)


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
                    **_doubts(part.detection),
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
                {"category": f.detection.category, **_doubts(f.detection), "reason": f.reason}
                for f in outcome.document.failures
            ],
        }
    return told


def _doubts(detection: DetectionPart) -> dict[str, Any]:
    """What may be wrong with the detection."""
    return {
        "alternatives": [{"category": o.category, "score": o.score} for o in detection.alternatives],
        "truncated": detection.truncated,
        "tiny": detection.tiny,
        "unsure": detection.unsure,
    }


def _category(detection: DetectionPart) -> str:
    from cadpose.annotations.style import category_text

    others = (other.category for other in detection.alternatives)
    return category_text(detection.category, others, detection.unsure)


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


def _print(outcomes: list[PhotoOutcome], out: Path, unnamed: set[Path]) -> None:
    from cadpose.annotations.style import flags_of

    columns = [
        "category",
        "CAD model",
        "chance",
        "azimuth elevation in-plane",
        "probability",
        "focal length",
        "box IoU",
        "flags",
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
            none = "the file does not name it" if outcome.photo in unnamed else "no object found"
            rows.append([name, none, *empty[1:]])
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
                    _category(part.detection),
                    part.cad.name,
                    _chance(part),
                    angles,
                    f"needs review {probability}" if sure["needs_review"] else probability,
                    f"{pose.focal_px:.0f} px",
                    f"{part.box_iou:.2f}",
                    " ".join(flags_of(part.detection)),
                ]
            )
        rows += [
            [
                name,
                _category(failure.detection),
                "left out",
                *empty[3:],
                " ".join(flags_of(failure.detection)),
            ]
            for failure in outcome.document.failures
        ]
    print_table(f"{len(outcomes)} photos", ["photo", *columns], rows)
    typer.echo(f"Pictures and documents: {out / 'index.html'}")
