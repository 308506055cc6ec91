"""Shapes: CAD models warped, recoloured and textured at random, ready to be drawn."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel
from cadpose.rendering.scene import Scene, build_scene, retextured
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.kernels import project_along, scaled_normals

_GREYS = ((0.95, 0.95, 0.94), (0.75, 0.74, 0.72), (0.5, 0.5, 0.5), (0.25, 0.25, 0.26), (0.08, 0.08, 0.09))
_WOODS = ((0.72, 0.52, 0.33), (0.52, 0.33, 0.18), (0.35, 0.2, 0.12), (0.85, 0.7, 0.5), (0.6, 0.4, 0.25))


@dataclass(frozen=True, eq=False)
class Shape:
    """One model as it is drawn.

    Attributes:
        cad: The catalogue entry that it was made from.
        scene: What the rasteriser draws: unit bounding-box diagonal, centred.
        symmetry: Rotations that leave it as it looks.
    """

    cad: CadModel
    scene: Scene
    symmetry: SymmetryGroup


class KeptScenes:
    """Models laid out for drawing; those not drawn for long make room for others.

    Args:
        mesh: Gives a model's mesh.
        symmetry: Gives the rotations that leave a model as it looks.
        most: Bytes that are kept; the last model is kept however large.
    """

    def __init__(
        self, mesh: Callable[[CadModel], Mesh], symmetry: Callable[[CadModel], SymmetryGroup], most: int
    ) -> None:
        self._mesh, self._symmetry, self._most = mesh, symmetry, most
        self._kept: OrderedDict[str, tuple[Scene, SymmetryGroup]] = OrderedDict()
        self._bytes = 0

    def of(self, cad: CadModel) -> tuple[Scene, SymmetryGroup]:
        """A model's scene and symmetry."""
        if cad.id in self._kept:
            self._kept.move_to_end(cad.id)
            return self._kept[cad.id]
        found = build_scene(self._mesh(cad)), self._symmetry(cad)
        self._kept[cad.id] = found
        self._bytes += _size(found[0])
        while self._bytes > self._most and len(self._kept) > 1:
            _, (old, _) = self._kept.popitem(last=False)
            self._bytes -= _size(old)
        return found


def _size(scene: Scene) -> int:
    return sum(value.nbytes for value in vars(scene).values() if isinstance(value, np.ndarray))


def warped(scene: Scene, symmetry: SymmetryGroup, rng: np.random.Generator, strength: float = 1.0) -> Scene:
    """The scene with other proportions: scaled along each axis, stretched here and squeezed there, tapered.

    Left and right stay alike. What would break the shape's own symmetry is left out: depth is not stretched
    unevenly for one that looks alike after half a turn, and width and depth are scaled alike for one that
    looks alike after less.
    """
    sigma = 0.13 * strength
    x, y, z = scene.coordinates
    order = symmetry.about((0.0, 1.0, 0.0)).order
    wide, high, deep = np.exp(np.clip(rng.normal(0.0, sigma, 3), -2.5 * sigma, 2.5 * sigma)).astype(
        np.float32
    )
    if order > 2:
        deep = wide
    upward = _stretch(y, rng, strength)
    backward = _stretch(z, rng, strength) if order == 1 else (z, np.ones_like(z))
    taper = 1.0 + np.float32(np.clip(rng.normal(0.0, 0.12 * strength), -0.3, 0.3)) * y
    new = np.stack([x * (wide * taper), upward[0] * high, backward[0] * deep * (taper if order > 2 else 1.0)])
    # Of the Jacobian only its diagonal counts for shading: the taper leans normals by a few degrees.
    slope = 1.0 / np.stack([wide * taper, high * upward[1], deep * backward[1]], axis=1)
    normals: NDArray[np.float32] = np.empty_like(scene.normals)
    scaled_normals(scene.normals, scene.faces, slope.astype(np.float32), normals)
    low, top = new.min(axis=1), new.max(axis=1)
    new = (new - ((low + top) / 2.0)[:, None]) / np.linalg.norm(top - low)
    return _moved(scene, new, normals)


def _moved(scene: Scene, coordinates: FloatArray, normals: NDArray[np.float32]) -> Scene:
    flat = np.ascontiguousarray(coordinates, np.float32)
    low, high = flat.min(axis=1), flat.max(axis=1)
    corners = np.array(
        [(a, b, c) for a in (low[0], high[0]) for b in (low[1], high[1]) for c in (low[2], high[2])]
    )
    return replace(
        scene,
        vertices=np.ascontiguousarray(flat.T),
        coordinates=flat,
        normals=np.ascontiguousarray(normals, np.float32),
        corners=corners.astype(np.float64),
    )


def _stretch(
    u: NDArray[np.float32], rng: np.random.Generator, strength: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A smooth growing function of the coordinate that keeps its ends, and its slope."""
    low, high = u.min(), u.max()
    span = max(high - low, 1e-9)
    t = (u - low) / span
    a1, a2 = rng.normal(0.0, 0.06 * strength), rng.normal(0.0, 0.03 * strength)
    # The slope 1 + a1·pi·cos + a2·2·pi·cos stays above 0.3.
    room = 0.7 / max(np.pi * abs(a1) + 2 * np.pi * abs(a2), 0.7)
    a1, a2 = a1 * room, a2 * room
    # From a table: sines of every vertex would take longer than the rest of the warp.
    k = np.linspace(0.0, 1.0, 257)
    value = k + a1 * np.sin(np.pi * k) + a2 * np.sin(2 * np.pi * k)
    slope = 1.0 + a1 * np.pi * np.cos(np.pi * k) + a2 * 2 * np.pi * np.cos(2 * np.pi * k)
    at = np.minimum((t * 256).astype(np.int32), 255)
    part = t * 256 - at
    value, slope = value.astype(np.float32), slope.astype(np.float32)
    return (
        low + (value[at] + (value[at + 1] - value[at]) * part) * span,
        slope[at] + (slope[at + 1] - slope[at]) * part,
    )


def redressed(scene: Scene, rng: np.random.Generator, backdrops: Backdrops) -> Scene:
    """The scene with other colours: shifted in hue, painted anew, all of one colour, or with new textures."""
    rgba = scene.rgba.copy()
    kind = rng.choice(4, p=(0.4, 0.25, 0.1, 0.25))
    if kind == 0:
        rgba[:, :3] = _shifted(rgba[:, :3], rng)
    elif kind == 1:
        for m in np.flatnonzero(rng.random(len(rgba)) < 0.6):
            rgba[m, :3] = random_colour(rng) * 255.0
    elif kind == 2:
        rgba[:, :3] = random_colour(rng) * 255.0
    changed = replace(scene, rgba=rgba)
    if kind != 3:
        return changed
    weight = np.bincount(scene.material, minlength=len(rgba)).astype(np.float64)
    count = min(int(rng.integers(1, 3)), int((weight > 0).sum()))
    chosen = rng.choice(len(rgba), size=count, replace=False, p=weight / weight.sum())
    rgba[chosen, :3] = 255.0 * rng.uniform(0.6, 1.0)
    return retextured(changed, chosen, backdrops.texture(rng), box_uv(scene, rng))


def box_uv(scene: Scene, rng: np.random.Generator) -> NDArray[np.float32]:
    """(F, 3, 2) texture coordinates from the two axes that a face lies along most, at a random scale."""
    uv = np.empty((len(scene.faces), 3, 2), np.float32)
    scale = float(rng.uniform(0.7, 5.0))
    u, v = (float(shift) for shift in rng.random(2))
    project_along(scene.vertices, scene.faces, scale, u, v, uv)
    return uv


def random_colour(rng: np.random.Generator) -> NDArray[np.float64]:
    """(3,) in [0, 1]: greys, woods and fabrics more often than pure colours."""
    kind = rng.random()
    if kind < 0.35:
        base = np.array(_GREYS[rng.integers(len(_GREYS))])
    elif kind < 0.55:
        base = np.array(_WOODS[rng.integers(len(_WOODS))])
    else:
        value, spread = rng.uniform(0.15, 0.95), rng.uniform(0.05, 0.9)
        base = value * (1.0 - spread * rng.random(3))
    return np.clip(base * rng.uniform(0.8, 1.15) + rng.normal(0.0, 0.02, 3), 0.0, 1.0)


def _shifted(rgb: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Colours turned about the grey axis, more or less saturated, lighter or darker."""
    grey = rgb.mean(axis=1, keepdims=True)
    angle = rng.uniform(0.0, 2 * np.pi)
    k = np.full(3, 1 / np.sqrt(3))
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    turned = grey + rng.uniform(0.3, 1.4) * ((rgb - grey) @ turn.T)
    lit = turned * rng.uniform(0.55, 1.5) + rng.uniform(-20, 20)
    return np.asarray(np.clip(lit, 0, 255), np.float32)
