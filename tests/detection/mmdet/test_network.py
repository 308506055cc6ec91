"""The real network of the real config, with random weights. Skipped where its packages are not set up."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.detection import reading
from cadpose.detection.coco import COCO_NAMES
from cadpose.errors import InputError
from cadpose.records import Photo
from tests.detection.mmdet.made import absent, hurry, photograph, published_form, settle

REASON = absent()
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(REASON), reason=REASON)]

#: Some names and shapes of the published network, one from each of its parts.
PARTS = {
    "backbone.conv1.weight": (64, 3, 7, 7),
    "backbone.layer1.0.conv2.weight_gamma": (64, 1, 1, 1),
    "backbone.layer2.0.conv2.weight_diff": (128, 128, 3, 3),
    "backbone.layer3.5.conv2.offset_l.weight": (18, 256, 3, 3),
    "backbone.layer4.2.conv2.switch.weight": (1, 512, 1, 1),
    "backbone.layer4.0.conv2.pre_context.bias": (512,),
    "neck.lateral_convs.3.conv.weight": (256, 2048, 1, 1),
    "neck.rfp_modules.0.layer2.0.rfp_conv.weight": (512, 256, 1, 1),
    "neck.rfp_aspp.aspp.2.weight": (64, 256, 3, 3),
    "neck.rfp_weight.bias": (1,),
    "rpn_head.rpn_reg.weight": (12, 256, 1, 1),
    "roi_head.bbox_head.0.shared_fcs.0.weight": (1024, 12544),
    "roi_head.bbox_head.2.fc_cls.weight": (81, 1024),
    "roi_head.mask_head.1.conv_res.conv.weight": (256, 256, 1, 1),
    "roi_head.mask_head.2.conv_logits.weight": (80, 256, 1, 1),
    "roi_head.semantic_head.conv_logits.weight": (183, 256, 1, 1),
}


@pytest.fixture(scope="module")
def detector(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Built, saved as OpenMMLab saves, built anew and loaded."""
    import torch

    from cadpose.detection.mmdet.detector import DetectorsDetector
    from cadpose.detection.mmdet.model import Htc

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    path = tmp_path_factory.mktemp("detectors") / "htc.pth"
    first = Htc(scale=(192, 128)).module
    settle(first)
    published_form(first, path)
    sums = {k: float(v.double().sum()) for k, v in first.state_dict().items()}
    del first
    made = DetectorsDetector(checkpoint=path, min_score=0.0, scale=(192, 128))
    path.unlink()
    module = made._network.module
    assert sums == {k: float(v.double().sum()) for k, v in module.state_dict().items()}
    hurry(module)
    yield made
    torch.set_num_threads(threads)


def test_names_and_shapes_are_the_published_ones(detector: Any) -> None:
    from cadpose.detection.mmdet.model import set_weights

    state = dict(detector._network.module.state_dict())
    assert {key: tuple(state[key].shape) for key in PARTS} == PARTS
    assert round(sum(p.numel() for p in detector._network.module.parameters()) / 1e6, 1) == 134.8
    state["neck.rfp_weight.weights"] = state.pop("neck.rfp_weight.weight")
    wanted = "x.pth: .* lacks neck.rfp_weight.weight, but has neck.rfp_weight.weights"
    with pytest.raises(InputError, match=wanted):
        set_weights(detector._network.module, state, "x.pth")


def test_boxes_and_masks_are_well_formed(detector: Any) -> None:
    photo = Photo(photograph(150, 200))
    found = detector.detect(photo)
    assert 1 <= len(found) <= 100
    assert [d.score for d in found] == sorted((d.score for d in found), reverse=True)
    for d in found:
        x0, y0, x1, y1 = d.box.to_tuple()
        assert 0 <= x0 < x1 <= 200 and 0 <= y0 < y1 <= 150 and d.source == "detectors"
        if d.mask is not None:
            assert d.mask.shape == (150, 200) and d.mask.dtype == np.bool_
            rows, columns = np.flatnonzero(d.mask.any(axis=1)), np.flatnonzero(d.mask.any(axis=0))
            # Pasted into the box, to a pixel.
            assert y0 - 1 <= rows[0] and rows[-1] <= y1 and x0 - 1 <= columns[0] and columns[-1] <= x1
    assert any(d.mask is not None for d in found)


def test_no_more_masks_than_memory_should_hold(detector: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    photo = Photo(photograph(150, 200))
    scores = detector.instances(photo).scores
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 7 * 150 * 200)
    few = detector.instances(photo)
    assert len(scores) > 7 and len(few.masks) == 7
    np.testing.assert_allclose(few.scores, np.sort(scores)[:-8:-1])


def test_what_is_found_is_mmdets_own_answer(detector: Any) -> None:
    import torch

    rgb = photograph(150, 200, seed=1)
    network = detector._network
    with torch.inference_mode(), pytest.warns(UserWarning):
        inputs, samples = network._prepared(rgb)
        (whole,) = network.module.predict(inputs, samples, rescale=True)
    wanted = whole.pred_instances
    raw = detector.instances(Photo(rgb))
    assert len(raw) == len(wanted) == 100
    np.testing.assert_allclose(raw.boxes, wanted.bboxes.numpy().clip(0, [200, 150] * 2), atol=1e-4)
    np.testing.assert_allclose(raw.scores, wanted.scores.numpy(), atol=1e-6)
    np.testing.assert_array_equal(raw.classes, np.array(sorted(COCO_NAMES))[wanted.labels.numpy()])
    assert (raw.masks != wanted.masks.numpy()).mean() < 1e-4
    # Asked for some classes, it gives those of the same hundred.
    floor = float(np.median(raw.scores))
    some = np.unique(raw.classes[raw.scores >= floor])[:2]
    few = network.instances(rgb, floor, some)
    keep = np.isin(raw.classes, some) & (raw.scores >= floor)
    np.testing.assert_allclose(few.boxes, raw.boxes[keep], atol=1e-4)
    assert (few.masks != raw.masks[keep]).mean() < 1e-4


@pytest.mark.parametrize("size", [(8, 400), (300, 5)])
def test_narrow_photos_do(detector: Any, size: tuple[int, int]) -> None:
    for d in detector.detect(Photo(photograph(*size))):
        assert d.mask is None or d.mask.shape == size


def test_the_picture_is_made_as_the_config_says(detector: Any) -> None:
    from cadpose.detection.mmdet.model import Htc, fitted

    network = detector._network
    # Red, green and blue apart; as large as it is to be, so that nothing is resized.
    inputs, (sample,) = network._prepared(np.full((120, 192, 3), (255, 128, 0), np.uint8))
    assert inputs.shape == (1, 3, 128, 192) and sample.metainfo["scale_factor"] == (1.0, 1.0)
    seen = inputs[0, :, 0, 0].tolist()
    assert seen == pytest.approx([(255 - 123.675) / 58.395, (128 - 116.28) / 57.12, -103.53 / 57.375])
    assert not inputs[:, :, 120:].any()
    assert sample.metainfo["img_shape"] == (120, 192) and sample.metainfo["batch_input_shape"] == (128, 192)
    mmcv = importlib.import_module("mmcv")
    for height, width in ((480, 640), (427, 640), (640, 333), (3000, 4000), (50, 999), (801, 1333)):
        rescaled = mmcv.imrescale(np.zeros((height, width, 3), np.uint8), (1333, 800))
        assert fitted(width, height, (1333, 800)) == rescaled.shape[1::-1]
    assert Htc.__init__.__defaults__ == ("cpu", None)
    config = importlib.import_module("cadpose.detection.mmdet.model")._config()
    assert config.model.test_cfg.rcnn.max_per_img == 100
    assert [s["scale"] for s in config.test_pipeline if s["type"] == "Resize"] == [(1333, 800)]


def test_classes_are_in_mmdets_order() -> None:
    importlib.import_module("cadpose.detection.mmdet.packages").require()
    spec = importlib.util.find_spec("mmdet")
    assert spec is not None and spec.origin is not None
    text = (Path(spec.origin).parent / "datasets" / "coco.py").read_text(encoding="utf-8")
    names = [
        ast.literal_eval(value)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Dict)
        for key, value in zip(node.keys, node.values, strict=True)
        if isinstance(key, ast.Constant) and key.value == "classes"
    ]
    assert list(names[0]) == [COCO_NAMES[i] for i in sorted(COCO_NAMES)]
