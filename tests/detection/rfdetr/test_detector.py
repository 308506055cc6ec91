from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.detection.canvas import Canvas, network_input
from cadpose.detection.onnx_detector import OnnxDetector
from cadpose.detection.onnx_head import read_head
from cadpose.detection.rfdetr import detector as module
from cadpose.detection.rfdetr import export
from cadpose.detection.rfdetr.detector import RfDetrDetector
from cadpose.detection.rfdetr.export import export_network, export_rfdetr
from cadpose.detection.rfdetr.network import build
from cadpose.detection.rfdetr.sizes import SIZES, head_of
from cadpose.errors import DependencyError, InputError
from cadpose.geometry.boxes import mask_iou
from cadpose.records import Photo
from cadpose.weights import UNPUBLISHED, Unpublished
from tests.detection.rfdetr.published import NARROW, SMALL, published_tensors, small_settings

torch = pytest.importorskip("torch")
pytest.importorskip("transformers")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path))
    folder = tmp_path / "weights"
    folder.mkdir()
    return folder


@pytest.fixture
def photo() -> Photo:
    rng = np.random.default_rng(5)
    return Photo(rng.integers(0, 256, (70, 110, 3), np.uint8))


@pytest.fixture
def small(cache: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The small network in the place of the published size n; its tensors."""
    tensors = published_tensors(SMALL, NARROW, seed=2)
    entry = Unpublished("rf-detr-seg-n", "small.pth", "https://example.org/small.pth", "none")
    torch.save({"model": tensors}, cache / entry.file)
    for place in (module, export):
        monkeypatch.setattr(place, "SIZES", {**SIZES, "n": SMALL})
        monkeypatch.setattr(place, "UNPUBLISHED", {entry.name: entry})
        monkeypatch.setattr(place, "configuration", lambda size: small_settings())
    return tensors


def test_every_size_has_weights_and_a_description_in_the_published_order() -> None:
    for name, size in SIZES.items():
        assert UNPUBLISHED[size.weights].url.endswith(f"/rf-detr-seg-{name}-ft.pth")
        assert len(UNPUBLISHED[size.weights].md5) == 32
        assert head_of(size.side, "x.onnx").input.size == (size.side, size.side)
        assert size.side % 4 == 0


def test_a_size_that_is_not_there_and_weights_that_are_not(cache: Path) -> None:
    with pytest.raises(InputError, match="no size xs: choose one of n, s, m, l, xl, 2xl"):
        RfDetrDetector("xs")
    with pytest.raises(DependencyError) as caught:
        RfDetrDetector()
    assert "rf-detr-seg-s-ft.pth" in str(caught.value) and str(cache) in str(caught.value)
    (cache / "rf-detr-seg-s-ft.pth").write_bytes(b"another file")
    with pytest.raises(DependencyError, match="MD5 differs"):
        RfDetrDetector()


def test_the_photo_is_normalised_as_published(photo: Photo) -> None:
    head = head_of(48, "x.onnx")
    x = network_input(photo.rgb, Canvas.of(photo.width, photo.height, head.input), head.input)
    tensor = torch.from_numpy(photo.rgb.transpose(2, 0, 1).copy()).float()[None] / 255
    tensor = torch.nn.functional.interpolate(tensor, (48, 48), mode="bilinear", align_corners=False)
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    expected = (tensor - mean[:, None, None]) / std[:, None, None]
    np.testing.assert_allclose(x, expected.numpy(), atol=0.8 / 255 / 0.224)  # OpenCV's 8 bits


def test_detections_are_what_the_network_gives(small: dict[str, Any], photo: Photo) -> None:
    detector = RfDetrDetector("n", min_score=0.0)
    assert detector.name == "rfdetr:n"
    found = detector.detect(photo)
    assert found and all(d.source == "rfdetr" for d in found)
    assert [d.score for d in found] == sorted((d.score for d in found), reverse=True)
    with torch.inference_mode():
        head = head_of(48, "x.onnx")
        x = network_input(photo.rgb, Canvas.of(photo.width, photo.height, head.input), head.input)
        out = build(small_settings(), small)(pixel_values=torch.from_numpy(x))
    masks = torch.nn.functional.interpolate(out.pred_masks, (70, 110), mode="bilinear", align_corners=False)
    scores = out.logits.sigmoid()[0]
    cx, cy, w, h = out.pred_boxes[0].unbind(-1)
    corners = torch.stack([cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2], -1) * torch.tensor([110, 70] * 2)
    corners = corners.clamp(min=0).minimum(torch.tensor([110.0, 70.0] * 2))
    for d in found:
        i = int((corners - torch.tensor(d.box.to_tuple())).abs().amax(1).argmin())
        np.testing.assert_allclose(corners[i], d.box.to_tuple(), atol=1e-3)
        assert d.score == pytest.approx(float(scores[i][torch.isclose(scores[i], torch.tensor(d.score))][0]))
        assert d.mask is None or mask_iou(d.mask, (masks[0, i] > 0).numpy()) > 0.99


def test_the_export_finds_the_same_without_torch(small: dict[str, Any], photo: Photo, tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    description = export_rfdetr("n", tmp_path / "out")
    assert description == tmp_path / "out" / "rf-detr-seg-n.json"
    head = read_head(description)
    data = (tmp_path / "out" / "rf-detr-seg-n.onnx").read_bytes()
    assert head.sha256 == hashlib.sha256(data).hexdigest()
    here, there = (
        d.detect(photo)
        for d in (RfDetrDetector("n", min_score=0.0), OnnxDetector(description, min_score=0.0))
    )
    assert len(here) == len(there) > 0
    for a, b in zip(here, there, strict=True):
        np.testing.assert_allclose(a.box.to_tuple(), b.box.to_tuple(), atol=1e-2)
        assert a.category == b.category and a.score == pytest.approx(b.score, abs=1e-4)
        assert (a.mask is None) == (b.mask is None)
        assert a.mask is None or b.mask is None or mask_iou(a.mask, b.mask) > 0.98


def test_export_leaves_the_network_as_it_was(tmp_path: Path) -> None:
    pytest.importorskip("onnx")
    net = build(small_settings(), published_tensors(SMALL, NARROW))
    export_network(net, SMALL.side, tmp_path, "net")
    assert "interpolate_pos_encoding" not in vars(net.model.model.backbone.backbone.embeddings)
    with pytest.raises(InputError, match="no size"):
        export_rfdetr("xs", tmp_path)


def test_weights_of_another_size(small: dict[str, Any], cache: Path, photo: Photo) -> None:
    torch.save({"model": published_tensors(SIZES["n"], NARROW)}, cache / "small.pth")
    with pytest.raises(DependencyError, match="do not fit"):
        RfDetrDetector("n").detect(photo)
