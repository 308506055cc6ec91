"""The stand-in for mmcv's compiled part, in a made-up mmcv."""

from __future__ import annotations

import importlib
import importlib.machinery
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from cadpose.detection.mmdet import extension, operators

torch = pytest.importorskip("torch")


@pytest.fixture
def mmcv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of an mmcv that has nothing in it."""
    package = types.ModuleType("mmcv")
    package.__path__ = [str(tmp_path)]
    package.__spec__ = importlib.machinery.ModuleSpec("mmcv", None, is_package=True)
    monkeypatch.setitem(sys.modules, "mmcv", package)
    monkeypatch.delitem(sys.modules, extension.NAME, raising=False)
    monkeypatch.setitem(sys.modules, extension.NAME, None)  # what was there comes back after the test
    del sys.modules[extension.NAME]
    return tmp_path


def test_every_name_is_there_and_three_work(mmcv: Path) -> None:
    assert extension.provide()
    given = importlib.import_module("mmcv._ext")
    boxes, scores = torch.tensor([[0.0, 0, 4, 4], [0, 0, 4, 5]]), torch.tensor([0.4, 0.6])
    assert given.nms(boxes, scores, iou_threshold=0.5, offset=0).tolist() == [1]
    assert callable(given.carafe_forward)
    with pytest.raises(NotImplementedError, match="carafe_forward is not among the operators"):
        given.carafe_forward(1, two=2)
    with pytest.raises(AttributeError):
        given.__wrapped__  # noqa: B018 (what inspect asks every module for)
    assert extension.provide()


def test_a_compiled_part_goes_before_it(mmcv: Path) -> None:
    (mmcv / "_ext.py").write_text("compiled = True\n")
    importlib.invalidate_caches()
    assert not extension.provide()
    assert importlib.import_module("mmcv._ext").compiled
    assert not extension.provide()


def test_results_go_where_mmcv_wants_them() -> None:
    torch.manual_seed(0)
    features = torch.randn(1, 4, 9, 11)
    rois = torch.tensor([[0.0, 4.0, 8.0, 30.0, 24.0]])
    none = torch.empty(0)
    out = torch.zeros(1, 4, 3, 5)
    shape: dict[str, Any] = {
        "aligned_height": 3,
        "aligned_width": 5,
        "spatial_scale": 0.25,
        "sampling_ratio": 0,
    }
    extension.roi_align_forward(features, rois, out, none, none, **shape, pool_mode=1, aligned=True)
    assert torch.equal(out, operators.roi_align(features, rois, (3, 5), 0.25))
    with pytest.raises(NotImplementedError, match="by maximum"):
        extension.roi_align_forward(features, rois, out, none, none, **shape, pool_mode=0, aligned=True)

    # Down and to the right differ, so that an exchange would show.
    weight = torch.randn(6, 2, 1, 3)
    plain = torch.nn.functional.conv2d(features, weight, None, (2, 1), (0, 2), (1, 2), groups=2)
    offset = torch.zeros(1, 6, *plain.shape[2:])
    out = torch.zeros_like(plain)
    sizes: dict[str, Any] = {
        "kH": 1,
        "kW": 3,
        "dH": 2,
        "dW": 1,
        "padH": 0,
        "padW": 2,
        "dilationH": 1,
        "dilationW": 2,
    }
    extension.deform_conv_forward(
        features, weight, offset, out, none, none, **sizes, group=2, deformable_group=1, im2col_step=1
    )
    torch.testing.assert_close(out, plain, atol=1e-5, rtol=0)
