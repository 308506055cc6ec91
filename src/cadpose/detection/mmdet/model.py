"""The network of mmdetection's ``detectors_htc-r50_1x_coco``: built, given weights, and run on a photo.

DetectoRS (Qiao, Chen, Yuille, CVPR 2021) with the heads of Hybrid Task Cascade and a ResNet-50. The config
comes with mmdet's wheel, and what it says is done: the size of the picture, mean and deviation, padding,
score threshold, suppression and number of objects.
"""

from __future__ import annotations

import importlib
import logging
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.mmdet import packages
from cadpose.detection.reading import most_masks
from cadpose.errors import DependencyError, InputError
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask
from cadpose.torch_files import read_torch_file

if TYPE_CHECKING:
    from torch import nn

log = logging.getLogger(__name__)

CONFIG = "detectors/detectors_htc-r50_1x_coco.py"
#: COCO id of each of the network's classes.
COCO_IDS = np.array(sorted(COCO_NAMES))
#: Largest checkpoint that is read; the published one has some 540 MB.
MAX_BYTES = 2**30
#: Padded sides are at least so long: the last map of 1/32 is mirrored by two cells, which takes three.
LEAST_SIDE = 96


@dataclass(frozen=True, eq=False)
class Instances:
    """N objects as the network gave them, best first.

    Attributes:
        boxes: (N, 4) x0, y0, x1, y1 in continuous pixels of the photo, inside it.
        classes: (N,) COCO ids, see :data:`cadpose.detection.coco.COCO_NAMES`.
        scores: (N,) in [0, 1].
        masks: (N, H, W) bool of the photo's size.

    Raises:
        ValueError: the arrays do not fit each other.
    """

    boxes: FloatArray
    classes: NDArray[np.int64]
    scores: FloatArray
    masks: Mask

    def __post_init__(self) -> None:
        n = len(self.scores)
        if self.boxes.shape != (n, 4) or self.classes.shape != (n,) or self.scores.shape != (n,):
            raise ValueError("Instances: boxes, classes and scores differ in length")
        if self.masks.dtype != np.bool_ or self.masks.ndim != 3 or len(self.masks) != n:
            raise ValueError(f"Instances.masks must be ({n}, H, W) bool, got {self.masks.shape}")

    def __len__(self) -> int:
        return len(self.scores)


class Htc:
    """The network on a device, its weights random until :meth:`load`.

    Args:
        device: ``"cpu"`` or ``"cuda"``.
        scale: The photo is brought as large as fits these two sides, either way round; None takes the
            config's.

    Raises:
        DependencyError: PyTorch, the device or OpenMMLab's packages are not there.
    """

    def __init__(self, device: str = "cpu", scale: tuple[int, int] | None = None) -> None:
        packages.require(device)
        packages.load()
        config = _config()
        resize = next(step for step in config.test_pipeline if step["type"] == "Resize")
        self.scale: tuple[int, int] = scale or tuple(resize["scale"])
        self.device = device
        self.module: nn.Module = _built(config).to(device).eval()

    def load(self, path: Path) -> None:
        """Set the weights from a checkpoint as OpenMMLab publishes them, ``meta`` and ``state_dict``.

        Raises:
            InputError: it cannot be read, or is not one of this network.
        """
        set_weights(self.module, read_weights(path), str(path))

    def instances(
        self, rgb: NDArray[np.uint8], floor: float = 0.0, classes: NDArray[np.int64] | None = None
    ) -> Instances:
        """The objects of a photo, at most 100 as the config says.

        Fewer, the best, where the masks of all would not fit in ``MAX_MASK_BYTES`` of the reading module.

        Args:
            rgb: (H, W, 3) uint8.
            floor: Lowest score; the config's own threshold of 0.001 holds besides.
            classes: COCO ids for which masks are made, None for all; the other objects are left out, after
                the 100 best were taken.
        """
        import torch

        # On a GPU cuDNN would round to 10 bits of mantissa.
        exact = torch.backends.cudnn.flags(enabled=True, allow_tf32=False)
        with torch.inference_mode(), exact, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # mmdet's about its own copying
            found = self._predicted(rgb, floor, classes)
        boxes = found.bboxes.cpu().numpy().astype(np.float64)
        boxes = np.clip(boxes, 0.0, np.array([rgb.shape[1], rgb.shape[0]] * 2, np.float64))
        return Instances(
            boxes=boxes,
            classes=np.asarray(COCO_IDS[found.labels.cpu().numpy()], np.int64),
            scores=found.scores.cpu().numpy().astype(np.float64),
            masks=found.masks.cpu().numpy(),
        )

    def _predicted(self, rgb: NDArray[np.uint8], floor: float, classes: NDArray[np.int64] | None) -> Any:
        """mmdet's own ``predict``, but without masks of objects that nobody asked for."""
        import torch

        network: Any = self.module
        inputs, samples = self._prepared(rgb)
        meta = [samples[0].metainfo]
        maps = network.extract_feat(inputs)
        proposals = network.rpn_head.predict(maps, samples, rescale=False)
        heads = network.roi_head
        semantic = heads.semantic_head(maps)[1]
        (found,) = heads.predict_bbox(
            x=maps,
            semantic_feat=semantic,
            batch_img_metas=meta,
            rpn_results_list=proposals,
            rcnn_test_cfg=heads.test_cfg,
            rescale=False,
        )
        keep = found.scores >= floor
        if classes is not None:
            wanted = torch.from_numpy(np.isin(COCO_IDS, classes)).to(keep.device)
            keep &= wanted[found.labels]
        kept = found[keep][: most_masks(rgb.shape[1], rgb.shape[0])]  # the best are first
        (found,) = heads.predict_mask(
            x=maps, semantic_heat=semantic, batch_img_metas=meta, results_list=[kept], rescale=True
        )
        return found

    def _prepared(self, rgb: NDArray[np.uint8]) -> tuple[Any, list[Any]]:
        """(1, 3, H', W') float32 input and mmdet's record about it."""
        import torch
        from torch.nn import functional as F

        height, width = rgb.shape[:2]
        new_width, new_height = fitted(width, height, self.scale)
        small = cv2.resize(rgb, (new_width, new_height), interpolation=cv2.INTER_LINEAR)
        # The config's preprocessor wants BGR, as OpenCV reads files.
        pixels = torch.from_numpy(np.ascontiguousarray(small[..., ::-1].transpose(2, 0, 1)))
        sample = importlib.import_module("mmdet.structures").DetDataSample(
            metainfo={
                "ori_shape": (height, width),
                "img_shape": (new_height, new_width),
                "scale_factor": (new_width / width, new_height / height),
            }
        )
        network: Any = self.module
        data = network.data_preprocessor({"inputs": [pixels], "data_samples": [sample]}, False)
        inputs = data["inputs"]
        missing = [max(LEAST_SIDE - side, 0) for side in inputs.shape[2:]]
        if any(missing):  # the config's network itself fails on pictures as narrow as this
            inputs = F.pad(inputs, (0, missing[1], 0, missing[0]))
            shape = tuple(inputs.shape[2:])
            sample.set_metainfo({"batch_input_shape": shape, "pad_shape": shape})
        return inputs, list(data["data_samples"])


def fitted(width: int, height: int, scale: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a picture as large as fits ``scale``, either way round (mmcv's rounding)."""
    factor = min(max(scale) / max(width, height), min(scale) / min(width, height))
    return max(int(width * factor + 0.5), 1), max(int(height * factor + 0.5), 1)


def _config() -> Any:
    folder = Path(str(importlib.import_module("mmdet").__file__)).parent / ".mim" / "configs"
    path = folder / CONFIG
    if not path.is_file():
        raise DependencyError(f"{path} is missing: run `cadpose detectors setup` again")
    config = importlib.import_module("mmengine.config").Config.fromfile(str(path))
    # What is for training only, weights to start from among it, would be fetched or warned of.
    config.model.train_cfg = None
    config.model.backbone.pop("init_cfg", None)
    config.model.neck.rfp_backbone.pop("pretrained", None)
    return config


def _built(config: Any) -> Any:
    registry = importlib.import_module("mmengine.registry")
    with warnings.catch_warnings(), registry.DefaultScope.overwrite_default_scope("mmdet"):
        warnings.simplefilter("ignore", UserWarning)  # about losses, which training alone has
        return registry.MODELS.build(config.model)


def read_weights(path: Path) -> dict[str, Any]:
    """The tensors of a checkpoint by name; nothing but plain data is unpickled.

    Raises:
        InputError: it is not there, too large, or something else.
    """
    import torch

    content = read_torch_file(path, MAX_BYTES, "DetectoRS")
    weights = content.get("state_dict") if isinstance(content, dict) else None
    if not isinstance(weights, dict):
        raise InputError(f"{path}: holds no state_dict, as OpenMMLab's checkpoints do")
    return {str(k).removeprefix("module."): v for k, v in weights.items() if isinstance(v, torch.Tensor)}


def set_weights(module: nn.Module, weights: dict[str, Any], name: str) -> None:
    """Set every parameter and buffer, in place; counters of batches may be missing.

    Raises:
        InputError: one is missing, of another shape, or not finite; the message begins with ``name``.
    """
    wanted = module.state_dict()
    needed = [key for key in wanted if not key.endswith("num_batches_tracked")]
    missing = [key for key in needed if key not in weights]
    unknown = [key for key in weights if key not in wanted]
    if missing:
        instead = f", but has {unknown[0]}" if unknown else ""
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise InputError(f"{name}: is not a checkpoint of DetectoRS, it lacks {missing[0]}{more}{instead}")
    for key in needed:
        given, own = weights[key], wanted[key]
        if given.shape != own.shape:
            raise InputError(
                f"{name}: {key} has shape {tuple(given.shape)}, DetectoRS has {tuple(own.shape)} there"
            )
        if not given.is_floating_point() or not bool(given.isfinite().all()):
            raise InputError(f"{name}: {key} holds what is not a finite number, fetch the file anew")
    if unknown:
        log.warning("%s: %d names are not the network's, %s the first", name, len(unknown), unknown[0])
    module.load_state_dict({key: weights[key] for key in wanted if key in weights}, strict=False)
