from __future__ import annotations

import argparse
import pickle
from pathlib import Path
from typing import Any

import pytest

from cadpose.detection.rfdetr import checkpoint
from cadpose.detection.rfdetr.checkpoint import read_checkpoint
from cadpose.detection.rfdetr.sizes import GROUPS
from cadpose.errors import DependencyError

torch = pytest.importorskip("torch")


def saved(path: Path, content: Any) -> Path:
    torch.save(content, path)
    return path


def test_tensors_beside_the_settings_of_training(tmp_path: Path) -> None:
    weight = torch.arange(6.0).reshape(2, 3)
    table = {"a.weight": weight, "_kp_active_mask": torch.zeros(0, 0)}
    args = argparse.Namespace(lr=1e-4, pretrain_weights="none", classes=["a"])
    tensors = read_checkpoint(saved(tmp_path / "x.pth", {"model": table, "args": args, "epoch": 3}), 5)
    assert list(tensors) == ["a.weight"] and torch.equal(tensors["a.weight"], weight)
    assert list(read_checkpoint(saved(tmp_path / "y.pth", {"a.weight": weight}), 5)) == ["a.weight"]


def test_queries_are_cut_group_by_group(tmp_path: Path) -> None:
    rows = torch.arange(GROUPS * 5, dtype=torch.float32)[:, None]
    table = {"query_feat.weight": rows, "refpoint_embed.weight": rows.repeat(1, 4), "other.weight": rows}
    tensors = read_checkpoint(saved(tmp_path / "x.pth", {"model": table}), 3)
    expected = [5.0 * g + i for g in range(GROUPS) for i in range(3)]
    assert tensors["query_feat.weight"][:, 0].tolist() == expected
    assert tensors["refpoint_embed.weight"].shape == (GROUPS * 3, 4)
    assert torch.equal(tensors["other.weight"], rows)
    # Fewer than wanted are left, for the network to refuse.
    assert len(read_checkpoint(tmp_path / "x.pth", 9)["query_feat.weight"]) == GROUPS * 5


class Runs:
    """Would write a file if it were unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.path,))


def test_nothing_in_a_file_is_run(tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    hostile = saved(tmp_path / "x.pth", {"model": {"a": torch.zeros(1)}, "args": Runs(mark)})
    with pytest.raises(DependencyError, match="cannot be read safely as weights") as caught:
        read_checkpoint(hostile, 5)
    (tmp_path / "y.pth").write_bytes(pickle.dumps(Runs(mark), protocol=2))
    with pytest.raises(DependencyError, match="cannot be read safely"):
        read_checkpoint(tmp_path / "y.pth", 5)
    assert not mark.exists() and "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"<html>not found</html>"])
def test_files_that_are_no_checkpoint(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.pth").write_bytes(content)
    with pytest.raises(DependencyError, match="fetch the published file again"):
        read_checkpoint(tmp_path / "x.pth", 5)


def test_checkpoints_without_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = torch.zeros(1)
    contents: list[Any] = [[one], {"model": {}}, {"model": {"a": 3}}, {"model": {1: one}}]
    for content in contents:
        with pytest.raises(DependencyError, match="holds"):
            read_checkpoint(saved(tmp_path / "x.pth", content), 5)
    monkeypatch.setattr(checkpoint, "MAX_BYTES", 10)
    with pytest.raises(DependencyError, match="larger than"):
        read_checkpoint(tmp_path / "x.pth", 5)
