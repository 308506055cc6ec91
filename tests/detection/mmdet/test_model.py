"""Checkpoints and picture sizes; the network itself is in test_network.py."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection.mmdet import model
from cadpose.detection.mmdet.model import Instances, fitted, read_weights, set_weights
from cadpose.errors import InputError

torch = pytest.importorskip("torch")


def network() -> Any:
    torch.manual_seed(0)
    return torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.BatchNorm2d(4))


def weights(**changes: Any) -> dict[str, Any]:
    made = {k: torch.full_like(v, 2) for k, v in network().state_dict().items()}
    return {k: v for k, v in (made | changes).items() if v is not None}


@pytest.mark.parametrize("zipped", [False, True])
def test_a_checkpoint_as_openmmlab_saves_it(tmp_path: Path, zipped: bool) -> None:
    path = tmp_path / "net.pth"
    meta = {"epoch": 12, "CLASSES": ("person",), "time": "Tue", "config": "a = 1"}
    state = {f"module.{k}": v for k, v in weights().items()}
    torch.save({"meta": meta, "state_dict": state}, path, _use_new_zipfile_serialization=zipped)
    module = network()
    set_weights(module, read_weights(path), str(path))
    assert all(bool((v == 2).all()) for v in module.state_dict().values())


def test_counters_may_be_missing_and_more_may_be_there(caplog: pytest.LogCaptureFixture) -> None:
    module = network()
    given_weights = weights(more=torch.ones(1)) | {"1.num_batches_tracked": torch.tensor(7)}
    set_weights(module, given_weights, "x")
    assert "1 names are not the network's, more the first" in caplog.text
    assert module[1].num_batches_tracked == 7
    del given_weights["1.num_batches_tracked"]
    set_weights(module, given_weights, "x")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"0.weight": None}, "x: is not a checkpoint of DetectoRS, it lacks 0.weight$"),
        ({"0.weight": None, "0.bias": None}, "it lacks 0.weight and 1 more$"),
        ({"0.weight": None, "0.weights": 1.0}, "it lacks 0.weight, but has 0.weights$"),
        ({"0.bias": torch.zeros(5)}, r"x: 0.bias has shape \(5,\), DetectoRS has \(4,\) there"),
        ({"0.bias": torch.tensor([0, 1, float("nan"), 2])}, "x: 0.bias holds what is not a finite number"),
        ({"0.bias": torch.zeros(4, dtype=torch.int64)}, "x: 0.bias holds what is not a finite number"),
    ],
)
def test_what_does_not_fit_is_one_sentence(changes: dict[str, Any], message: str) -> None:
    module = network()
    before = {k: v.clone() for k, v in module.state_dict().items()}
    with pytest.raises(InputError, match=message) as caught:
        set_weights(module, weights(**changes), "x")
    assert "\n" not in str(caught.value)
    assert all(torch.equal(v, before[k]) for k, v in module.state_dict().items())


class Bomb:
    def __reduce__(self) -> Any:
        return print, ("boom",)


def test_files_that_are_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "net.pth"
    with pytest.raises(InputError, match=r"net\.pth: cannot be read \(No such file"):
        read_weights(path)
    with pytest.raises(InputError, match="is not a file"):
        read_weights(tmp_path)
    for content in (b"", b"PK\x03\x04 nothing", pickle.dumps(Bomb(), 2), pickle.dumps({"state_dict": {}}, 2)):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"net\.pth: is no checkpoint of plain tensors") as caught:
            read_weights(path)
        assert "\n" not in str(caught.value)
    torch.save({"state_dict": Bomb()}, path)
    with pytest.raises(InputError, match="is no checkpoint of plain tensors"):
        read_weights(path)
    assert "boom" not in capsys.readouterr().out
    for held in (weights(), {"state_dict": [1]}, torch.ones(3)):
        torch.save(held, path)
        with pytest.raises(InputError, match="holds no state_dict"):
            read_weights(path)


def test_a_file_that_is_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model, "MAX_BYTES", 1 << 20)
    path = tmp_path / "net.pth"
    path.write_bytes(bytes((1 << 20) + 1))
    with pytest.raises(InputError, match="larger than 1 MiB, which no checkpoint of DetectoRS is"):
        read_weights(path)


@given(width=st.integers(1, 8000), height=st.integers(1, 8000))
def test_pictures_fit_and_keep_their_shape(width: int, height: int) -> None:
    new_width, new_height = fitted(width, height, (1333, 800))
    assert 1 <= max(new_width, new_height) <= 1333 and 1 <= min(new_width, new_height) <= 800
    # One of the two sides is reached, to half a pixel.
    assert max(new_width, new_height) == 1333 or min(new_width, new_height) == 800
    if min(new_width, new_height) > 1:
        assert abs(new_width / width - new_height / height) <= 0.5 / width + 0.5 / height
    assert fitted(height, width, (800, 1333)) == (new_height, new_width)


def test_instances_are_checked() -> None:
    one: dict[str, Any] = {
        "boxes": np.zeros((1, 4)),
        "classes": np.ones(1, np.int64),
        "scores": np.ones(1),
        "masks": np.zeros((1, 2, 3), np.bool_),
    }
    assert len(Instances(**one)) == 1
    with pytest.raises(ValueError, match="differ in length"):
        Instances(**one | {"scores": np.ones(2)})
    with pytest.raises(ValueError, match=r"Instances\.masks"):
        Instances(**one | {"masks": np.zeros((1, 2, 3))})
