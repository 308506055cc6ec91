from __future__ import annotations

import hashlib
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from cadpose.errors import DependencyError, InputError
from cadpose.training.checkpoints import read_checkpoint
from cadpose.training.posecontrast.loading import (
    CHECKPOINTS,
    checkpoint_file,
    load_initial,
    load_weights,
)
from cadpose.training.posecontrast.network import PoseContrast
from tests.training.posecontrast.made import TINY, authors_content, moco_content


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path))
    (tmp_path / "weights").mkdir()
    return tmp_path / "weights"


def test_mocos_names_map_to_the_encoder_and_nothing_else() -> None:
    net = PoseContrast()
    head = {k: v.clone() for k, v in net.net_vp.state_dict().items()}
    content = moco_content()
    assert load_weights(net, content, "moco") == "encoder"
    state = content["state_dict"]
    assert isinstance(state, dict)
    for key, value in net.net_feat.state_dict().items():
        assert torch.equal(value, state[f"module.encoder_q.{key}"]), key
    assert all(torch.equal(v, head[k]) for k, v in net.net_vp.state_dict().items())
    # The authors' converted form of the same file.
    converted = {k.removeprefix("module.encoder_q."): v for k, v in state.items() if "encoder_q" in k}
    again = PoseContrast()
    assert load_weights(again, {"model": converted, "__author__": "MOCO"}, "converted") == "encoder"
    found = again.net_feat.state_dict()
    assert all(torch.equal(found[k], v) for k, v in net.net_feat.state_dict().items())


def test_the_authors_names_map_to_all() -> None:
    source, net = TINY.network(1), TINY.network(2)
    assert load_weights(net, authors_content(source), "theirs") == "network"
    assert all(torch.equal(v, source.state_dict()[k]) for k, v in net.state_dict().items())


def test_counters_of_batches_may_lack() -> None:
    net = TINY.network(0)
    old = {k: v for k, v in TINY.network(1).net_feat.state_dict().items() if "num_batches" not in k}
    assert load_weights(net, {"state_dict": old}, "old") == "encoder"


def test_what_does_not_fit_names_the_parameter() -> None:
    net = TINY.network(0)
    content = authors_content(TINY.network(1))
    head = content["net_vp"]
    assert isinstance(head, dict)
    short = {k: v for k, v in head.items() if k != "fc_reg_inp.bias"}
    with pytest.raises(InputError, match=r"no fc_reg_inp\.bias"):
        load_weights(net, content | {"net_vp": short}, "x.pth")
    with pytest.raises(InputError, match=r"fc_cls_azi.bias has shape \(25,\)"):
        load_weights(net, content | {"net_vp": dict(head) | {"fc_cls_azi.bias": torch.zeros(25)}}, "x.pth")
    with pytest.raises(InputError, match="not numbers"):
        load_weights(
            net, content | {"net_vp": dict(head) | {"fc_cls_azi.bias": torch.full((24,), torch.nan)}}, "x"
        )
    with pytest.raises(InputError, match=r"no conv1\.weight"):
        load_weights(net, {"epoch": 3}, "x.pth")


def test_tensors_of_other_kinds_are_refused() -> None:
    net, content = TINY.network(0), authors_content(TINY.network(1))
    head = content["net_vp"]
    assert isinstance(head, dict)
    bias = head["fc_cls_azi.bias"]
    for kind in (bias.to_sparse(), bias.to(torch.complex64), bias.to(torch.float8_e4m3fn)):
        with pytest.raises(InputError, match=r"fc_cls_azi\.bias holds numbers of another kind"):
            load_weights(net, content | {"net_vp": dict(head) | {"fc_cls_azi.bias": kind}}, "x.pth")


def test_files_that_are_no_checkpoints(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="check the path"):
        read_checkpoint(tmp_path / "none.pth")
    with pytest.raises(InputError, match="not a file"):
        read_checkpoint(tmp_path)
    (tmp_path / "text.pth").write_text("no weights")
    with pytest.raises(InputError, match="plain tensors"):
        read_checkpoint(tmp_path / "text.pth")
    torch.save([1, 2], tmp_path / "list.pth")
    with pytest.raises(InputError, match="dictionary"):
        read_checkpoint(tmp_path / "list.pth")


def test_nothing_hostile_is_run(tmp_path: Path) -> None:
    class Hostile:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "touched",))

    (tmp_path / "a.pth").write_bytes(pickle.dumps({"net_feat": Hostile()}))
    torch.save({"net_feat": Hostile()}, tmp_path / "b.pth")
    for name in ("a.pth", "b.pth"):
        with pytest.raises(InputError):
            read_checkpoint(tmp_path / name)
    assert not (tmp_path / "touched").exists()


def test_absent_weights_name_the_address_and_the_place(cache: Path) -> None:
    for checkpoint in CHECKPOINTS.values():
        with pytest.raises(DependencyError) as caught:
            checkpoint_file(checkpoint.name)
        assert checkpoint.url in str(caught.value) and str(cache / checkpoint.file) in str(caught.value)


def test_the_md5_is_checked_where_it_is_known(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (cache / CHECKPOINTS["moco"].file).write_bytes(b"weights")
    with pytest.raises(DependencyError, match="MD5 differs"):
        load_initial(TINY.network(0), "moco")
    right = replace(CHECKPOINTS["moco"], md5=hashlib.md5(b"weights").hexdigest())
    monkeypatch.setitem(CHECKPOINTS, "moco", right)
    assert checkpoint_file("moco") == cache / right.file


def test_a_file_that_changes_after_its_first_use_is_refused(cache: Path) -> None:
    path = cache / CHECKPOINTS["posecontrast-pascal3d"].file
    torch.save(authors_content(TINY.network(1)), path)
    net = TINY.network(0)
    assert load_initial(net, "posecontrast-pascal3d") == "network"
    record = path.with_name(path.name + ".sha256")
    assert record.read_text().split()[0] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert load_initial(net, "posecontrast-pascal3d") == "network"
    torch.save(authors_content(TINY.network(2)), path)
    with pytest.raises(DependencyError, match="changed since"):
        load_initial(net, "posecontrast-pascal3d")
    record.unlink()
    assert load_initial(net, "posecontrast-pascal3d") == "network"


def test_random_leaves_the_weights_alone() -> None:
    net, same = TINY.network(4), TINY.network(4)
    assert load_initial(net, "random") == "random"
    assert all(torch.equal(a, b) for a, b in zip(net.parameters(), same.parameters(), strict=True))
