"""From a library and a seed to photos: photo number i is the same whoever draws it, and in whatever order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel, Rotation
from cadpose.rendering.lights import Lights
from cadpose.rendering.raster import Rasteriser
from cadpose.rendering.scene import Scene
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.compose import cover, paste, relight, shade_ground
from cadpose.training.synth.degrade import degraded
from cadpose.training.synth.drawers import Drawer, RasterDrawer
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.records import SynthObject, SynthPhoto
from cadpose.training.synth.shapes import KeptScenes, Shape, redressed, warped
from cadpose.training.synth.views import camera_on, random_distance, random_lights, random_rotation

#: Objects of which less is seen are not labelled.
LEAST_VISIBLE = 0.3
_LEAST_PIXELS = 60
_SERIES, _PHOTO = 0, 1


@dataclass(eq=False)
class _Placed:
    """An object as drawn, before others hide it."""

    shape: Shape
    R_cv_from_s: FloatArray
    camera: Cameras
    rect: FloatArray
    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    light: NDArray[np.float32] | None
    total: float


class SynthGenerator:
    """Draws synthetic photos.

    Args:
        models: CAD models to draw from.
        mesh: Gives a model's mesh.
        symmetry: Gives the rotations that leave a model as it looks.
        backdrops: Where backdrops and textures come from.
        options: Chances and ranges.
        seed: With a photo's number it decides everything.
        drawer: Draws the shapes; the rasteriser unless told. Labels do not depend on it but for masks.
        kept_bytes: Memory for models that may be drawn again; about 2 MB each.

    Raises:
        ValueError: no model is given.
    """

    def __init__(
        self,
        models: Sequence[CadModel],
        mesh: Callable[[CadModel], Mesh],
        symmetry: Callable[[CadModel], SymmetryGroup],
        backdrops: Backdrops,
        options: SynthOptions | None = None,
        seed: int = 0,
        drawer: Drawer | None = None,
        kept_bytes: int = 2 << 30,
    ) -> None:
        if not models:
            raise ValueError("synthetic photos need at least one CAD model")
        self.options = options or SynthOptions()
        self.seed = seed
        self.backdrops = backdrops
        # By origin, the first part of the id: a hundred models made by formula do not drown ten others.
        self._by_category: dict[str, list[list[CadModel]]] = {}
        for category in sorted({model.category for model in models}):
            own = [model for model in models if model.category == category]
            origins = sorted({model.id.partition("/")[0] for model in own})
            groups = [[m for m in own if m.id.partition("/")[0] == origin] for origin in origins]
            self._by_category[category] = groups
        self._categories = sorted(self._by_category)
        weights = np.array([self._weight(c) for c in self._categories])
        self._chances = weights / weights.sum()
        self._by_id = {model.id: model for model in models}
        self.drawer: Drawer = drawer or RasterDrawer()
        self._plain = Rasteriser()
        self._scenes = KeptScenes(mesh, symmetry, kept_bytes)
        self._series: tuple[int, list[Shape]] | None = None

    def photo(self, index: int) -> SynthPhoto:
        """Photo number ``index``."""
        series = index // self.options.series
        shapes = self._shapes(series)
        self.drawer.begin(self.seed, series, index)
        rng = np.random.default_rng((self.seed, _PHOTO, index))
        o = self.options
        canvas = self.backdrops.draw(rng, o.size, o.backdrop_photo)
        lights = random_lights(rng)
        main = self._placed(shapes[index % len(shapes)], rng, lights, self._main_place(rng))
        layers = [main]
        for _ in range(2):
            if rng.random() < o.company:
                other = self._placed(
                    shapes[int(rng.integers(len(shapes)))], rng, lights, self._beside(rng, main)
                )
                layers.insert(0 if rng.random() < 0.6 else len(layers), other)
        for placed in layers:
            if rng.random() < o.shadow:
                # A drawer that knows the shadow leaves the draws of chance after it as they are.
                ground = canvas if placed.light is None else canvas.copy()
                shade_ground(ground, placed.shape.scene.vertices, placed.camera, lights, rng)
                if placed.light is not None:
                    relight(canvas, placed.light)
            paste(canvas, placed.rgb, placed.alpha)
        masks = _visible_masks(layers)
        if rng.random() < o.occluder:
            alpha = cover(o.size, main.rect, rng)
            paste(canvas, self.backdrops.draw(rng, o.size, 0.7), alpha)
            masks = [mask & (alpha < 128) for mask in masks]
        order = sorted(range(len(layers)), key=lambda i: layers[i] is not main)
        objects = [_labelled(layers[i], masks[i], o.size) for i in order]
        rgb = degraded(canvas, rng, o.degrade)
        return SynthPhoto(index, rgb, tuple(found for found in objects if found is not None))

    def plain(self, cad: str, R_cv_from_s: FloatArray, size: int) -> NDArray[np.uint8]:
        """(size, size, 3) uint8: a model as the library has it, in plain light on white, filling the square.

        Raises:
            KeyError: it is none of ``models``.
        """
        scene, _ = self.scene(cad)
        camera = Cameras.framing(R_cv_from_s[None], scene.vertices.astype(np.float64), size=size)
        return np.asarray(self._plain.render_scene(scene, camera).over(255)[0], np.uint8)

    def scene(self, cad: str) -> tuple[Scene, SymmetryGroup]:
        """A model as the library has it, laid out for drawing, and the rotations that leave it as it looks.

        Raises:
            KeyError: it is none of ``models``.
        """
        return self._scenes.of(self._by_id[cad])

    def _weight(self, category: str) -> float:
        return float(self.options.weights.get(category, np.sqrt(sum(map(len, self._by_category[category])))))

    def _shapes(self, series: int) -> list[Shape]:
        if self._series is None or self._series[0] != series:
            rng = np.random.default_rng((self.seed, _SERIES, series))
            self._series = (series, [self._shape(rng) for _ in range(self.options.shapes)])
        return self._series[1]

    def _shape(self, rng: np.random.Generator) -> Shape:
        category = self._categories[rng.choice(len(self._categories), p=self._chances)]
        groups = self._by_category[category]
        chances = np.sqrt([len(group) for group in groups])
        models = groups[rng.choice(len(groups), p=chances / chances.sum())]
        cad = models[rng.integers(len(models))]
        scene, symmetry = self._scenes.of(cad)
        if self.options.warp:
            scene = warped(scene, symmetry, rng, self.options.warp)
        if rng.random() < self.options.redress:
            scene = redressed(scene, rng, self.backdrops)
        return Shape(cad, scene, symmetry)

    def _main_place(self, rng: np.random.Generator) -> tuple[float, tuple[float, float]]:
        """Longer side and middle of the main object's rectangle in pixels."""
        o = self.options
        longer = rng.uniform(*o.fill) * o.size
        free = max(o.size - longer, 0.0) / 2
        if rng.random() < o.truncate:
            free += 0.25 * longer
        cx, cy = o.size / 2 + rng.uniform(-free, free, 2)
        return float(longer), (float(cx), float(cy))

    def _beside(self, rng: np.random.Generator, main: _Placed) -> tuple[float, tuple[float, float]]:
        size = self.options.size
        x0, y0, x1, y1 = main.rect
        longer = rng.uniform(0.25, 0.8) * size
        angle = rng.uniform(0, 2 * np.pi)
        reach = rng.uniform(0.35, 0.75)
        cx = (x0 + x1) / 2 + np.cos(angle) * reach * ((x1 - x0) / 2 + longer / 2)
        cy = (y0 + y1) / 2 + np.sin(angle) * reach * 0.6 * ((y1 - y0) / 2 + longer / 2)
        return float(longer), (float(cx), float(cy))

    def _placed(
        self, shape: Shape, rng: np.random.Generator, lights: Lights, place: tuple[float, tuple[float, float]]
    ) -> _Placed:
        R = random_rotation(rng)
        longer, centre = place
        camera, rect = camera_on(
            R,
            shape.scene.coordinates,
            longer_px=longer,
            centre_px=centre,
            t_z=random_distance(rng, self.options.distance),
            size=self.options.size,
        )
        drawn = self.drawer.draw(shape, camera, lights)
        total = float(drawn.alpha.sum()) / 255.0
        return _Placed(shape, R, camera, rect, drawn.rgb, drawn.alpha, drawn.light, total)


def _visible_masks(layers: Sequence[_Placed]) -> list[NDArray[np.bool_]]:
    """What is seen of each layer under those after it."""
    masks: list[NDArray[np.bool_]] = []
    for i, placed in enumerate(layers):
        mask = placed.alpha >= 128
        for later in layers[i + 1 :]:
            mask = mask & (later.alpha < 128)
        masks.append(mask)
    return masks


def _labelled(placed: _Placed, mask: NDArray[np.bool_], size: int) -> SynthObject | None:
    seen = float(mask.sum())
    x0, y0, x1, y1 = placed.rect
    # Of what lies outside the photo only the rectangle is known: its share stands for the object's.
    inside = max(0.0, min(x1, size) - max(x0, 0.0)) * max(0.0, min(y1, size) - max(y0, 0.0))
    share = inside / max((x1 - x0) * (y1 - y0), 1e-9)
    visible = share * min(1.0, seen / max(placed.total, 1.0))
    if visible < LEAST_VISIBLE or seen < _LEAST_PIXELS:
        return None
    camera = placed.camera
    return SynthObject(
        cad=placed.shape.cad.id,
        category=placed.shape.cad.category,
        rotation=Rotation.from_matrix(placed.R_cv_from_s),
        focal_px=float(camera.focal_px[0]),
        principal_px=(float(camera.principal_px[0, 0]), float(camera.principal_px[0, 1])),
        t_z=float(camera.t_cv[0, 2]),
        box=Box(float(x0), float(y0), float(x1), float(y1)),
        visible_box=Box.from_mask(mask),
        mask=mask,
        visible=visible,
        hidden=float(1.0 - seen / np.count_nonzero(placed.alpha >= 128)),
        truncated=bool(min(x0, y0) < 0 or max(x1, y1) > size),
        symmetry=placed.shape.symmetry,
    )
