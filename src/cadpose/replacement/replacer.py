"""The replacement: an object goes, another CAD model stands in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.annotations.document import document_from
from cadpose.annotations.scenes.contents import Meshes
from cadpose.annotations.scenes.gltf import gltf_scene
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh
from cadpose.records import Annotation, CadModel, Candidate, Mask, Photo, Pose4Dof
from cadpose.rendering.raster import Rasteriser
from cadpose.replacement.inpainting import Inpainter, default_inpainter, paint_over
from cadpose.replacement.light import Light, even_light, guess_light
from cadpose.replacement.linear import display, linear
from cadpose.replacement.look import Look, look_of
from cadpose.replacement.placing import Size, standing_pose
from cadpose.replacement.region import contact_region, floor_row, grown, removed_region
from cadpose.replacement.shadow import darkening, ground_shadow
from cadpose.replacement.surface import Surface, surface_of
from cadpose.replacement.window import Window, window_about
from cadpose.stopwatch import Stopwatch

# Of samples a side of a drawing: more are not worth their memory.
_MOST_SAMPLES = 8200
# Longest side at which the object and its light are examined.
_EXAMINED = 960
# Pixels about a drawing that blur and edges need.
_MARGIN = 8.0


@dataclass(frozen=True, eq=False)
class Replacement:
    """A photo with another model in an object's place.

    Attributes:
        picture: (H, W, 3) uint8 sRGB, the finished picture, of the photo's size.
        background: (H, W, 3) uint8 sRGB, the photo without the object.
        pose: Where the new model stands.
        light: The light that it was drawn in.
        shadow: (H, W) float in [0, 1], the share of light that the new model takes from the ground.
        coverage: (H, W) float in [0, 1], the share of each pixel that the new model covers.
        removed: (H, W) bool, what was painted over.
        cad: The new model.
        inpainter: What painted the background: ``"patchmatch"`` or ``"telea"``.
        seconds: Time spent by stage.
    """

    picture: NDArray[np.uint8]
    background: NDArray[np.uint8]
    pose: Pose4Dof
    light: Light
    shadow: FloatArray
    coverage: FloatArray
    removed: Mask
    cad: CadModel
    inpainter: str
    seconds: dict[str, float]
    _annotation: Annotation = field(repr=False)
    _library: Meshes = field(repr=False)

    def scene_glb(self) -> bytes:
        """The scene as binary glTF: the background with the shadow on it as backdrop, camera, model, lights.

        Raises:
            LibraryError: the model's file is damaged.
            InputError: the pose has no finite place in a scene.
        """
        lit = linear(self.background) * (1.0 - self.shadow.astype(np.float32))[..., None]
        photo = Photo(np.round(display(lit)).astype(np.uint8), f"{self._annotation.photo_name} (replaced)")
        told = document_from(photo, [replace(self._annotation, photo_name=photo.name)])
        return gltf_scene(told, self._library, photo)


class Replacer:
    """Puts CAD models of a library in the place of annotated objects.

    Args:
        library: Where the models are.
        renderer: What draws them; the rasteriser, as it knows normals.
        inpainter: What paints the background.
        seed: Of the background's search and of the grain.
    """

    def __init__(
        self,
        library: Meshes,
        renderer: Rasteriser | None = None,
        inpainter: Inpainter | None = None,
        seed: int = 0,
    ) -> None:
        self.library = library
        self.seed = seed
        self._fine = renderer or Rasteriser(supersample=3)
        self._coarse = Rasteriser(supersample=1)
        self._inpainter = inpainter

    def replace(
        self,
        photo: Photo,
        annotation: Annotation,
        cad: CadModel,
        pose: Pose4Dof | None = None,
        *,
        shadow: bool = True,
        light: bool = True,
        size: Size = "match",
        others: Sequence[Annotation] = (),
    ) -> Replacement:
        """Replace an annotated object.

        Args:
            photo: The photo that was annotated.
            annotation: The object, with a mask.
            cad: The model of the library that is to stand there.
            pose: Where it is to stand, exactly; unless told, on the old model's ground in its rotation.
            shadow: Draw its shadow on the ground.
            light: Guess the light from the photo; otherwise colours are the model's own, lit from above.
            size: As large in the picture as the old model, or as both models' sizes in centimetres say.
            others: The photo's other annotations: their pixels are not copied into the background.

        Raises:
            InputError: there is no mask, or it is empty or of another photo; the photo is another one; a real
                size is unknown; or the new model would lie outside the photo.
            LibraryError: a model is not in the library, or its file is damaged.
        """
        clock = Stopwatch()
        mask = _mask_of(photo, annotation)
        height, width = mask.shape
        with clock.time("read"):
            old_mesh, mesh = self.library.mesh(annotation.cad), self.library.mesh(cad)
        new_pose = pose or standing_pose(old_mesh, annotation.cad, mesh, cad, annotation.pose, size)
        with clock.time("light"):
            region, told = self._examined(photo, mask, old_mesh, annotation.pose, light)
        with clock.time("draw"):
            window, surface = self._draw(mesh, new_pose, width, height)
        if window is None or surface is None or not surface.coverage.any():
            raise InputError(
                f"{cad.name or cad.id} would stand outside {photo.name}: give it another pose or size"
            )
        with clock.time("inpaint"):
            inpainter = self._inpainter or default_inpainter(self.seed)
            near = grown(region, 0.5 * _side(region)) & ~region
            look = look_of(photo.rgb, near if near.sum() > 2000 else ~mask)
            background = paint_over(
                photo.rgb,
                region,
                _barred(others, annotation, mask),
                inpainter,
                floor_row(old_mesh, annotation.pose),
            )
            background = _grained(background, region, look, self.seed)
        with clock.time("shadow"):
            lost = np.zeros(mask.shape)
            if shadow:
                lamp_s = new_pose.rotation.to_matrix().T @ np.array(told.direction)
                lost = darkening(ground_shadow(mesh, lamp_s), told, new_pose, width, height)
        with clock.time("compose"):
            picture, coverage = _composed(background, lost, window, surface, told, look, self.seed)
        return Replacement(
            picture=picture,
            background=background,
            pose=new_pose,
            light=told,
            shadow=lost,
            coverage=coverage,
            removed=region,
            cad=cad,
            inpainter=inpainter.name,
            seconds=dict(clock.seconds),
            _annotation=_annotated(annotation, cad, new_pose, coverage > 0.5),
            _library=self.library,
        )

    def _examined(
        self, photo: Photo, mask: Mask, mesh: Mesh, pose: Pose4Dof, light: bool
    ) -> tuple[Mask, Light]:
        """What is removed, and the light: both are seen well enough in a photo of moderate size."""
        scale = min(1.0, _EXAMINED / max(mask.shape))
        rgb, small, own = photo.rgb, mask, pose
        if scale < 1.0:
            height, width = (max(1, round(n * scale)) for n in mask.shape)
            x, y = width / mask.shape[1], height / mask.shape[0]
            rgb = np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
            share = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
            small = np.asarray(share >= min(0.5, float(share.max())))
            px, py = pose.principal_px
            own = replace(pose, focal_px=pose.focal_px * x, principal_px=(px * x, py * y))
        window = _window(mesh, own, small.shape)
        silhouette = np.zeros(small.shape, np.bool_)
        if window is not None:
            surface = surface_of(mesh, window.cameras(own), self._coarse)
            silhouette[window.slices] = surface.coverage > 0.5
        region = removed_region(small, silhouette, contact_region(mesh, own, small))
        up = own.rotation.to_matrix()[:, 1]
        told = even_light(up)
        if light and window is not None:
            near = grown(region, 0.6 * _side(region)) & ~region
            about = near if near.sum() > 2000 else ~small
            told = guess_light(rgb, _eroded(small)[window.slices], surface, up, about, window)
        if scale < 1.0:
            size = (mask.shape[1], mask.shape[0])
            region = cv2.resize(region.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.25
        return np.asarray(region | mask), told

    def _draw(
        self, mesh: Mesh, pose: Pose4Dof, width: int, height: int
    ) -> tuple[Window | None, Surface | None]:
        window = _window(mesh, pose, (height, width))
        if window is None:
            return None, None
        most = _MOST_SAMPLES // max(window.width, window.height)
        renderer = self._fine
        if renderer.supersample > most:
            renderer = Rasteriser(supersample=max(1, most))
        return window, surface_of(mesh, window.cameras(pose), renderer)


def _window(mesh: Mesh, pose: Pose4Dof, shape: tuple[int, ...]) -> Window | None:
    return window_about(pose.project(mesh.hull), _MARGIN, shape[1], shape[0])


def _mask_of(photo: Photo, annotation: Annotation) -> Mask:
    mask = annotation.detection.mask
    name = annotation.photo_name
    if (photo.width, photo.height) != annotation.photo_size or (
        photo.sha256 and annotation.photo_sha256 and photo.sha256 != annotation.photo_sha256
    ):
        raise InputError(f"{photo.name} is not the photo that was annotated as {name}")
    if mask is None:
        raise InputError(
            f"the {annotation.detection.category} of {name} has no mask, so it cannot be removed: "
            "annotate it with --masks network, or draw its mask on the review page"
        )
    if mask.shape != (photo.height, photo.width):
        raise InputError(
            f"the mask of {mask.shape[1]} x {mask.shape[0]} pixels does not fit {photo.name} of "
            f"{photo.width} x {photo.height}"
        )
    if not mask.any():
        raise InputError(f"the mask of the {annotation.detection.category} of {name} is empty: draw it again")
    return mask


def _barred(others: Sequence[Annotation], annotation: Annotation, mask: Mask) -> Mask:
    """What other objects cover, a little grown, as a mask seldom holds all of its object."""
    barred = np.zeros_like(mask)
    for other in others:
        told = other.detection.mask
        if other is not annotation and told is not None and told.shape == mask.shape and told.any():
            barred |= grown(told, 0.02 * _side(told))
    return barred


def _side(mask: Mask) -> int:
    ys, xs = np.nonzero(mask)
    return 1 + max(int(np.ptp(ys)), int(np.ptp(xs)))


def _eroded(mask: Mask) -> Mask:
    """Without its rim, where the mask and the model's normals disagree most."""
    r = max(1, round(0.01 * _side(mask)))
    inner = cv2.erode(mask.astype(np.uint8), np.ones((2 * r + 1, 2 * r + 1), np.uint8)) > 0
    return np.asarray(inner if inner.any() else mask)


def _grained(rgb: NDArray[np.uint8], region: Mask, look: Look, seed: int) -> NDArray[np.uint8]:
    """The painted part with the photo's grain: copied patches were averaged, and so lost theirs."""
    grain = look.grain((region.shape[0], region.shape[1]), seed)[region] * np.float32(0.7)
    noisy = rgb.copy()
    noisy[region] = np.clip(np.round(rgb[region] + grain[:, None]), 0, 255).astype(np.uint8)
    return noisy


def _composed(
    background: NDArray[np.uint8],
    lost: FloatArray,
    window: Window,
    surface: Surface,
    light: Light,
    look: Look,
    seed: int,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """The finished picture and the (H, W) coverage; what neither model nor shadow touches stays as it is."""
    picture = background.copy()
    shaded = lost > 0
    left = np.float32(1.0) - lost[shaded].astype(np.float32)
    picture[shaded] = np.round(display(linear(background[shaded]) * left[:, None]))
    # Without normals, as on glass seen edge on, the light is that of a surface facing the camera.
    normals = surface.normals
    plain = ~normals.any(axis=-1)
    normals[plain] = (0.0, 0.0, -1.0)
    alpha = surface.coverage[..., None]
    drawn = np.concatenate([_tone_mapped(linear(surface.rgb) * light.on(normals)) * alpha, alpha], axis=-1)
    if look.blur > 0.1:
        drawn = np.asarray(cv2.GaussianBlur(drawn, (0, 0), look.blur), np.float32)
    alpha = drawn[..., 3:]
    # Colour is toned before mixing, so that a monochrome photo stays so.
    own = look.toned(display(drawn[..., :3] / np.maximum(alpha, 1e-4)))
    own = own + look.grain((window.height, window.width), seed + 1)[..., None]
    rows, columns = window.slices
    behind = linear(picture[rows, columns])
    mixed = display(linear(np.clip(np.round(own), 0, 255).astype(np.uint8)) * alpha + behind * (1.0 - alpha))
    touched = alpha > 1.0 / 512.0
    picture[rows, columns] = np.where(touched, np.round(mixed).astype(np.uint8), picture[rows, columns])
    coverage = np.zeros(lost.shape)
    coverage[rows, columns] = np.where(touched, alpha, 0.0)[..., 0]
    return picture, coverage


def _tone_mapped(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Bright light rolls off instead of burning out: straight up to 0.7, then towards 1."""
    bright = light > 0.7
    if bright.any():
        light[bright] = 1.0 - np.float32(0.3) * np.exp((np.float32(0.7) - light[bright]) / np.float32(0.3))
    return light


def _annotated(annotation: Annotation, cad: CadModel, pose: Pose4Dof, covered: Mask) -> Annotation:
    """What the scene says of the new model; nothing of it was found in the photo."""
    ys, xs = np.nonzero(covered)
    box = annotation.detection.box
    if len(ys):
        box = Box(float(xs.min()), float(ys.min()), float(xs.max() + 1), float(ys.max() + 1))
    detection = replace(annotation.detection, box=box, category=cad.category, mask=None, source="replaced")
    return replace(
        annotation,
        photo_sha256="",
        detection=detection,
        pose=pose,
        candidates=(Candidate(cad, 0.0, pose.rotation),),
        hypotheses=(),
        box_iou=1.0,
        mask_iou=None,
        none_probability=None,
        refinement=None,
        pose_6dof=None,
        confidence=None,
        verdict=None,
    )
