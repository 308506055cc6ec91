from __future__ import annotations

import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError, InputError
from cadpose.similarity.delf.parameters import Parameters, layers, variable_shapes
from cadpose.weights import UNPUBLISHED
from tests.similarity.delf.made import FloatArray, bundle, datum, made_variables, write_model

Variables = dict[str, FloatArray]


@pytest.fixture(scope="module")
def variables() -> Variables:
    return made_variables()[0]


@pytest.fixture
def folder(tmp_path: Path, variables: Variables) -> Path:
    write_model(tmp_path / "delf_gld_20190411", *made_variables())
    return tmp_path / "delf_gld_20190411"


def test_names_and_shapes_are_tf_slims() -> None:
    shapes = variable_shapes()
    # Root, 13 units of three convolutions, three shortcuts, attention: 44 of which have normalisation.
    assert len(layers()) == 1 + 39 + 3 + 2
    assert len(shapes) == 44 * 5 + 2
    assert shapes["resnet_v1_50/conv1/weights"] == (7, 7, 3, 64)
    assert shapes["resnet_v1_50/block1/unit_1/bottleneck_v1/shortcut/weights"] == (1, 1, 64, 256)
    assert shapes["resnet_v1_50/block2/unit_1/bottleneck_v1/conv1/weights"] == (1, 1, 256, 128)
    assert shapes["resnet_v1_50/block3/unit_6/bottleneck_v1/conv2/weights"] == (3, 3, 256, 256)
    assert shapes["resnet_v1_50/block3/unit_6/bottleneck_v1/conv3/BatchNorm/moving_variance"] == (1024,)
    assert shapes["attention_block/attention/compute/conv1/BatchNorm/gamma"] == (512,)
    assert shapes["attention_block/attention/compute/conv2/biases"] == (1,)
    assert not [name for name in shapes if "block4" in name or "unit_2/bottleneck_v1/shortcut" in name]


def test_a_folder_and_an_archive_give_the_variables_folded(
    folder: Path, made: Parameters, tmp_path: Path
) -> None:
    packed = tmp_path / "delf.tar.gz"
    with tarfile.open(packed, "w:gz", compresslevel=0) as archive:
        archive.add(folder, "delf_gld_20190411")
    for path in (folder, packed):
        read = Parameters.read(path, "made-up")
        assert read.name == "made-up" and set(read.convolutions) == set(layers())
        for scope, convolution in made.convolutions.items():
            np.testing.assert_array_equal(read.convolutions[scope].weight, convolution.weight)
            np.testing.assert_array_equal(read.convolutions[scope].bias, convolution.bias)
        np.testing.assert_array_equal(read.mean, made.mean)
        np.testing.assert_array_equal(read.projection, made.projection)


def test_normalisation_is_folded_in(made: Parameters, variables: Variables) -> None:
    scope = "resnet_v1_50/block2/unit_3/bottleneck_v1/conv2"
    x = np.random.default_rng(1).normal(size=(128, 3, 3))
    w = variables[f"{scope}/weights"].astype(np.float64)
    plain = np.einsum("ihw,hwio->o", x, w)
    gamma, beta, mean, variance = (
        variables[f"{scope}/BatchNorm/{part}"].astype(np.float64)
        for part in ("gamma", "beta", "moving_mean", "moving_variance")
    )
    right = gamma * (plain - mean) / np.sqrt(variance + 1e-5) + beta
    ours = made.convolutions[scope]
    folded = np.einsum("ihw,oihw->o", x, ours.weight) + ours.bias
    np.testing.assert_allclose(folded, right, atol=1e-5)


def test_the_last_layer_keeps_its_bias(made: Parameters, variables: Variables) -> None:
    scope = "attention_block/attention/compute/conv2"
    ours = made.convolutions[scope]
    np.testing.assert_array_equal(ours.weight, variables[f"{scope}/weights"].transpose(3, 2, 0, 1))
    np.testing.assert_array_equal(ours.bias, variables[f"{scope}/biases"])


def test_what_does_not_fit_is_refused(variables: Variables, made: Parameters) -> None:
    _, mean, matrix = made_variables()
    name = "resnet_v1_50/block3/unit_2/bottleneck_v1/conv3/weights"
    with pytest.raises(ValueError, match=f"no variable {name}"):
        Parameters.from_variables("x", {k: v for k, v in variables.items() if k != name}, mean, matrix)
    with pytest.raises(ValueError, match=rf"{name} has the shape \(1, 1, 256, 512\)"):
        Parameters.from_variables("x", variables | {name: variables[name][..., :512]}, mean, matrix)
    variance = name.replace("weights", "BatchNorm/moving_variance")
    with pytest.raises(ValueError, match="negative variance"):
        Parameters.from_variables("x", variables | {variance: -variables[variance]}, mean, matrix)
    for wrong in ((mean[:-1], matrix), (mean, matrix[:39]), (mean, matrix[:, :-1])):
        with pytest.raises(ValueError, match="PCA"):
            Parameters.from_variables("x", variables, *wrong)
    # A mean kept as a row is the same mean.
    row = Parameters.from_variables("x", variables, mean[None], matrix[:40])
    np.testing.assert_array_equal(row.mean, made.mean)
    with pytest.raises(ValueError, match="no layer"):
        replace(made, convolutions={})
    swapped = made.convolutions["resnet_v1_50/block1/unit_1/bottleneck_v1/conv1"]
    with pytest.raises(ValueError, match="has the shape"):
        replace(made, convolutions=dict(made.convolutions) | {"resnet_v1_50/conv1": swapped})


def test_damaged_archives_are_told_of_in_a_sentence(folder: Path) -> None:
    def told() -> str:
        with pytest.raises(InputError) as caught:
            Parameters.read(folder)
        message = str(caught.value)
        assert str(folder) in message and "\n" not in message
        return message

    files = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    for path, data in files.items():
        if path.name != "saved_model.pb":
            path.write_bytes(data[: len(data) // 2])
            assert "cannot be used" in told(), path
            path.unlink()
            assert "not in it" in told() or "data files" in told(), path
            path.write_bytes(data)
    names = folder / "model" / "variables"
    for path in names.iterdir():
        path.unlink()
    index, (data,) = bundle({"other": np.ones(3, np.float32)})
    (names / "variables.index").write_bytes(index)
    (names / "variables.data-00000-of-00001").write_bytes(data)
    assert "no variable" in told()


def test_another_pca_is_told_of(folder: Path) -> None:
    (folder / "pca" / "mean.datum").write_bytes(datum(np.ones(3, np.float32)))
    with pytest.raises(InputError, match=r"its content cannot be used \(a PCA of shapes \(3,\)"):
        Parameters.read(folder)


@pytest.mark.parametrize("name", ["delf", "delf-v1"])
def test_the_authors_weights_are_asked_for(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "cache"))
    entry = UNPUBLISHED[name]
    with pytest.raises(DependencyError) as caught:
        Parameters.official(name)
    assert entry.url in str(caught.value) and str(entry.path) in str(caught.value)
    entry.path.parent.mkdir(parents=True)
    entry.path.write_bytes(b"something else")
    with pytest.raises(InputError, match=r"no \.tar\.gz archive"):
        Parameters.official(name)
