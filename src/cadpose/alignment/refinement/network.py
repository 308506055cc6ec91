"""The network that looks at photo and drawn pose together and tells what to change."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.onnx_session import open_session
from cadpose.weights import ensure


@dataclass(frozen=True, eq=False)
class Advice:
    """What to change.

    Attributes:
        step: (6,) as :func:`cadpose.alignment.refinement.steps.stepped` takes it.
        expected_error: Angle in degrees that is expected to be left after the step.
    """

    step: FloatArray
    expected_error: float


class RefinementNetwork:
    """Advice by the trained network (docs/model-card.md).

    Args:
        device: ``"cpu"`` or ``"cuda"``.
        network: ONNX file in the place of the shipped one.
    """

    def __init__(self, device: str = "cpu", network: Path | None = None) -> None:
        self.device, self.network = device, network

    @cached_property
    def _session(self) -> Any:
        return open_session(self.network or ensure("refinement"), self.device)

    def advise(
        self, photo: NDArray[np.float32], view: NDArray[np.float32], cover: NDArray[np.float32]
    ) -> Advice:
        """What would bring the view to the photo.

        Args:
            photo: (112, 14, 14) stride-16 map of the crop.
            view: (112, 14, 14) stride-16 map of the drawn pose.
            cover: (14, 14) share of each cell that the model covers.
        """
        step, error = self._session.run(
            ["step", "error"], {"photo": photo[None], "view": view[None], "cover": cover[None, None]}
        )
        return Advice(np.asarray(step[0], np.float64), float(np.clip(error[0], 0.0, 180.0)))
