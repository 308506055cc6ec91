"""PoseContrast as a rotation estimator: an exported network through ONNX Runtime.

The method's test-time flip is used: the crop and its mirror image are both looked at, and the answer of
the one whose azimuth is the surer is kept, as the authors' published code does.

Source: Xiao, Du, Marlet, "PoseContrast: Class-Agnostic Object Viewpoint Estimation in the Wild with
Pose-Aware Contrastive Learning", 3DV 2021. How the network is made: docs/training.md.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.angles import flip_angles, geodesic_degrees, rotation_from_angles
from cadpose.onnx_session import open_session
from cadpose.records import CadModel, Rotation, RotationHypothesis
from cadpose.rotation.bins import BINS, decode_hypotheses, probabilities

#: Names of the graph's input and outputs.
INPUT = "images"
OUTPUTS = (
    "azimuth",
    "elevation",
    "inplane",
    "azimuth_offset",
    "elevation_offset",
    "inplane_offset",
)
#: Where the network is looked for unless told.
VARIABLE = "CADPOSE_POSECONTRAST"
#: Side of the square crop in pixels.
SIDE = 224
#: Largest file that is loaded; ResNet-50 has some 100 MB.
MAX_BYTES = 2**30
#: Two hypotheses differ by at least this many degrees.
_DISTANCE = 25.0
#: Triples of bins that are looked through for such.
_LOOKED_AT = 256
#: Grey level that crops have beside the box (photos.FILL), where this network has seen black.
_FILL = 255


class PoseContrastEstimator:
    """Rotation from the crop alone, whatever the category.

    Args:
        path: ONNX file made by ``cadpose train rotation --arch posecontrast``, None for the file that
            ``$CADPOSE_POSECONTRAST`` names.
        device: ``"cpu"`` or ``"cuda"`` (needs onnxruntime-gpu).
        hypotheses: How many rotations to return at most.
        threads: ONNX Runtime threads within one operator; 0 lets it choose.

    Raises:
        DependencyError: no file was named, or it is not there.
    """

    name = "posecontrast"

    def __init__(
        self, path: Path | None = None, *, device: str = "cpu", hypotheses: int = 5, threads: int = 0
    ) -> None:
        told = os.environ.get(VARIABLE, "")
        if path is None and not told:
            raise DependencyError(
                "the rotation estimator posecontrast needs a trained network, and none comes with cadpose: "
                "make one with `cadpose train rotation --arch posecontrast` and name its .onnx in "
                f"${VARIABLE}"
            )
        self.path = Path(told).expanduser() if path is None else path
        if not self.path.is_file():
            raise DependencyError(
                f"there is no network {self.path}: name the .onnx that `cadpose train rotation` wrote "
                f"in ${VARIABLE}"
            )
        self.device = device
        self.hypotheses = hypotheses
        self.threads = threads

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel] = ()) -> list[RotationHypothesis]:
        """Rotation hypotheses, best first, at least 25° apart.

        The first is the method's answer. The score of each is the product of the probabilities of its
        three bins, and its ``probability`` the share of that among those returned: neither is calibrated.

        Args:
            crop: (224, 224, 3) uint8, the longer side of the object's box fills the square, white beside.
            cads: Not looked at.

        Raises:
            InputError: the file is not such a network, or its answer is not a number.
        """
        if crop.shape != (SIDE, SIDE, 3) or crop.dtype != np.uint8:
            raise ValueError(f"expected a ({SIDE}, {SIDE}, 3) uint8 crop, found {crop.shape} {crop.dtype}")
        seen = blackened(crop)
        outputs = self._run(np.stack([seen, seen[:, ::-1]]))
        # The authors compare azimuths alone; equal ones leave the crop as it is.
        sure = probabilities(outputs[0]).max(axis=1)
        view = int(np.argmax(sure))
        chosen = [output[view : view + 1] for output in outputs]
        angles, scores = decode_hypotheses(chosen[:3], chosen[3:], _LOOKED_AT)
        columns = angles[0].T
        azimuth, elevation, inplane = flip_angles(*columns) if view else columns
        R = rotation_from_angles(azimuth, elevation, inplane)
        kept: list[int] = []
        for i in range(len(R)):
            if len(kept) == self.hypotheses:
                break
            if not kept or (geodesic_degrees(R[i], R[kept]) >= _DISTANCE).all():
                kept.append(i)
        shares = scores[0, kept] / scores[0, kept].sum()
        return [
            RotationHypothesis(
                Rotation(float(azimuth[i]), float(elevation[i]), float(inplane[i])),
                score=float(scores[0, i]),
                probability=float(share),
            )
            for i, share in zip(kept, shares, strict=True)
        ]

    def _run(self, images: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
        answers = self._session.run(list(OUTPUTS), {INPUT: np.ascontiguousarray(images)})
        outputs = [np.asarray(a, np.float64) for a in answers]
        if [o.shape for o in outputs] != [(len(images), k) for k in BINS] * 2:
            raise InputError(f"{self.path}: answers other shapes than a PoseContrast network, export it anew")
        if not all(np.isfinite(o).all() for o in outputs):
            raise InputError(f"{self.path}: answers values that are not numbers, train it anew")
        return outputs

    @cached_property
    def _session(self) -> Any:
        if self.path.stat().st_size > MAX_BYTES:
            raise InputError(f"{self.path}: larger than {MAX_BYTES >> 20} MiB, which no such network is")
        try:
            session = open_session(self.path, self.device, self.threads)
        except Exception as error:  # ONNX Runtime's errors share no class
            raise InputError(
                f"{self.path}: is no ONNX network ({type(error).__name__}), export it anew"
            ) from None
        inputs = [(i.name, i.type, list(i.shape[1:])) for i in session.get_inputs()]
        if inputs != [(INPUT, "tensor(uint8)", [SIDE, SIDE, 3])] or not set(OUTPUTS) <= {
            o.name for o in session.get_outputs()
        }:
            raise InputError(f"{self.path}: is another network than PoseContrast as cadpose exports it")
        return session


def blackened(crop: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A letterboxed crop with its white bands turned black, as the network was trained.

    The bands lie on two opposite sides and are equally broad. Where the photo itself is white beside the
    object, they come out a little too broad, which is as if the box were tighter.

    Args:
        crop: (S, S, 3) uint8, white beside the box.

    Returns:
        A (S, S, 3) uint8 copy.
    """
    white = (crop == _FILL).all(axis=2)
    bands = []
    for axis in (1, 0):
        inside = np.flatnonzero(~white.all(axis=axis))
        bands.append(min(inside[0], len(white) - 1 - inside[-1]) if len(inside) else 0)
    out = crop.copy()
    across = int(np.argmax(bands))
    if band := int(bands[across]):
        # The next line may be part photo, part white.
        band += 1
        lines = out if across == 0 else out.swapaxes(0, 1)
        lines[:band] = lines[-band:] = 0
    return out
