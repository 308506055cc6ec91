"""What a wheel and a source distribution of cadpose have to hold, and what they must not.

    python scripts/wheel_contents.py dist/cadpose-*.whl dist/cadpose-*.tar.gz

Prints what is wrong, one fault a line, and exits 1; else the sizes. It reads the archives only, so it needs
nothing but cadpose's own registry of weights.
"""

from __future__ import annotations

import hashlib
import sys
import tarfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path, PurePosixPath

from cadpose.weights import REGISTRY

#: Largest archive in bytes: the networks are 41 MB of it and hardly shrink.
MOST_BYTES = 48_000_000
#: Beside the networks, which the registry names.
IN_THE_WHEEL = (
    "cadpose/py.typed",
    *(f"cadpose/data/{name}-schema.json" for name in ("annotation", "failure", "network")),
    "cadpose/data/sweethome3d-exceptions.csv",
    "cadpose/review/static/index.html",
    "cadpose/review/static/app.js",
    "cadpose/review/static/app.css",
    "cadpose/review/static/three.js",
    "cadpose/review/static/widget.js",
    "cadpose/review/static/licenses.md",
    "cadpose/annotations/migrations/env.py",
    "cadpose/annotations/migrations/versions/0001_first.py",
    "cadpose/annotations/migrations/versions/0002_history.py",
    "cadpose/annotations/migrations/versions/0003_region.py",
)
IN_THE_INFO = ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE", "licenses/NOTICE")
# The bundle's sources come along, so that a source distribution is one of the review page too.
IN_THE_SOURCE = (
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "NOTICE",
    "CHANGELOG.md",
    "CITATION.cff",
    "PKG-INFO",
    "web/package-lock.json",
    "web/src/main.tsx",
    *(f"src/{name}" for name in IN_THE_WHEEL),
)
#: Parts of a path that have no place in either.
UNWANTED_PARTS = frozenset(
    {"tests", "node_modules", "__pycache__", "runs", "dist", ".venv", ".git", ".mypy_cache", ".hypothesis"}
)
#: Ends of names: compiled files, photos, databases, models.
UNWANTED_ENDS = (
    ".pyc",
    ".so",
    ".jpg",
    ".jpeg",
    ".png",
    ".webp",
    ".db",
    ".sqlite",
    ".obj",
    ".glb",
    ".pt",
    ".pth",
)


def unwanted(names: Iterable[str]) -> list[str]:
    """Members that do not belong, or that would be written outside their folder."""
    found = []
    for name in names:
        path = PurePosixPath(name)
        outside = path.is_absolute() or ".." in path.parts
        if outside or UNWANTED_PARTS & set(path.parts) or name.lower().endswith(UNWANTED_ENDS):
            found.append(f"holds {name}")
    return found


def missing(names: set[str], wanted: Iterable[str]) -> list[str]:
    """What is wanted and not there."""
    return [f"lacks {name}" for name in wanted if name not in names]


def wrong_weights(digest: Callable[[str], str | None], folder: str) -> list[str]:
    """Networks that are not those of the registry; ``digest`` gives a member's SHA-256."""
    shipped = [weights for weights in REGISTRY.values() if weights.package == "cadpose"]
    return [
        f"lacks the network {weights.name}, or holds another"
        for weights in shipped
        if digest(f"{folder}{weights.file}") != weights.sha256
    ]


def wheel_faults(path: Path) -> list[str]:
    """What is wrong with a wheel."""
    with zipfile.ZipFile(path) as archive:
        names = {name for name in archive.namelist() if not name.endswith("/")}
        info = next(
            (name.partition("/")[0] for name in names if name.endswith(".dist-info/WHEEL")), "?.dist-info"
        )

        def digest(name: str) -> str | None:
            return hashlib.sha256(archive.read(name)).hexdigest() if name in names else None

        strangers = sorted({name.partition("/")[0] for name in names} - {"cadpose", info})
        return [
            *missing(names, IN_THE_WHEEL),
            *missing(names, (f"{info}/{name}" for name in IN_THE_INFO)),
            *wrong_weights(digest, "cadpose/"),
            *unwanted(names),
            *(f"holds {name} beside the package" for name in strangers),
        ]


def source_faults(path: Path) -> list[str]:
    """What is wrong with a source distribution."""
    root = path.name.removesuffix(".tar.gz") + "/"
    with tarfile.open(path, "r:gz") as archive:
        members = {member.name: member for member in archive.getmembers() if not member.isdir()}
        names = {name.removeprefix(root) for name in members}

        def digest(name: str) -> str | None:
            file = archive.extractfile(members[root + name]) if root + name in members else None
            return hashlib.sha256(file.read()).hexdigest() if file else None

        return [
            *missing(names, IN_THE_SOURCE),
            *wrong_weights(digest, "src/cadpose/"),
            *unwanted(names),
            *(f"{name} is no plain file" for name, member in members.items() if not member.isfile()),
            *(f"holds {name} beside {root}" for name in members if not name.startswith(root)),
        ]


def faults(path: Path) -> list[str]:
    """What is wrong with either, its size included."""
    size = path.stat().st_size
    found = wheel_faults(path) if path.suffix == ".whl" else source_faults(path)
    if size > MOST_BYTES:
        found.append(f"has {size / 1e6:.1f} MB, more than {MOST_BYTES / 1e6:.0f}")
    return [f"{path.name} {fault}" for fault in found]


def main(paths: list[Path]) -> int:
    """Exit code: 0 where all is in order."""
    found = [fault for path in paths for fault in faults(path)]
    for line in found or [f"{path.name}: {path.stat().st_size / 1e6:.1f} MB, in order" for path in paths]:
        print(line)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main([Path(argument) for argument in sys.argv[1:]]))
