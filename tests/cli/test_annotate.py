"""What `cadpose annotate` tells beyond the pose."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Rotation, RotationHypothesis
from tests.cli.invoking import cadpose, given, said
from tests.small_library import save, shoot


def test_annotate_tells_how_sure_the_rotation_is(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hatch = shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))
    photo = save(tmp_path / "photos" / "street.png", hatch.photo.rgb)
    hypothesis = RotationHypothesis(hatch.rotation, 1.0, 0.413, 37.0, True)
    monkeypatch.setattr(Annotator, "estimate_rotation", lambda *_: [hypothesis])
    common = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch)[:4]]
    result = cadpose("annotate", photo, *common)
    assert result.exit_code == 0 and "needs review 0.41" in result.stdout
    (told,) = said(cadpose("annotate", photo, *common, "--json"))
    (found,) = told["annotations"]
    assert (found["probability"], found["expected_error"], found["needs_review"]) == (0.413, 37.0, True)
    # What was given is certain and needs nobody.
    result = cadpose("annotate", photo, *common, "--rotation", "35,12,4")
    assert "1.00" in result.stdout and "needs review" not in result.stdout
