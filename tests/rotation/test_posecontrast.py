"""The estimator over a made-up session; the real one is tested where networks are exported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.backends import Backends
from cadpose.errors import DependencyError, InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import crop_square
from cadpose.rotation.bins import BINS, encode_angles, probabilities
from cadpose.rotation.posecontrast import OUTPUTS, VARIABLE, PoseContrastEstimator, blackened

CROP = np.full((224, 224, 3), 90, np.uint8)


class FakeSession:
    """Answers by view: (angles, how sure of the azimuth)."""

    def __init__(self, *views: tuple[tuple[float, float, float], float]) -> None:
        self.views = views
        self.seen: NDArray[np.uint8] | None = None
        self.scale = 1.0

    def run(self, names: list[str], inputs: dict[str, NDArray[np.uint8]]) -> list[NDArray[np.float32]]:
        assert names == list(OUTPUTS)
        self.seen = inputs["images"]
        out = [np.zeros((2, k), np.float32) for k in BINS * 2]
        for i, (angles, sure) in enumerate(self.views):
            coded = encode_angles(*angles)
            for axis in range(3):
                out[axis][i, coded.bins[0, axis]] = sure if axis == 0 else 4.0
                out[axis + 3][i] = coded.offsets[0, axis]
        return [o * np.float32(self.scale) for o in out]


def made(tmp_path: Path, session: Any, **told: Any) -> PoseContrastEstimator:
    path = tmp_path / "net.onnx"
    path.touch()
    estimator = PoseContrastEstimator(path, **told)
    estimator.__dict__["_session"] = session
    return estimator


def angles_of(found: Any) -> list[float]:
    return [found.rotation.azimuth, found.rotation.elevation, found.rotation.inplane]


def test_the_surer_of_crop_and_mirror_image_is_kept(tmp_path: Path) -> None:
    crop = CROP.copy()
    crop[:, :100] = 10
    upright = FakeSession(((40, 20, 5), 6.0), ((200, 30, -7), 3.0))
    found = made(tmp_path, upright).estimate(crop)
    assert angles_of(found[0]) == pytest.approx([40, 20, 5], abs=1e-4)
    assert upright.seen is not None
    np.testing.assert_array_equal(upright.seen[0], crop)
    np.testing.assert_array_equal(upright.seen[1], crop[:, ::-1])
    # The mirror image's answer is mirrored back.
    mirrored = FakeSession(((40, 20, 5), 3.0), ((200, 30, -7), 6.0))
    assert angles_of(made(tmp_path, mirrored).estimate(crop)[0]) == pytest.approx([160, 30, 7], abs=1e-4)


def test_hypotheses_differ_and_their_shares_sum_to_one(tmp_path: Path) -> None:
    found = made(tmp_path, FakeSession(((90, 0, 0), 3.0), ((0, 0, 0), 0.5)), hypotheses=4).estimate(CROP)
    assert len(found) == 4
    assert [f.score for f in found] == sorted((f.score for f in found), reverse=True)
    assert sum(f.probability for f in found) == pytest.approx(1.0)
    for i, one in enumerate(found):
        assert all(one.rotation.error_to(other.rotation) >= 25 for other in found[:i])
    logit = np.eye(24)[0] * 3
    assert found[0].score == pytest.approx(
        probabilities(logit).max()
        * probabilities(np.eye(12)[0] * 4).max()
        * probabilities(np.eye(24)[0] * 4).max()
    )


@given(st.floats(5, 300), st.floats(5, 300), st.integers(0, 2**16))
def test_white_bands_become_black_and_the_object_stays(width: float, height: float, seed: int) -> None:
    photo = np.random.default_rng(seed).integers(0, 200, (400, 400, 3), np.uint8)
    box = Box.from_xywh(40.3, 30.7, width, height)
    white, black = crop_square(photo, box), crop_square(photo, box, fill=0)
    found = blackened(white)
    # All but the line on either side that is part photo, part band.
    differ = (found != black).any(axis=2)
    assert not differ.any(axis=1).sum() > 4 or not differ.any(axis=0).sum() > 4
    band = (224 - 224 * min(width, height) / max(width, height)) / 2
    if band > 2:
        lines = found if height < width else found.swapaxes(0, 1)
        assert not lines[: int(band)].any() and not lines[-int(band) :].any()
    assert (white == crop_square(photo, box)).all()  # the caller's crop is not written to


def test_white_that_is_no_band_stays() -> None:
    full = np.full((224, 224, 3), 255, np.uint8)
    np.testing.assert_array_equal(blackened(full), full)
    one_side = CROP.copy()
    one_side[:30] = 255
    np.testing.assert_array_equal(blackened(one_side), one_side)
    inner = CROP.copy()
    inner[50:60, 10:200] = 255
    np.testing.assert_array_equal(blackened(inner), inner)


def test_without_a_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(DependencyError, match=r"cadpose train rotation .*\$CADPOSE_POSECONTRAST"):
        PoseContrastEstimator()
    monkeypatch.setenv(VARIABLE, str(tmp_path / "none.onnx"))
    with pytest.raises(DependencyError, match=r"none\.onnx"):
        PoseContrastEstimator()


def test_chosen_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    backends = Backends("cpu", 0, tmp_path, lambda cad, R: pytest.fail("draws nothing"))
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(DependencyError, match=VARIABLE):
        backends.rotation("posecontrast", "raster")
    (tmp_path / "net.onnx").touch()
    monkeypatch.setenv(VARIABLE, str(tmp_path / "net.onnx"))
    chosen = backends.rotation("posecontrast", "raster")
    assert isinstance(chosen, PoseContrastEstimator) and chosen.name == "posecontrast"
    assert chosen.path == tmp_path / "net.onnx"


def test_files_that_are_no_such_network(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(InputError, match=r"text\.onnx: is no ONNX network"):
        PoseContrastEstimator(tmp_path / "text.onnx").estimate(CROP)
    from cadpose.weights import ensure

    with pytest.raises(InputError, match="another network"):
        PoseContrastEstimator(ensure("lite0-trunk")).estimate(CROP)


def test_answers_that_are_none(tmp_path: Path) -> None:
    session = FakeSession(((0, 0, 0), 1.0), ((0, 0, 0), 1.0))
    session.scale = float("nan")
    with pytest.raises(InputError, match="not numbers"):
        made(tmp_path, session).estimate(CROP)
    with pytest.raises(ValueError, match="uint8 crop"):
        made(tmp_path, session).estimate(CROP[:100])
