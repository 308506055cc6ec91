"""OpenMMLab's packages, set up in a folder of their own beside cadpose's environment.

Their wheels ask for ``opencv-python``, which must not stand beside ``opencv-python-headless``, and for the
compiled mmcv, of which no wheel exists for current PyTorch. No extra can say "without dependencies", so
``cadpose detectors setup`` does: three pure Python wheels, pinned and checked by SHA-256. What they really
import is in the extra ``detectors``.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import platformdirs

from cadpose.errors import DependencyError

#: Names the packages' folder, instead of the user's data folder.
ENVIRONMENT_VARIABLE = "CADPOSE_DETECTORS"

#: Requirements with the SHA-256 of their one wheel, which fits every platform.
WHEELS = {
    "mmcv-lite==2.1.0": "1d9913c35f793de4a3a022b93cecb712e1e7262eb4704eb8cd15e623dd375000",
    "mmdet==3.3.0": "2e23e291281ac57e7dccf8678e957da45fbe560ce78a1f5ded6afeccd3730f17",
    "mmengine==0.10.7": "262ac976a925562f78cd5fd14dd1bc9b680ed0aa81f0d85b723ef782f99c54ee",
}

#: What they import besides PyTorch; the extra brings it.
NEEDED = (
    *("addict", "matplotlib", "pycocotools", "scipy", "shapely"),
    *("six", "termcolor", "terminaltables", "tqdm", "yaml", "yapf"),
)

_READY = "cadpose-ready"
_EXTRA = "`pip install 'cadpose[detectors]'`"
_TRIAL = "from cadpose.detection.mmdet.packages import load; load()"


def detectors_folder() -> Path:
    """Where the packages are or will be: $CADPOSE_DETECTORS or the user's data folder."""
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    return Path(named).expanduser() if named else Path(platformdirs.user_data_dir("cadpose")) / "detectors"


def setup_detectors(folder: Path | None = None, progress: Callable[[str], None] = lambda line: None) -> Path:
    """Download the packages, and try them before they are put in place.

    Args:
        folder: Where; the default is detectors_folder().
        progress: Told one line before each step.

    Returns:
        The folder.

    Raises:
        DependencyError: the extra is missing, the download failed, or the folder holds something else.
    """
    folder = folder or detectors_folder()
    if folder.exists() and not (folder / _READY).is_file() and (not folder.is_dir() or any(folder.iterdir())):
        raise DependencyError(
            f"{folder} holds something else: move it away, or set {ENVIRONMENT_VARIABLE} to another folder"
        )
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".part-") as beside:
            made = Path(beside) / "packages"
            _fill(made, Path(beside) / "requirements.txt", progress)
            (made / _READY).write_text("\n".join(WHEELS) + "\n", encoding="ascii")
            progress("trying them")
            environment = os.environ | {ENVIRONMENT_VARIABLE: str(made)}
            _step([sys.executable, "-c", _TRIAL], "DetectoRS's packages do not load", environment)
            if folder.exists():
                shutil.rmtree(folder)
            made.rename(folder)
    except OSError as error:
        raise DependencyError(
            f"{folder} cannot be written ({error.strerror}), check its permissions"
        ) from None
    return folder


def _fill(folder: Path, requirements: Path, progress: Callable[[str], None]) -> None:
    lines = [f"{name} --hash=sha256:{digest}\n" for name, digest in WHEELS.items()]
    requirements.write_text("".join(lines), encoding="ascii")
    progress(f"downloading {' '.join(WHEELS)} (4 MB)")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    more = ["--only-binary=:all:", "--require-hashes", "--target", str(folder), "-r", str(requirements)]
    _step([*pip, *more], "DetectoRS's packages cannot be installed", os.environ)


def _step(command: list[str], what: str, environment: os._Environ[str] | dict[str, str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=dict(environment))
    if done.returncode != 0:
        lines = [line.strip() for line in (done.stderr or done.stdout).splitlines() if line.strip()]
        raise DependencyError(f"{what}: {lines[-1] if lines else 'it said nothing'}")


def require(device: str = "cpu") -> None:
    """Nothing, where PyTorch, the device and the packages are there; they are not imported, but can be after.

    An mmdet that is installed in cadpose's own environment goes before the one in the folder.

    Raises:
        DependencyError: something is not there; the message says how to get it.
    """
    try:
        import torch
    except ImportError:
        raise DependencyError(
            f"DetectoRS needs PyTorch: install it with {_EXTRA}, then run `cadpose detectors setup`"
        ) from None
    if device == "cuda" and not torch.cuda.is_available():
        raise DependencyError(
            "DetectoRS on cuda needs a GPU and a build of torch for CUDA; neither is seen here"
        )
    if importlib.util.find_spec("mmdet") is not None:
        return
    folder = detectors_folder()
    if not (folder / _READY).is_file():
        raise DependencyError(
            f"DetectoRS is not set up in {folder}: run `cadpose detectors setup`, or set "
            f"{ENVIRONMENT_VARIABLE} to the folder where it was"
        )
    lacking = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if lacking:
        raise DependencyError(f"DetectoRS's packages need {', '.join(lacking)}: install them with {_EXTRA}")
    sys.path.append(str(folder))
    importlib.invalidate_caches()


def load() -> None:
    """Import mmdet's networks, with our operators where mmcv has none compiled.

    Raises:
        DependencyError: something is missing or does not fit.
    """
    require()
    from cadpose.detection.mmdet import extension

    try:
        extension.provide()
        importlib.import_module("mmdet.models")
    except (ImportError, AssertionError, AttributeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DependencyError(
            f"DetectoRS's packages cannot be imported ({reason}): install what they need with {_EXTRA}, then "
            "run `cadpose detectors setup`"
        ) from None
