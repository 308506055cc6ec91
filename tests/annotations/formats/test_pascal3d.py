"""PASCAL3D+'s viewpoints say the same pose as the data set's own tools and our reader understand them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.annotations.formats.registry import documents_from
from cadpose.datasets.pascal3d import pascal3d
from cadpose.errors import InputError
from tests.annotations.formats.made import Made
from tests.datasets.trees import thing, write_mat, write_photo, write_text


@pytest.fixture
def file(made: Made, tmp_path: Path) -> Path:
    return made.export("pascal3d", tmp_path / "views.json")


def published_projection(view: dict[str, float], points: Any) -> Any:
    """(P, 3) points in PASCAL3D+'s axes to (P, 2) pixels from 0, as PASCAL3D+'s project_3d.m does."""
    a, e, theta = (np.deg2rad(view[key]) for key in ("azimuth", "elevation", "theta"))
    C = view["distance"] * np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    Rz = np.array([[np.cos(-a), -np.sin(-a), 0], [np.sin(-a), np.cos(-a), 0], [0, 0, 1]])
    t = -(np.pi / 2 - e)
    Rx = np.array([[1, 0, 0], [0, np.cos(t), -np.sin(t)], [0, np.sin(t), np.cos(t)]])
    R = Rx @ Rz
    M = view["viewport"]
    P = np.diag([M * view["focal"], M * view["focal"], -1.0]) @ np.column_stack([R, -R @ C])
    x = P @ np.column_stack([points, np.ones(len(points))]).T
    x = x[:2] / x[2]
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    x = turn @ x
    return np.column_stack([view["px"] + x[0], view["py"] - x[1]]) - 0.5


def test_the_published_projection_agrees(made: Made, file: Path) -> None:
    records = json.loads(file.read_text())["records"]
    points = np.random.default_rng(1).uniform(-0.4, 0.4, (40, 3))
    seen = 0
    for record, document in zip(records, made.documents, strict=True):
        for told, part in zip(record["objects"], document.annotations, strict=True):
            p_from_s = points @ np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]]).T
            pixels = published_projection(told["viewpoint"], p_from_s)
            np.testing.assert_allclose(pixels, part.pose.pose().project(points), atol=1e-9)
            seen += 1
    assert seen == 4


def test_our_reader_of_the_data_set_agrees(made: Made, file: Path, tmp_path: Path) -> None:
    """The same numbers in a .mat file are read as the same labels."""
    told = json.loads(file.read_text())
    things = [o for record in told["records"] for o in record["objects"]]
    root = tmp_path / "set"
    for number, entry in enumerate(things):
        keys = {k: entry[k] for k in ("class", "cad_index", "viewpoint")} | {"class": "car"}
        write_mat(
            root / f"Annotations/car_imagenet/n{number}.mat", [thing(**keys, bbox=np.array([entry["bbox"]]))]
        )
        write_photo(root / f"Images/car_imagenet/n{number}.JPEG")
    write_text(root / "PASCAL/VOCdevkit/VOC2012/ImageSets/Main/car_val.txt")
    labels = list(pascal3d(root))
    parts = [part for document in made.documents for part in document.annotations]
    assert len(labels) == len(parts)
    for label, part in zip(labels, parts, strict=True):
        angles = (part.pose.azimuth, part.pose.elevation, part.pose.inplane)
        assert (label.azimuth, label.elevation, label.inplane) == pytest.approx(angles, abs=1e-9)
        assert label.focal_px == pytest.approx(part.pose.focal_px)
        assert label.principal_px == pytest.approx(part.pose.principal_px)
        assert label.t_cv == (0.0, 0.0, part.pose.t_z)
        assert label.box is not None
        assert label.box.to_tuple() == pytest.approx(part.detection.box)
    cads = [told["cads"][o["class"]][o["cad_index"] - 1] for o in things]
    assert cads == [part.cad.id for part in parts]


def edited(file: Path, edit: Any) -> Any:
    told = json.loads(file.read_text())
    edit(told["records"][0]["objects"][0])
    file.write_text(json.dumps(told))
    return next(iter(documents_from("pascal3d", file))).annotations[0]


def test_an_edited_viewpoint_counts(made: Made, file: Path) -> None:
    part = edited(file, lambda o: o["viewpoint"].update(azimuth=-10.0, viewport=200.0, px=41.5))
    assert (part.pose.azimuth, part.pose.focal_px) == (pytest.approx(350.0), 200.0)
    assert part.pose.principal_px == (41.0, made.documents[0].annotations[0].pose.principal_px[1])
    assert part.pose.elevation == pytest.approx(8.1)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda o: o["viewpoint"].update(distance=0.0), "distance"),
        (lambda o: o["viewpoint"].update(azimuth="x"), "azimuth"),
        (lambda o: o.pop("cadpose"), "object 1 has none of the keys"),
        (lambda o: o.pop("viewpoint"), "viewpoint"),
    ],
)
def test_mistakes(file: Path, edit: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        edited(file, edit)
    assert str(caught.value).startswith(f"{file}: record 1")
