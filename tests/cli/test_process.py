"""The program as a process: signals, pipes, full disks, names that are no text."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cadpose.library.catalogue import Library
from tests.small_library import save

PROGRAM = [sys.executable, "-c", "from cadpose.cli.main import main; main()"]


def run(*arguments: object, shell: str = "", **options: object) -> subprocess.CompletedProcess[bytes]:
    """Run the program; ``shell`` follows its command line."""
    command = [*PROGRAM, *(os.fspath(a) if isinstance(a, Path) else str(a) for a in arguments)]
    if shell:
        command = ["bash", "-c", f'"$@" {shell}', "bash", *command]
    return subprocess.run(command, capture_output=True, timeout=120, check=False, **options)  # type: ignore[call-overload,no-any-return]


@pytest.mark.parametrize("extra", ["--json", "--category=car"])
def test_a_pipe_that_nobody_reads(small_library: Library, extra: str) -> None:
    """What `| head` leaves behind: the reader is gone before the first word."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [*PROGRAM, "library", "list", "--library", str(small_library.path), extra]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, b"")


def test_a_pipe_that_reads_the_first_line_only(small_library: Library) -> None:
    done = run("library", "list", "--library", small_library.path, shell="| head -1")
    assert done.stderr == b"" and done.stdout.startswith(b"5 models in ")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, which Linux has")
@pytest.mark.parametrize("extra", ["--json", "--category=car"])
def test_a_full_disk_under_stdout(small_library: Library, extra: str) -> None:
    done = run("library", "list", "--library", small_library.path, extra, shell="> /dev/full")
    assert done.returncode == 1
    assert done.stderr.decode().splitlines()[0] == "cadpose: No space left on device"
    assert b"Traceback" not in done.stderr


def test_an_unexpected_error_of_the_system_is_one_sentence(tmp_path: Path, small_library: Library) -> None:
    patched = (
        "import tempfile, sys\n"
        "def full(*a, **k): raise OSError(28, 'No space left on device', '/somewhere')\n"
        "from pathlib import Path\nPath.glob = full\n"
        "from cadpose.cli.main import main; main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", patched, "library", "check", "--library", str(small_library.path)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "cadpose: /somewhere: No space left on device\n"


def test_ctrl_c(small_library: Library, tmp_path: Path) -> None:
    """Midway through many photos: 130, no traceback, whole files only."""
    photos = tmp_path / "photos"
    for number in range(400):
        save(photos / f"{number}.png", np.full((40, 60, 3), number % 250, np.uint8))
    out = tmp_path / "out"
    arguments = ["annotate", photos, "--library", small_library.path, "--out", out]
    given = ["--box", "5,5,50,35", "--category", "car", "--rotation", "30,10"]
    # A job in the background of a script ignores Ctrl-C, and its children inherit that.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    program = [*PROGRAM[:2], listening + PROGRAM[2]]
    process = subprocess.Popen(
        [*program, *map(str, arguments), *given], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 60
    while not (out / "0.json").exists() and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert (stdout, stderr) == (b"", b"cadpose: stopped\n")
    documents = list(out.glob("*.json"))
    assert 0 < len(documents) < 400
    for path in documents:
        json.loads(path.read_text())
    assert not list(out.glob(".*")) and (out / "index.html").is_file()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux takes any bytes for a file name")
def test_names_that_are_no_text(small_library: Library, tmp_path: Path) -> None:
    photo = tmp_path / os.fsdecode(b"caf\xe9\n.png")
    save(tmp_path / "plain.png", np.full((40, 60, 3), 90, np.uint8)).rename(photo)
    arguments = ["annotate", photo, "--library", small_library.path, "--out", tmp_path / "out"]
    given = ["--box", "5,5,50,35", "--category", "car", "--rotation", "30,10"]
    done = run(*arguments, *given)
    assert (done.returncode, done.stderr) == (0, b"")
    done = run(*arguments, *given, "--json", "--resume")
    (told,) = json.loads(done.stdout)
    assert told["photo"] == str(photo) and told["resumed"] is True and done.returncode == 0
    done = run("annotate", tmp_path / os.fsdecode(b"\xff.png"), "--library", small_library.path)
    assert done.returncode == 1 and done.stderr.count(b"\n") == 1 and b"Traceback" not in done.stderr


def test_a_terminal_that_knows_ascii_only(small_library: Library) -> None:
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    done = run("library", "list", "--library", small_library.path, env=ascii_only)
    assert (done.returncode, done.stderr) == (0, b"") and b"chair" in done.stdout
