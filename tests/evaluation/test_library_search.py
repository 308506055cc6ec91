from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("onnx", reason="needs cadpose[train]")
pytest.importorskip("faiss", reason="needs cadpose[index]")
from cadpose.datasets.labels import Label
from cadpose.evaluation import library_search
from cadpose.evaluation.library_search import SearchOutcome, labelled_rotation, search_labels, search_table
from cadpose.evaluation.shape_similarity import Shapes, ShapeSimilarity
from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from cadpose.similarity.embedding import ViewEmbedder
from cadpose.similarity.index.library_index import LibraryIndex
from tests.similarity.index.made import network
from tests.small_library import save, shoot


@pytest.fixture(scope="module")
def labels(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> list[Label]:
    folder = tmp_path_factory.mktemp("photos")
    made = []
    for i, model in enumerate(small_library.models()):
        shot = shoot(small_library, model.id, Rotation(30.0 + 20 * i, 10.0))
        photo = save(folder / f"{i}.png", shot.photo.rgb)
        made.append(Label(photo, model.category, shot.box, model.id, 30.0 + 20 * i, 10.0, 0.0))
    return made


def test_every_photo_has_an_answer(small_library: Library, labels: list[Label], tmp_path: Path) -> None:
    embedder = ViewEmbedder(network(), threads=1)
    LibraryIndex.build(small_library, embedder, tmp_path)
    index = LibraryIndex.open(tmp_path, embedder)
    lost = [replace(labels[0], photo=labels[0].photo.with_name("none.png")), replace(labels[0], azimuth=None)]
    outcomes = search_labels(
        [*labels, *lost],
        index,
        lambda name: [e.id for e in index.entries if e.category == name],
        Shapes(small_library),
        labelled_rotation,
    )
    assert [bool(one.reason) for one in outcomes] == [False] * 5 + [True] * 2
    assert "--rotation predicted" in outcomes[-1].reason
    for one in outcomes[:5]:
        assert one.place is not None and one.among == (3 if one.label.category == "car" else 2)
        assert (one.fscore == 1.0) == (one.place == 1)
        assert 0 < one.chance_fscore < 1 and one.chance_chamfer > 0
    table = search_table(outcomes)
    assert table["rejected"] == 2 and set(table["categories"]) == {"car", "chair"}
    assert table["all"]["photos"] == 5 and table["all"]["top3"] == 1.0
    assert table["categories"]["chair"]["chance"]["top1"] == 0.5
    assert table["all"]["top1"] >= 0.6


def test_chance_is_told_by_a_sample(
    small_library: Library, labels: list[Label], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    embedder = ViewEmbedder(network(), threads=1)
    LibraryIndex.build(small_library, embedder, tmp_path, categories=["car"])
    index = LibraryIndex.open(tmp_path, embedder)
    cars, compared = [e.id for e in index.entries], list[str]()

    class Counted(Shapes):
        def similarity(self, a: str, b: str) -> ShapeSimilarity:
            compared.append(a)
            return super().similarity(a, b)

    def chance(seed: int) -> list[str]:
        compared.clear()
        shapes = Counted(small_library)
        (one,) = search_labels(labels[:1], index, lambda _: cars, shapes, labelled_rotation, seed=seed)
        assert one.among == 3
        return compared[1:]  # the first is the answer

    assert chance(0) == cars
    monkeypatch.setattr(library_search, "_BY_CHANCE", 2)
    assert len(chance(0)) == 2 and chance(0) == chance(0)
    assert len({tuple(chance(seed)) for seed in range(8)}) > 1


def test_places_and_chance(labels: list[Label]) -> None:
    true = str(labels[0].cad)
    outcomes = [
        SearchOutcome(labels[0], found=("a", true), among=100, fscore=0.5, chamfer=0.2),
        SearchOutcome(labels[0], found=(true,), among=100, fscore=1.0),
        SearchOutcome(labels[0], found=("a",), among=100),
    ]
    assert [one.place for one in outcomes] == [2, 1, None]
    row = search_table(outcomes)["all"]
    assert (row["top1"], row["top3"], row["top50"]) == pytest.approx((1 / 3, 2 / 3, 2 / 3))
    assert row["chance"]["top10"] == pytest.approx(0.1) and row["fscore"] == pytest.approx(0.5)
    assert search_table([SearchOutcome(labels[0], reason="lost")])["all"] is None
