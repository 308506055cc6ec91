"""Blender as a renderer, the paper's way: a worker process with a virtualenv of its own.

Blender's module needs another numpy than ours and is GPL; nothing of it is loaded here.
"""

from __future__ import annotations

import os
import selectors
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Self

import numpy as np
import platformdirs

from cadpose.errors import DependencyError
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.records import Views
from cadpose.rendering.blender_worker import read_message, write_message
from cadpose.rendering.scene import agreeing_normals, material_kind

#: Names the virtualenv's folder, instead of the user's data folder.
ENVIRONMENT_VARIABLE = "CADPOSE_BLENDER"

#: Debian packages with the libraries that Blender's module is linked to.
APT_PACKAGES = (
    "libx11-6",
    "libgl1",
    "libsm6",
    "libxext6",
    "libxfixes3",
    "libxi6",
    "libxrender1",
    "libxkbcommon0",
)

# Each release of the module is for one Python only.
_REQUIREMENTS = {"3.11": ("bpy==4.5.*", "numpy<2"), "3.13": ("bpy>=5.1,<6",)}

_WORKER = Path(__file__).with_name("blender_worker.py")
_READY = "cadpose-ready"


def blender_folder() -> Path:
    """Where the virtualenv is or will be: $CADPOSE_BLENDER or the user's data folder."""
    named = os.environ.get(ENVIRONMENT_VARIABLE)
    return Path(named) if named else Path(platformdirs.user_data_dir("cadpose")) / "blender"


def blender_python(folder: Path | None = None) -> Path:
    """The Python of Blender's virtualenv.

    Raises:
        DependencyError: it has not been set up.
    """
    folder = folder or blender_folder()
    python = folder / "bin" / "python"
    if not (folder / _READY).is_file() or not python.exists():
        raise DependencyError(
            f"Blender is not set up in {folder}: run `cadpose blender setup`, or set "
            f"{ENVIRONMENT_VARIABLE} to the folder where it was"
        )
    return python


def setup_blender(folder: Path | None = None, progress: Callable[[str], None] = lambda line: None) -> Path:
    """Make Blender's virtualenv and try it.

    Args:
        folder: Where; the default is blender_folder().
        progress: Told one line before each step.

    Returns:
        The virtualenv's Python.

    Raises:
        DependencyError: no fitting Python, the download failed, or a system library is missing.
    """
    folder = folder or blender_folder()
    version, base = _base_python()
    (folder / _READY).unlink(missing_ok=True)
    progress(f"making a virtualenv with Python {version} in {folder}")
    _step([base, "-m", "venv", "--clear", str(folder)], f"cannot make a virtualenv in {folder}")
    python = folder / "bin" / "python"
    progress(f"downloading {' '.join(_REQUIREMENTS[version])} (about 400 MB)")
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    _step([*install, *_REQUIREMENTS[version]], "cannot install Blender's Python module")
    progress("trying it")
    _step([str(python), "-I", "-c", "import bpy"], "Blender's Python module does not load")
    beside = folder / (_READY + ".new")
    beside.write_text(" ".join(_REQUIREMENTS[version]) + "\n")
    beside.replace(folder / _READY)
    return python


def _base_python() -> tuple[str, str]:
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    if own in _REQUIREMENTS:
        return own, sys.executable
    for version in _REQUIREMENTS:
        if found := shutil.which(f"python{version}"):
            return version, found
    raise DependencyError(f"Blender's module needs Python {' or '.join(_REQUIREMENTS)}: install one of them")


def _step(command: list[str], what: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise DependencyError(_explain(what, done.stderr or done.stdout))


def _explain(what: str, log: str) -> str:
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    reason = lines[-1] if lines else "it said nothing"
    if "cannot open shared object file" in log:
        return f"{what} ({reason}): install the libraries with `apt-get install {' '.join(APT_PACKAGES)}`"
    return f"{what}: {reason}"


class BlenderRenderer:
    """Draws with Cycles in a worker process; the same cameras and masks as the rasteriser.

    Materials are matt; texture and material colours are display values, as everywhere in cadpose; the lights
    are the rasteriser's, with shadows. The worker starts with the first view and ends with close() or with
    this process. Calls from several threads take turns.

    Args:
        samples: Camera rays a pixel.
        denoise: Whether to denoise; 4 samples look grainy without.
        threads: Threads in the worker; 0 uses every core.
        folder: Virtualenv that setup_blender made; the default is blender_folder().
        timeout: Seconds that one view may take.

    Raises:
        DependencyError: Blender is not set up.
        ValueError: an argument is out of range.
    """

    def __init__(
        self,
        samples: int = 4,
        *,
        denoise: bool = True,
        threads: int = 0,
        folder: Path | None = None,
        timeout: float = 300.0,
    ) -> None:
        self.name = f"blender-{samples}" + ("" if denoise else "-noisy")
        if samples < 1 or threads < 0 or timeout <= 0:
            raise ValueError("samples and timeout must be positive, threads at least 0")
        self._python = blender_python(folder)
        self._settings = {"do": "setup", "samples": samples, "denoise": denoise, "threads": threads}
        self._timeout = timeout
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._log: IO[bytes] | None = None
        self._loaded: weakref.ref[Mesh] | None = None

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """N views of ``mesh``, one a camera.

        Raises:
            DependencyError: the worker failed or took too long; the message tells its last words.
        """
        shape = (len(cameras), cameras.height, cameras.width)
        rgb, alpha = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        depth = np.full(shape, np.inf, np.float32)
        with self._lock:
            if self._process is None:
                self._start()
            if self._loaded is None or self._loaded() is not mesh:
                self._load(mesh)
            for i in range(len(cameras)):
                camera = {
                    "R_cv_from_s": cameras.R_cv_from_s[i].tolist(),
                    "t_cv": cameras.t_cv[i].tolist(),
                    "focal_px": float(cameras.focal_px[i]),
                    "principal_px": cameras.principal_px[i].tolist(),
                    "width": cameras.width,
                    "height": cameras.height,
                }
                arrays = self._ask({"do": "render", "camera": camera})
                rgb[i], alpha[i], depth[i] = arrays["rgb"], arrays["alpha"], arrays["depth"]
        return Views(rgb=rgb, alpha=alpha, depth=depth)

    def close(self) -> None:
        """End the worker; the next view starts another."""
        process, self._process, self._loaded = self._process, None, None
        if process is not None:
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._log is not None:
            self._log.close()
            self._log = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_process", None) is not None:
            self.close()

    def _start(self) -> None:
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed by close)
        self._process = subprocess.Popen(
            [str(self._python), "-I", str(_WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
        )
        self._answer()
        self._ask(self._settings)

    def _load(self, mesh: Mesh) -> None:
        arrays: dict[str, Any] = {
            "vertices": mesh.vertices,
            "faces": mesh.faces,
            "corner_normals": agreeing_normals(mesh),
            "corner_uv": mesh.corner_uv,
            "face_material": mesh.face_material,
        }
        materials = []
        for i, material in enumerate(mesh.materials):
            materials.append({"rgba": material.rgba, "kind": material_kind(material).name.lower()})
            if material.texture is not None:
                texture = material.texture
                if texture.shape[2] == 3:
                    texture = np.concatenate([texture, np.full_like(texture[..., :1], 255)], axis=2)
                arrays[f"texture{i}"] = texture
        self._loaded = None
        self._ask({"do": "mesh", "materials": materials}, arrays)
        self._loaded = weakref.ref(mesh)

    def _ask(self, header: dict[str, Any], arrays: dict[str, Any] | None = None) -> dict[str, Any]:
        assert self._process is not None and self._process.stdin is not None
        try:
            write_message(self._process.stdin, header, arrays)
            return self._answer()
        except OSError:
            raise self._failure("Blender's worker has ended") from None
        except KeyboardInterrupt:
            # The answer to this question must not be taken for the answer to the next.
            self.close()
            raise

    def _answer(self) -> dict[str, Any]:
        assert self._process is not None and self._process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            deadline = time.monotonic() + self._timeout
            if not selector.select(max(deadline - time.monotonic(), 0.0)):
                self._process.kill()
                raise self._failure(f"Blender's worker took more than {self._timeout:g} s")
        try:
            message = read_message(self._process.stdout)
        except (ValueError, OSError):
            message = None
        if message is None:
            raise self._failure("Blender's worker has ended")
        header, arrays = message
        if "error" in header:
            self._loaded = None
            raise DependencyError(f"Blender could not draw the model: {header['error']}")
        return arrays

    def _failure(self, what: str) -> DependencyError:
        log = ""
        if self._log is not None:
            self._log.seek(0)
            log = self._log.read()[-4000:].decode(errors="replace")
        self.close()
        return DependencyError(_explain(what, log))
