"""A PostgreSQL server of the tests' own: in a temporary folder, on a socket, gone with the session."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_PROGRAMS = "/usr/lib/postgresql/*/bin"
# No crash of the machine matters to a test: nothing waits for the disk.
_FAST = "-c fsync=off -c synchronous_commit=off -c full_page_writes=off -c dynamic_shared_memory_type=mmap"

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


def _as_whom() -> list[str]:
    """The server refuses to run as root."""
    if os.getuid() != 0:
        return []
    for user in ("postgres", "nobody"):
        try:
            subprocess.run(
                ["setpriv", f"--reuid={user}", "--clear-groups", "true"], check=True, capture_output=True
            )
        except (OSError, subprocess.CalledProcessError):
            continue
        return ["setpriv", f"--reuid={user}", "--clear-groups"]
    pytest.skip(
        "needs a PostgreSQL server, which does not run as root, and setpriv cannot become another user"
    )


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
            shutil.chown(folder, user[1].partition("=")[2])

        def run(program: str, *arguments: str) -> None:
            command = [*user, str(programs / program), "-D", str(folder / "data"), *arguments]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                pytest.fail(f"{program} failed: {done.stdout} {done.stderr}")

        run("initdb", "-U", "cadpose", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync")
        options = f"-k {folder} -c listen_addresses='' {_FAST}"
        run("pg_ctl", "-w", "-t", "60", "-l", str(folder / "log"), "-o", options, "start")
        try:
            numbers = itertools.count(1)

            def new_database() -> str:
                # A schema is made at once, a database of its own is three hundred files.
                name = f"store{next(numbers)}"
                with psycopg.connect(
                    host=str(folder), user="cadpose", dbname="postgres", autocommit=True
                ) as connection:
                    connection.execute(f"CREATE SCHEMA {name}".encode())
                return f"postgresql+psycopg://cadpose@/postgres?host={folder}&options=-csearch_path%3D{name}"

            yield new_database
        finally:
            run("pg_ctl", "-w", "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
