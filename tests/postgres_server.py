"""A PostgreSQL server of the tests' own: in a temporary folder, on a socket, gone with the session."""

from __future__ import annotations

import itertools
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_PROGRAMS = "/usr/lib/postgresql/*/bin"
# No crash of the machine matters to a test: nothing waits for the disk.
_FAST = [
    argument
    for setting in (
        "fsync=off",
        "synchronous_commit=off",
        "full_page_writes=off",
        "dynamic_shared_memory_type=mmap",
    )
    for argument in ("-c", setting)
]

#: Gives the URL of an empty place of its own for tables.
NewDatabase = Callable[[], str]


def _folder_of_programs() -> Path:
    found = sorted(
        Path("/").glob(f"{_PROGRAMS[1:]}/initdb"), key=lambda path: int(path.parts[4].split(".")[0])
    )
    if not found:
        told = shutil.which("initdb")
        if told is None:
            pytest.skip(f"needs a PostgreSQL server: no {_PROGRAMS}/initdb (run `make postgres`)")
        return Path(told).parent
    return found[-1].parent


def _as_whom() -> str:
    """Another user's name where needed, because the server refuses to run as root."""
    if os.getuid() != 0:
        return ""
    for user in ("postgres", "nobody"):
        try:
            subprocess.run([*_become(user), "true"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        return user
    pytest.skip(
        "needs a PostgreSQL server, which does not run as root, and setpriv cannot become another user"
    )


def _become(user: str) -> list[str]:
    return ["setpriv", f"--reuid={user}", "--clear-groups"] if user else []


def _dies_with_us(user: str) -> list[str]:
    """The server ends with the tests, also where those are killed."""
    if shutil.which("setpriv") is None:
        return []
    return ["setpriv", "--pdeathsig=QUIT", *_become(user)[1:]]


@contextmanager
def postgres_server() -> Iterator[NewDatabase]:
    """Start a server; skips the test, with the reason, where there is none."""
    pytest.importorskip("psycopg", reason="needs psycopg: pip install 'cadpose[postgres]'")
    import psycopg

    programs, user = _folder_of_programs(), _as_whom()
    # A socket's path may have about 100 characters only.
    folder = Path(tempfile.mkdtemp(prefix="cadpose-pg-", dir="/tmp"))
    try:
        if user:
            shutil.chown(folder, user)
        data = str(folder / "data")
        make = [*_become(user), str(programs / "initdb"), "-D", data, "-U", "cadpose", "-A", "trust"]
        make += ["-E", "UTF8", "--locale=C", "--no-sync"]
        done = subprocess.run(make, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.fail(f"initdb failed: {done.stdout} {done.stderr}")
        serve = [*_dies_with_us(user), str(programs / "postgres"), "-D", data, "-k", str(folder)]
        with (folder / "log").open("w") as log:
            server = subprocess.Popen(
                [*serve, "-c", "listen_addresses=", *_FAST], stdout=log, stderr=log, cwd=folder
            )

        def run(statement: str) -> None:
            with psycopg.connect(
                host=str(folder), user="cadpose", dbname="postgres", autocommit=True
            ) as connection:
                connection.execute(statement.encode())

        try:
            for _ in range(600):
                try:
                    run("SELECT 1")
                    break
                except psycopg.OperationalError:
                    time.sleep(0.1)
                if server.poll() is not None:
                    pytest.fail(f"the server ended: {(folder / 'log').read_text()}")
            numbers = itertools.count(1)

            def new_database() -> str:
                # A schema is made at once, a database of its own is three hundred files.
                name = f"store{next(numbers)}"
                run(f"CREATE SCHEMA {name}")
                return f"postgresql+psycopg://cadpose@/postgres?host={folder}&options=-csearch_path%3D{name}"

            yield new_database
        finally:
            server.send_signal(signal.SIGQUIT)
            server.wait(60)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
