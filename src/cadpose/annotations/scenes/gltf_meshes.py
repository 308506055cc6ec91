"""CAD models as glTF meshes: geometry, materials, each texture once; and a model alone as a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from cadpose.annotations.scenes.extras import GENERATOR
from cadpose.annotations.scenes.glb import GlbBuilder
from cadpose.annotations.scenes.pieces import Piece, pieces_of
from cadpose.annotations.scenes.shades import linear_from_srgb
from cadpose.library.mesh import Mesh
from cadpose.library.textures import encode_texture
from cadpose.rendering.scene import MaterialKind

_ALPHA_MODE = {MaterialKind.OPAQUE: "OPAQUE", MaterialKind.CUTOUT: "MASK", MaterialKind.GLASS: "BLEND"}
_REPEAT, _CLAMP, _LINEAR, _MIPMAPS = 10497, 33071, 9729, 9987

#: The file's samplers: the first one repeats a texture, the second does not.
SAMPLERS: tuple[dict[str, int], ...] = tuple(
    {"magFilter": _LINEAR, "minFilter": _MIPMAPS, "wrapS": wrap, "wrapT": wrap} for wrap in (_REPEAT, _CLAMP)
)


@dataclass
class MeshWriter:
    """Adds models to a glTF file that has ``SAMPLERS``.

    Attributes:
        glb: The file.
    """

    glb: GlbBuilder
    _textures: dict[int, int] = field(default_factory=dict)

    def mesh(self, name: str, pieces: Sequence[Piece]) -> int:
        """A model's mesh, a primitive a material; its index."""
        primitives = [self._primitive(piece) for piece in pieces]
        return self.glb.add("meshes", {"name": name, "primitives": primitives})

    def _primitive(self, piece: Piece) -> dict[str, Any]:
        attributes = {
            "POSITION": self.glb.vectors(piece.vertices, bounds=True),
            "NORMAL": self.glb.vectors(piece.normals),
        }
        if piece.uv is not None:
            # glTF counts v from the top.
            attributes["TEXCOORD_0"] = self.glb.vectors(piece.uv * (1, -1) + (0, 1))
        return {
            "attributes": attributes,
            "indices": self.glb.indices(piece.faces),
            "material": self._material(piece),
        }

    def _material(self, piece: Piece) -> int:
        red, green, blue = linear_from_srgb(piece.material.rgba[:3])
        surface: dict[str, Any] = {
            "baseColorFactor": [red, green, blue, piece.material.rgba[3]],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.8,
        }
        if piece.material.texture is not None:
            surface["baseColorTexture"] = {"index": self._texture(piece)}
        told: dict[str, Any] = {
            "name": piece.material.name,
            "pbrMetallicRoughness": surface,
            "doubleSided": True,
            "alphaMode": _ALPHA_MODE[piece.kind],
        }
        return self.glb.add("materials", told)

    def _texture(self, piece: Piece) -> int:
        texture = piece.material.texture
        assert texture is not None
        if id(texture) not in self._textures:
            data = encode_texture(texture)
            kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
            image = self.glb.add("images", {"mimeType": kind, "bufferView": self.glb.blob(data)})
            self._textures[id(texture)] = self.glb.add("textures", {"source": image, "sampler": 0})
        return self._textures[id(texture)]


def single_mesh_glb(mesh: Mesh, name: str = "") -> bytes:
    """A mesh alone as a binary glTF file, in its own axes and units; invisible materials are left out.

    Args:
        mesh: The mesh.
        name: What to call it.
    """
    header = {"asset": {"version": "2.0", "generator": GENERATOR}, "scene": 0, "samplers": list(SAMPLERS)}
    glb = GlbBuilder(header)
    pieces = pieces_of(mesh)
    node: dict[str, Any] = {"name": name}
    if pieces:  # a mesh without primitives is not valid glTF
        node["mesh"] = MeshWriter(glb).mesh(name, pieces)
    glb.add("scenes", {"nodes": [glb.add("nodes", node)]})
    return glb.to_bytes()
