from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.errors import InputError, LibraryError
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.records import CadModel, Detection, Rotation, RotationHypothesis
from cadpose.similarity.embedding import ViewEmbedder
from cadpose.similarity.index.describe import ViewDescriber
from cadpose.similarity.index.library_index import LibraryIndex, index_folder
from cadpose.similarity.index.segments import SegmentStore
from tests.similarity.index.made import network
from tests.small_library import Shot, shoot


@pytest.fixture(scope="module")
def index(
    small_library: Library, embedder: ViewEmbedder, tmp_path_factory: pytest.TempPathFactory
) -> LibraryIndex:
    folder = tmp_path_factory.mktemp("index")
    assert LibraryIndex.build(small_library, embedder, folder).models == 5
    return LibraryIndex.open(folder, embedder)


@pytest.fixture(scope="module")
def shots(small_library: Library) -> list[Shot]:
    return [
        shoot(small_library, model.id, Rotation(azimuth, 12.0))
        for model in small_library.models("car")
        for azimuth in (40.0, 200.0)
    ]


@pytest.mark.parametrize("knows_rotation", [True, False])
def test_the_photographed_model_is_found(
    index: LibraryIndex, shots: list[Shot], knows_rotation: bool
) -> None:
    right = 0
    for shot in shots:
        rotations = [shot.rotation] if knows_rotation else []
        found = index.query(shot.photo.rgb, shot.box, category="car", rotations=rotations)
        assert {m.category for m in found} == {"car"} and len(found) == 3
        assert [m.score for m in found] == sorted((m.score for m in found), reverse=True)
        right += found[0].cad == shot.cad.id
        if knows_rotation:
            assert found[0].rotation.error_to(shot.rotation) < 50.0
    # The network is a random one: by chance it would be two.
    assert right >= (4 if knows_rotation else 3)


def test_how_many_are_found(index: LibraryIndex, shots: list[Shot]) -> None:
    shot = shots[0]
    assert len(index.query(shot.photo.rgb, shot.box)) == 5 == len(index)
    plain = index.query(shot.photo.rgb, shot.box, top=2, rerank=False)
    assert len(plain) == 2 and [m.score for m in plain] == pytest.approx([m.cosine for m in plain])
    assert index.query(shot.photo.rgb, shot.box, category="sofa") == []


def test_what_cannot_be_asked(index: LibraryIndex, shots: list[Shot]) -> None:
    with pytest.raises(InputError, match="outside"):
        index.query(shots[0].photo.rgb, Box(900.0, 900.0, 950.0, 950.0))
    with pytest.raises(ValueError, match="top"):
        index.query(shots[0].photo.rgb, shots[0].box, top=0)


def test_an_index_of_another_network_is_refused(index: LibraryIndex, tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match="another network"):
        LibraryIndex.open(index.folder, ViewEmbedder(network(1)))
    with pytest.raises(LibraryError, match="no view index"):
        LibraryIndex.open(tmp_path, ViewEmbedder(network()))


@pytest.mark.parametrize("key", ["cells", "renderer", "views", "encoder"])
def test_an_index_of_other_settings_is_refused(
    small_library: Library, embedder: ViewEmbedder, tmp_path: Path, key: str
) -> None:
    settings = ViewDescriber(embedder).settings
    assert key in settings
    SegmentStore.create(tmp_path, {**settings, key: "other"})
    with pytest.raises(LibraryError, match=rf"other settings \({key}\)"):
        LibraryIndex.open(tmp_path, embedder)
    with pytest.raises(LibraryError, match=rf"other settings \({key}\)"):
        LibraryIndex.build(small_library, embedder, tmp_path)


def test_candidates_are_models_that_can_be_read(
    index: LibraryIndex, shots: list[Shot], small_library: Library, caplog: pytest.LogCaptureFixture
) -> None:
    shot = shots[0]
    found = Detection(shot.box, "car")
    guess = [RotationHypothesis(shot.rotation, 1.0, 1.0)]
    both = index.candidates(small_library, shot.photo, found, guess, 2)
    assert len(both) == 2 and {cad.category for cad in both} == {"car"}
    all_of_them = [
        m.cad for m in index.query(shot.photo.rgb, shot.box, category="car", rotations=[shot.rotation])
    ]
    assert [cad.id for cad in both] == all_of_them[:2]

    class Fewer(Library):
        def get(self, cad_id: str) -> CadModel:
            if cad_id == both[0].id:
                raise LibraryError("it has left")
            return super().get(cad_id)

    left = index.candidates(Fewer(small_library.path), shot.photo, found, guess, 2)
    assert [cad.id for cad in left] == all_of_them[1:]
    assert "passed over" in caplog.text
    with pytest.raises(LibraryError, match="no CAD model of category 'sofa'"):
        index.candidates(small_library, shot.photo, Detection(shot.box, "sofa"), guess, 2)


def test_the_digest_tells_indexes_apart(
    index: LibraryIndex, small_library: Library, embedder: ViewEmbedder, tmp_path: Path
) -> None:
    LibraryIndex.build(small_library, embedder, tmp_path, categories=["car"])
    cars = LibraryIndex.open(tmp_path, embedder).digest
    assert index.digest is index.digest  # worked out once
    assert cars != index.digest == LibraryIndex.open(index.folder, embedder).digest
    LibraryIndex.build(small_library, embedder, tmp_path)
    assert LibraryIndex.open(tmp_path, embedder).digest == index.digest


def test_the_rotations_to_search_at() -> None:
    def told(*chances: float) -> list[float]:
        hypotheses = [RotationHypothesis(Rotation(10.0 * i, 0.0), 1.0, p) for i, p in enumerate(chances)]
        return [r.azimuth for r in LibraryIndex.likely_rotations(hypotheses)]

    assert told(0.95, 0.05) == [0.0]
    assert told(0.6, 0.35, 0.05) == [0.0, 10.0]
    assert told(0.3, 0.2, 0.1, 0.1) == [0.0, 10.0, 20.0]


def test_where_a_library_keeps_it(small_library: Library) -> None:
    assert index_folder(small_library) == small_library.path / "view-index"
