"""Reads BOP's files as bop_toolkit_lib.inout does, which no package registry holds.

Written after its load_scene_gt, load_scene_camera, load_bop_results, check_bop_results and load_ply: the same
keys, shapes, line format, and the types that its PLY reader knows.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np


def load_json(path: Path) -> dict[int, Any]:
    def by_number(told: dict[str, Any]) -> dict[Any, Any]:
        return {int(k) if k.lstrip("-").isdigit() else k: v for k, v in told.items()}

    loaded: dict[int, Any] = json.loads(path.read_text(), object_hook=by_number)
    return loaded


def load_scene_camera(path: Path) -> dict[int, Any]:
    cameras = load_json(path)
    for camera in cameras.values():
        camera["cam_K"] = np.array(camera["cam_K"], np.float64).reshape((3, 3))
    return cameras


def load_scene_gt(path: Path) -> dict[int, Any]:
    scene = load_json(path)
    for image in scene.values():
        for gt in image:
            gt["cam_R_m2c"] = np.array(gt["cam_R_m2c"], np.float64).reshape((3, 3))
            gt["cam_t_m2c"] = np.array(gt["cam_t_m2c"], np.float64).reshape((3, 1))
    return scene


def load_bop_results(path: Path) -> list[dict[str, Any]]:
    results = []
    times: dict[tuple[int, int], float] = {}
    for number, line in enumerate(path.read_text().splitlines()):
        if number == 0 and line == "scene_id,im_id,obj_id,score,R,t,time":
            continue
        words = line.split(",")
        if len(words) != 7:
            raise ValueError(f"a line does not have 7 elements: {line}")
        result: dict[str, Any] = {
            "scene_id": int(words[0]),
            "im_id": int(words[1]),
            "obj_id": int(words[2]),
            "score": float(words[3]),
            "R": np.array([float(w) for w in words[4].split()]).reshape((3, 3)),
            "t": np.array([float(w) for w in words[5].split()]).reshape((3, 1)),
            "time": float(words[6]),
        }
        key = (result["scene_id"], result["im_id"])
        if abs(times.setdefault(key, result["time"]) - result["time"]) > 0.001:
            raise ValueError("the running time is not the same for all estimates of an image")
        results.append(result)
    return results


_FORMATS = {"float": ("f", 4), "double": ("d", 8), "int": ("i", 4), "uchar": ("B", 1)}


def load_ply(path: Path) -> dict[str, Any]:
    """Points, normals, colours and faces of a binary PLY."""
    counts = {"vertex": 0, "face": 0}
    points: list[tuple[str, str]] = []
    corners: list[tuple[str, str]] = []
    with path.open("rb") as file:
        section = ""
        while (line := file.readline().decode().strip()) != "end_header":
            words = line.split()
            if words[0] == "element":
                section = words[1]
                counts[section] = int(words[2])
            elif words[:2] == ["property", "list"]:
                assert words[-1] in ("vertex_indices", "vertex_index")
                corners = [("n", words[2]), *((f"i{i}", words[3]) for i in range(3))]
            elif words[0] == "property" and section == "vertex":
                points.append((words[2], words[1]))
            elif words[0] == "format":
                assert "binary" in line

        def row(properties: list[tuple[str, str]]) -> dict[str, Any]:
            told = {}
            for name, kind in properties:
                letter, size = _FORMATS[kind]
                told[name] = struct.unpack(letter, file.read(size))[0]
            return told

        vertices = [row(points) for _ in range(counts["vertex"])]
        faces = [row(corners) for _ in range(counts["face"])]
        assert file.read() == b""
    assert all(face["n"] == 3 for face in faces)

    def columns(*names: str) -> Any:
        return np.array([[vertex[name] for name in names] for vertex in vertices])

    return {
        "pts": columns("x", "y", "z"),
        "normals": columns("nx", "ny", "nz"),
        "colors": columns("red", "green", "blue"),
        "faces": np.array([[face[f"i{i}"] for i in range(3)] for face in faces]),
    }
