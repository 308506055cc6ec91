"""What `cadpose annotate` tells beyond the pose."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Rotation, RotationHypothesis
from tests.cli.invoking import cadpose, given, one_sentence, said
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


def test_lists_copies_failures_and_tables(small_library: Library, tmp_path: Path) -> None:
    """A list of photos, one of them missing, one the same as another; tried again; as a table too."""
    hatch = shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))
    first = save(tmp_path / "photos" / "a.png", hatch.photo.rgb)
    copy = first.with_name("b.png")
    copy.write_bytes(first.read_bytes())
    missing = first.with_name("c.png")
    listed = tmp_path / "photos.txt"
    listed.write_text(f"{first}\n{copy}\n{missing}\n")
    common = [listed, "--library", small_library.path, "--out", tmp_path / "out", *given(hatch)]
    result = cadpose("annotate", *common, "--json")
    assert result.exit_code == 1 and str(missing) in result.stderr
    done, same, failed = said(result)
    assert (done["error"], same["same_as"], failed["photo"]) == (None, str(first), str(missing))
    assert same["document"] == done["document"] and "there is no file" in failed["error"]
    again = cadpose("annotate", *common, "--resume")
    assert "it failed earlier, --retry-failed tries it again" in again.stderr
    assert "same bytes as" in again.stdout and "report.html" in again.stdout
    save(missing, hatch.photo.rgb[:-10])
    result = cadpose("annotate", *common, "--retry-failed", "--parquet", tmp_path / "all.parquet", "--json")
    assert result.exit_code == 0
    assert [told["resumed"] for told in said(result)] == [True, False, False]
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(tmp_path / "all.parquet").num_rows == 2


def test_many_photos_are_counted_not_listed(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cadpose.cli.annotate_output._MOST_ROWS", 1)
    hatch = shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))
    photos = tmp_path / "photos"
    save(photos / "a.png", hatch.photo.rgb)
    save(photos / "b.png", hatch.photo.rgb[:-10])
    common = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch)]
    result = cadpose("annotate", photos, *common)
    assert result.exit_code == 0
    assert "2 photos, 2 objects annotated, 0 photos failed" in result.stdout and "a.png" not in result.stdout
    (photos / "c.png").write_bytes(b"no picture")
    result = cadpose("annotate", photos, *common, "--resume")
    assert result.exit_code == 1
    assert "What was not annotated" in result.stdout and "c.png" in result.stdout


def test_ray_says_what_it_needs(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    photo = save(tmp_path / "a.png", np.full((40, 60, 3), 90, np.uint8))
    result = cadpose("annotate", photo, "--library", small_library.path, "--executor", "ray")
    one_sentence(result, "--executor ray needs Ray Data", "pip install 'cadpose[ray]'")
