from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from cadpose.errors import InputError
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.head import (
    CHECKPOINT,
    HeadRecipe,
    MapHead,
    head_errors,
    load_head,
    save_head,
    train_head,
)
from cadpose.training.lite.maps import Maps
from tests.training.lite.made import CATEGORIES, made_maps

pytestmark = pytest.mark.usefixtures("one_thread")

RECIPE = HeadRecipe(epochs=4, batch=4, warmup=2, ema=0.5, unknown=0.0)


@pytest.fixture(scope="module")
def shard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("maps") / "000000.npz"
    path.write_bytes(made_maps(8).to_bytes())
    return path


def test_number_of_parameters() -> None:
    counts = [sum(p.numel() for p in MapHead(["a"] * n).parameters()) for n in (2, 3)]
    assert counts == [1_691_240, 1_691_240 + 32]
    wide = sum(p.numel() for p in MapHead(["a"] * 2, wide=True).parameters())
    assert counts[0] < wide < 3_000_000


def test_it_learns_a_small_set_by_heart(shard: Path) -> None:
    recipe = replace(RECIPE, epochs=60, batch=8, warmup=10, ema=0.9, contrast=0.2)
    unseen = Maps.from_file(shard)
    before, _ = head_errors(MapHead(CATEGORIES), unseen)
    head = train_head([shard], CATEGORIES, recipe)
    found, category = head_errors(head, unseen)
    assert float(before.median()) > 40.0
    assert float(found.max()) < 10.0, found
    assert category.tolist() == unseen.category.tolist() and not head.training


def test_a_pause_changes_nothing(shard: Path, tmp_path: Path) -> None:
    def stop(step: int, row: dict[str, float]) -> None:
        if row.get("unseen") and step == 4:  # after the second of four epochs, before its checkpoint
            raise KeyboardInterrupt

    told: dict[str, Any] = {"unseen": Maps.from_file(shard)}
    whole = train_head([shard], CATEGORIES, RECIPE, out=tmp_path / "a", **told)
    with pytest.raises(KeyboardInterrupt):
        train_head([shard], CATEGORIES, RECIPE, out=tmp_path / "b", on_step=stop, **told)
    resumed = train_head([shard], CATEGORIES, RECIPE, out=tmp_path / "b", resume=True, **told)
    assert all(torch.equal(v, resumed.state_dict()[k]) for k, v in whole.state_dict().items())
    a, b = (
        [{k: v for k, v in row.items() if k != "seconds"} for row in Curves(tmp_path / n).rows] for n in "ab"
    )
    assert a == b and [row["step"] for row in a if row.get("unseen")] == [2, 4, 6, 8]
    with pytest.raises(InputError, match="another recipe"):
        train_head([shard], CATEGORIES, replace(RECIPE, rate=1.0), out=tmp_path / "b", resume=True)
    (tmp_path / "b" / CHECKPOINT).write_bytes(b"no checkpoint")
    with pytest.raises(InputError, match="no checkpoint of a head"):
        train_head([shard], CATEGORIES, RECIPE, out=tmp_path / "b", resume=True)


def test_nothing_to_learn_from(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(Maps.empty().to_bytes())
    with pytest.raises(InputError, match="draw more photos"):
        train_head([tmp_path / "a.npz"], CATEGORIES, RECIPE)


@pytest.mark.parametrize("wide", [False, True])
def test_weights_round_trip(tmp_path: Path, wide: bool) -> None:
    torch.manual_seed(1)
    head = MapHead(CATEGORIES, wide).eval()
    save_head(head, tmp_path / "head.pt")
    again = load_head(tmp_path / "head.pt")
    data = made_maps(2)
    inputs = (*(torch.from_numpy(c) for c in data.cells), torch.eye(2).repeat(2, 1))
    with torch.no_grad():
        one, two = head(*inputs), again(*inputs)
    assert all(torch.equal(a, b) for a, b in zip(one[0] + one[1], two[0] + two[1], strict=True))
    assert (
        again.categories == CATEGORIES
        and again.wide is wide
        and [p.name for p in tmp_path.iterdir()] == ["head.pt"]
    )
    (tmp_path / "head.pt").write_bytes(b"PK")
    with pytest.raises(InputError, match="holds no head"):
        load_head(tmp_path / "head.pt")
