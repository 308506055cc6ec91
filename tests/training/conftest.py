"""Networks need torch, which only ``cadpose[train]`` brings."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from cadpose.library.catalogue import Library

if find_spec("torch") is None:
    collect_ignore = ["test_losses.py", "test_ring.py"]
    collect_ignore_glob = ["posecontrast/test_*.py", "lite/test_*.py", "triplet/test_*.py"]
    collect_ignore_glob += ["masks/test_*.py", "refinement/test_*.py"]


@pytest.fixture(scope="module")
def one_thread() -> Iterator[None]:
    """PyTorch on one thread, which is quicker than several for what is so small."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def held_out(small_library: Library, monkeypatch: pytest.MonkeyPatch) -> str:
    """The one car that no training sees."""
    from cadpose.training.lite import sources

    held = small_library.models("car")[0].id
    monkeypatch.setattr(sources, "read_held_out", lambda lookalikes=True: {"car": frozenset({held})})
    return held
