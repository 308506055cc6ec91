"""Exported scenes in Blender: its own camera sees the models on their pixels. `make blender` sets it up."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cadpose.annotations.scenes.gltf import write_gltf_scene
from cadpose.annotations.scenes.usd import write_usd_scene
from cadpose.errors import DependencyError
from cadpose.rendering.blender import blender_python
from tests.annotations.scenes.made import SHELF, street

_SCRIPT = Path(__file__).with_name("in_blender.py")


@pytest.mark.slow
def test_blenders_camera_sees_every_model_on_its_pixels(tmp_path: Path) -> None:
    try:
        python = blender_python()
    except DependencyError as error:
        pytest.skip(str(error))
    photo, document = street()
    files = [tmp_path / "scene.glb"]
    write_gltf_scene(document, SHELF, photo, files[0])
    try:
        write_usd_scene(document, SHELF, photo, tmp_path / "scene.usdz")
        files.append(tmp_path / "scene.usdz")
    except DependencyError:
        pass  # its other tests say so
    told = json.dumps([str(file) for file in files])
    run = subprocess.run([python, str(_SCRIPT)], input=told, capture_output=True, text=True, check=True)
    for file, scene in zip(files, json.loads(run.stdout.strip().splitlines()[-1]), strict=True):
        found: dict[str, list[list[float]]] = scene["shares"]
        for number, annotation in enumerate(document.to_annotations()):
            mine = [
                v for name, v in found.items() if f"{number + 1} " in name or f"Object_{number + 1}/" in name
            ]
            # Shares of the frame, from its bottom left.
            pixels = np.concatenate([np.array(v) for v in mine]) * (120, -80) + (0, 80)
            expected = annotation.pose.project(np.asarray(SHELF.mesh(annotation.cad).vertices))
            for pixel in expected:
                assert np.abs(pixels - pixel).max(axis=1).min() < 0.02, (file.name, number)
        corners = next(v for name, v in found.items() if name.lower().endswith("photo"))
        assert np.sort(np.array(corners), axis=0) == pytest.approx(
            np.array([[0, 0], [0, 0], [1, 1], [1, 1]]), abs=1e-4
        )
        assert len(scene["images"]) == 3
        assert all(width > 0 for width in scene["images"])
