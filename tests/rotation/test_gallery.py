from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cadpose.encoder import SIDE
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Views
from cadpose.rendering.raster import Rasteriser
from cadpose.rotation import gallery as gallery_module
from cadpose.rotation import grid
from cadpose.rotation.features import LEVELS, Described, describe
from cadpose.rotation.gallery import GalleryStore
from tests.rotation.fakes import ColourEncoder, cad, car

ROTATIONS = grid.grid_rotations()[::29]


@pytest.fixture(autouse=True)
def few_rotations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gallery_module, "grid_rotations", lambda: ROTATIONS)


class Drawing:
    """Draws the made-up car and counts the views; fails when told to."""

    def __init__(self) -> None:
        self.mesh = car()
        self.renderer = Rasteriser(1)
        self.views = 0
        self.error: BaseException | None = None

    def __call__(self, model: CadModel, R_cv_from_s: FloatArray) -> Views:
        if self.error is not None:
            raise self.error
        self.views += len(R_cv_from_s)
        return self.renderer.render(self.mesh, Cameras.framing(R_cv_from_s, self.mesh.hull, size=SIDE))


@pytest.fixture
def drawing() -> Drawing:
    return Drawing()


@pytest.fixture
def store(tmp_path: Path, drawing: Drawing) -> GalleryStore:
    return GalleryStore(tmp_path / "galleries", ColourEncoder(), drawing, "raster")


def same(a: Described, b: Described) -> bool:
    return all(
        np.array_equal(x, y)
        for i in range(len(LEVELS))
        for x, y in ((a.cells[i], b.cells[i]), (a.cover[i], b.cover[i]))
    )


def test_templates_are_the_renders_at_the_grid(store: GalleryStore, drawing: Drawing) -> None:
    gallery = store.get(cad("a"))
    assert len(gallery) == len(ROTATIONS) == drawing.views
    for i in (0, 5, len(gallery) - 1):
        views = drawing(cad("a"), ROTATIONS[i : i + 1])
        alone = describe(store.encoder, views.over(255), views.alpha)
        for level in range(len(LEVELS)):
            np.testing.assert_array_equal(gallery.cells[level][i], alone.cells[level][0])
            np.testing.assert_array_equal(gallery.cover[level][i], alone.cover[level][0])


def test_a_cached_gallery_is_not_drawn_again(store: GalleryStore, drawing: Drawing) -> None:
    first = store.get(cad("a"))
    drawing.error = AssertionError("drawn again")
    assert same(store.get(cad("a")), first)
    # Another process, the same folder.
    other = GalleryStore(store.folder, ColourEncoder(), drawing, "raster")
    assert same(other.get(cad("a")), first)
    assert [p.name for p in store.folder.iterdir()] == [store.path(cad("a")).name]


def test_threads_make_the_same_templates(store: GalleryStore, drawing: Drawing, tmp_path: Path) -> None:
    threads = GalleryStore(tmp_path / "others", ColourEncoder(), drawing, "raster", workers=2)
    assert same(threads.get(cad("a")), store.get(cad("a")))


def test_the_file_is_named_by_what_it_depends_on(store: GalleryStore) -> None:
    blender = GalleryStore(store.folder, store.encoder, store.render, "blender")
    paths = {
        store.path(cad("a", "1")),
        store.path(cad("a", "2")),
        store.path(cad("b", "1")),
        blender.path(cad("a", "1")),
    }
    assert len(paths) == 4
    assert store.path(cad("a", "1")) in paths
    # An id is no path: nothing may leave the folder.
    assert store.path(cad("../../a", "1")).parent == store.folder


def test_a_changed_mesh_is_drawn_anew(store: GalleryStore, drawing: Drawing) -> None:
    store.get(cad("a", "1"))
    store.get(cad("a", "2"))
    assert drawing.views == 2 * len(ROTATIONS)


def damage_cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def damage_bit(data: bytes) -> bytes:
    return data[: len(data) // 3] + bytes([data[len(data) // 3] ^ 255]) + data[len(data) // 3 + 1 :]


def damage_compression(data: bytes) -> bytes:
    # The directory names a compression method that nobody has.
    at = data.index(b"PK\x01\x02") + 10
    return data[:at] + b"\x63\x00" + data[at + 2 :]


def damage_encrypted(data: bytes) -> bytes:
    at = data.index(b"PK\x01\x02") + 8
    return data[:at] + b"\x01\x00" + data[at + 2 :]


@pytest.mark.parametrize(
    "damage",
    [damage_cut, damage_bit, damage_compression, damage_encrypted, lambda _: b"", lambda _: b"no zip"],
    ids=["cut", "bit", "compression", "encrypted", "empty", "text"],
)
def test_a_damaged_file_is_made_again(
    store: GalleryStore, drawing: Drawing, damage: Callable[[bytes], bytes], caplog: pytest.LogCaptureFixture
) -> None:
    first = store.get(cad("a"))
    path = store.path(cad("a"))
    path.write_bytes(damage(path.read_bytes()))
    with caplog.at_level(logging.WARNING):
        assert same(store.get(cad("a")), first)
    assert drawing.views == 2 * len(ROTATIONS)
    assert str(path) in caplog.text
    assert same(GalleryStore(store.folder, store.encoder, drawing, "raster").get(cad("a")), first)
    assert drawing.views == 2 * len(ROTATIONS)


@pytest.mark.parametrize("wrong", ["pickle", "missing", "short", "type"])
def test_a_file_of_other_content_is_made_again(store: GalleryStore, drawing: Drawing, wrong: str) -> None:
    first = store.get(cad("a"))
    path = store.path(cad("a"))
    with np.load(path) as data:
        arrays = dict(data)
    if wrong == "pickle":
        arrays["cells_stride16"] = np.array([{}], dtype=object)
    elif wrong == "missing":
        del arrays["cover_stride32"]
    elif wrong == "short":
        arrays = {k: v[:-1] for k, v in arrays.items()}
    else:
        arrays["cover_stride16"] = arrays["cover_stride16"].astype(np.float64)
    np.savez(path, **arrays)
    assert same(store.get(cad("a")), first)
    assert drawing.views == 2 * len(ROTATIONS)


def test_nothing_is_left_behind_where_drawing_fails(store: GalleryStore, drawing: Drawing) -> None:
    store.get(cad("a"))
    drawing.error = RuntimeError("out of memory")
    with pytest.raises(RuntimeError, match="out of memory"):
        store.get(cad("b"))
    assert [p.name for p in store.folder.iterdir()] == [store.path(cad("a")).name]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_broken_write_leaves_no_file(
    store: GalleryStore, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def half(file: object, **_: object) -> None:
        assert hasattr(file, "write")
        file.write(b"PK half a file")
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", half)
        if isinstance(error, OSError):
            # A full disk costs the cache, not the answer.
            assert len(store.get(cad("a"))) == len(ROTATIONS)
        else:
            with pytest.raises(KeyboardInterrupt):
                store.get(cad("a"))
    assert list(store.folder.iterdir()) == []


def test_a_cache_that_cannot_be_written_is_done_without(
    tmp_path: Path, drawing: Drawing, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("in the way")
    store = GalleryStore(tmp_path / "file" / "galleries", ColourEncoder(), drawing, "raster")
    with caplog.at_level(logging.WARNING):
        assert len(store.get(cad("a"))) == len(ROTATIONS)
    assert "cannot be kept" in caplog.text
