"""One self-contained HTML page a photo, and a gallery of a run: no script, nothing loaded from elsewhere.

Names of photos and CAD models are whatever their authors wrote, so every text is escaped, and the pages'
own Content-Security-Policy forbids everything but inline styles and inlined pictures.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import PurePosixPath
from urllib.parse import quote

from PIL import Image

from cadpose.annotations.document import AnnotationDocument, FailurePart
from cadpose.annotations.parts import AnnotationPart, HypothesisPart
from cadpose.annotations.strip import LIMIT
from cadpose.annotations.style import colour_of, jpeg_bytes, object_crop, png_bytes, short, view_image
from cadpose.geometry.boxes import Box
from cadpose.records import Photo, Views

_TILE = 176
_STYLE = """
:root{color-scheme:light dark;--paper:#fff;--ink:#181c21;--faint:#626a73;--line:#dfe3e8;--tile:#eff1f4}
@media(prefers-color-scheme:dark){
:root{--paper:#15181c;--ink:#e8eaed;--faint:#9aa3ad;--line:#2d333a;--tile:#aab0b8}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1180px;padding:24px 20px 48px;background:var(--paper);color:var(--ink);
font:15px/1.45 system-ui,sans-serif;overflow-wrap:anywhere}
h1{font-size:20px;margin:0 0 2px}h2{font-size:17px;margin:34px 0 6px;padding-left:10px;
border-left:5px solid var(--c,var(--line))}
p{margin:0 0 10px}.faint,figcaption span:not(.flag),dt{color:var(--faint)}
img{display:block;max-width:100%;height:auto}
.overlay{width:100%;margin-top:14px;border-radius:6px}
.strip{display:grid;grid-template-columns:repeat(auto-fill,minmax(165px,1fr));gap:10px;margin:12px 0}
figure{margin:0;font-size:13px}figcaption{padding:4px 2px;line-height:1.35}
figcaption span:not(.flag){display:block}
.tile{display:flex;align-items:center;justify-content:center;aspect-ratio:1;background:var(--tile);
border-radius:5px;overflow:hidden}.tile img{max-height:100%}
.best .tile{outline:3px solid var(--c)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 14px;margin:8px 0;font-size:14px}dd{margin:0}
.flag{margin-left:10px;padding:1px 8px;border-radius:9px;font-size:12px;font-weight:600;
background:#ffd34d;color:#181c21;vertical-align:2px;white-space:nowrap}
.gallery{display:grid;grid-template-columns:repeat(auto-fill,minmax(250px,1fr));gap:18px;margin-top:18px}
.gallery a{color:inherit;text-decoration:none}.gallery .tile{aspect-ratio:4/3;background:var(--line)}
.gallery .tile img{width:100%;height:100%;object-fit:contain}
"""
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


@dataclass(frozen=True, eq=False)
class GalleryEntry:
    """A photo's place in the gallery.

    Attributes:
        document: What was found in it.
        card: File name of its card, beside the gallery page.
        thumbnail: JPEG, from ``gallery_entry``.
    """

    document: AnnotationDocument
    card: str
    thumbnail: bytes


def gallery_entry(document: AnnotationDocument, card: str, overlay: Image.Image) -> GalleryEntry:
    """Keep a small picture of the overlay for ``index_html``."""
    small = overlay.convert("RGB")
    small.thumbnail((400, 300), Image.Resampling.LANCZOS)
    return GalleryEntry(document, PurePosixPath(card).name, jpeg_bytes(small, quality=80))


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
        f"<h1>{_text(document.photo.name)}</h1>",
        f'<p class="faint">{width} × {height} px · {_count(found, "object")} annotated</p>',
        f'<img class="overlay" alt="The photo with the models drawn over it" src="{_jpeg(overlay)}">',
    ]
    for number, (part, views) in enumerate(zip(document.annotations, renders, strict=True)):
        body.append(_object(photo, part, views, number))
    if document.failures:
        body.append("<h2>Found but not annotated</h2><dl>")
        body.extend(_failure(failure) for failure in document.failures)
        body.append("</dl>")
    return _page(document.photo.name, "\n".join(body))


def index_html(cards: Iterable[GalleryEntry], title: str = "cadpose") -> str:
    """The gallery page of a run; each entry links to the card that lies beside it."""
    tiles = []
    total = annotated = 0
    for entry in cards:
        total += 1
        parts = entry.document.annotations
        annotated += len(parts)
        models = " · ".join(f"{part.detection.category}: {short(part.cad.name, 40)}" for part in parts)
        doubtful = any(_flagged(part.hypotheses) for part in parts)
        flag = '<span class="flag">needs review</span>' if doubtful else ""
        tiles.append(
            f'<a href="{escape(quote("./" + entry.card), quote=True)}"><figure>'
            f'<div class="tile"><img alt="" src="{_uri("jpeg", entry.thumbnail)}"></div>'
            f"<figcaption>{_text(PurePosixPath(entry.document.photo.name).name)}{flag}"
            f"<span>{_text(models) if models else 'no object was annotated'}</span></figcaption></figure></a>"
        )
    body = (
        f"<h1>{_text(title)}</h1>"
        f'<p class="faint">{_count(total, "photo")}, {_count(annotated, "object")} annotated</p>'
        f'<div class="gallery">{"".join(tiles)}</div>'
    )
    return _page(title, body)


def _object(photo: Photo, part: AnnotationPart, views: Views, number: int) -> str:
    if not 1 <= len(views) <= len(part.candidates):
        raise ValueError(f"{len(views)} views do not fit {len(part.candidates)} candidates")
    red, green, blue = colour_of(number)
    crop = object_crop(photo, Box(*part.detection.box), _TILE)
    figures = [_figure(_jpeg(crop), "the photo", f"{part.detection.category} {part.detection.score:.2f}", "")]
    for i, candidate in enumerate(part.candidates[: min(len(views), LIMIT)]):
        source = _uri("png", png_bytes(view_image(views, i, _TILE)))
        caption = f"{i + 1} · {candidate.score:.3f}"
        figures.append(_figure(source, caption, candidate.cad.name, "best" if i == 0 else ""))
    cad, pose = part.cad, part.pose
    mask = "" if part.mask_iou is None else f", silhouette {part.mask_iou:.2f}"
    facts = {
        "Rotation": f"azimuth {pose.azimuth:.1f}°, elevation {pose.elevation:.1f}°, "
        f"in-plane {pose.inplane:.1f}°",
        "Focal length": f"{pose.focal_px:.1f} px at distance {pose.t_z:g}, "
        f"principal point ({pose.principal_px[0]:.1f}, {pose.principal_px[1]:.1f})",
        "Confidence": _confidence(part),
        "IoU": f"box {part.box_iou:.2f}{mask}",
        "Model": cad.id,
        "Licence": " · ".join(text for text in (cad.licence, cad.creator, cad.source) if text),
        "Time": ", ".join(f"{stage} {spent:.2f} s" for stage, spent in part.seconds.items()),
    }
    rows = "".join(f"<dt>{name}</dt><dd>{_text(value)}</dd>" for name, value in facts.items() if value)
    flag = '<span class="flag">needs review</span>' if _flagged(part.hypotheses) else ""
    return (
        f'<section style="--c:rgb({red},{green},{blue})">'
        f"<h2>{_text(part.detection.category)} · {_text(cad.name)}{flag}</h2>"
        f'<div class="strip">{"".join(figures)}</div><dl>{rows}</dl></section>'
    )


def _flagged(hypotheses: Sequence[HypothesisPart]) -> bool:
    return bool(hypotheses) and hypotheses[0].needs_review


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
        f"<figcaption>{_text(first)}<span>{_text(short(second, 80))}</span></figcaption></figure>"
    )


def _failure(failure: FailurePart) -> str:
    detection = failure.detection
    return f"<dt>{_text(detection.category)} {detection.score:.2f}</dt><dd>{_text(failure.reason)}</dd>"


def _page(title: str, body: str) -> str:
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width,initial-scale=1">\n'
        f"<title>{_text(title)}</title><style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _text(value: str) -> str:
    return escape(short(value, 400), quote=True)


def _jpeg(image: Image.Image) -> str:
    return _uri("jpeg", jpeg_bytes(image))


def _uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
