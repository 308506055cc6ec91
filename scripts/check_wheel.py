"""Build wheel and source distribution, and try both in clean virtualenvs: `make wheel`.

    python scripts/check_wheel.py [--out dist] [--python 3.12 ...] [--every] [--no-resolve] [--no-trials]
        [--tried FILE]

1. Both are built twice, the second time from what the first source distribution holds, in another folder:
   the bytes have to be the same.
2. What they hold is looked through (wheel_contents.py) and their metadata checked (twine).
3. All extras have to resolve together, for each Python version.
4. For each Python at hand, the wheel is installed by pip into a clean virtualenv without extras and put
   through try_install.py; the source distribution is installed by uv, and has to give the wheel's files.
5. uv has to install and run the wheel as a tool.

A Python that is not there is told, and with --every is an error; --tried writes down those that passed.
--no-trials ends after the second step. It needs the extra `release` and a network.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = ROOT / "scripts"
#: What `requires-python` allows.
VERSIONS = ("3.11", "3.12", "3.13")
#: Files that an installer writes itself, and their hashes in RECORD.
OWN = re.compile(r"\.dist-info/(INSTALLER|REQUESTED|RECORD|direct_url\.json|uv_[a-z_]+\.json)|/bin/|\.pyc")


def run(
    *command: str | Path, cwd: Path | None = None, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program; a failure ends the script with what it said."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(
            f"{' '.join(words)}\nended with {done.returncode}\n{done.stdout[-4000:]}{done.stderr[-4000:]}"
        )
    return done


def say(sentence: str) -> None:
    print(sentence, flush=True)


def uv() -> Path:
    """The uv of this virtualenv."""
    found = Path(sys.executable).with_name("uv")
    if not found.is_file():
        sys.exit("uv is not installed: pip install -e '.[release]'")
    return found


def clean_environment() -> dict[str, str]:
    """This one without virtualenv or Python's own variables; uv fetches no Python of its own."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV", "CADPOSE"))}
    return {**kept, "UV_PYTHON_DOWNLOADS": "never", "UV_NO_PROGRESS": "1"}


def find_python(version: str) -> Path | None:
    """An interpreter of a version that can make virtualenvs: this one's, pyenv's, or one on the path."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [
        Path(sys.base_prefix) / "bin" / f"python{version}",
        *sorted(pyenv.glob(f"{version}.*/bin/python{version}"), reverse=True),
        *(Path(folder) / f"python{version}" for folder in os.environ.get("PATH", "").split(os.pathsep)),
    ]
    probe = "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"
    for candidate in candidates:
        if candidate.is_file():
            answer = subprocess.run(
                [candidate, "-c", probe], capture_output=True, text=True, check=False, env=clean_environment()
            )
            if answer.stdout.strip() == version:
                return candidate
    return None


def build(source: Path, out: Path) -> tuple[Path, Path]:
    """Source distribution of a folder, and the wheel of that."""
    stamp = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    environment = clean_environment() | ({"SOURCE_DATE_EPOCH": stamp} if stamp else {})
    run(uv(), "build", "--quiet", "--no-create-gitignore", "--out-dir", out, source, environment=environment)
    (wheel,), (archive,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, archive


def build_twice(out: Path, scratch: Path) -> tuple[Path, Path]:
    """Build from the tree, then from the source distribution, and compare the bytes."""
    first = build(ROOT, scratch / "first")
    with tarfile.open(first[1]) as archive:
        archive.extractall(scratch / "elsewhere", filter="data")
    (unpacked,) = (scratch / "elsewhere").iterdir()
    for path in unpacked.rglob("*"):
        os.utime(path)
    second = build(unpacked, scratch / "second")
    for one, other in zip(first, second, strict=True):
        if one.read_bytes() != other.read_bytes():
            sys.exit(f"{one.name} differs when it is built again from the source distribution")
    out.mkdir(parents=True, exist_ok=True)
    for old in [*out.glob("*.whl"), *out.glob("*.tar.gz")]:
        old.unlink()
    wheel, archive_path = (out / path.name for path in first)
    for path, target in zip(first, (wheel, archive_path), strict=True):
        shutil.move(path, target)
    return wheel, archive_path


def installed_files(python: Path) -> dict[str, str]:
    """Path to hash of what the install of cadpose laid down, as its RECORD says."""
    code = (
        "from importlib.metadata import files\n"
        "for f in files('cadpose'):\n"
        "    print(f.as_posix(), f.hash.value if f.hash else '', sep='\\t')"
    )
    lines = run(python, "-c", code, environment=clean_environment()).stdout.splitlines()
    pairs = (line.split("\t") for line in lines)
    return {name: value for name, value in pairs if not OWN.search("/" + name)}


def try_wheel(python: Path, wheel: Path, version: str, scratch: Path) -> dict[str, str]:
    """Install the wheel by pip, put the install through its paces, and tell its files."""
    run(python, "-m", "venv", scratch / "pip", environment=clean_environment())
    inside = scratch / "pip" / "bin" / "python"
    run(inside, "-m", "pip", "install", "--quiet", wheel, environment=clean_environment())
    run(inside, "-m", "pip", "check", environment=clean_environment())
    (scratch / "empty").mkdir()
    tried = run(
        inside, SCRIPTS / "try_install.py", version, cwd=scratch / "empty", environment=clean_environment()
    )
    say(f"  wheel by pip: {tried.stdout.strip()}")
    return installed_files(inside)


def try_source(python: Path, archive: Path, version: str, files: Mapping[str, str], scratch: Path) -> None:
    """Install the source distribution by uv: the same files, and a command that runs."""
    run(uv(), "venv", "--quiet", "--python", python, scratch / "uv", environment=clean_environment())
    inside = scratch / "uv" / "bin" / "python"
    run(uv(), "pip", "install", "--quiet", "--python", inside, archive, environment=clean_environment())
    run(uv(), "pip", "check", "--python", inside, environment=clean_environment())
    told = run(
        scratch / "uv" / "bin" / "cadpose", "--version", environment=clean_environment()
    ).stdout.strip()
    if told != f"cadpose {version}":
        sys.exit(f"the source distribution's command says {told!r}")
    own = installed_files(inside)
    if own != files:
        differ = sorted({name for name, _ in own.items() ^ files.items()})
        sys.exit(f"wheel and source distribution lay down different files: {', '.join(differ[:10])}")
    say(f"  source distribution by uv: the wheel's {len(files)} files")


def try_tool(wheel: Path, version: str, scratch: Path) -> None:
    """`uv tool install` and `uvx`, with the Python that runs this."""
    environment = clean_environment() | {
        "UV_TOOL_DIR": str(scratch / "tools"),
        "UV_TOOL_BIN_DIR": str(scratch / "bin"),
    }
    python = ("--python", sys.executable)
    run(uv(), "tool", "install", "--quiet", *python, wheel, environment=environment)
    once = ("tool", "run", "--quiet", *python, "--from", wheel)
    for told in (
        run(scratch / "bin" / "cadpose", "--version", environment=environment),
        run(uv(), *once, "cadpose", "--version", cwd=scratch, environment=environment),
    ):
        if told.stdout.strip() != f"cadpose {version}":
            sys.exit(f"as uv's tool the command says {told.stdout!r}")
    say("as a tool of uv: installed, and run once without")


def resolve_extras(versions: Sequence[str]) -> None:
    """All extras together, for each Python version, as packages are now."""
    for version in versions:
        options = ("--quiet", "--all-extras", "--python-version", version, "--no-header")
        found = run(
            uv(), "pip", "compile", *options, ROOT / "pyproject.toml", environment=clean_environment()
        )
        count = len(re.findall(r"^[\w.-]+==", found.stdout, re.MULTILINE))
        say(f"Python {version}: all extras resolve together, to {count} packages")


def main() -> None:
    """All of it, for the Pythons at hand."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the two files")
    parser.add_argument("--python", action="append", choices=VERSIONS, help="only this version")
    parser.add_argument("--every", action="store_true", help="a Python that is not there is an error")
    parser.add_argument("--no-resolve", action="store_true", help="leave the extras alone")
    parser.add_argument("--no-trials", action="store_true", help="build and look, but install nothing")
    parser.add_argument("--tried", type=Path, help="file for the Pythons whose trial passed, on one line")
    options = parser.parse_args()
    if options.tried is not None:
        options.tried.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="cadpose-wheel-") as folder:
        scratch = Path(folder)
        wheel, archive = build_twice(options.out, scratch)
        version = wheel.name.split("-")[1]
        say(f"cadpose {version}: built twice, the same bytes")
        say(run(sys.executable, SCRIPTS / "wheel_contents.py", wheel, archive).stdout.strip())
        run(sys.executable, "-m", "twine", "check", "--strict", wheel, archive)
        say("twine: metadata and description in order")
        if options.no_trials:
            return
        wanted = options.python or VERSIONS
        if not options.no_resolve:
            resolve_extras(wanted)
        absent = []
        for each in wanted:
            python = find_python(each)
            if python is None:
                absent.append(each)
                continue
            say(f"Python {each}:")
            with tempfile.TemporaryDirectory(dir=scratch) as room:
                files = try_wheel(python, wheel, version, Path(room))
                try_source(python, archive, version, files, Path(room))
        try_tool(wheel, version, scratch)
    for each in absent:
        say(f"Python {each}: NOT TRIED, there is none here")
    if len(absent) == len(wanted) or (absent and options.every):
        sys.exit("not every Python was tried")
    if options.tried is not None:
        options.tried.parent.mkdir(parents=True, exist_ok=True)
        passed = [each for each in wanted if each not in absent]
        options.tried.write_text(" ".join(passed) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
