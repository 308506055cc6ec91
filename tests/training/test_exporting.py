from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError, InputError

torch = pytest.importorskip("torch")


class Doubling(torch.nn.Module):  # type: ignore[misc, name-defined]
    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:  # type: ignore[name-defined]
        return x * 2, x + 1


def export(path: Path, monkeypatch: pytest.MonkeyPatch, answers: tuple[float, float]) -> float:
    from cadpose.training import exporting

    found = [np.full((3, 2), answer, np.float32) for answer in answers]
    monkeypatch.setattr(exporting, "_run", lambda *args: found)
    inputs = {"x": torch.ones(3, 2)}
    return exporting.export_compared(Doubling().eval(), inputs, ("a", "b"), path, axes={"x": "n"})


def test_the_largest_difference_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    difference = export(tmp_path / "net.onnx", monkeypatch, (2.0, 2.00005))
    assert difference == pytest.approx(5e-5, rel=0.01)
    assert (tmp_path / "net.onnx").is_file()


def test_other_answers_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DependencyError, match=r"differs from torch's by 0\.5"):
        export(tmp_path / "net.onnx", monkeypatch, (2.0, 2.5))
    assert not (tmp_path / "net.onnx").exists()


@pytest.mark.parametrize("answers", [(2.0, np.nan), (np.nan, 2.0)])
def test_what_is_no_number_is_refused_in_any_output(
    answers: tuple[float, float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"net\.onnx: not written, .* not numbers"):
        export(tmp_path / "net.onnx", monkeypatch, answers)
    assert not (tmp_path / "net.onnx").exists()
