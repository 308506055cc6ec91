"""A data set in BOP's format: models, photos, poses, masks, and the poses as a results file.

BOP gives one camera matrix to an image, and an annotation's camera is its own: every object gets an image of
its own, whose photo is the same file, unless the camera that took the photo is asked for and known. A scene
holds at most 1000 images. Model axes are z up, front +y; lengths are millimetres. K is in continuous pixels,
as everywhere here, and as BOP's own toolkit draws.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.bop_models import BopModels, diagonal_mm
from cadpose.annotations.formats.bop_reading import read
from cadpose.annotations.formats.extras import extras_of, photo_extras
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import JsonEntries, dumped
from cadpose.annotations.formats.pictures import same_file, write_png
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.views import View, view_of
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import R_s_from_b
from cadpose.records import Mask
from cadpose.rendering.raster import Rasteriser
from cadpose.rle import decode_mask

#: Images of a scene.
SCENE = 1000
RESULTS = "cadpose_annotations-test.csv"

_NOTES = """# Annotations of cadpose in BOP's format

Written by `cadpose export bop`. Lengths are millimetres. A model whose size is not known has
`"metric": false` in models_info.json and a bounding-box diagonal of 1000 mm. Each object has its own image,
and the same photo may stand behind several images, because each annotation has a camera of its own.
`cadpose.jsonl` in a scene's folder holds what BOP has no place for. mask_visib is the mask that was detected,
mask the silhouette of the model.
"""


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Fill a folder.

    Raises:
        InputError: a photo is missing or is another one, or a model of the library is another one.
        LibraryError: the library lacks a model.
    """
    models = BopModels(out / "models", sources)
    (out / "dataset_info.md").write_text(_NOTES, encoding="utf-8")
    with ExitStack() as stack:
        results = stack.enter_context((out / RESULTS).open("w", encoding="utf-8", newline="\n"))
        results.write("scene_id,im_id,obj_id,score,R,t,time\n")
        targets = stack.enter_context(JsonEntries(out / "test_targets_bop19.json"))
        scenes = stack.enter_context(_Scenes(out, models, results, targets))
        for document in documents:
            scenes.add(document, sources)
    models.finish()


class _Scenes:
    """Scenes, one open at a time."""

    def __init__(self, out: Path, models: BopModels, results: IO[str], targets: JsonEntries) -> None:
        self._out, self._models, self._results, self._targets = out, models, results, targets
        self._renderer = Rasteriser(supersample=1)
        self._scene = 0
        self._image = 0
        self._open = ExitStack()
        self._files: dict[str, JsonEntries] = {}
        self._camera_told = False

    def __enter__(self) -> _Scenes:
        self._begin()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.__exit__(None, None, None)

    def _begin(self) -> None:
        self._open.close()
        self._open = ExitStack()
        self._scene, self._image = self._scene + 1, 0
        folder = self.folder
        folder.mkdir(parents=True)
        for name in ("gt", "camera", "gt_info"):
            file = JsonEntries(folder / f"scene_{name}.json", "{}")
            self._files[name] = self._open.enter_context(file)
        self._kept = self._open.enter_context((folder / "cadpose.jsonl").open("w", encoding="utf-8"))

    @property
    def folder(self) -> Path:
        """The open scene's."""
        return self._out / "test" / f"{self._scene:06d}"

    def add(self, document: AnnotationDocument, sources: Sources) -> None:
        """The images of a photo; one without annotations has none."""
        if not document.annotations:
            return
        views = [view_of(part, sources.photo_camera) for part in document.annotations]
        keys = list(dict.fromkeys(view.camera_key for view in views))
        if self._image and self._image + len(keys) > SCENE:
            self._begin()
        photo = sources.photo(document)
        if (photo.width, photo.height) != document.photo.size:
            raise InputError(f"{photo.name} has another size than was annotated: annotate it again")
        first: Path | None = None
        for key in keys:
            path = self.folder / "rgb" / f"{self._image:06d}.png"
            if first is None:
                write_png(path, photo)
                first = path
            else:
                same_file(path, first)
            members = [i for i, view in enumerate(views) if view.camera_key == key]
            self._add_image(document, members, views)
            self._image += 1

    def _add_image(self, document: AnnotationDocument, members: list[int], views: list[View]) -> None:
        name = str(self._image)
        K = views[members[0]].K
        self._files["camera"].add({"cam_K": K.ravel().tolist(), "depth_scale": 1.0}, name)
        if not self._camera_told:
            self._tell_camera(K, document.photo.size)
        parts = [document.annotations[i] for i in members]
        spent = sum(sum(part.seconds.values()) for part in parts)
        poses, infos = [], []
        counts: dict[int, int] = {}
        for place, (i, part) in enumerate(zip(members, parts, strict=True)):
            number = self._models.number(part.cad)
            counts[number] = counts.get(number, 0) + 1
            R, t = views[i].R_cv_from_s @ R_s_from_b, views[i].t_cv * diagonal_mm(part.cad)
            turn, shift = R.ravel().tolist(), t.tolist()
            poses.append({"cam_R_m2c": turn, "cam_t_m2c": shift, "obj_id": number})
            infos.append(self._add_masks(document, part, views[i], place))
            score = part.detection.score if part.confidence is None else part.confidence
            texts = [" ".join(map(repr, values)) for values in (turn, shift)]
            self._results.write(
                f"{self._scene},{self._image},{number},{score!r},{texts[0]},{texts[1]},{spent!r}\n"
            )
            kept = {
                "im_id": self._image,
                "gt_id": place,
                "position": i,
                "obj_id": number,
                "photo_camera": views[i].camera_key != view_of(part, False).camera_key,
                "has_mask": part.detection.mask is not None,
                "photo": photo_extras(document),
                "annotation": extras_of(part),
            }
            self._kept.write(dumped(kept) + "\n")
        self._files["gt"].add(poses, name)
        self._files["gt_info"].add(infos, name)
        for number, count in sorted(counts.items()):
            self._targets.add(
                {"im_id": self._image, "inst_count": count, "obj_id": number, "scene_id": self._scene}
            )

    def _add_masks(
        self, document: AnnotationDocument, part: AnnotationPart, view: View, place: int
    ) -> dict[str, Any]:
        width, height = document.photo.size
        try:
            mesh = self._models.sources.mesh(part.cad)
            silhouette = self._renderer.render(mesh, view.cameras(width, height)).mask[0]
        except ValueError as error:
            raise InputError(f"{document.photo.name}: its silhouette cannot be drawn ({error})") from None
        found = part.detection.mask
        visible = silhouette if found is None else decode_mask(found.size, found.counts)
        name = f"{self._image:06d}_{place:06d}.png"
        write_png(self.folder / "mask" / name, silhouette)
        write_png(self.folder / "mask_visib" / name, visible)
        whole = int(silhouette.sum())
        seen = int((silhouette & visible).sum())
        return {
            "bbox_obj": _bbox(silhouette),
            "bbox_visib": _bbox(visible),
            "px_count_all": whole,
            "px_count_valid": whole,
            "px_count_visib": int(visible.sum()),
            # The detected mask may reach beyond the silhouette: its share within counts.
            "visib_fract": seen / whole if whole else 0.0,
        }

    def _tell_camera(self, K: Any, size: tuple[int, int]) -> None:
        """``camera.json``: of the first image; cameras differ from image to image."""
        told = {"cx": K[0, 2], "cy": K[1, 2], "depth_scale": 1.0, "fx": K[0, 0], "fy": K[1, 1]}
        told |= {"height": size[1], "width": size[0]}
        (self._out / "camera.json").write_text(dumped(told) + "\n", encoding="utf-8")
        self._camera_told = True


def _bbox(mask: Mask) -> list[int]:
    """x, y, width, height in whole pixels; -1 of an empty mask, as BOP's toolkit writes it."""
    if not mask.any():
        return [-1, -1, -1, -1]
    return [int(value) for value in Box.from_mask(np.asarray(mask)).to_xywh()]


BOP = Format("bop", "a BOP data set with a results file, one folder", True, write, read)
