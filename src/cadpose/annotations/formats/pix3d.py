"""Pix3D's layout: pix3d.json, img, mask and model.

Pix3D's principal point is the middle of its picture, and an annotation's is a pixel of its own. So every
object gets a picture of its own: the photo with a white margin on the sides that lack one for the principal
point, to the nearest half pixel, to lie in the middle. With that the pose is exact up to 0.36 pixels; our
keys hold it to the last digit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import output_paths
from cadpose.annotations.formats.extras import (
    SAME,
    Native,
    annotation_from,
    document_from_parts,
    extras_of,
    located,
    native_pose,
    photo_extras,
    photo_size,
)
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import JsonEntries, iter_json
from cadpose.annotations.formats.pictures import read_mask, write_png
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import file_stem
from cadpose.annotations.formats.views import view_of
from cadpose.annotations.parts import CadPart, MaskPart, PosePart
from cadpose.datasets.files import inside
from cadpose.errors import InputError
from cadpose.geometry.labels import from_pix3d, to_pix3d
from cadpose.library.mesh import Mesh
from cadpose.records import Photo
from cadpose.rendering.raster import Rasteriser
from cadpose.rle import MAX_PIXELS, decode_mask, encode_mask

_WHAT = "the pix3d.json of `cadpose export pix3d`"
_WHITE = 255


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Fill a folder.

    Raises:
        InputError: a photo is missing or is another one, or a model of the library is another one.
        LibraryError: the library lacks a model.
    """
    models: set[str] = set()
    renderer = Rasteriser(supersample=1)
    with JsonEntries(out / "pix3d.json") as file:
        for document in documents:
            photo = sources.photo(document) if document.annotations else None
            for number, part in enumerate(document.annotations):
                if photo is not None:
                    file.add(_entry(document, photo, part, number, out, sources, models, renderer))


def _entry(
    document: AnnotationDocument,
    photo: Photo,
    part: AnnotationPart,
    number: int,
    out: Path,
    sources: Sources,
    models: set[str],
    renderer: Rasteriser,
) -> dict[str, Any]:
    view = view_of(part, sources.photo_camera)
    left, top, width, height = _frame(view.principal_px, document.photo.size, document.photo.name)
    category = _safe(part.detection.category)
    name = f"{category}/{file_stem(document)}-{number:03d}.png"
    model = f"model/{category}/{_model_stem(part.cad)}/model.obj"
    mesh = sources.mesh(part.cad)
    if model not in models:
        models.add(model)
        (out / model).parent.mkdir(parents=True, exist_ok=True)
        (out / model).write_bytes(_obj(mesh))
    found = part.detection.mask
    if found is None:
        cameras = view.cameras(photo.width, photo.height)
        mask = renderer.render(mesh, cameras).mask[0]
    else:
        mask = decode_mask(found.size, found.counts)
    rgb = np.full((height, width, 3), _WHITE, np.uint8)
    rgb[top : top + photo.height, left : left + photo.width] = photo.rgb
    framed = np.zeros((height, width), np.bool_)
    framed[top : top + photo.height, left : left + photo.width] = mask
    write_png(out / "img" / name, Photo(rgb))
    write_png(out / "mask" / name, framed)
    x0, y0, x1, y1 = part.detection.box
    return {
        "img": f"img/{name}",
        "category": part.detection.category,
        "img_size": [width, height],
        "mask": f"mask/{name}",
        "img_source": "cadpose",
        "model": model,
        "model_source": part.cad.source,
        "bbox": [x0 + left, y0 + top, x1 + left, y1 + top],
        **to_pix3d(view.R_cv_from_s, view.t_cv, view.focal_px, width),
        "inplane_rotation": part.pose.inplane,
        "truncated": part.detection.truncated,
        "occluded": False,
        "slightly_occluded": False,
        "cadpose": {
            "photo": photo_extras(document),
            "position": number,
            "offset": [left, top],
            "photo_camera": view.camera_key != view_of(part, False).camera_key,
            "has_mask": found is not None,
            "annotation": extras_of(part),
        },
    }


def _frame(principal: tuple[float, float], size: tuple[int, int], name: str) -> tuple[int, int, int, int]:
    """Left and top margin, width and height of the picture in whose middle the principal point lies."""
    sides = []
    for at, length in zip(principal, size, strict=True):
        # In half pixels; the picture is as long as twice the longer side of the point.
        middle = round(2.0 * at)
        sides.append((max(length - middle, 0), max(middle, 2 * length - middle)))
    (left, width), (top, height) = sides
    if width * height > MAX_PIXELS:
        raise InputError(
            f"{name}: the principal point of an object lies too far outside the photo for Pix3D's format: "
            "leave it out with --category or --verdict, or use another format"
        )
    return left, top, width, height


def _obj(mesh: Mesh) -> bytes:
    """Positions and faces as OBJ, in ShapeNet axes as Pix3D's models are."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.astype(np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode("ascii")


def _safe(name: str) -> str:
    return output_paths([name.replace(".", "_")], Path())[0].json.stem


def _model_stem(cad: CadPart) -> str:
    """A folder name for a model: what its path ends with, and digits that no other model has."""
    from cadpose.library.storage import sha256_of

    pieces = PurePosixPath(cad.id.replace("\\", "/")).with_suffix("").parts
    return f"{_safe('_'.join(pieces[-2:]))[:60]}-{sha256_of(cad.id.encode())[:8]}"


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a folder: boxes, classes and masks as Pix3D's own keys tell them.

    Raises:
        InputError: the folder is not one that `write` wrote.
    """
    file = path / "pix3d.json" if path.is_dir() else path
    told: set[bytes] = set()
    sha256, photo, where = b"", None, ""
    parts: list[AnnotationPart] = []
    for number, (key, entry) in enumerate(iter_json(file, _WHAT), start=1):
        place = located(file, "entry", number)
        kept = entry.get("cadpose") if not key and isinstance(entry, dict) else None
        if not isinstance(kept, dict) or not isinstance(kept.get("photo"), dict):
            raise InputError(
                f"{place} lacks the keys that `cadpose export` writes: "
                "read Pix3D itself with `cadpose dataset convert pix3d`"
            )
        digest = str(kept["photo"].get("sha256")).encode()[:64]
        if digest != sha256:
            if parts:
                yield document_from_parts(photo, parts, where)
            if digest in told:
                raise InputError(f"{place}: the entries of a photo are scattered, sort them by photo")
            told.add(digest)
            sha256, photo, parts = digest, kept["photo"], []
        where = place
        parts.append(_part(entry, kept, file, place))
    if parts:
        yield document_from_parts(photo, parts, where)


def _part(entry: dict[str, Any], kept: dict[str, Any], file: Path, where: str) -> AnnotationPart:
    plain = annotation_from(kept.get("annotation"), Native(), where)
    try:
        left, top = (int(value) for value in kept["offset"])
        width, height = (int(value) for value in entry["img_size"])
        photo_width, photo_height = photo_size(kept["photo"], where)
        x0, y0, x1, y1 = (float(value) for value in entry["bbox"])
        camera = from_pix3d(
            np.array(entry["rot_mat"], np.float64).reshape(3, 3),
            np.array(entry["trans_mat"], np.float64).reshape(3),
            float(entry["focal_length"]),
            (width, height),
            np.array(entry["cam_position"], np.float64).reshape(3),
        )
        name, category = str(entry["mask"]), str(entry["category"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{where} lacks {error} or holds another type") from None
    if not (0 <= left <= width - photo_width and 0 <= top <= height - photo_height):
        raise InputError(f"{where} places its photo outside its picture: export it again")
    mask = None
    if kept.get("has_mask") is True:
        drawn = read_mask(inside(file.parent, name, file), (height, width))
        own = drawn[top : top + photo_height, left : left + photo_width]
        mask = MaskPart(size=(photo_height, photo_width), counts=encode_mask(own))
    pose: PosePart | None = None
    if kept.get("photo_camera") is not True:
        x, y = camera.principal_px[0] - left, camera.principal_px[1] - top
        near = max(abs(x - plain.pose.principal_px[0]), abs(y - plain.pose.principal_px[1])) <= 0.25 + SAME
        principal = plain.pose.principal_px if near else (x, y)
        f = camera.focal_px
        K = np.array([[f, 0.0, principal[0]], [0.0, f, principal[1]], [0.0, 0.0, 1.0]])
        pose = native_pose(plain.pose, camera.R_cv_from_s, camera.t_cv, K, where)
    box = (x0 - left, y0 - top, x1 - left, y1 - top)
    return annotation_from(kept["annotation"], Native(box, category, mask, True, pose), where)


PIX3D = Format("pix3d", "Pix3D's folder: pix3d.json, img, mask, model", True, write, read)
