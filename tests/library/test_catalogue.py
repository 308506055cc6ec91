from __future__ import annotations

import os
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.errors import LibraryError
from cadpose.library import catalogue as catalogue_module
from cadpose.library import importing as importing_module
from cadpose.library.catalogue import Library
from cadpose.library.folder import folder_items
from cadpose.library.importing import ImportItem, mesh_path
from cadpose.library.loading import load_mesh_file
from cadpose.library.mesh import Mesh
from cadpose.library.normalise import normalise
from cadpose.library.sampling import farthest_points
from cadpose.library.storage import mesh_from_file, mesh_to_bytes

from .builders import CUBE_VERTICES, obj_box, png

SIZES = {"low": (2, 1, 1), "tall": (1, 3, 1), "long": (1, 1, 5), "low_copy": (2.001, 1, 1)}


@pytest.fixture
def items(tmp_path: Path) -> list[ImportItem]:
    folder = tmp_path / "boxes" / "chair"
    folder.mkdir(parents=True)
    for name, (w, h, d) in SIZES.items():
        (folder / f"{name}.obj").write_text(obj_box(w, h, d))
    return folder_items(tmp_path / "boxes")


@pytest.fixture
def library(tmp_path: Path, items: list[ImportItem]) -> Library:
    made = Library.create(tmp_path / "library")
    assert not made.add(items).failed
    return Library.open(tmp_path / "library")


def test_reading(library: Library) -> None:
    assert [m.id for m in library.models()] == sorted(f"boxes/chair/{n}.obj" for n in SIZES)
    assert library.categories() == {"chair": 4}
    assert library.models("car") == ()
    model = library.get("boxes/chair/tall.obj")
    assert (model.category, model.face_count, model.name) == ("chair", 12, "tall")
    mesh = library.mesh(model)
    assert np.allclose(mesh.bounds[1] - mesh.bounds[0], np.array([1, 3, 1]) / np.sqrt(11), atol=1e-6)
    assert library.mesh(model.id) is mesh
    assert library.scale(model.id) == pytest.approx(1 / np.sqrt(11))
    assert library.check() == []


def test_memory_holds_few_meshes(library: Library) -> None:
    library.cache_size = 2
    first = library.mesh("boxes/chair/long.obj")
    for name in ("low", "tall", "low_copy"):
        library.mesh(f"boxes/chair/{name}.obj")
    assert library.mesh("boxes/chair/long.obj") is not first


def test_an_unknown_id_names_what_is_close(library: Library) -> None:
    with pytest.raises(LibraryError, match=r"did you mean boxes/chair/tall\.obj"):
        library.get("tall.obj")
    with pytest.raises(LibraryError, match=r"did you mean boxes/chair/long\.obj"):
        library.mesh("boxes/chair/lonng.obj")


@pytest.mark.parametrize("made", [False, True])
def test_missing_or_empty_library_says_what_to_do(tmp_path: Path, made: bool) -> None:
    if made:
        Library.create(tmp_path)
    with pytest.raises(LibraryError, match="cadpose library add"):
        Library.open(tmp_path)


def test_default_folder(tmp_path: Path, library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CADPOSE_LIBRARY", str(library.path))
    assert Library.open().categories() == {"chair": 4}
    monkeypatch.setenv("CADPOSE_LIBRARY", str(tmp_path / "none"))
    with pytest.raises(LibraryError, match="no CAD library"):
        Library.open()


def test_an_index_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "index.sqlite").write_bytes(b"not a database at all" * 100)
    with pytest.raises(LibraryError, match="cannot be used"):
        Library.open(tmp_path)


def test_adding_again_changes_nothing(library: Library, items: list[ImportItem]) -> None:
    before, files = library.digest, sorted(library.path.rglob("*.npz"))
    report = library.add(items)
    assert len(report.unchanged) == 4
    assert not (report.added or report.updated or report.failed)
    # Even a full second import gives the same bytes.
    report = library.add([replace(i, fingerprint="other") for i in items])
    assert len(report.updated) == 4
    assert library.digest == before
    assert sorted(library.path.rglob("*.npz")) == files


def test_digest_follows_the_content(library: Library, items: list[ImportItem]) -> None:
    before = library.digest
    library.add([replace(items[0], category="table")])
    assert library.digest != before
    library.add([items[0]])
    assert library.digest == before
    library.remove([items[0].id])
    assert library.digest != before


def test_files_of_replaced_and_removed_models_are_deleted(library: Library, items: list[ImportItem]) -> None:
    library.surface_samples(items[0].id, 100)
    path = Path(items[0].container)
    path.write_text(obj_box(1, 7, 1))
    assert library.add(folder_items(path.parent.parent)).updated == (items[0].id,)
    assert library.check() == []
    assert not list(library.path.rglob("*.npy"))
    assert library.remove([items[0].id, "unknown"]) == 1
    assert len(library.models()) == len(list(library.path.rglob("*.npz"))) == 3
    assert library.check() == []


def test_one_bad_model_does_not_stop_the_others(tmp_path: Path, items: list[ImportItem]) -> None:
    Path(items[0].container).write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    Path(items[1].container).write_text(CUBE_VERTICES)
    seen: list[tuple[int, int]] = []
    library = Library.create(tmp_path / "library")
    report = library.add(items, progress=lambda done, total, name: seen.append((done, total)))
    assert [f[0] for f in report.failed] == [items[0].id, items[1].id]
    assert "finite" in report.failed[0][1]
    assert "no faces" in report.failed[1][1]
    assert len(report.added) == 2
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert library.check() == []


def test_an_error_nobody_foresaw_is_told_of_its_model_only(
    tmp_path: Path, items: list[ImportItem], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(mesh: Mesh, rotation: object) -> tuple[Mesh, float]:
        if np.ptp(mesh.bounds[:, 1]) > 2:
            raise KeyError("tall")
        return normalise(mesh)

    monkeypatch.setattr(importing_module, "normalise", broken)
    report = Library.create(tmp_path / "library").add(items)
    ((name, reason),) = report.failed
    assert name == "boxes/chair/tall.obj"
    assert "KeyError: 'tall'" in reason
    assert len(report.added) == 3


def test_killed_midway_leaves_what_was_done(tmp_path: Path, items: list[ImportItem]) -> None:
    class Killed(BaseException):
        pass

    def kill(done: int, total: int, name: str) -> None:
        if done == 2:
            raise Killed

    with pytest.raises(Killed):
        Library.create(tmp_path / "library").add(items, progress=kill)
    library = Library.open(tmp_path / "library")
    assert len(library.models()) == 2
    assert library.check() == []
    assert len(library.add(items).added) == 2


def test_workers_give_the_same_library(tmp_path: Path, library: Library, items: list[ImportItem]) -> None:
    other = Library.create(tmp_path / "parallel")
    assert len(other.add(items, workers=2).added) == 4
    assert other.digest == library.digest


def test_damage_is_found(library: Library) -> None:
    first, second, third = library.models()[:3]
    path = mesh_path(library.path / "meshes", first.sha256)
    path.write_bytes(path.read_bytes()[:-100])
    mesh_path(library.path / "meshes", second.sha256).unlink()
    (path.parent / ".part-left-over").write_bytes(b"")
    problems = library.check()
    assert len(problems) == 3
    assert sum(first.id in p for p in problems) == 1
    assert sum(second.id in p and "missing" in p for p in problems) == 1
    assert sum(".part-left-over" in p for p in problems) == 1
    for model in (first, second):
        with pytest.raises(LibraryError, match="add the model again"):
            library.mesh(model)
    assert library.mesh(third)


def test_errors_name_the_model_and_the_log_its_path(
    library: Library, caplog: pytest.LogCaptureFixture
) -> None:
    first, second, third = library.models()[:3]
    paths = [mesh_path(library.path / "meshes", m.sha256) for m in (first, second, third)]
    paths[0].unlink()
    paths[1].write_bytes(b"no mesh")
    with zipfile.ZipFile(paths[2], "w") as archive:
        archive.writestr("other.npy", b"")
    caplog.set_level("DEBUG", logger="cadpose.library.storage")
    for model, path in zip((first, second, third), paths, strict=True):
        with pytest.raises(LibraryError) as caught:
            library.mesh(model)
        assert str(caught.value).startswith(f"{model.id}: The mesh file is missing or damaged (")
        assert str(library.path) not in str(caught.value)
        assert str(path) in caplog.messages
    with pytest.raises(LibraryError) as caught:
        library.get("unknown")
    assert str(library.path) not in str(caught.value)


def test_a_missing_mesh_is_imported_again(library: Library, items: list[ImportItem]) -> None:
    mesh_path(library.path / "meshes", library.get(items[0].id).sha256).unlink()
    assert library.add(items).updated == (items[0].id,)
    assert library.check() == []


def test_surface_samples(library: Library) -> None:
    points = library.surface_samples("boxes/chair/long.obj", 20_000, seed=3)
    assert points.shape == (20_000, 3)
    assert points.dtype == np.float32
    low, high = library.mesh("boxes/chair/long.obj").bounds
    on_face = (np.abs(points - low) < 1e-6) | (np.abs(points - high) < 1e-6)
    assert on_face.any(axis=1).all()
    # Ends are 2 of 22 units of area.
    assert on_face[:, 2].mean() == pytest.approx(2 / 22, abs=0.01)
    kept = list(library.path.rglob("*.npy"))
    assert len(kept) == 1
    assert np.array_equal(library.surface_samples("boxes/chair/long.obj", 20_000, seed=3), points)
    # A damaged cache is replaced, another seed is another sample.
    kept[0].write_bytes(b"rubbish")
    assert np.array_equal(library.surface_samples("boxes/chair/long.obj", 20_000, seed=3), points)
    assert not np.array_equal(library.surface_samples("boxes/chair/long.obj", 20_000, seed=4), points)
    assert library.check() == []


def test_samples_where_nothing_can_be_written(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, data: bytes) -> None:
        raise PermissionError(path)

    monkeypatch.setattr(catalogue_module, "write_atomic", refuse)
    assert library.surface_samples("boxes/chair/long.obj", 100).shape == (100, 3)
    assert not list(library.path.rglob("*.npy"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(LibraryError, match="cannot be made"):
        Library.create(tmp_path / "library")


def test_representatives(library: Library) -> None:
    chosen = [m.name for m in library.representatives("chair", 10)]
    # The near copy is passed over, whatever is asked for.
    assert len(chosen) == 3
    assert {"tall", "long"} < set(chosen)
    assert [m.name for m in library.representatives("chair", 2)] == chosen[:2]
    with pytest.raises(LibraryError, match="no model of category 'car'"):
        library.representatives("car")


def test_representatives_are_chosen_once_until_the_library_changes(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def counted(rows: NDArray[np.float32], count: int, least: float) -> list[int]:
        asked.append(count)
        return farthest_points(rows, count, least)

    monkeypatch.setattr(catalogue_module, "farthest_points", counted)
    first = library.representatives("chair", 3)
    assert library.representatives("chair", 3) == first
    assert asked == [3]
    library.representatives("chair", 2)
    assert asked == [3, 2]
    library.remove([first[0].id])
    assert first[0] not in library.representatives("chair", 3)
    assert asked == [3, 2, 3]


def test_stored_mesh_comes_back(tmp_path: Path) -> None:
    (tmp_path / "wood.png").write_bytes(png((10, 90, 170), (8, 8)))
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd wood.png\nnewmtl b\nKd 1 0 0\nd 0.5\n")
    square = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 2\nvt 0 0\nvt 3 0\nvt 1 1\n"
    (tmp_path / "m.obj").write_text(square + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1 3 4\n")
    mesh = load_mesh_file(tmp_path / "m.obj")
    stored = mesh_to_bytes(mesh)
    assert stored == mesh_to_bytes(mesh)
    (tmp_path / "m.npz").write_bytes(stored)
    back = mesh_from_file(tmp_path / "m.npz")
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert np.array_equal(back.face_material, mesh.face_material)
    assert np.abs(back.corner_normals - mesh.corner_normals).max() < 2e-5
    textured = np.array([m.texture is not None for m in mesh.materials])[mesh.face_material]
    assert np.array_equal(back.corner_uv[textured], mesh.corner_uv[textured])
    assert [m.rgba for m in back.materials] == [m.rgba for m in mesh.materials]
    pictures = [m.texture for m in back.materials if m.texture is not None]
    assert [p[0, 0].tolist() for p in pictures] == [[10, 90, 170]]


def test_a_mesh_file_with_pickles_is_not_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "evil.npz", header=np.array([{"a": 1}], dtype=object))
    with pytest.raises(LibraryError, match="damaged"):
        mesh_from_file(tmp_path / "evil.npz")
