"""One untrusted OBJ, GLB, glTF, PLY or STL file to a `Mesh`, in the file's own axes.

The order is always: size, header, counts, then decoding by trimesh, then textures. trimesh is handed
bytes only: it opens no path, fetches nothing and decodes no image.
"""

from __future__ import annotations

import io
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.obj import load_obj
from trimesh.exchange.ply import load_ply
from trimesh.exchange.stl import load_stl
from trimesh.geometry import triangulate_quads

from cadpose.errors import InputError
from cadpose.library import gltf
from cadpose.library.assets import Assets, FolderAssets, read_capped
from cadpose.library.limits import DEFAULT_LIMITS, MIB, Limits
from cadpose.library.mesh import Material, Mesh
from cadpose.library.mtl import MtlMaterial, parse_mtl
from cadpose.library.parts import Part, assemble, colour_palette
from cadpose.library.textures import TextureBudget, with_alpha_map

log = logging.getLogger(__name__)

MESH_SUFFIXES = (".obj", ".glb", ".gltf", ".ply", ".stl")
_MTLLIB = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
_USEMTL = re.compile(r"^[ \t]*usemtl[ \t]+([^\r\n]+)", re.MULTILINE)


def load_mesh_file(
    path: Path,
    *,
    root: Path | None = None,
    limits: Limits = DEFAULT_LIMITS,
    warn: Callable[[str], None] | None = None,
) -> Mesh:
    """Load one mesh file from disk.

    Args:
        path: An .obj, .glb, .gltf, .ply or .stl file.
        root: Materials and textures are read from below this folder only; by default the file's own.
        limits: Caps on size.
        warn: Told of everything that was mended, without the file's name; by default it goes to the log.

    Returns:
        The mesh in the file's axes and units, its bounding box centred at the origin.

    Raises:
        InputError: the file cannot be used; the message says why.
    """
    assets = FolderAssets(path, root)
    return load_mesh(read_capped(path, limits.file_bytes), path.name, assets, limits=limits, warn=warn)


def load_mesh(
    data: bytes,
    name: str,
    assets: Assets,
    *,
    limits: Limits = DEFAULT_LIMITS,
    warn: Callable[[str], None] | None = None,
) -> Mesh:
    """As `load_mesh_file`, from bytes; ``name``'s ending tells the format."""
    suffix = Path(name).suffix.lower()
    told: set[str] = set()

    def tell(message: str) -> None:
        if message not in told:
            told.add(message)
            if warn is None:
                log.warning("%s: %s", name, message)
            else:
                warn(message)

    if len(data) > limits.file_bytes:
        raise InputError(f"{name} is larger than the {limits.file_bytes // MIB} MiB allowed.")
    if not data:
        raise InputError(f"{name} is empty (0 bytes).")
    try:
        if suffix == ".obj":
            parts = _obj_parts(data, name, assets, limits, tell)
        elif suffix in (".glb", ".gltf"):
            parts = gltf.load_parts(data, name, assets, limits, tell)
        elif suffix == ".ply":
            parts = _ply_parts(data, name, limits)
        elif suffix == ".stl":
            parts = _stl_parts(data, name, limits)
        else:
            raise InputError(f"{name} is not a mesh format that can be read ({', '.join(MESH_SUFFIXES)}).")
        return assemble(parts, name, limits, tell)
    except (InputError, MemoryError, KeyboardInterrupt):
        raise
    except Exception as error:  # decoders of hostile bytes raise whatever their parser met
        reason = f"{type(error).__name__}: {error}"
        raise InputError(f"{name} is damaged or no {suffix[1:]} file ({reason}).") from error


_FACE_LINE = re.compile(r"^[^\S\n]*f[^\n]*", re.MULTILINE)
_WORD = re.compile(r"\S+")


def _more_triangles_than(most: int, text: str) -> bool:
    """Whether the faces fan out to more triangles; a line of millions of corners is never split whole."""
    total = 0
    for match in _FACE_LINE.finditer(text):
        start, end = match.span()
        if end - start < 4096:
            words = len(match[0].split())
        else:
            words = sum(1 for _ in islice(_WORD.finditer(text, start, end), most - total + 4))
        total += max(words - 3, 1)
        if total > most:
            return True
    return False


class _Materials(dict[str, bytes]):
    """Answers every name that trimesh asks for with one material file of bare names."""

    def __init__(self, names: list[str]) -> None:
        super().__init__()
        self._text = "".join(f"newmtl {n}\n" for n in names).encode()

    def __missing__(self, key: str) -> bytes:
        return self._text


def _obj_parts(
    data: bytes, name: str, assets: Assets, limits: Limits, warn: Callable[[str], None]
) -> list[Part]:
    if b"\0" in data[:4096]:
        raise InputError(f"{name} is not an OBJ file: it holds binary data.")
    if data.count(b"\nv ") > limits.vertices:
        raise InputError(f"{name} has more than the {limits.vertices} vertices allowed.")
    # Every line ending and continuation is made plain first: the counts hold for what trimesh will see.
    text = data.decode("utf-8", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    text = text.replace("\\\n", "")
    if _more_triangles_than(limits.faces, text):
        raise InputError(f"{name} has more than the {limits.faces} faces allowed.")
    if not re.search(r"^f[ \t]", text, re.MULTILINE):
        raise InputError(f"{name} has no faces; only surfaces can be drawn.")
    # The statement "v nan 0 0" would make trimesh drop the vertices in silence.
    if re.search(r"^v[ \t][-+.eE\d \t]*(nan|inf)", text, re.MULTILINE | re.IGNORECASE):
        raise InputError(f"{name} has vertices that are not finite numbers (NaN or infinity).")
    described = _read_mtl(data, name, assets, limits, warn)
    used = list(dict.fromkeys(m.strip() for m in _USEMTL.findall(text)))
    if len(used) > limits.materials:
        raise InputError(f"{name} has more than the {limits.materials} materials allowed.")
    absent = [m for m in used if m not in described]
    if absent and described:
        warn(f"material {absent[0]!r} is not in the material file; it is drawn grey")
    # trimesh reads the material file named first; ours holds the names alone.
    text = _split_by_coordinates(_absolute_indices(_MTLLIB_TEXT.sub("", text)))
    loaded = load_obj(
        io.BytesIO(("mtllib names.mtl\n" + text).encode()),
        resolver=_Materials(list(dict.fromkeys(m.strip() for m in _USEMTL.findall(text))) or ["none"]),
    )
    textures = _Textures(assets, TextureBudget(limits), warn)
    names = set(used)
    made = {n: _material(m, textures) for n, m in described.items() if n in names}
    parts = []
    for piece in (loaded.get("geometry") or {}).values():
        visual = piece.get("visual")
        source = str(getattr(getattr(visual, "material", None), "name", "")).removesuffix(_PLAIN)
        part = _plain_part(piece, getattr(visual, "uv", None), made.get(source, Material()))
        colours = piece.get("vertex_colors")
        if colours is not None and source not in made:
            part = colour_palette(part, np.asarray(colours))
        parts.append(part)
    return parts


_MTLLIB_TEXT = re.compile(r"^[ \t]*mtllib[ \t][^\r\n]*", re.MULTILINE)


_PLAIN = "|without coordinates"


def _split_by_coordinates(text: str) -> str:
    """Faces without texture coordinates moved to a material of their own.

    trimesh drops the coordinates of a whole material if one of its faces has none.
    """
    textured = re.search(r"^f[ \t]+\d+/\d", text, re.MULTILINE)
    if not textured or not re.search(r"^f[ \t]+\d+(//|[ \t])", text, re.MULTILINE):
        return text
    lines: list[str] = []
    material, plain = "none", False
    for line in text.split("\n"):
        if line.startswith("usemtl"):
            material, plain = line[6:].strip() or "none", False
        elif line.startswith("f"):
            corner = line[1:].split(None, 1)[0].split("/") if line[1:].strip() else [""]
            if (len(corner) < 2 or not corner[1]) != plain:
                plain = not plain
                lines.append(f"usemtl {material}{_PLAIN if plain else ''}")
        lines.append(line)
    return "\n".join(lines)


def _absolute_indices(text: str) -> str:
    """Relative (negative) face indices made absolute; trimesh counts them from the end of the file."""
    if not re.search(r"^[ \t]*f[ \t].*-\d", text, re.MULTILINE):
        return text
    seen = {"v": 0, "vt": 0, "vn": 0}
    lines = text.split("\n")
    for i, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        if words[0] in seen:
            seen[words[0]] += 1
        elif words[0] == "f" and "-" in line:
            corners = []
            for corner in words[1:]:
                fields = corner.split("/")
                for k, (field, kind) in enumerate(zip(fields, seen, strict=False)):
                    if field.startswith("-"):
                        fields[k] = str(seen[kind] + 1 + int(field))
                corners.append("/".join(fields))
            lines[i] = "f " + " ".join(corners)
    return "\n".join(lines)


def _read_mtl(
    data: bytes, name: str, assets: Assets, limits: Limits, warn: Callable[[str], None]
) -> dict[str, MtlMaterial]:
    described: dict[str, MtlMaterial] = {}
    for match in _MTLLIB.findall(data)[:16]:
        written = match.decode("utf-8", errors="replace").strip()
        # The format allows several files in one statement, and many exporters put blanks into one name.
        found = [assets.read(written, limits.texture_bytes)]
        if found[0] is None and " " in written:
            found = [assets.read(w, limits.texture_bytes) for w in written.split()]
        if all(f is None for f in found):
            warn(f"material file {written[:120]!r} is missing; the model is drawn grey")
        for content in found:
            if content is not None:
                described |= parse_mtl(content.decode("utf-8", errors="replace"))
    return described


@dataclass
class _Textures:
    """One model's textures by the names its materials give, each made once under one budget."""

    assets: Assets
    budget: TextureBudget
    warn: Callable[[str], None]
    _images: dict[tuple[str, str | None], NDArray[np.uint8] | None] = field(default_factory=dict)

    def get(self, map_kd: str, map_d: str | None = None) -> NDArray[np.uint8] | None:
        """The colour texture, with the opacity map as its alpha where there is one."""
        key = (map_kd, map_d)
        if key not in self._images:
            self._images[key] = self._combined(map_kd, map_d) if map_d else self._decoded(map_kd)
        return self._images[key]

    def _combined(self, map_kd: str, map_d: str) -> NDArray[np.uint8] | None:
        texture = self.get(map_kd)
        alpha = None if texture is None else self.get(map_d)
        if texture is None or alpha is None:
            return texture
        try:
            self.budget.charge(texture, map_kd)
        except InputError as error:
            self.warn(f"{str(error).rstrip('.')}; its opacity map is left out")
            return texture
        return with_alpha_map(texture, alpha)

    def _decoded(self, written: str) -> NDArray[np.uint8] | None:
        content = self.assets.read(written, self.budget.limits.texture_bytes)
        if content is None:
            self.warn(f"texture {written[:120]!r} is missing; the material's colour is used")
            return None
        try:
            return self.budget.decode(content, written)
        except InputError as error:
            self.warn(f"{str(error).rstrip('.')}; the material's colour is used")
            return None


def _material(source: MtlMaterial, textures: _Textures) -> Material:
    texture = textures.get(source.map_kd, source.map_d) if source.map_kd else None
    colour = (1.0, 1.0, 1.0) if texture is not None else source.kd
    return Material((*colour, source.alpha), texture, source.name)


def _plain_part(piece: dict[str, Any], uv: Any, material: Material) -> Part:
    normals = piece.get("vertex_normals")
    return Part(
        vertices=np.asarray(piece["vertices"], dtype=np.float64),
        faces=triangulate_quads(piece["faces"]).reshape(-1, 3),
        normals=None if normals is None else np.asarray(normals, dtype=np.float64),
        uv=None if uv is None else np.asarray(uv, dtype=np.float64),
        material=material,
    )


def _ply_parts(data: bytes, name: str, limits: Limits) -> list[Part]:
    end = data[:65536].find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise InputError(f"{name} is not a PLY file: its header is missing.")
    for line in data[:end].splitlines():
        words = line.split()
        if words[:1] == [b"element"]:
            if len(words) < 3 or not words[2].isdigit():
                raise InputError(f"{name} is damaged: its PLY header does not count its elements.")
            # Every element takes at least a byte, so a larger count is a lie.
            count = int(words[2])
            if count > min(len(data), limits.vertices):
                raise InputError(f"{name} announces {count} elements, more than it holds or than is allowed.")
            if words[1] == b"face" and count > limits.faces:
                raise InputError(f"{name} has more than the {limits.faces} faces allowed.")
    piece = load_ply(io.BytesIO(data), resolver=None, skip_materials=True)
    if piece.get("faces") is None or not len(piece["faces"]):
        raise InputError(f"{name} has no faces; only surfaces can be drawn.")
    part = _plain_part(piece, None, Material())
    colours = piece.get("vertex_colors")
    return [part if colours is None else colour_palette(part, np.asarray(colours))]


def _stl_parts(data: bytes, name: str, limits: Limits) -> list[Part]:
    announced = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    binary = len(data) >= 84 + 50 * announced and not data[:512].lstrip().startswith(b"solid")
    count = announced if binary else data.count(b"facet normal")
    if count > limits.faces:
        raise InputError(f"{name} has more than the {limits.faces} faces allowed.")
    piece = load_stl(io.BytesIO(data))
    if "vertices" not in piece:
        raise InputError(f"{name} has no faces; only surfaces can be drawn.")
    return [_plain_part({"vertices": piece["vertices"], "faces": piece["faces"]}, None, Material())]
