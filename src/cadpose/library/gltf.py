"""glTF and GLB: the header is judged, then trimesh decodes geometry from bytes we hand it.

trimesh never sees a path or an image: buffers come from `Assets`, materials are replaced by their index.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.gltf import load_gltf

from cadpose.errors import InputError
from cadpose.library.assets import Assets
from cadpose.library.limits import Limits
from cadpose.library.mesh import Material
from cadpose.library.parts import Part, colour_palette
from cadpose.library.textures import TextureBudget

_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_DEEPEST = 256
# Extensions that leave the geometry readable as it is.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights", "EXT_texture_", "KHR_mesh_quantization")


def load_parts(
    data: bytes, name: str, assets: Assets, limits: Limits, warn: Callable[[str], None]
) -> list[Part]:
    """Triangles of the default scene with world transforms applied.

    Raises:
        InputError: not glTF 2, over a limit, compressed, or a buffer is missing or outside the folder.
    """
    header, binary = _split(data, name)
    required = header.get("extensionsRequired") or []
    for extension in required:
        if not str(extension).startswith(_HARMLESS):
            raise InputError(
                f"{name} needs the glTF extension {extension}, which is not supported; export it plain."
            )
    buffers = _buffers(header, binary, name, assets, limits)
    _judge(header, buffers, name, limits)
    if len(header.get("materials") or []) > limits.materials:
        raise InputError(f"{name} has more than the {limits.materials} materials allowed.")
    materials = _Materials(header, buffers, name, assets, TextureBudget(limits), warn)
    plain = dict(header)
    plain["materials"] = [{"name": str(i)} for i in range(len(header.get("materials") or []))]
    for key in ("images", "textures", "samplers", "animations", "skins", "extensions", "extensionsUsed"):
        plain.pop(key, None)
    plain["buffers"] = [{"uri": f"buffer{i}", "byteLength": len(b)} for i, b in enumerate(buffers)]
    held = {f"buffer{i}": b for i, b in enumerate(buffers)}
    loaded = load_gltf(io.BytesIO(json.dumps(plain).encode()), resolver=held)
    return _assemble(loaded, materials, name, limits)


def _split(data: bytes, name: str) -> tuple[dict[str, Any], bytes | None]:
    text, binary = data, None
    if data[:4] == b"glTF":
        if len(data) < 20:
            raise InputError(f"{name} is cut off inside its GLB header.")
        _, version, _, size, kind = struct.unpack("<4s4I", data[:20])
        if version != 2 or kind != 0x4E4F534A or 20 + size > len(data):
            raise InputError(f"{name} is not a whole GLB 2.0 file.")
        text, at = data[20 : 20 + size], 20 + size
        while at + 8 <= len(data):
            size, kind = struct.unpack("<II", data[at : at + 8])
            if at + 8 + size > len(data):
                raise InputError(f"{name} is cut off inside a GLB chunk.")
            if kind == 0x004E4942 and binary is None:
                binary = data[at + 8 : at + 8 + size]
            at += 8 + size
    try:
        header = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name} is not glTF: its header is no JSON ({error}).") from error
    if not isinstance(header, dict) or not isinstance(header.get("asset", {}), dict):
        raise InputError(f"{name} is not glTF: its header is no JSON object.")
    version_text = str(header.get("asset", {}).get("version", "2.0"))
    if not version_text.startswith("2"):
        raise InputError(f"{name} is glTF {version_text}; only glTF 2 is supported.")
    return header, binary


def _uri_bytes(uri: str, assets: Assets, limit: int, name: str) -> bytes | None:
    if uri.startswith("data:"):
        _, _, payload = uri.partition(",")
        if len(payload) > limit * 4 // 3 + 4:
            raise InputError(f"{name} holds an embedded file of more than the {limit >> 20} MiB allowed.")
        try:
            return base64.b64decode(payload)
        except (binascii.Error, ValueError) as error:
            raise InputError(f"{name} holds an embedded file that is no base64 ({error}).") from error
    return assets.read(uri, limit)


def _buffers(
    header: dict[str, Any], binary: bytes | None, name: str, assets: Assets, limits: Limits
) -> list[bytes]:
    buffers: list[bytes] = []
    left = limits.file_bytes
    for index, info in enumerate(header.get("buffers") or []):
        if "uri" in info:
            found = _uri_bytes(str(info["uri"]), assets, left, name)
            if found is None:
                raise InputError(f"{name} needs {str(info['uri'])[:120]!r}, which is not there.")
        elif index == 0 and binary is not None:
            found = binary
        else:
            raise InputError(f"{name} has a buffer without content.")
        left -= len(found)
        buffers.append(found)
    return buffers


def _natural(value: Any, name: str, what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise InputError(f"{name} is damaged: {what} is {value!r}.")
    return value


def _judge(header: dict[str, Any], buffers: list[bytes], name: str, limits: Limits) -> None:
    """Every accessor stays inside its view and all together below the limits, before numpy allocates."""
    views = header.get("bufferViews") or []
    for view in views:
        index = _natural(view.get("buffer"), name, "a buffer's number")
        end = _natural(view.get("byteOffset", 0), name, "an offset") + _natural(
            view.get("byteLength"), name, "a length"
        )
        if index >= len(buffers) or end > len(buffers[index]):
            raise InputError(f"{name} is damaged: a buffer view ends beyond its buffer.")
    total = 0
    for accessor in header.get("accessors") or []:
        count = _natural(accessor.get("count"), name, "an accessor's count")
        width = _COMPONENT_BYTES.get(accessor.get("componentType"), 4) * _COMPONENTS.get(
            accessor.get("type"), 16
        )
        total += count * width
        if "sparse" in accessor:
            raise InputError(f"{name} uses sparse accessors, which are not supported; export it plain.")
        if "bufferView" in accessor:
            view_index = _natural(accessor["bufferView"], name, "a view's number")
            if view_index >= len(views) or count * width > views[view_index]["byteLength"] + width:
                raise InputError(f"{name} is damaged: an accessor reaches beyond its buffer view.")
        elif count:
            raise InputError(f"{name} is damaged or compressed: an accessor has no buffer view.")
    if total > 2 * limits.file_bytes:
        raise InputError(f"{name} describes {total >> 20} MiB of geometry, more than is allowed.")


@dataclass
class _Materials:
    """Materials by index, textures decoded once under one budget."""

    header: dict[str, Any]
    buffers: list[bytes]
    name: str
    assets: Assets
    budget: TextureBudget
    warn: Callable[[str], None]
    _images: dict[int, NDArray[np.uint8] | None] = field(default_factory=dict)
    _without_alpha: dict[int, NDArray[np.uint8] | None] = field(default_factory=dict)
    _done: dict[int, Material] = field(default_factory=dict)

    def get(self, index: int) -> Material:
        if index not in self._done:
            self._done[index] = self._make(index)
        return self._done[index]

    def _make(self, index: int) -> Material:
        source = (self.header.get("materials") or [])[index]
        pbr = source.get("pbrMetallicRoughness") or {}
        factor, slot = pbr.get("baseColorFactor"), pbr.get("baseColorTexture")
        gloss = (source.get("extensions") or {}).get("KHR_materials_pbrSpecularGlossiness")
        if gloss:
            factor, slot = gloss.get("diffuseFactor", factor), gloss.get("diffuseTexture", slot)
        linear = np.ones(4)
        if isinstance(factor, list) and len(factor) in (3, 4):
            linear[: len(factor)] = np.nan_to_num(np.asarray(factor, dtype=np.float64))
        linear = np.clip(linear, 0.0, 1.0)
        r, g, b = srgb_from_linear(linear[:3])
        opaque = source.get("alphaMode", "OPAQUE") == "OPAQUE"
        alpha = 1.0 if opaque else float(linear[3])
        texture = self._texture(slot, opaque) if isinstance(slot, dict) else None
        return Material(
            (float(r), float(g), float(b), alpha), texture, str(source.get("name", f"material {index}"))
        )

    def _texture(self, slot: dict[str, Any], opaque: bool) -> NDArray[np.uint8] | None:
        textures, images = self.header.get("textures") or [], self.header.get("images") or []
        number = slot.get("index")
        if not isinstance(number, int) or not 0 <= number < len(textures):
            return None
        entry = textures[number]
        webp = (entry.get("extensions") or {}).get("EXT_texture_webp") or {}
        image = webp.get("source", entry.get("source"))
        if not isinstance(image, int) or not 0 <= image < len(images):
            return None
        if image not in self._images:
            self._images[image] = self._image(image, images[image])
        texture = self._images[image]
        if not opaque or texture is None or texture.shape[2] == 3:
            return texture
        if image not in self._without_alpha:
            self._without_alpha[image] = self._stripped(texture, str(image))
        return self._without_alpha[image]

    def _stripped(self, texture: NDArray[np.uint8], label: str) -> NDArray[np.uint8] | None:
        try:
            self.budget.charge(texture, label)
        except InputError as error:
            self.warn(f"{str(error).rstrip('.')}; the material's colour is used")
            return None
        return np.ascontiguousarray(texture[..., :3])

    def _image(self, index: int, info: dict[str, Any]) -> NDArray[np.uint8] | None:
        label = str(info.get("name") or info.get("uri") or index)[:80]
        data: bytes | None = None
        views = self.header.get("bufferViews") or []
        view_index = info.get("bufferView")
        if isinstance(view_index, int) and 0 <= view_index < len(views):
            view = views[view_index]
            start = view.get("byteOffset", 0)
            data = self.buffers[view["buffer"]][start : start + view["byteLength"]]
        elif "uri" in info:
            data = _uri_bytes(str(info["uri"]), self.assets, self.budget.limits.texture_bytes, self.name)
        if data is None:
            self.warn(f"texture {label} is missing; the material's colour is used")
            return None
        try:
            return self.budget.decode(data, label)
        except InputError as error:
            self.warn(f"{str(error).rstrip('.')}; the material's colour is used")
            return None


def srgb_from_linear(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light in [0, 1] to the sRGB curve (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def _assemble(loaded: dict[str, Any], materials: _Materials, name: str, limits: Limits) -> list[Part]:
    geometry: dict[str, dict[str, Any]] = loaded.get("geometry") or {}
    edges = {
        str(e["frame_to"]): (str(e.get("frame_from", "world")), np.asarray(e.get("matrix", np.eye(4))))
        for e in loaded.get("graph") or []
    }
    parts: list[Part] = []
    total = 0
    for edge in loaded.get("graph") or []:
        key = edge.get("geometry")
        if key is None or "faces" not in geometry.get(key, {}):
            continue
        piece = geometry[key]
        total += len(piece["faces"])
        if total > limits.faces:
            raise InputError(f"{name} has more than the {limits.faces} faces allowed.")
        matrix, frame, seen = np.eye(4), str(edge["frame_to"]), set[str]()
        while frame in edges and frame not in seen:
            seen.add(frame)
            if len(seen) > _DEEPEST:
                raise InputError(f"{name} nests its nodes more than {_DEEPEST} deep.")
            parent, step = edges[frame]
            matrix, frame = step @ matrix, parent
        parts.append(_part(piece, materials).transformed(matrix))
    return parts


def _part(piece: dict[str, Any], materials: _Materials) -> Part:
    visual = piece.get("visual")
    uv, material = None, Material()
    if visual is not None:
        uv = getattr(visual, "uv", None)
        material = materials.get(int(visual.material.name))
    if uv is not None and np.issubdtype(np.asarray(uv).dtype, np.integer):
        # trimesh flips v as 1 - v in the integer type; undo that and apply glTF's normalisation.
        top = float(np.iinfo(uv.dtype).max)
        uv = np.stack([uv[:, 0] / top, 1.0 - (1 - uv[:, 1]).astype(uv.dtype) / top], axis=1)
    colours = piece.get("vertex_colors")
    if colours is None and visual is not None:
        colours = (getattr(visual, "vertex_attributes", None) or {}).get("color")
    part = Part(
        vertices=np.asarray(piece["vertices"], dtype=np.float64),
        faces=np.asarray(piece["faces"], dtype=np.int64),
        normals=None if piece.get("vertex_normals") is None else np.asarray(piece["vertex_normals"]),
        uv=None if uv is None else np.asarray(uv, dtype=np.float64),
        material=material,
    )
    if colours is not None and material.texture is None:
        return colour_palette(part, np.asarray(colours), linear=True)
    return part
