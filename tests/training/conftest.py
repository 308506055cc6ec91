"""Networks need torch, which only ``cadpose[train]`` brings."""

from __future__ import annotations

from importlib.util import find_spec

if find_spec("torch") is None:
    collect_ignore = ["test_losses.py", "test_ring.py"]
    collect_ignore_glob = ["posecontrast/test_*.py", "lite/test_*.py", "triplet/test_*.py"]
    collect_ignore_glob += ["masks/test_*.py", "refinement/test_*.py"]
