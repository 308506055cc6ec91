"""The paper's learned baseline (Table 4): two encoders trained with a triplet loss, through ONNX Runtime.

One encoder describes the photo's crop, the other the renders, both with vectors of unit length; the nearer
a render's vector is to the photo's, the more alike they are. How the networks are made: docs/training.md.

Source: Langer, Budvytis, Cipolla, "Leveraging Geometry for Shape Estimation from a Single RGB Image", BMVC
2021, as the paper compares with it.
"""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.frames import FloatArray
from cadpose.onnx_session import open_session
from cadpose.records import Mask, Views
from cadpose.similarity.triplet_framing import Framing

#: Names of the graph's inputs, outputs and of its metadata's entry.
INPUTS = ("photos", "renders")
OUTPUTS = ("photo_features", "render_features")
FRAMING = "cadpose.framing"
#: Where the network is looked for unless told.
VARIABLE = "CADPOSE_TRIPLET"
#: Largest file that is loaded; two VGG16 without their classifiers have some 120 MB.
MAX_BYTES = 2**30
#: Renders described at once.
_CHUNK = 32


class TripletMeasure:
    """A :class:`cadpose.similarity.SimilarityMeasure`: minus the Euclidean distance of the features.

    Args:
        path: ONNX file made by ``cadpose train triplet``, None for the file that ``$CADPOSE_TRIPLET`` names.
        device: ``"cpu"`` or ``"cuda"`` (needs onnxruntime-gpu).
        threads: ONNX Runtime threads within one operator; 0 lets it choose.

    Raises:
        DependencyError: no file was named, or it is not there.
    """

    name = "triplet"

    def __init__(self, path: Path | None = None, *, device: str = "cpu", threads: int = 0) -> None:
        told = os.environ.get(VARIABLE, "")
        if path is None and not told:
            raise DependencyError(
                "the similarity measure triplet needs a trained network, and none comes with cadpose: make "
                f"one with `cadpose train triplet` and name its .onnx in ${VARIABLE}"
            )
        self.path = Path(told).expanduser() if path is None else path
        if not self.path.is_file():
            raise DependencyError(
                f"there is no network {self.path}: name the .onnx that `cadpose train triplet` wrote in "
                f"${VARIABLE}"
            )
        self.device = device
        self.threads = threads

    @property
    def framing(self) -> Framing:
        """How the network was shown crops and renders.

        Raises:
            InputError: the file is not such a network.
        """
        return self._loaded[1]

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """(N,) scores in [-2, 0]; see :class:`cadpose.similarity.SimilarityMeasure`.

        The mask, where there is one, takes the photo's background away; else ``aspect`` tells what lies
        beside the box.

        Raises:
            InputError: the file is not such a network, or its answer is not a number.
        """
        photo = self.framing.photo(crop, mask, aspect)[None]
        renders = self.framing.renders(views)
        parts = [self._distances(photo, renders[i : i + _CHUNK]) for i in range(0, len(renders), _CHUNK)]
        return -np.concatenate(parts)

    def _distances(self, photo: NDArray[np.uint8], renders: NDArray[np.uint8]) -> FloatArray:
        session, _ = self._loaded
        try:
            answers = session.run(list(OUTPUTS), dict(zip(INPUTS, (photo, renders), strict=True)))
        except Exception as error:  # ONNX Runtime's errors share no class
            raise InputError(
                f"{self.path}: fails on {len(renders)} renders ({type(error).__name__}), train it anew"
            ) from None
        a, b = (np.asarray(answer, np.float64) for answer in answers)
        if a.ndim != 2 or len(a) != 1 or b.shape != (len(renders), a.shape[1]):
            raise InputError(f"{self.path}: answers other shapes than a triplet network, train it anew")
        distances = np.linalg.norm(b - a, axis=1)
        if not np.isfinite(distances).all():
            raise InputError(f"{self.path}: answers values that are not numbers, train it anew")
        return np.asarray(distances)

    @cached_property
    def _loaded(self) -> tuple[Any, Framing]:
        if self.path.stat().st_size > MAX_BYTES:
            raise InputError(f"{self.path}: larger than {MAX_BYTES >> 20} MiB, which no such network is")
        try:
            session = open_session(self.path, self.device, self.threads)
        except Exception as error:  # ONNX Runtime's errors share no class
            raise InputError(
                f"{self.path}: is no ONNX network ({type(error).__name__}), train it anew"
            ) from None
        other = f"{self.path}: is another network than the triplet baseline as cadpose exports it"
        try:
            framing = Framing.from_json(session.get_modelmeta().custom_metadata_map[FRAMING])
        except (KeyError, ValueError):
            raise InputError(other) from None
        square = [framing.side, framing.side, 3]
        inputs = [(i.name, i.type, list(i.shape[1:])) for i in session.get_inputs()]
        if inputs != [(name, "tensor(uint8)", square) for name in INPUTS] or not set(OUTPUTS) <= {
            o.name for o in session.get_outputs()
        }:
            raise InputError(other)
        for graph_input in session.get_inputs():
            if isinstance(graph_input.shape[0], int):
                raise InputError(
                    f"{self.path}: takes {graph_input.shape[0]} {graph_input.name} at once, no other number, "
                    "export it with a free first axis"
                )
        return session, framing
