"""The command line called within the test's own process, and what it has to say."""

from __future__ import annotations

import json
from typing import Any

from typer.testing import CliRunner, Result

from cadpose.cli.main import app
from tests.small_library import Shot


def cadpose(*arguments: object, env: dict[str, str] | None = None) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments], env={"TERM": "dumb", **(env or {})})


def said(result: Result) -> Any:
    """The JSON on stdout: exactly one value, one line."""
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert result.stdout.count("\n") == 1
    return json.loads(result.stdout)


def given(shot: Shot, category: str = "car") -> list[str]:
    box = ",".join(f"{v:g}" for v in shot.box.to_tuple())
    r = shot.rotation
    return ["--box", box, "--category", category, "--rotation", f"{r.azimuth},{r.elevation},{r.inplane}"]


def one_sentence(result: Result, *words: object) -> None:
    """Exit code 1 and one line on stderr that holds the words."""
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == 1
    assert result.stderr.startswith("cadpose: ") and result.stderr.count("\n") == 1, result.stderr
    for word in words:
        assert str(word) in result.stderr
    assert "Traceback" not in result.output
