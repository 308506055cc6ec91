"""From a library to a network that refines, with everything small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from cadpose.alignment.refinement.network import RefinementNetwork
from cadpose.encoder import CHANNELS16
from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.rotation.features import LEVELS, STEPS, standardised
from cadpose.training.drawn import CHECKPOINT
from cadpose.training.refinement import train as training
from cadpose.training.refinement.export import export, trained_network
from cadpose.training.refinement.network import UNITS, StepNetwork
from cadpose.training.refinement.train import train
from tests.training.told import TINY, options

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "UNSEEN_PHOTOS", 4)


def test_train_resume_export_and_use(small_library: Library, held_out: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    report = train(options(small_library, out, steps=2), lambda *_: None, **TINY)
    assert report.validation is not None
    assert 0.0 <= report.validation["median"] <= 180.0
    assert json.loads((out / "settings.json").read_text())["architecture"] == "refinement"
    with pytest.raises(InputError, match="holds a training already"):
        train(options(small_library, out, steps=2), lambda *_: None, **TINY)
    before = trained_network(out / CHECKPOINT).state_dict()
    train(options(small_library, out, steps=2, resume=True), lambda *_: None, **TINY)
    after = trained_network(out / CHECKPOINT).state_dict()
    assert all(torch.equal(before[k], after[k]) for k in before)

    # The file answers on the encoder's maps what the network answers on standardised ones.
    rng = np.random.default_rng(0)
    photo, view = rng.normal(0.0, 5.0, (2, CHANNELS16, 14, 14)).astype(np.float32)
    cover = rng.random((14, 14), np.float32)
    advice = RefinementNetwork(network=report.network).advise(photo, view, cover)
    cells = torch.from_numpy(standardised(np.stack([photo, view]), LEVELS[0])).float() / STEPS
    a, b = cells.transpose(1, 2).reshape(2, 1, CHANNELS16, 14, 14)
    with torch.no_grad():
        step, error = trained_network(out / CHECKPOINT)(a, b, torch.from_numpy(cover)[None, None])
    np.testing.assert_allclose(advice.step, (step[0] * torch.tensor(UNITS)).numpy(), atol=3e-3)
    assert advice.expected_error == pytest.approx(float(error[0]) * np.degrees(0.1), rel=0.05, abs=0.05)


def test_the_network_can_learn_a_shift() -> None:
    """Photo and view are the same map, moved by whole cells: the offset is told after a few steps."""
    torch.manual_seed(0)
    network = StepNetwork(16)
    optimiser = torch.optim.Adam(network.parameters(), 3e-3)
    generator = torch.Generator().manual_seed(0)
    for _ in range(60):
        told, true = _shifted(network, generator)
        loss = (told[:, 4:] - true).abs().mean()
        optimiser.zero_grad()
        torch.autograd.backward([loss])
        optimiser.step()
    network.eval()
    with torch.no_grad():
        told, true = _shifted(network, generator)
    assert float((told[:, 4:] - true).abs().mean()) < 0.5 * float(true.abs().mean())


def _shifted(network: StepNetwork, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor]:
    view = torch.randn((32, CHANNELS16, 14, 14), generator=generator)
    shift = torch.randint(-2, 3, (32, 2), generator=generator)
    rolled = [torch.roll(v, (int(y), int(x)), (1, 2)) for v, (x, y) in zip(view, shift, strict=True)]
    step, _ = network(torch.stack(rolled), view, torch.ones(32, 1, 14, 14))
    return step, shift.float()


def test_another_file_is_no_checkpoint(tmp_path: Path) -> None:
    torch.save({"average": {}}, tmp_path / "other.pt")
    with pytest.raises(InputError, match=r"other\.pt"):
        export(tmp_path / "other.pt", tmp_path / "refinement.onnx")
