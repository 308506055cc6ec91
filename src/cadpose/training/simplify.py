"""Meshes with fewer faces and smaller textures: drawing is faster, and at 256 pixels they look the same."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.library.catalogue import INDEX, Library
from cadpose.library.importing import mesh_path
from cadpose.library.mesh import Material, Mesh
from cadpose.library.normals import crease_normals
from cadpose.library.sampling import sample_surface
from cadpose.library.storage import mesh_to_bytes, sha256_of, write_atomic

#: How far the new surface may lie from the old one, in model diagonals, at all but the worst 1 % of points.
_TOLERANCE = 0.008
_POINTS = 4000


def simplified(mesh: Mesh, faces: int = 8000, texture_side: int = 128) -> Mesh:
    """The mesh with about ``faces`` faces at most, by quadric edge collapse, and smaller textures.

    Where so few faces would tear the shape, two or four times as many are tried, and then all are kept. A
    new face takes material and texture coordinates from the old face nearest to its middle.

    Raises:
        DependencyError: fast-simplification or SciPy is not installed.
    """
    whole = replace(mesh, materials=tuple(_reduced(m, texture_side) for m in mesh.materials))
    for budget in (faces, 2 * faces, 4 * faces):
        if len(mesh.faces) <= budget:
            break
        fewer = _collapsed(whole, budget)
        if fewer is not None and _apart(mesh, fewer) < _TOLERANCE:
            return fewer
    return whole


def _collapsed(mesh: Mesh, faces: int) -> Mesh | None:
    """None where the collapse stopped far from the goal, which is a sign of a torn shape."""
    try:
        import fast_simplification
        from scipy.spatial import cKDTree
    except ImportError as error:
        raise DependencyError("simplified meshes need: pip install 'cadpose[train]'") from error
    share = 1.0 - faces / len(mesh.faces)
    vertices, triangles = fast_simplification.simplify(np.array(mesh.vertices), np.array(mesh.faces), share)
    vertices, triangles = np.asarray(vertices, np.float32), np.asarray(triangles, np.int32)
    corners = vertices[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles = triangles[area > 1e-12]
    if not 0 < len(triangles) <= 1.2 * faces:
        return None
    old = mesh.vertices[mesh.faces].astype(np.float64)
    _, nearest = cKDTree(old.mean(axis=1)).query(vertices[triangles].mean(axis=1))
    return Mesh(
        vertices=vertices,
        faces=triangles,
        corner_normals=crease_normals(vertices.astype(np.float64), triangles.astype(np.int64)),
        corner_uv=_carried_uv(old[nearest], mesh.corner_uv[nearest], vertices[triangles].astype(np.float64)),
        face_material=mesh.face_material[nearest],
        materials=mesh.materials,
    )


def _apart(old: Mesh, new: Mesh) -> float:
    """99th percentile of the distance from points of the old surface to the new one."""
    from scipy.spatial import cKDTree

    tree = cKDTree(sample_surface(new, 10 * _POINTS, seed=0))
    distance, _ = tree.query(sample_surface(old, _POINTS, seed=1))
    # Points of a surface are some way apart themselves.
    own, _ = cKDTree(sample_surface(old, 10 * _POINTS, seed=2)).query(sample_surface(old, _POINTS, seed=1))
    return float(np.percentile(distance, 99) - np.percentile(own, 99))


def _carried_uv(
    old: NDArray[np.float64], uv: NDArray[np.float32], new: NDArray[np.float64]
) -> NDArray[np.float32]:
    """The old face's coordinates, continued linearly to the new corners. All arrays are (F, 3, k)."""
    edges = old[:, 1:] - old[:, :1]
    gram = edges @ edges.transpose(0, 2, 1) + 1e-12 * np.eye(2)
    weights = np.linalg.solve(gram, edges @ (new - old[:, :1]).transpose(0, 2, 1)).transpose(0, 2, 1)
    # Slivers would throw coordinates far out.
    weights = np.clip(weights, -4.0, 5.0)
    steps = (uv[:, 1:] - uv[:, :1]).astype(np.float64)
    return np.asarray(uv[:, :1] + weights @ steps, np.float32)


def _reduced(material: Material, side: int) -> Material:
    texture = material.texture
    if texture is None or max(texture.shape[:2]) <= side:
        return material
    scale = side / max(texture.shape[:2])
    height, width = (max(1, round(n * scale)) for n in texture.shape[:2])
    small = cv2.resize(texture, (width, height), interpolation=cv2.INTER_AREA)
    return replace(material, texture=np.asarray(small, np.uint8))


def simplify_library(
    source: Library,
    folder: Path,
    ids: Iterable[str],
    faces: Mapping[str, int] | int = 8000,
    texture_side: int = 128,
    on_done: Callable[[str], None] = lambda _: None,
) -> Library:
    """A library of simplified copies of some models, with the same ids.

    Args:
        source: Where the models are.
        folder: Where the copies go; what is there already is replaced.
        ids: Which models.
        faces: See :func:`simplified`; a number for all, or one a category, with ``""`` for the others.
        texture_side: Likewise.
        on_done: Called with each id.

    Raises:
        LibraryError: a model is missing or damaged, or the folder cannot be written.
    """
    kept = list(ids)
    Library.create(folder)
    shutil.copyfile(source.path / INDEX, folder / INDEX)
    rows = []
    for cad_id in kept:
        most = faces if isinstance(faces, int) else faces.get(source.get(cad_id).category, faces[""])
        mesh = simplified(source.mesh(cad_id), most, texture_side)
        data = mesh_to_bytes(mesh)
        sha256 = sha256_of(data)
        write_atomic(mesh_path(folder / "meshes", sha256), data)
        rows.append((sha256, len(mesh.faces), cad_id))
        on_done(cad_id)
    with closing(sqlite3.connect(folder / INDEX)) as db:
        db.executemany("UPDATE models SET sha256 = ?, faces = ? WHERE id = ?", rows)
        db.execute("CREATE TEMP TABLE kept (id TEXT PRIMARY KEY)")
        db.executemany("INSERT INTO kept VALUES (?)", [(i,) for i in kept])
        db.execute("DELETE FROM models WHERE id NOT IN (SELECT id FROM kept)")
        db.commit()
    return Library.open(folder)
