from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.loading import load_mesh, load_mesh_file

from .builders import (
    NoAssets,
    glb,
    png,
    triangle_gltf,
)


def test_glb_colour_transform_and_mirror() -> None:
    moved = {"mesh": 0, "translation": [0, 0, 3], "scale": [-1, 1, 1]}
    header, binary = triangle_gltf(nodes=[moved, {"mesh": 0}], scenes=[{"nodes": [0, 1]}])
    mesh = load_mesh(glb(header, binary), "t.glb", NoAssets())
    assert mesh.bounds.tolist() == [[-2, -0.5, -1.5], [2, 0.5, 1.5]]
    corners = mesh.vertices[mesh.faces]
    assert (corners[..., 0] * corners[..., 2] <= 0).all()
    # Linear 0.5 is 0.735 on the sRGB curve.
    assert mesh.materials[0].rgba == pytest.approx((0.7353569, 0.0, 1.0, 1.0), abs=1e-5)
    a, b, c = corners.swapaxes(0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def textured_gltf(image: bytes) -> dict[str, Any]:
    """One triangle whose texture and buffer are embedded."""
    header, binary = triangle_gltf()
    uv = np.array([[0, 0], [1, 0], [0, 1]], dtype="<f4").tobytes()
    header["buffers"] = [
        {"uri": "data:application/octet-stream;base64," + base64.b64encode(binary + uv).decode()}
    ]
    header["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(uv)})
    header["accessors"].append({"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"})
    header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 1
    header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    header["textures"] = [{"source": 0}]
    header["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(image).decode()}]
    return header


def test_gltf_with_embedded_buffer_and_texture() -> None:
    mesh = load_mesh(json.dumps(textured_gltf(png((9, 8, 7)))).encode(), "t.gltf", NoAssets())
    texture = mesh.materials[0].texture
    assert texture is not None
    assert texture[0, 0].tolist() == [9, 8, 7]
    # glTF counts v from the top, a Mesh from the bottom.
    at_origin = np.argmin(np.abs(mesh.vertices[mesh.faces[0]]).sum(axis=1))
    assert mesh.corner_uv[0, at_origin] == pytest.approx((0.0, 1.0))


def test_gltf_materials_share_the_texture_without_its_alpha() -> None:
    header = textured_gltf(png((9, 8, 7, 100)))
    first = header["meshes"][0]["primitives"][0]
    header["meshes"][0]["primitives"] = [first | {"material": i} for i in range(4)]
    plain, blend = header["materials"][0], {"alphaMode": "BLEND"}
    header["materials"] = [plain, plain | {"name": "b"}, plain | blend, plain | blend]
    factor = {"baseColorFactor": [1, 0, 0, 1]}
    header["materials"][1] = {"pbrMetallicRoughness": plain["pbrMetallicRoughness"] | factor}
    mesh = load_mesh(json.dumps(header).encode(), "t.gltf", NoAssets())
    textures = [m.texture for m in mesh.materials if m.texture is not None]
    assert sorted(t.shape[2] for t in textures) == [3, 3, 4]
    assert len({id(t) for t in textures}) == 2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"buffers": [{"uri": "../../etc/passwd", "byteLength": 36}]}, "outside"),
        ({"buffers": [{"uri": "http://example.org/x.bin", "byteLength": 36}]}, "not there"),
        ({"accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}]}, "no buffer view"),
        ({"accessors": [{"componentType": 5126, "count": 10**12, "type": "VEC3"}]}, "no buffer view"),
        (
            {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 10**9, "type": "VEC3"}]},
            "beyond its buffer view",
        ),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10**9}]}, "beyond its buffer"),
        ({"bufferViews": [{"buffer": -1, "byteLength": 4}]}, "damaged"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression"),
        ({"meshes": []}, "no faces"),
        ({"nodes": [{"children": [0]}]}, "no faces"),
    ],
)
def test_bad_gltf(tmp_path: Path, changes: dict[str, object], says: str) -> None:
    header, binary = triangle_gltf(**changes)
    (tmp_path / "t.glb").write_bytes(glb(header, binary))
    with pytest.raises(InputError, match=says):
        load_mesh_file(tmp_path / "t.glb")


def test_instances_are_counted() -> None:
    nodes = [{"mesh": 0} for _ in range(50)]
    header, binary = triangle_gltf(nodes=nodes, scenes=[{"nodes": list(range(50))}])
    with pytest.raises(InputError, match="more than the 20 faces"):
        load_mesh(glb(header, binary), "t.glb", NoAssets(), limits=replace(DEFAULT_LIMITS, faces=20))


def test_gltf_image_outside_the_folder_is_refused(tmp_path: Path) -> None:
    header, binary = triangle_gltf(
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"uri": "../%2e%2e/secret.png"}],
    )
    (tmp_path / "t.glb").write_bytes(glb(header, binary))
    with pytest.raises(InputError, match="outside"):
        load_mesh_file(tmp_path / "t.glb")
