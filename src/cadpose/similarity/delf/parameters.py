"""DELF's parameters: TF-slim's variables to convolutions with batch normalisation folded in, and the PCA.

Names and shapes are those that tf_slim.nets.resnet_v1 and DELF's attention layers give their variables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.similarity.delf.archive import read_files
from cadpose.similarity.delf.bundle import read_index, read_variables
from cadpose.similarity.delf.datum import read_datum
from cadpose.weights import UNPUBLISHED, placed

#: Bottleneck width and number of units of blocks 1 to 3; each block's last unit has stride 2.
BLOCKS = ((64, 3), (128, 4), (256, 6))
#: Channels of the feature map, of the attention's hidden layer, and of a descriptor after the PCA.
CHANNELS = 1024
HIDDEN = 512
DESCRIPTOR = 40

ROOT = "resnet_v1_50/conv1"
ATTENTION = ("attention_block/attention/compute/conv1", "attention_block/attention/compute/conv2")

#: TF-slim's resnet_arg_scope.
_EPSILON = 1e-5
_NORMALISATION = ("gamma", "beta", "moving_mean", "moving_variance")
_MOST_BYTES = 256 * 2**20
_INDEX = "variables/variables.index"
_MEAN, _MATRIX = "pca/mean.datum", "pca/pca_proj_mat.datum"
_FILES = rf"{_INDEX}|variables/variables\.data-\d{{5}}-of-\d{{5}}|{_MEAN}|{_MATRIX}"


@dataclass(frozen=True, eq=False)
class Convolution:
    """One convolution, ready for use.

    Attributes:
        weight: (O, I, k, k) float32.
        bias: (O,) float32.
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Parameters:
    """All that DELF has learnt.

    Attributes:
        name: What features made with them are called.
        convolutions: By TF-slim scope, for example ``resnet_v1_50/block1/unit_1/bottleneck_v1/conv2``.
        mean: (1024,) float32, taken from descriptors of unit length.
        projection: (40, 1024) float32, the first principal directions.

    Raises:
        ValueError: a convolution is absent or a shape is wrong.
    """

    name: str
    convolutions: Mapping[str, Convolution]
    mean: NDArray[np.float32]
    projection: NDArray[np.float32]

    def __post_init__(self) -> None:
        for scope, (outputs, inputs, k) in layers().items():
            convolution = self.convolutions.get(scope)
            if convolution is None:
                raise ValueError(f"there is no layer {scope}")
            shape = convolution.weight.shape
            if shape != (outputs, inputs, k, k) or convolution.bias.shape != (outputs,):
                raise ValueError(f"the layer {scope} has the shape {shape}")
        if self.mean.shape != (CHANNELS,) or self.projection.shape != (DESCRIPTOR, CHANNELS):
            raise ValueError(f"a PCA of shapes {self.mean.shape} and {self.projection.shape}")

    @classmethod
    def from_variables(
        cls,
        name: str,
        variables: Mapping[str, NDArray[np.float32]],
        mean: NDArray[np.float32],
        matrix: NDArray[np.float32],
    ) -> Parameters:
        """From TF-slim's variables by name and the PCA's mean (1024 numbers) and matrix (at least 40 rows).

        Raises:
            ValueError: something is absent or of another shape.
        """
        for variable, shape in variable_shapes().items():
            if variable not in variables:
                raise ValueError(f"there is no variable {variable}")
            if variables[variable].shape != shape:
                found = variables[variable].shape
                raise ValueError(f"{variable} has the shape {found}, DELF's has {shape}")
        if mean.size != CHANNELS or matrix.ndim != 2 or len(matrix) < DESCRIPTOR:
            raise ValueError(f"a PCA of shapes {mean.shape} and {matrix.shape}")
        return cls(
            name,
            {scope: _convolution(scope, variables) for scope in layers()},
            mean.reshape(CHANNELS),
            matrix[:DESCRIPTOR],
        )

    @classmethod
    def official(cls, name: str = "delf") -> Parameters:
        """The authors' weights as a person has put them into the cache.

        Args:
            name: ``"delf"`` (trained on Google Landmarks, 2019) or ``"delf-v1"`` (2017).

        Raises:
            DependencyError: they are not there, or have changed since their first use.
            InputError: the archive is not such.
        """
        return cls.read(placed(UNPUBLISHED[name]), name)

    @classmethod
    def read(cls, path: Path, name: str = "delf") -> Parameters:
        """From the authors' archive or the folder that it was unpacked to.

        Raises:
            InputError: it cannot be read, is damaged, or holds another network.
        """
        files = read_files(path, _FILES, _MOST_BYTES)
        for needed in (_INDEX, _MEAN, _MATRIX):
            if needed not in files:
                raise InputError(f"{path}: is no archive of DELF, {needed} is not in it")
        shards = [files[file] for file in sorted(files) if ".data-" in file]
        at = _INDEX
        try:
            variables = read_variables(read_index(files[_INDEX]), shards, variable_shapes())
            at = _MEAN
            mean = read_datum(files[_MEAN])
            at = _MATRIX
            matrix = read_datum(files[_MATRIX])
            at = "its content"
            return cls.from_variables(name, variables, mean, matrix)
        except ValueError as error:
            raise InputError(f"{path}: {at} cannot be used ({error}), fetch the archive again") from None


def layers() -> dict[str, tuple[int, int, int]]:
    """Every convolution by TF-slim scope: output channels, input channels, side of the kernel."""
    told = {ROOT: (64, 3, 7)}
    inputs = 64
    for block, (width, units) in enumerate(BLOCKS, 1):
        for unit in range(1, units + 1):
            scope = f"resnet_v1_50/block{block}/unit_{unit}/bottleneck_v1"
            if unit == 1:
                told[f"{scope}/shortcut"] = (4 * width, inputs, 1)
            told[f"{scope}/conv1"] = (width, inputs, 1)
            told[f"{scope}/conv2"] = (width, width, 3)
            told[f"{scope}/conv3"] = (4 * width, width, 1)
            inputs = 4 * width
    hidden, score = ATTENTION
    return told | {hidden: (HIDDEN, CHANNELS, 1), score: (1, HIDDEN, 1)}


def variable_shapes() -> dict[str, tuple[int, ...]]:
    """Every variable that is read, by name. The last layer has biases, all others batch normalisation."""
    told: dict[str, tuple[int, ...]] = {}
    for scope, (outputs, inputs, k) in layers().items():
        told[f"{scope}/weights"] = (k, k, inputs, outputs)
        if scope == ATTENTION[1]:
            told[f"{scope}/biases"] = (outputs,)
        else:
            told |= {f"{scope}/BatchNorm/{part}": (outputs,) for part in _NORMALISATION}
    return told


def _convolution(scope: str, variables: Mapping[str, NDArray[np.float32]]) -> Convolution:
    # TensorFlow keeps (k, k, I, O).
    weight = variables[f"{scope}/weights"].transpose(3, 2, 0, 1).astype(np.float64)
    if scope == ATTENTION[1]:
        bias = variables[f"{scope}/biases"].astype(np.float64)
    else:
        gamma, beta, mean, variance = (
            variables[f"{scope}/BatchNorm/{part}"].astype(np.float64) for part in _NORMALISATION
        )
        if (variance < 0).any():
            raise ValueError(f"{scope} has a negative variance")
        scale = gamma / np.sqrt(variance + _EPSILON)
        weight, bias = weight * scale[:, None, None, None], beta - mean * scale
    return Convolution(np.ascontiguousarray(weight, np.float32), bias.astype(np.float32))
