from __future__ import annotations

import sys
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cadpose.backends import (
    DETECTORS,
    MASKS,
    RFDETR_SIZE,
    Backends,
    detector_kind,
    embedded_detector,
    encoder_on,
    make_detector,
    make_masks,
)
from cadpose.encoder import lite0
from cadpose.errors import CadposeError, DependencyError
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.records import CadModel, Views
from cadpose.rendering.raster import Rasteriser
from cadpose.rotation.render_and_compare import RenderAndCompare
from cadpose.weights import cache_folder


def nothing_drawn(cad: CadModel, R_cv_from_s: FloatArray) -> Views:
    raise AssertionError("making a backend draws nothing")


@pytest.fixture
def backends() -> Backends:
    return Backends(device="cpu", seed=3, cache=None, render_framed=nothing_drawn)


def test_names_give_stages(backends: Backends) -> None:
    assert isinstance(backends.renderer("raster"), Rasteriser)
    assert backends.detector("embedded", ["car"]).name == "embedded"
    assert backends.detector("ssd", ["car"]).name == "ssd"
    assert backends.masks("grabcut").name == "grabcut"
    assert backends.masks("none").name == "none"
    assert backends.rotation("render-and-compare", "raster").name == "render-and-compare"
    for name in ("aligned", "fused", "sm1", "sm2", "sm3", "sift-sm1"):
        assert backends.similarity(name).name
    assert backends.similarity("sm1").name != backends.similarity("sift-sm1").name


def test_what_ranks_is_the_joint_ranking_or_a_measure(backends: Backends) -> None:
    assert backends.ranking("fused", "raster").name == "lite0-fused"
    with pytest.raises(CadposeError, match="choose one of: joint, aligned, fused, sm1"):
        backends.ranking("x", "raster")


@pytest.mark.parametrize(
    ("stage", "make"),
    [
        ("renderer", lambda b, which: b.renderer(which)),
        ("detector", lambda b, which: b.detector(which, ["car"])),
        ("masks", lambda b, which: b.masks(which)),
        ("rotation", lambda b, which: b.rotation(which, "raster")),
        ("similarity", lambda b, which: b.similarity(which)),
    ],
)
def test_stages_of_ones_own_and_unknown_names(
    backends: Backends, stage: str, make: Callable[[Backends, object], object]
) -> None:
    own = object()
    assert make(backends, own) is own
    with pytest.raises(CadposeError, match=rf"^unknown {stage} 'x', choose one of: \w") as told:
        make(backends, "x")
    assert "\n" not in str(told.value)


def test_every_detector_and_mask_method_is_listed() -> None:
    for name in DETECTORS:
        kind, rest = detector_kind(name)
        assert name == (f"{kind}:{rest}" if rest else kind)
    assert detector_kind("onnx:a/b:c.json") == ("onnx", "a/b:c.json")
    with pytest.raises(CadposeError) as told:
        make_masks("x")
    assert all(name in str(told.value) for name in MASKS)


@pytest.mark.parametrize("name", ["embedded:", "embedded:x", "ssd:quarters", "rfdetr:", "onnx", "onnx:", ""])
def test_a_detector_takes_no_other_words(name: str) -> None:
    with pytest.raises(CadposeError, match=r"^unknown detector .*, choose one of: embedded, ssd, "):
        make_detector(name)


def test_what_cannot_be_imported_is_told_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What detectors need is imported when it is used, and they name the extra; a fault here is a fault."""
    monkeypatch.setitem(sys.modules, "cadpose.detection.rfdetr.detector", None)
    with pytest.raises(ImportError):
        make_detector("rfdetr:n", ["car"])


def test_a_detector_gets_what_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[object, ...]] = []
    for module, name in (
        ("cadpose.detection.rfdetr.detector", "RfDetrDetector"),
        ("cadpose.detection.onnx_detector", "OnnxDetector"),
        ("cadpose.detection.mask_network", "NetworkMasks"),
    ):
        stand_in = types.ModuleType(module)
        setattr(stand_in, name, lambda *given, **named: made.append((*given, *named.values())))
        monkeypatch.setitem(sys.modules, module, stand_in)
    make_detector("rfdetr", ["car"])
    make_detector("rfdetr:l", None, "cuda")
    make_detector("onnx:my/head.json", ["bed"])
    make_masks("network", "cuda")
    assert made == [
        (RFDETR_SIZE, ["car"], "cpu"),
        ("l", None, "cuda"),
        (Path("my/head.json"), ["bed"], "cpu"),
        ("cuda",),
    ]


def folder_of(estimator: object) -> Path:
    assert isinstance(estimator, RenderAndCompare)
    return estimator.galleries.folder


def test_galleries_lie_in_the_cache_folder(
    backends: Backends, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert folder_of(backends.rotation("render-and-compare", "raster")) == cache_folder() / "galleries"
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "told"))
    assert folder_of(backends.rotation("render-and-compare", "raster")) == tmp_path / "told" / "galleries"
    own = Backends("cpu", 0, tmp_path / "own", nothing_drawn)
    assert folder_of(own.rotation("render-and-compare", "raster")) == tmp_path / "own"
    assert not list(tmp_path.iterdir()), "nothing is made before it is needed"


def test_the_seed_reaches_what_draws_random_numbers(backends: Backends) -> None:
    from cadpose.detection.masks import GrabCutMasks
    from cadpose.similarity.local_affine import LocalAffine

    masks, measure = backends.masks("grabcut"), backends.similarity("sm1")
    assert isinstance(masks, GrabCutMasks) and masks.seed == 3
    assert isinstance(measure, LocalAffine) and measure.seed == 3


def test_a_device_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    import onnxruntime

    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    assert encoder_on("cpu") is lite0("cpu")
    for make in (encoder_on, embedded_detector):
        with pytest.raises(DependencyError, match="onnxruntime-gpu"):
            make("cuda")
    with pytest.raises(CadposeError, match="unknown device 'gpu'"):
        encoder_on("gpu")
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider"])
    assert encoder_on("cuda").device == "cuda"


def test_blender_is_imported_only_when_asked_for(
    small_library: Library, backends: Backends, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "cadpose.rendering.blender", raising=False)
    backends.renderer("raster")
    assert "cadpose.rendering.blender" not in sys.modules
    monkeypatch.setenv("CADPOSE_BLENDER", str(tmp_path / "none"))
    # Made at once, started at the first view: then one sentence says how to get it.
    with pytest.raises(DependencyError, match="cadpose blender setup"):
        renderer = backends.renderer("blender")
        mesh = small_library.mesh(small_library.models()[0])
        renderer.render(mesh, Cameras.framing(np.eye(3)[None], mesh.hull, size=32))
