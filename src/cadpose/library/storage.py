"""One mesh as one .npz: compact arrays, textures as PNG or JPEG bytes, read without pickle."""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import LibraryError
from cadpose.library.mesh import Material, Mesh
from cadpose.library.textures import decode_stored, encode_texture

log = logging.getLogger(__name__)

FORMAT = 1


def mesh_to_bytes(mesh: Mesh) -> bytes:
    """The stored form; the same mesh always gives the same bytes."""
    index = np.uint16 if len(mesh.vertices) <= 65536 else np.uint32
    textured = np.array([m.texture is not None for m in mesh.materials])[mesh.face_material]
    textures: dict[int, int] = {}
    encoded: list[bytes] = []
    described = []
    for material in mesh.materials:
        slot = -1
        if material.texture is not None:
            if id(material.texture) not in textures:
                textures[id(material.texture)] = len(encoded)
                encoded.append(encode_texture(material.texture))
            slot = textures[id(material.texture)]
        described.append({"name": material.name[:120], "rgba": list(material.rgba), "texture": slot})
    header = json.dumps({"format": FORMAT, "materials": described})
    arrays: dict[str, NDArray[np.generic]] = {
        "header": np.frombuffer(header.encode(), dtype=np.uint8),
        "vertices": mesh.vertices,
        "faces": mesh.faces.astype(index),
        # 16 bits a component: 0.002 degrees, half the bytes.
        "normals": np.rint(mesh.corner_normals * 32767.0).astype(np.int16),
        "face_material": mesh.face_material.astype(np.uint8 if len(mesh.materials) <= 256 else np.int32),
        # Coordinates of untextured faces are never looked at.
        "uv": mesh.corner_uv[textured],
    }
    for number, image in enumerate(encoded):
        arrays[f"texture{number}"] = np.frombuffer(image, dtype=np.uint8)
    out = io.BytesIO()
    np.savez(out, allow_pickle=False, **arrays)
    return out.getvalue()


def mesh_from_file(path: Path) -> Mesh:
    """What `mesh_to_bytes` wrote.

    Raises:
        LibraryError: the file is missing, damaged or of another format; the message leaves it to the
            caller to name the model.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            header = json.loads(data["header"].tobytes())
            if header["format"] != FORMAT:
                raise LibraryError(f"The mesh file has format {header['format']}; add the model again.")
            images = {
                slot: decode_stored(data[f"texture{slot}"].tobytes())
                for slot in {m["texture"] for m in header["materials"]}
                if slot >= 0
            }
            materials = tuple(
                Material(tuple(m["rgba"]), images.get(m["texture"]), m["name"]) for m in header["materials"]
            )
            face_material = data["face_material"].astype(np.int32)
            textured = np.array([m.texture is not None for m in materials])[face_material]
            uv = np.zeros((len(face_material), 3, 2), dtype=np.float32)
            uv[textured] = data["uv"]
            return Mesh(
                vertices=data["vertices"],
                faces=data["faces"].astype(np.int32),
                corner_normals=data["normals"].astype(np.float32) * np.float32(1 / 32767),
                corner_uv=uv,
                face_material=face_material,
                materials=materials,
            )
    except LibraryError:
        raise
    except (OSError, KeyError, ValueError, IndexError, EOFError, TypeError, zipfile.BadZipFile) as error:
        log.debug("%s", path, exc_info=True)
        # Errors of the system name the path, which has no place in results that are passed on.
        reason = error.strerror or type(error).__name__ if isinstance(error, OSError) else error
        raise LibraryError(f"The mesh file is missing or damaged ({reason}); add the model again.") from error


def sha256_of(data: bytes) -> str:
    """Hex digest."""
    return hashlib.sha256(data).hexdigest()


def write_atomic(path: Path, data: bytes) -> None:
    """Write beside, flush to disk, move into place: the file is whole or not there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, temporary = tempfile.mkstemp(prefix=".part-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
