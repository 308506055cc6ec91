from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cadpose.errors import CadposeError, DependencyError
from cadpose.training.architectures import ARCHITECTURES, TrainingOptions, architecture


@pytest.mark.parametrize("name", ARCHITECTURES)
def test_every_architecture_trains_and_exports(name: str) -> None:
    pytest.importorskip("torch")
    module = architecture(name)
    assert callable(module.train) and callable(module.export)


def test_an_unknown_one_names_the_known() -> None:
    with pytest.raises(CadposeError, match="posecontrast"):
        architecture("vgg")


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made_up_arch.py").write_text("import torch_that_is_not_there\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(ARCHITECTURES, "posecontrast", "made_up_arch")
    with pytest.raises(DependencyError, match=r"torch_that_is_not_there: pip install 'cadpose\[train\]'"):
        architecture("posecontrast")


def test_options_out_of_range() -> None:
    wrongs: tuple[dict[str, Any], ...] = ({"epochs": 0}, {"batch_size": 1}, {"seed": -1}, {"workers": -1})
    for wrong in wrongs:
        with pytest.raises(ValueError, match="at least"):
            TrainingOptions(data=Path("a"), out=Path("b"), **wrong)
