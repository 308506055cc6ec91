from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
import torch

from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.training.lite.embedder import SIDE
from cadpose.training.lite.stream import Objects, ObjectStream, loader, objects, turns_of
from cadpose.training.ring import Ring
from tests.training.lite.made import CATEGORIES, source_of
from tests.training.synth.making import PLAIN, generator_of

QUIET: dict[str, Any] = {"company": 0.0, "occluder": 0.0, "truncate": 0.0, "degrade": 0.0}


def joined(chunks: list[Objects]) -> tuple[torch.Tensor, ...]:
    return tuple(torch.cat(parts) for parts in zip(*(c.fields() for c in chunks), strict=True))


@pytest.fixture(scope="module")
def drawn(small_library: Library) -> list[Objects]:
    return list(ObjectStream(source_of(small_library), photos=24))


def test_the_same_seed_gives_the_same_objects(small_library: Library, drawn: list[Objects]) -> None:
    again = list(ObjectStream(source_of(small_library), photos=24))
    assert all(torch.equal(a, b) for a, b in zip(joined(drawn), joined(again), strict=True))
    other = list(ObjectStream(source_of(small_library, seed=4), photos=24))
    assert not torch.equal(joined(drawn)[3][:5], joined(other)[3][:5])


def test_two_workers_draw_what_one_does(small_library: Library, drawn: list[Objects]) -> None:
    stream = ObjectStream(source_of(small_library), photos=24)
    both = list(loader(stream, workers=2))
    assert stream.chunk == 12 and len(both) == len(drawn) == 2
    assert all(torch.equal(a, b) for a, b in zip(joined(drawn), joined(both), strict=True))


def test_it_goes_on_from_a_later_photo(small_library: Library, drawn: list[Objects]) -> None:
    later = next(iter(ObjectStream(source_of(small_library), first=12)))
    assert all(torch.equal(a, b) for a, b in zip(drawn[1].fields(), later.fields(), strict=True))


def test_only_objects_worth_learning_from(small_library: Library, drawn: list[Objects]) -> None:
    _, _, visible, angles, turns, category, renders, models = joined(drawn)
    assert float((visible[:, 2:] - visible[:, :2]).amax(dim=1).min()) >= 40.0
    assert set(category.tolist()) == {0, 1} and float(angles[:, 1].abs().max()) <= 90
    assert renders.shape[1:] == (3, 112, 112) and renders.dtype == torch.uint8
    source = source_of(small_library)
    library = Library.open(source.library)
    told = [library.get(source.models[m]).category for m in models.tolist()]
    assert told == [CATEGORIES[c] for c in category.tolist()]
    mains = list(ObjectStream(source_of(small_library, company=1.0, size=160), photos=12, main_only=True))
    every = list(ObjectStream(source_of(small_library, company=1.0, size=160), photos=12))
    assert sum(map(len, mains)) <= 12 < sum(map(len, every))
    assert turns.dtype == torch.int64


def test_turns_of_a_front(small_library: Library) -> None:
    found = generator_of(small_library, **PLAIN).photo(0).objects[0]
    assert turns_of(found) == 1
    assert turns_of(replace(found, symmetry=SymmetryGroup.cyclic(4))) == 4
    assert turns_of(replace(found, symmetry=SymmetryGroup.revolution())) == 0
    # About a lying axis it is no matter of azimuth.
    assert turns_of(replace(found, symmetry=SymmetryGroup.cyclic(4, (1.0, 0.0, 0.0)))) == 1


def numbered(first: int, count: int) -> Objects:
    n = torch.arange(first, first + count)
    photos = n.to(torch.uint8)[:, None, None, None].expand(-1, 3, 2, 2)
    four = n[:, None].expand(-1, 4).float()
    renders = n.to(torch.uint8)[:, None, None, None].expand(-1, 3, SIDE, SIDE)
    return Objects(photos, four, four, four[:, :3], n, n, renders, n)


def test_a_ring_keeps_the_newest_objects() -> None:
    ring: Ring[Objects] = Ring(5, torch.device("cpu"))
    ring.add(numbered(0, 3))
    generator = torch.Generator().manual_seed(0)
    assert set(ring.draw(50, generator).turns.tolist()) == {0, 1, 2}
    ring.add(numbered(3, 4))
    assert ring.entered == 7
    drawn = ring.draw(100, generator)
    assert set(drawn.turns.tolist()) == {2, 3, 4, 5, 6}
    assert torch.equal(drawn.angles[:, 0], drawn.turns.float())
    assert torch.equal(drawn.photos[:, 0, 0, 0], drawn.turns.to(torch.uint8))
    assert torch.equal(drawn.category, drawn.turns) and torch.equal(drawn.models, drawn.turns)
    assert torch.equal(drawn.renders[:, 0, 0, 0], drawn.turns.to(torch.uint8))


def test_plain_views_show_the_model_turned_nearly_as_in_the_photo(small_library: Library) -> None:
    source = source_of(small_library, size=160, warp=0.0, redress=0.0, **QUIET)
    found = objects(source.generator(), range(24), source)
    assert found is not None
    bare = objects(source.generator(), range(24), source, plain=False)
    assert bare is not None and bare.renders.shape == (len(found), 3, 0, 0)
    assert torch.equal(bare.photos, found.photos)
    # A plain view is white but for the model, which reaches two opposite borders and no further.
    dark = (found.renders < 250).any(dim=1)
    wide = dark.any(dim=1).float().sum(dim=1).maximum(dark.any(dim=2).float().sum(dim=1))
    assert float(wide.min()) >= 0.9 * SIDE and 0.05 < float(dark.float().mean()) < 0.8
    # Its outline is as wide for its height as the object's box, but for a turn of up to 24 degrees.
    size = found.boxes[:, 2:] - found.boxes[:, :2]
    drawn = torch.stack([dark.any(dim=1).sum(dim=1), dark.any(dim=2).sum(dim=1)], dim=1)
    apart = (torch.log(size[:, 0] / size[:, 1]) - torch.log(drawn[:, 0] / drawn[:, 1])).abs()
    assert float(apart.median()) < 0.35
