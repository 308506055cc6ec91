"""One self-contained HTML page a photo: no script, nothing loaded from elsewhere.

Names of photos and CAD models are whatever their authors wrote, so every text is escaped, and the pages'
own Content-Security-Policy forbids everything but inline styles and inlined pictures.
"""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument, FailurePart
from cadpose.annotations.page import data_uri, jpeg_uri, page, text
from cadpose.annotations.parts import DetectionPart
from cadpose.annotations.strip import LIMIT
from cadpose.annotations.style import (
    category_text,
    colour_of,
    flags_of,
    object_crop,
    png_bytes,
    short,
    standing_text,
    view_image,
)
from cadpose.geometry.boxes import Box
from cadpose.records import Photo, Views

_TILE = 176


def card_html(
    photo: Photo, document: AnnotationDocument, overlay: Image.Image, renders: Sequence[Views]
) -> str:
    """The page of one photo.

    Args:
        photo: The photo, for the crops.
        document: Its document.
        overlay: From ``draw_overlay``.
        renders: One for each annotation: views of its first candidates in rank order.

    Raises:
        ValueError: the renders do not fit the annotations.
    """
    if len(renders) != len(document.annotations):
        raise ValueError(f"{len(renders)} renders do not fit {len(document.annotations)} annotations")
    width, height = document.photo.size
    found = len(document.annotations)
    body = [
        f"<h1>{text(document.photo.name)}</h1>",
        f'<p class="faint">{width} × {height} px · {_count(found, "object")} annotated</p>',
        f'<img class="overlay" alt="The photo with the models drawn over it" src="{jpeg_uri(overlay)}">',
    ]
    for number, (part, views) in enumerate(zip(document.annotations, renders, strict=True)):
        body.append(_object(photo, part, views, number))
    if document.failures:
        body.append("<h2>Found but not annotated</h2><dl>")
        body.extend(_failure(failure) for failure in document.failures)
        body.append("</dl>")
    return page(document.photo.name, "\n".join(body))


def _object(photo: Photo, part: AnnotationPart, views: Views, number: int) -> str:
    if not 1 <= len(views) <= len(part.candidates):
        raise ValueError(f"{len(views)} views do not fit {len(part.candidates)} candidates")
    red, green, blue = colour_of(number)
    crop = object_crop(photo, Box(*part.detection.box), _TILE)
    figures = [
        _figure(jpeg_uri(crop), "the photo", f"{part.detection.category} {part.detection.score:.2f}", "")
    ]
    for i, candidate in enumerate(part.candidates[: min(len(views), LIMIT)]):
        source = data_uri("png", png_bytes(view_image(views, i, _TILE)))
        caption = standing_text(i + 1, candidate.score, candidate.probability)
        figures.append(_figure(source, caption, candidate.cad.name, "best" if i == 0 else ""))
    cad, pose = part.cad, part.pose
    mask = "" if part.mask_iou is None else f", silhouette {part.mask_iou:.2f}"
    facts = {
        "Rotation": f"azimuth {pose.azimuth:.1f}°, elevation {pose.elevation:.1f}°, "
        f"in-plane {pose.inplane:.1f}°",
        "Focal length": f"{pose.focal_px:.1f} px at distance {pose.t_z:g}, "
        f"principal point ({pose.principal_px[0]:.1f}, {pose.principal_px[1]:.1f})",
        "Confidence": _confidence(part),
        "Model's chance": _chance(part),
        "Verdict": _verdict(part),
        "Distance": _distance(part),
        "IoU": f"box {part.box_iou:.2f}{mask}",
        "Model": cad.id,
        "Licence": " · ".join(text for text in (cad.licence, cad.creator, cad.source) if text),
        "Time": ", ".join(f"{stage} {spent:.2f} s" for stage, spent in part.seconds.items()),
    }
    rows = "".join(f"<dt>{name}</dt><dd>{text(value)}</dd>" for name, value in facts.items() if value)
    words = ["needs review"] * _flagged(part) + [f for f in flags_of(part.detection) if f != "unsure"]
    flags = "".join(f'<span class="flag">{word}</span>' for word in words)
    return (
        f'<section style="--c:rgb({red},{green},{blue})">'
        f"<h2>{text(_category(part.detection))} · {text(cad.name)}{flags}</h2>"
        f'<div class="strip">{"".join(figures)}</div><dl>{rows}</dl></section>'
    )


def _flagged(part: AnnotationPart) -> bool:
    return part.cad_needs_review or (bool(part.hypotheses) and part.hypotheses[0].needs_review)


def _chance(part: AnnotationPart) -> str:
    """What the ranking says of its first model; empty where it tells nothing."""
    first, none = part.candidates[0].probability, part.none_probability
    if first is None or none is None:
        return ""
    told = f"{first:.2f} to be the object's own, {none:.2f} that none of these is"
    return f"none of these; {told}" if none > 0.5 else told


def _verdict(part: AnnotationPart) -> str:
    """What may be done with it; empty where nothing is told."""
    if part.verdict is None or part.confidence is None:
        return ""
    return f"{part.verdict.replace('_', ' ')}, {part.confidence:.2f} that rotation and model are both right"


def _distance(part: AnnotationPart) -> str:
    """How far away the object is; empty where the camera is unknown."""
    whole = part.pose_6dof
    if whole is None:
        return ""
    camera = f"focal length {whole.camera.focal_px:.0f} px, {whole.camera.source}"
    if whole.t_m is not None:
        return f"{sum(v * v for v in whole.t_m) ** 0.5:.2f} m ({camera})"
    return f"{sum(v * v for v in whole.t_cv) ** 0.5:.2f} times the model's diagonal ({camera})"


def _confidence(part: AnnotationPart) -> str:
    """What the estimator says of its first rotation, the one that is drawn."""
    hypotheses = part.hypotheses
    if part.detection.rotation is not None or not hypotheses:
        return "the rotation was given" if part.detection.rotation is not None else ""
    first = hypotheses[0]
    if first.expected_error is None:
        return f"share {first.probability:.2f} among {_count(len(hypotheses), 'rotation')}"
    return f"probability {first.probability:.2f} within 30°, expected error {first.expected_error:.0f}°"


def _figure(source: str, first: str, second: str, kind: str) -> str:
    return (
        f'<figure class="{kind}"><div class="tile"><img alt="" src="{source}"></div>'
        f"<figcaption>{text(first)}<span>{text(short(second, 80))}</span></figcaption></figure>"
    )


def _failure(failure: FailurePart) -> str:
    detection = failure.detection
    told = " · ".join(
        [f"{_category(detection)} {detection.score:.2f}", *(f for f in flags_of(detection) if f != "unsure")]
    )
    return f"<dt>{text(told)}</dt><dd>{text(failure.reason)}</dd>"


def _category(detection: DetectionPart) -> str:
    return category_text(
        detection.category, (other.category for other in detection.alternatives), detection.unsure
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
