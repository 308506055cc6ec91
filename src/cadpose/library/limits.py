"""How much one untrusted model or archive may cost before it is refused."""

from __future__ import annotations

from dataclasses import dataclass

MIB = 1024 * 1024


@dataclass(frozen=True, slots=True)
class Limits:
    """Caps that are checked before anything is decoded.

    Attributes:
        file_bytes: One mesh file, or one buffer it names.
        faces: Triangles of one model, after triangulation and instancing.
        vertices: Vertices of one model.
        materials: Materials of one model; decoders pass over all vertices for each.
        textures: Texture images of one model.
        texture_bytes: One encoded texture image.
        texture_pixels: One texture image, width times height.
        total_pixels: All textures of one model together, counting those made of two.
        texture_side: Longer side a texture is stored with; larger ones are reduced.
        archive_entries: Files in one archive.
        archive_bytes: What one archive says it unpacks to.
        archive_ratio: Unpacked over packed size of one entry of more than a megabyte.
    """

    file_bytes: int = 192 * MIB
    faces: int = 2_000_000
    vertices: int = 4_000_000
    materials: int = 1024
    textures: int = 128
    texture_bytes: int = 48 * MIB
    texture_pixels: int = 64_000_000
    total_pixels: int = 256_000_000
    texture_side: int = 1024
    archive_entries: int = 50_000
    archive_bytes: int = 4096 * MIB
    archive_ratio: int = 200


DEFAULT_LIMITS = Limits()
