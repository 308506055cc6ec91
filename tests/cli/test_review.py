"""``cadpose review`` as a process: it starts, tells its address, serves, and ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from cadpose.annotations.store import Store
from cadpose.library.catalogue import Library
from tests.annotations.factory import make_document
from tests.cli.invoking import cadpose, one_sentence

pytest.importorskip("fastapi", reason="needs cadpose[review]")
pytest.importorskip("uvicorn", reason="needs cadpose[review]")

PROGRAM = [sys.executable, "-c", "from cadpose.cli.main import main; main()", "review", "--no-open"]


@contextmanager
def running(*arguments: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The server's process and the address it told, token included."""
    command = [*PROGRAM, "--json", *map(str, arguments)]
    # A shell's background job ignores Ctrl-C, and its children do too unless told otherwise.
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        yield process, json.loads(line)["url"]
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def get(url: str, path: str, **heads: str) -> tuple[int, Any]:
    base, _, token = url.partition("/?token=")
    request = urllib.request.Request(base + path, headers={"authorization": f"Bearer {token}", **heads})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def test_it_serves_and_stops(tmp_path: Path, small_library: Library) -> None:
    store = f"sqlite:///{tmp_path / 'a.db'}"
    with Store(store) as opened:
        opened.add(make_document("a.jpg"))
    with running("--store", store, "--library", small_library.path, "--author", "Ada") as (process, url):
        assert url.startswith("http://127.0.0.1:") and len(url.partition("token=")[2]) >= 32
        status, told = get(url, "/api/session")
        assert status == 200 and told["author"] == "Ada" and told["library"]["models"] == 5
        assert get(url, "/api/queue")[1]["total"] == 2
        assert get(url, "/api/queue", host="evil.example")[0] == 403
        assert get(url + "x", "/api/queue")[0] == 401
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
        assert (process.returncode, out, err) == (130, "", "cadpose: stopped\n")


def test_a_newcomers_store_is_made(tmp_path: Path) -> None:
    """Without a library too: the page says what to do."""
    file = tmp_path / "new" / "a.db"
    with running("--store", f"sqlite:///{file}") as (process, url):
        assert file.is_file()
        told = get(url, "/api/session")[1]
        assert told["library"] is None and not told["actions"]["annotate"]
        assert get(url, "/api/queue")[1] == {"items": [], "after": None, "total": 0}
        process.terminate()
        _, err = process.communicate(timeout=20)
        no_library, new_store = err.splitlines()
        assert "cadpose library add" in no_library and new_store.endswith(f"empty store was made: {file}")


def test_a_port_that_is_taken(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        result = cadpose("review", "--store", f"sqlite:///{tmp_path / 'a.db'}", "--port", port, "--no-open")
    one_sentence(result, f"port {port}", "in use", "--port")
    assert not (tmp_path / "a.db").exists()


def test_other_machines_only_where_that_is_meant(tmp_path: Path) -> None:
    store = f"sqlite:///{tmp_path / 'a.db'}"
    result = cadpose("review", "--store", store, "--host", "0.0.0.0", "--no-open")
    one_sentence(result, "0.0.0.0", "--allow-remote")
    with running("--store", store, "--host", "0.0.0.0", "--allow-remote") as (process, url):
        assert url.startswith("http://127.0.0.1:") and get(url, "/api/session")[0] == 200
        port = url.split(":")[2].partition("/")[0]
        assert get(url, "/api/session", host=f"{socket.gethostname()}:{port}")[0] == 200
        assert get(url, "/api/session", host=f"evil.example:{port}")[0] == 403
        process.send_signal(signal.SIGINT)
        assert "not encrypted" in process.communicate(timeout=20)[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--store", "sqlite://"], ["memory", "sqlite:///file.db"]),
        (["--store", "nonsense"], ["database URL"]),
        (["--store", "sqlite:///a.db", "--photos", "/no/such"], ["/no/such", "--photos"]),
        (["--store", "sqlite:///a.db", "--library", "/no/such"], ["/no/such", "library"]),
        (["--store", "sqlite:///a.db", "--host", "no.such.host.invalid", "--allow-remote"], ["--host"]),
        (["--store", "sqlite:///a.db", "--host", "203.0.113.9", "--allow-remote"], ["--host"]),
    ],
)
def test_what_cannot_be_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    result = cadpose("review", "--no-open", *arguments)
    assert result.exit_code == 1 and "Traceback" not in result.output
    last = result.stderr.splitlines()[-1]
    assert all(word in last for word in words), result.stderr


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("cadpose.review")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    result = cadpose("review", "--store", f"sqlite:///{tmp_path / 'a.db'}", "--no-open")
    one_sentence(result, "uvicorn", "pip install 'cadpose[review]'")


def test_help_is_quick_and_needs_no_web_framework() -> None:
    code = (
        "import sys\nfrom cadpose.cli.main import app\n"
        "assert not {'fastapi', 'uvicorn', 'starlette'} & set(sys.modules)"
    )
    env = {**os.environ, "PYTHONWARNINGS": "ignore"}
    subprocess.run([sys.executable, "-c", code], check=True, env=env, timeout=60)
