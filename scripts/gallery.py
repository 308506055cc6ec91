"""Make the pictures and tables of docs/gallery.md: good and bad answers, as they fall.

    python scripts/gallery.py WORK      # photos are drawn into WORK and kept there

Two synthetic photos of every category that has held-out models, numbers 0 and 1 of the category's seed: at
the first the object's own model is among the ten candidates, at the second it is not. Then scikit-image's
photographs, in which the embedded detector finds what it finds. Nothing is left out.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import skimage.data
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.alignment.trust import RIGHT_DEGREES, RIGHT_IOU
from cadpose.annotations.marks import outline
from cadpose.annotations.style import (
    FAINT,
    INK,
    PAPER,
    RIGHT,
    TILE_PAPER,
    WRONG,
    Colour,
    colour_of,
    font,
    jpeg_bytes,
    resized,
    short,
    view_image,
)
from cadpose.datasets.label import Label, mask_in_photo, object_in_photo
from cadpose.datasets.labels import read_labels
from cadpose.evaluation.pool import Pool, label_pool
from cadpose.evaluation.rotation import rotation_error
from cadpose.geometry.boxes import box_iou, mask_iou
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.pipeline import Annotator
from cadpose.records import Annotation, CadModel, Detection, Photo, Rotation
from cadpose.training.held_out import read_held_out
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.writer import LABELS, write_photos

#: Of the first category; the next ones count up, for one seed gives all categories the same views.
SEED = 80
DOCS = Path(__file__).resolve().parent.parent / "docs"
#: As the milder photos of the model card, one whole object each; every photo has a shape of its own.
OPTIONS = SynthOptions(
    size=448, series=1, shapes=1, warp=0.5, company=0.0, occluder=0.0, truncate=0.0, degrade=0.0
)
#: By number of the photo.
POOLS: tuple[Pool, ...] = ("with-true", "without-true")
REAL = ("stereo_motorcycle", "coffee", "clock", "camera", "rocket")

#: Every model that a picture shows, by id.
SHOWN: dict[str, CadModel] = {}

_TILE, _GAP, _LINE, _WORDS = 300, 8, 24, 19
_OPACITY = 0.6


@dataclass(frozen=True, eq=False)
class Tile:
    """A picture with two lines below it."""

    picture: Image.Image
    first: str
    second: str = ""
    colour: Colour = INK


def draw_rows(rows: list[list[Tile]]) -> Image.Image:
    """Tiles side by side, row below row."""
    columns, height = max(map(len, rows)), _TILE + 2 * _LINE + _GAP
    out = Image.new("RGB", (columns * (_TILE + _GAP) - _GAP, len(rows) * height - _GAP), PAPER)
    draw = ImageDraw.Draw(out)
    for y, row in enumerate(rows):
        for x, tile in enumerate(row):
            left, top = x * (_TILE + _GAP), y * height
            out.paste(TILE_PAPER, (left, top, left + _TILE, top + _TILE))
            picture = tile.picture.copy()
            picture.thumbnail((_TILE, _TILE), Image.Resampling.LANCZOS)
            at = (left + (_TILE - picture.width) // 2, top + (_TILE - picture.height) // 2)
            out.paste(picture, at, picture if picture.mode == "RGBA" else None)
            for line, (words, colour) in enumerate(((tile.first, tile.colour), (tile.second, FAINT))):
                told = short(words, 60)
                while draw.textlength(told, font=font(_WORDS)) > _TILE:
                    told = short(told, len(told) - 1)
                draw.text((left, top + _TILE + 1 + line * _LINE), told, fill=colour, font=font(_WORDS))
    return out


def laid_over(
    annotator: Annotator, photo: Photo, found: list[Annotation], least: int = 900
) -> NDArray[np.uint8]:
    """(H, W, 3) the photo with every answer's model blended in and outlined, its box drawn thin."""
    scale = max(1.0, least / max(photo.width, photo.height))
    width, height = round(photo.width * scale), round(photo.height * scale)
    canvas = resized(photo.rgb, width, height).copy()
    for i, annotation in enumerate(found):
        views = annotator.render_pose(annotation.cad, annotation.pose, photo.width, photo.height)
        alpha = resized(views.alpha[0], width, height)
        cover = _OPACITY * alpha[..., None].astype(np.float32) / 255.0
        mixed = canvas * (1.0 - cover) + resized(views.rgb[0], width, height) * cover
        canvas = np.clip(mixed + 0.5, 0, 255).astype(np.uint8)
        outline(canvas, alpha, colour_of(i), max(width, height) / 350.0)
    return canvas


def angles(rotation: Rotation) -> str:
    """``az 312° el 8° ip 0°``."""
    azimuth = round(rotation.azimuth) % 360
    return f"az {azimuth}° el {round(rotation.elevation)}° ip {round(rotation.inplane)}°"


def drawn(annotator: Annotator, cad: CadModel, rotation: Rotation) -> Image.Image:
    return view_image(annotator.render_framed(cad, rotation.to_matrix()[None]), 0, _TILE - 10)


def detected(annotator: Annotator, photo: Photo, label: Label) -> str:
    """What the embedded detector takes the labelled object for, by the box that lies best on it."""
    _, box = object_in_photo(label)
    by_iou = [
        (float(box_iou(np.array(d.box.to_tuple()), np.array(box.to_tuple()))), d)
        for d in annotator.detector.detect(photo)
    ]
    overlap, best = max(by_iou, key=lambda pair: pair[0], default=(0.0, None))
    if best is None or overlap < 0.5:
        return "not found"
    if best.unsure:
        return "unsure"
    return "found" if best.category == label.category else f"as {best.category}"


def synthetic(annotator: Annotator, category: str, labels: list[Label]) -> tuple[Image.Image, list[str]]:
    """The picture and the table's lines of one category."""
    library = annotator.library
    rows: list[list[Tile]] = []
    lines: list[str] = []
    for label, kind in zip(labels, POOLS, strict=True):
        assert label.cad is not None and label.rotation is not None
        photo, box = object_in_photo(label)
        cads = label_pool(library, kind, annotator.candidate_count)(label)
        found = annotator.annotate_object(photo, Detection(box, category), cads)
        true, truth = library.get(label.cad), mask_in_photo(label, photo)
        assert truth is not None and found.confidence is not None
        symmetry, first = library.symmetry(true), found.hypotheses[0]
        error = rotation_error(label, found.pose.rotation, symmetry)
        guessed = rotation_error(label, first.rotation, symmetry)
        silhouette = annotator.render_pose(found.cad, found.pose, photo.width, photo.height).mask[0]
        iou = mask_iou(silhouette, truth)
        own = found.cad.id == true.id
        right = error <= RIGHT_DEGREES and iou >= RIGHT_IOU and (own or kind == "without-true")
        colour = RIGHT if right else WRONG
        best = found.candidates[0]
        chance = f", chance {best.probability:.2f}" if best.probability is not None else ""
        verdict = f"{found.verdict} {found.confidence:.2f}"
        rows.append(
            [
                Tile(Image.fromarray(photo.rgb), f"{category}, photo {len(rows) + 1}", "synthetic"),
                Tile(Image.fromarray(laid_over(annotator, photo, [found])), verdict, f"IoU {iou:.2f}"),
                Tile(drawn(annotator, found.cad, found.pose.rotation),
                     f"{found.cad.name}{chance}", angles(found.pose.rotation)),
                Tile(drawn(annotator, true, label.rotation),
                     f"true: {true.name}", f"{angles(label.rotation)}: {error:.0f}° off", colour),
            ]
        )  # fmt: skip
        told_right = "yes" if right else "**no**"
        model = "own" if own else ("another" if kind == "with-true" else "another; own not there")
        none = "" if found.none_probability is None else f", none {found.none_probability:.2f}"
        lines.append(
            f"| {category} {len(rows)} | {found.cad.name} ({model}){chance}{none} | "
            f"{guessed:.0f}°, {first.probability:.2f} | {error:.0f}° | {iou:.2f} | {verdict} | "
            f"{told_right} | {detected(annotator, photo, label)} |"
        )
        SHOWN.update({true.id: true, found.cad.id: found.cad})
    return draw_rows(rows), lines


def real(annotator: Annotator, name: str) -> tuple[Image.Image, list[str]]:
    """The picture and the table's lines of one of scikit-image's photographs."""
    loaded = getattr(skimage.data, name)()
    rgb = np.asarray(loaded[0] if isinstance(loaded, tuple) else loaded, np.uint8)
    rgb = np.repeat(rgb[..., None], 3, axis=2) if rgb.ndim == 2 else rgb
    title = name.removeprefix("stereo_")
    photo = Photo(np.ascontiguousarray(rgb), name=f"{title}.png")
    found = annotator.annotate(photo)
    row = [Tile(Image.fromarray(rgb), title, "" if found else "nothing found")]
    lines = []
    if not found:
        lines.append(f"| {title} | nothing | | | | | |")
    else:
        row.append(Tile(Image.fromarray(laid_over(annotator, photo, found)), f"{len(found)} found"))
    for i, annotation in enumerate(found):
        best, d = annotation.candidates[0], annotation.detection
        assert annotation.confidence is not None and annotation.none_probability is not None
        chance = "" if best.probability is None else f"chance {best.probability:.2f}, none "
        chance += f"{annotation.none_probability:.2f}"
        verdict = f"{annotation.verdict} {annotation.confidence:.2f}"
        named = "unsure" if d.unsure else d.category
        if len(row) < 5:
            row.append(Tile(drawn(annotator, best.cad, annotation.pose.rotation),
                            f"{named}: {best.cad.name}", verdict, colour_of(i)))  # fmt: skip
        lines.append(
            f"| {title} | {named} {d.score:.2f} | {best.cad.name}, {chance} | "
            f"{angles(annotation.pose.rotation)} | {annotation.hypotheses[0].probability:.2f} | "
            f"{annotation.box_iou:.2f} | {verdict} |"
        )
        SHOWN[best.cad.id] = best.cad
    return draw_rows([row]), lines


def credits() -> str:
    """Names by licence and creator."""
    by: dict[tuple[str, str], set[str]] = {}
    for cad in SHOWN.values():
        by.setdefault((cad.licence, cad.creator or "unnamed"), set()).add(cad.name)
    lines = [
        f"| {licence} | {creator} | {', '.join(sorted(names))} |"
        for (licence, creator), names in sorted(by.items())
    ]
    return "\n".join(["| licence | creator | models |", "|---|---|---|", *lines])


def put(page: str, name: str, text: str) -> str:
    """The page with a table between its marks made anew."""
    mark = re.compile(rf"<!-- {name} -->.*?<!-- end -->", re.DOTALL)
    page, places = mark.subn(lambda _: f"<!-- {name} -->\n\n{text}\n\n<!-- end -->", page)
    if places != 1:
        sys.exit(f"docs/gallery.md has no place for {name}")
    return page


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("work", type=Path, help="folder for the drawn photos")
    parser.add_argument("--library", type=Path, help="folder of the CAD library")
    parser.add_argument("--photos-only", action="store_true", help="draw the photos and stop")
    told = parser.parse_args()
    library = Library.open(told.library)
    held_out = read_held_out(lookalikes=False)
    for seed, (category, ids) in enumerate(held_out.items(), SEED):
        recipe = Recipe.from_library(library, [category], only=ids, options=OPTIONS, seed=seed)
        write_photos(recipe, told.work / category, len(POOLS), format="png", resume=True)
        print(f"{category}: photos drawn", flush=True)
    if told.photos_only:
        return
    annotator = Annotator(library)
    table, pictures = [], {}
    for category in held_out:
        labels = list(read_labels(told.work / category / LABELS))
        pictures[f"gallery-{category}"], lines = synthetic(annotator, category, labels)
        table += lines
        print(*lines, sep="\n", flush=True)
    head = (
        "| photo | first candidate | first hypothesis | answer | IoU | verdict | right | detector |\n"
        "|---|---|---|---|---|---|---|---|"
    )
    synthetic_table = "\n".join([head, *table])
    table = []
    for name in REAL:
        pictures[f"gallery-{name.removeprefix('stereo_')}"], lines = real(annotator, name)
        table += lines
        print(*lines, sep="\n", flush=True)
    head = (
        "| photo | found | first candidate | answer | first hypothesis | box IoU | verdict |\n"
        "|---|---|---|---|---|---|---|"
    )
    for name, picture in pictures.items():
        write_atomic(DOCS / "pictures" / f"{name}.jpg", jpeg_bytes(picture, 80))
    path = DOCS / "gallery.md"
    page = path.read_text(encoding="utf-8")
    page = put(page, "synthetic", synthetic_table)
    page = put(page, "real", "\n".join([head, *table]))
    page = put(page, "credits", credits())
    write_atomic(path, page.encode())


if __name__ == "__main__":
    main()
