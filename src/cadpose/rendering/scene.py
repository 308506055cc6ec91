"""A mesh laid out for the rasteriser's kernels: sorted faces, agreeing normals, mip-mapped textures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.library.mesh import Material, Mesh
from cadpose.rendering.visibility import ID_MAX

#: Bits of ``Scene.look``.
TEXTURED, SMOOTH, MEAN_TEXEL = 1, 2, 4

#: Longer side that a texture is reduced to; a view shows far fewer texels.
MAX_TEXTURE_SIDE = 2048
#: Materials below this opacity are not drawn at all.
INVISIBLE = 1.0 / 255.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Flat arrays; faces in the order opaque, cut-out (a texture with holes), glass (alpha < 1).

    Attributes:
        vertices: (V, 3) float32.
        coordinates: (3, V) float32, the same transposed.
        faces: (F, 3) int32; invisible faces are left out.
        normals: (F, 3, 3) float32 corner normals, turned to the side that the winding faces.
        uv: (F, 3, 2) float32.
        uv_area: (F,) float32 area in texture coordinates.
        look: (F,) uint8 bits TEXTURED, SMOOTH, MEAN_TEXEL (textured without coordinates).
        material: (F,) int32.
        rgba: (M, 4) float32, colours in [0, 255], alpha in [0, 1].
        material_levels: (M, 2) int32 first mip level and number of levels, zeros without a texture.
        levels: (L, 3) int32 first texel, width, height.
        texels: (T,) uint32, red in the lowest byte and alpha in the highest, row-major from the top.
        corners: (8, 3) float64 corners of the bounding box.
        opaque: Number of opaque faces.
        cutout: Number of cut-out faces.
    """

    vertices: NDArray[np.float32]
    coordinates: NDArray[np.float32]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]
    uv_area: NDArray[np.float32]
    look: NDArray[np.uint8]
    material: NDArray[np.int32]
    rgba: NDArray[np.float32]
    material_levels: NDArray[np.int32]
    levels: NDArray[np.int32]
    texels: NDArray[np.uint32]
    corners: NDArray[np.float64]
    opaque: int
    cutout: int


def build_scene(mesh: Mesh) -> Scene:
    """Lay a mesh out for drawing.

    Raises:
        ValueError: the mesh has more faces than a sample's word can name (16.7 million).
    """
    if len(mesh.faces) > ID_MAX:
        raise ValueError(f"a mesh of {len(mesh.faces)} faces is too large to draw; {ID_MAX} is the most")
    kind = np.array([material_kind(material) for material in mesh.materials], np.int8)[mesh.face_material]
    order = np.argsort(kind, kind="stable")
    order = order[: int((kind < MaterialKind.INVISIBLE).sum())]
    faces = np.ascontiguousarray(mesh.faces[order])
    uv = np.ascontiguousarray(mesh.corner_uv[order])
    material = np.ascontiguousarray(mesh.face_material[order])
    normals = agreeing_normals(mesh)[order]
    side_a, side_b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    textured = np.array([m.texture is not None for m in mesh.materials])[material]
    look = np.where(textured, TEXTURED, 0).astype(np.uint8)
    look[np.abs(normals - normals[:, :1]).max(axis=(1, 2), initial=0) > 1e-3] |= SMOOTH
    look[textured & ~uv.any(axis=(1, 2))] |= MEAN_TEXEL
    rgba = np.array([m.rgba for m in mesh.materials], np.float32) * np.array([255, 255, 255, 1], np.float32)
    material_levels, levels, texels = _mip_maps(mesh.materials)
    return Scene(
        vertices=mesh.vertices,
        coordinates=np.ascontiguousarray(mesh.vertices.T),
        faces=faces,
        normals=np.ascontiguousarray(normals, np.float32),
        uv=uv,
        uv_area=(0.5 * np.abs(side_a[:, 0] * side_b[:, 1] - side_a[:, 1] * side_b[:, 0])).astype(np.float32),
        look=look,
        material=material,
        rgba=rgba,
        material_levels=material_levels,
        levels=levels,
        texels=texels,
        corners=np.array(list(product(*mesh.bounds.T))),
        opaque=int((kind == MaterialKind.OPAQUE).sum()),
        cutout=int((kind == MaterialKind.CUTOUT).sum()),
    )


def agreeing_normals(mesh: Mesh) -> NDArray[np.float32]:
    """(F, 3, 3) corner normals turned to the side that their face's winding faces."""
    corners = mesh.vertices[mesh.faces]
    winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    against = np.einsum("fci,fi->fc", mesh.corner_normals, winding) < 0
    return np.where(against[..., None], -mesh.corner_normals, mesh.corner_normals)


class MaterialKind(IntEnum):
    """How a material covers; the order in which a scene holds its faces."""

    OPAQUE = 0
    CUTOUT = 1  # a texture with holes
    GLASS = 2
    INVISIBLE = 3


def material_kind(material: Material) -> MaterialKind:
    """What a material's opacity and its texture's alpha make of it."""
    alpha = material.rgba[3]
    if alpha < INVISIBLE:
        return MaterialKind.INVISIBLE
    if alpha < 0.995:
        return MaterialKind.GLASS
    if material.texture is None or material.texture.shape[2] == 3:
        return MaterialKind.OPAQUE
    opacity = material.texture[..., 3]
    if opacity.min(initial=255) > 250:
        return MaterialKind.OPAQUE
    # A few half-transparent texels are the soft rim of a hole; many are a pane.
    between = (opacity > 16) & (opacity < 240)
    return MaterialKind.GLASS if between.mean() > 0.5 else MaterialKind.CUTOUT


def _mip_maps(
    materials: tuple[Material, ...],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.uint32]]:
    material_levels = np.zeros((len(materials), 2), np.int32)
    levels: list[tuple[int, int, int]] = []
    images: list[NDArray[np.uint32]] = []
    seen: dict[int, tuple[int, int]] = {}
    offset = 0
    for i, material in enumerate(materials):
        texture = material.texture
        if texture is None or 0 in texture.shape:
            continue
        if id(texture) not in seen:
            first = len(levels)
            for image in _mip_map(texture):
                levels.append((offset, image.shape[1], image.shape[0]))
                images.append(np.ascontiguousarray(image).view("<u4").ravel())
                offset += len(images[-1])
            seen[id(texture)] = (first, len(levels) - first)
        material_levels[i] = seen[id(texture)]
    return (
        material_levels,
        np.array(levels, np.int32).reshape(-1, 3),
        np.concatenate(images) if images else np.zeros(0, np.uint32),
    )


def _mip_map(texture: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    if texture.shape[2] == 3:
        texture = np.concatenate([texture, np.full_like(texture[..., :1], 255)], axis=2)
    longer = max(texture.shape[:2])
    if longer > MAX_TEXTURE_SIDE:
        texture = _reduced(texture, MAX_TEXTURE_SIDE / longer)
    images = [np.ascontiguousarray(texture)]
    while max(images[-1].shape[:2]) > 1:
        images.append(_reduced(images[-1], 0.5))
    return images


def _reduced(image: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    height, width = (max(1, int(n * factor)) for n in image.shape[:2])
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def retextured(
    scene: Scene, materials: NDArray[np.int64], texture: NDArray[np.uint8], uv: NDArray[np.float32]
) -> Scene:
    """The scene with some materials covered by another texture.

    Args:
        scene: Stays as it is.
        materials: (K,) which materials.
        texture: (H, W, 3) uint8; it replaces their own, and is multiplied by their colour.
        uv: (F, 3, 2) float32 coordinates, used for the faces of these materials.
    """
    images = _mip_map(texture)
    first = len(scene.levels)
    offset = len(scene.texels)
    levels, flat = [], []
    for image in images:
        levels.append((offset, image.shape[1], image.shape[0]))
        flat.append(np.ascontiguousarray(image).view("<u4").ravel())
        offset += len(flat[-1])
    faces = np.isin(scene.material, materials)
    look = np.where(faces, (scene.look | TEXTURED) & ~np.uint8(MEAN_TEXEL), scene.look).astype(np.uint8)
    mapped = np.where(faces[:, None, None], uv, scene.uv).astype(np.float32)
    material_levels = scene.material_levels.copy()
    material_levels[materials] = (first, len(images))
    side_a, side_b = mapped[:, 1] - mapped[:, 0], mapped[:, 2] - mapped[:, 0]
    area = 0.5 * np.abs(side_a[:, 0] * side_b[:, 1] - side_a[:, 1] * side_b[:, 0])
    return replace(
        scene,
        uv=mapped,
        uv_area=area.astype(np.float32),
        look=look,
        material_levels=material_levels,
        levels=np.concatenate([scene.levels, np.array(levels, np.int32)]),
        texels=np.concatenate([scene.texels, *flat]),
    )
