"""Every public name has an example in its docstring, and every example does what it says."""

from __future__ import annotations

import doctest
import inspect
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import cadpose
from cadpose.detection import Detector
from cadpose.detection.masks import MaskEstimator
from cadpose.rendering import Renderer
from cadpose.rotation import RotationEstimator
from cadpose.similarity import SimilarityMeasure

#: What a user may put in a stage's place.
PROTOCOLS = (Detector, MaskEstimator, RotationEstimator, SimilarityMeasure, Renderer)
PUBLIC: dict[str, Any] = {
    **{name: getattr(cadpose, name) for name in cadpose.__all__},
    **{protocol.__name__: protocol for protocol in PROTOCOLS},
}
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
API = Path(__file__).resolve().parent.parent / "docs" / "api"


def examples(name: str) -> list[doctest.DocTest]:
    """The examples in the docstrings of a public name and of its methods."""
    found = PUBLIC[name]
    module = import_module(found.__module__)
    return [test for test in doctest.DocTestFinder().find(found, name, module) if test.examples]


@pytest.mark.parametrize("name", PUBLIC)
def test_the_examples_do_what_they_say(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Nothing of the user's is read, and what the examples leave lies in the test's own folder.
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CADPOSE_LIBRARY", str(tmp_path / "no-library"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    tests = examples(name)
    assert any(test.name == name for test in tests), f"{name} has no example in its docstring"
    report: list[str] = []
    for test in tests:
        test.globs = {}  # as a reader's session: what is not imported is not there
        doctest.DocTestRunner(verbose=False, optionflags=FLAGS).run(test, out=report.append)
    assert not report, "".join(report)


def test_the_reference_has_every_public_name() -> None:
    told = {
        line.removeprefix("::: ").strip()
        for page in API.glob("*.md")
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("::: ")
    }
    for name, found in PUBLIC.items():
        assert f"{found.__module__}.{name}" in told, name
    for path in told:
        module, _, name = path.rpartition(".")
        assert inspect.getdoc(getattr(import_module(module), name)), path
