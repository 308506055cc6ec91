from __future__ import annotations

import io
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Material
from cadpose.rendering import blender, blender_worker
from cadpose.rendering.blender import BlenderRenderer, blender_python
from cadpose.rendering.blender_worker import read_exr, read_message, to_linear, to_srgb, write_message
from cadpose.rendering.lights import STUDIO
from cadpose.rendering.raster import Rasteriser
from tests.rendering.shapes import QUAD_UV, cube, front_camera, mesh_of, quad, sphere


def test_messages_arrive_as_they_were_sent() -> None:
    stream = io.BytesIO()
    arrays = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "empty": np.zeros((0, 4), np.int32)}
    write_message(stream, {"do": "x"}, arrays)
    write_message(stream, {"do": "y"})
    stream.seek(0)
    message = read_message(stream)
    assert message is not None
    assert message[0] == {"do": "x"}
    for name, array in arrays.items():
        assert message[1][name].dtype == array.dtype
        np.testing.assert_array_equal(message[1][name], array)
    assert read_message(stream) == ({"do": "y"}, {})
    assert read_message(stream) is None


@pytest.mark.parametrize(
    "data",
    [
        struct.pack(">I", 1 << 30),
        struct.pack(">I", 20) + b"short",
        struct.pack(">I", 65) + b'{"arrays":[{"name":"a","dtype":"<f4","shape":[99999999,99999999]}]}'[:65],
        struct.pack(">I", 52) + b'{"arrays":[{"name":"a","dtype":"|O","shape":[1]}]}   ',
    ],
)
def test_damaged_messages_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError):
        read_message(io.BytesIO(data))


def test_colours_return_from_linear_light() -> None:
    levels = np.linspace(0, 1, 256)
    np.testing.assert_allclose(to_srgb(to_linear(levels)), levels, atol=1e-9)
    assert float(to_linear(0.5)) == pytest.approx(0.2140, abs=1e-4)


def exr_of(channels: dict[str, np.ndarray], compression: bytes = b"\0") -> bytes:
    """The smallest scan-line OpenEXR file, after the format's description."""
    names = sorted(channels)
    height, width = channels[names[0]].shape
    table = b"".join(n.encode() + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for n in names) + b"\0"
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2)
    for name, kind, value in (
        (b"channels", b"chlist", table),
        (b"compression", b"compression", compression),
        (b"dataWindow", b"box2i", window),
    ):
        header += name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    lines = [
        struct.pack("<ii", y, 4 * width * len(names)) + b"".join(channels[n][y].tobytes() for n in names)
        for y in range(height)
    ]
    start = len(header) + 8 * height
    offsets = [start + sum(map(len, lines[:y])) for y in range(height)]
    return header + struct.pack(f"<{height}Q", *offsets) + b"".join(lines)


def test_exr_channels_are_read() -> None:
    rng = np.random.default_rng(0)
    channels = {n: rng.random((3, 5)).astype("<f4") for n in ("V.Combined.R", "V.Combined.A", "V.Depth.Z")}
    read = read_exr(exr_of(channels))
    assert read.keys() == channels.keys()
    for name, array in channels.items():
        np.testing.assert_array_equal(read[name], array)


def test_other_exr_files_are_refused() -> None:
    channels = {"R": np.zeros((2, 2), "<f4")}
    with pytest.raises(ValueError, match="compressed"):
        read_exr(exr_of(channels, b"\3"))
    with pytest.raises(ValueError, match="OpenEXR"):
        read_exr(b"\x89PNG" + bytes(40))


def test_the_worker_has_the_rasteriser_s_lights() -> None:
    assert (*STUDIO.key, STUDIO.key_strength) == blender_worker.KEY
    assert (*STUDIO.fill, STUDIO.fill_strength) == blender_worker.FILL
    assert STUDIO.ambient == blender_worker.AMBIENT


def test_without_blender_the_error_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(blender.ENVIRONMENT_VARIABLE, str(tmp_path))
    with pytest.raises(DependencyError, match="cadpose blender setup"):
        BlenderRenderer()


def fake_virtualenv(folder: Path, script: str) -> Path:
    """A folder that looks set up, whose Python runs ``script`` instead of the worker."""
    (folder / "bin").mkdir()
    python = folder / "bin" / "python"
    (folder / "worker.py").write_text(script)
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "{folder}/worker.py"\n')
    python.chmod(0o755)
    (folder / "cadpose-ready").touch()
    return folder


def test_a_missing_system_library_is_named_with_its_packages(tmp_path: Path) -> None:
    script = "raise ImportError('libSM.so.6: cannot open shared object file: No such file or directory')"
    with (
        BlenderRenderer(folder=fake_virtualenv(tmp_path, script)) as renderer,
        pytest.raises(DependencyError, match=r"libSM.*apt-get install .*libsm6"),
    ):
        renderer.render(cube(), front_camera())


def test_a_worker_that_hangs_is_ended(tmp_path: Path) -> None:
    folder = fake_virtualenv(tmp_path, "import time; time.sleep(60)")
    with (
        BlenderRenderer(folder=folder, timeout=0.3) as renderer,
        pytest.raises(DependencyError, match=r"more than 0\.3 s"),
    ):
        renderer.render(cube(), front_camera())


@pytest.mark.slow
def test_blender_and_the_rasteriser_draw_the_same_mask() -> None:
    try:
        blender_python()
    except DependencyError as error:
        pytest.skip(str(error))
    R = rotation_from_angles(np.array([30.0, 200.0]), np.array([20.0, -35.0]), np.array([0.0, 25.0]))
    texture = np.array([[[250, 20, 20], [20, 250, 20]]], np.uint8).repeat(8, axis=0).repeat(8, axis=1)
    flag = mesh_of(quad(0.0), (Material((1, 1, 1, 1), texture),), uv=QUAD_UV)
    with BlenderRenderer() as renderer:
        for mesh in (cube(), sphere()):
            # Neither square nor centred.
            cameras = Cameras.from_rotations(
                R, focal_px=320.0, width=200, height=160, principal_px=np.array([[90.0, 85.0], [110.0, 70.0]])
            )
            ours, theirs = Rasteriser(2).render(mesh, cameras), renderer.render(mesh, cameras)
            for i in range(len(cameras)):
                a, b = ours.mask[i], theirs.mask[i]
                assert (a & b).sum() / (a | b).sum() >= 0.99
                shift = np.argwhere(a).mean(axis=0) - np.argwhere(b).mean(axis=0)
                assert np.abs(shift).max() < 0.25
            inside = (ours.alpha == 255) & (theirs.alpha == 255)
            assert np.median(np.abs(ours.depth[inside] - theirs.depth[inside])) < 1e-3
            assert abs(ours.rgb[inside].mean() - theirs.rgb[inside].mean()) < 20
        renderer.render(flag, front_camera())
        # Each mesh's texture is its own, not one that Cycles has kept from another.
        mirrored = mesh_of(quad(0.0), (Material((1, 1, 1, 1), texture[:, ::-1]),), uv=QUAD_UV)
        for mesh, first in ((mirrored, 1), (flag, 0), (mirrored, 1), (mirrored, 1), (flag, 0)):
            left, right = renderer.render(mesh, front_camera()).rgb[0, 32, [22, 42]].astype(int)
            assert left[first] > 2 * left[1 - first]
            assert right[1 - first] > 2 * right[first]
