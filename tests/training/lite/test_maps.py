from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.rotation.features import LEVELS
from cadpose.training.lite import maps
from cadpose.training.lite.augment import GENTLE, Augmentation
from cadpose.training.lite.maps import Maps, draw_shards
from tests.training.lite.made import made_maps, source_of


def arrays(m: Maps) -> list[NDArray[Any]]:
    return [*m.cells, m.angles, m.turns, m.category]


def same(a: Maps, b: Maps) -> bool:
    pairs = zip(arrays(a), arrays(b), strict=True)
    return all(x.dtype == y.dtype and np.array_equal(x, y) for x, y in pairs)


def test_bytes_round_trip(tmp_path: Path) -> None:
    made = made_maps(3)
    (tmp_path / "a.npz").write_bytes(made.to_bytes())
    assert same(Maps.from_file(tmp_path / "a.npz"), made)
    assert same(Maps.joined([made, Maps.empty()]), made) and len(Maps.empty()) == 0
    (tmp_path / "b.npz").write_bytes(made_maps(2, seed=1).to_bytes())
    (tmp_path / "c.npz").write_bytes(Maps.empty().to_bytes())
    whole, sizes = Maps.from_files([tmp_path / f"{n}.npz" for n in "acb"])
    assert same(whole, Maps.joined([made, made_maps(2, seed=1)])) and sizes == [6, 0, 4]


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 not a zip", made_maps(2).to_bytes()[:5000]])
def test_a_damaged_file_is_named(tmp_path: Path, damage: bytes) -> None:
    (tmp_path / "a.npz").write_bytes(damage)
    with pytest.raises(InputError, match=r"a\.npz is no shard"):
        Maps.from_file(tmp_path / "a.npz")
    with pytest.raises(InputError, match=r"a\.npz is no shard"):
        Maps.from_files([tmp_path / "a.npz"])


def test_an_archive_of_other_arrays_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", angles=np.zeros(3))
    with pytest.raises(InputError, match=r"a\.npz is no shard"):
        Maps.from_file(tmp_path / "a.npz")


def test_shards_are_the_same_whoever_draws_and_go_on(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maps, "SHARD", 3)  # forked workers see it
    source, told = source_of(small_library), [GENTLE, Augmentation()]
    one = list(draw_shards(source, tmp_path / "one", range(3), augmentations=told, workers=1))
    drawn = Maps.from_file(one[0])
    assert len(drawn) % 2 == 0 and len(drawn) >= 2
    assert [c.shape[1:] for c in drawn.cells] == [(level.cells, level.channels) for level in LEVELS]
    half = len(drawn) // 2
    assert np.array_equal(drawn.category[:half], drawn.category[half:])
    assert not np.array_equal(drawn.cells[0][:half], drawn.cells[0][half:])
    assert np.array_equal(drawn.angles[:half, 1], drawn.angles[half:, 1])

    done: list[Path] = []
    kept = tmp_path / "two" / one[1].name
    kept.parent.mkdir()
    kept.write_bytes(one[1].read_bytes())
    when = kept.stat().st_mtime_ns
    two = list(
        draw_shards(source, kept.parent, (2, 1, 0), augmentations=told, workers=2, on_done=done.append)
    )
    assert {p.name for p in two} == {p.name for p in one} and kept not in done and len(done) == 2
    assert kept.stat().st_mtime_ns == when
    assert [p.read_bytes() for p in sorted(two)] == [p.read_bytes() for p in one]
    assert sorted(p.name for p in kept.parent.iterdir()) == [p.name for p in one]


def test_one_crop_of_the_main_objects(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maps, "SHARD", 3)
    (path,) = draw_shards(
        source_of(small_library, company=1.0, size=160), tmp_path, [0],
        augmentations=[Augmentation()], main_only=True, workers=1,
    )  # fmt: skip
    assert 1 <= len(Maps.from_file(path)) <= 3
