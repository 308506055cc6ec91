"""docs/command-line.md says what the program takes: verbs, options, choices, defaults, exit codes."""

from __future__ import annotations

import inspect
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

import pytest
import typer

from cadpose.cli.main import app
from cadpose.encoder import Lite0
from cadpose.similarity.registry import measures

PAGE = Path(__file__).resolve().parent.parent / "docs" / "command-line.md"
ROW = re.compile(r"^\| (`-[^|]*`) \|([^|]*)\|([^|]*)\|([^|]*)\|$", re.MULTILINE)


def verbs(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """(full name, command) of everything that takes options, groups without any of their own left out."""
    inner = getattr(command, "commands", {})
    if not inner or documented(command):
        yield name, command
    for key, sub in inner.items():
        yield from verbs(sub, f"{name} {key}")


def documented(command: Any) -> dict[frozenset[str], Any]:
    """The command's options by their spellings."""
    return {
        frozenset([*param.opts, *param.secondary_opts]): param
        for param in command.params
        if param.param_type_name == "option" and param.name != "help"
    }


def sections() -> dict[str, str]:
    """Text of each part of the page by the verb in its heading."""
    parts = re.split(r"^## `([^`]+)`$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def rows(section: str) -> dict[frozenset[str], tuple[str, str]]:
    """(default, value and meaning) of each option of a section by its spellings."""
    return {
        frozenset(re.findall(r"`([^`]+)`", spellings)): (default.strip(" `"), f"{value} {meaning}")
        for spellings, value, default, meaning in ROW.findall(section)
    }


def default_of(param: Any) -> str:
    """A parameter's default as the page writes it."""
    if param.secondary_opts:
        return str(param.opts[0] if param.default else param.secondary_opts[0])
    if param.default is None or isinstance(param.default, bool):
        return ""
    return f"{param.default:g}" if isinstance(param.default, float) else str(param.default)


def choices_of(command: Any) -> dict[str, tuple[str, ...]]:
    """What the options of a command that take one of several words accept, by parameter."""
    hints = get_type_hints(inspect.unwrap(command.callback))
    return {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Literal}


VERBS = dict(verbs(typer.main.get_command(app), "cadpose"))


def test_every_verb_has_a_part_and_every_part_a_verb() -> None:
    assert len(VERBS) >= 12
    assert set(sections()) == set(VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_the_options_are_those_of_the_program(verb: str) -> None:
    told, options, choices = rows(sections()[verb]), documented(VERBS[verb]), choices_of(VERBS[verb])
    assert set(told) == set(options)
    for spellings, param in options.items():
        default, text = told[spellings]
        assert default == default_of(param), spellings
        for choice in choices.get(param.name, ()):
            assert f"`{choice}`" in text, spellings


def commands_on_pages() -> Iterator[tuple[str, str]]:
    """(page, command) of every line in a block that calls the program, continued lines joined."""
    root = PAGE.parent.parent
    for page in [root / "README.md", *sorted((root / "docs").rglob("*.md"))]:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        fenced = "\n".join(re.findall(r"^```(?:sh)?\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
        indented = "\n".join(re.findall(r"^ {4,}(.*)$", text, re.MULTILINE))
        call = r"^\s*(?:\$ )?(?:[A-Z_]+=\S+ )*(cadpose [a-z].*)$"
        for line in re.findall(call, f"{fenced}\n{indented}", re.MULTILINE):
            yield page.name, line


def test_commands_on_pages_use_verbs_and_options_that_there_are() -> None:
    seen, wrong = 0, []
    for page, line in commands_on_pages():
        words = shlex.split(line.partition(" #")[0])
        verb = max((v for v in VERBS if words[: len(v.split())] == v.split()), key=len, default="")
        if verb in ("", "cadpose"):
            wrong.append(f"{page}: {line}: no such verb")
            continue
        known = {spelling for spellings in documented(VERBS[verb]) for spelling in spellings} | {"--help"}
        told = {word.partition("=")[0] for word in words if re.match(r"--[a-z]|-[a-wA-Z]$", word)}
        seen += 1
        if told - known:
            wrong.append(f"{page}: {line}: {sorted(told - known)}")
    assert wrong == []
    assert seen > 100


def test_choices_are_found() -> None:
    assert choices_of(VERBS["cadpose annotate"])["align_to"] == ("box", "paper", "mask")


def test_every_measure_is_named() -> None:
    section = sections()["cadpose annotate"]
    names = measures(cast(Lite0, None), 0)  # the names only: nothing is made
    plain = {name for name in names if "-" not in name}
    assert all(f"`{name}`" in section for name in plain)
    kinds = {name.partition("-")[0] for name in names if name not in plain}
    assert kinds == {"sift", "delf", "xfeat"} and all(f"`{kind}-`" in section for kind in kinds)
    for kind in kinds:
        behind = {name.partition("-")[2] for name in names if name.startswith(f"{kind}-")}
        assert behind == plain - {"aligned", "fused", "triplet"}


def test_every_exit_code_and_environment_variable_is_told() -> None:
    page = PAGE.read_text(encoding="utf-8")
    code = "\n".join(
        path.read_text(encoding="utf-8") for path in (PAGE.parent.parent / "src" / "cadpose").rglob("*.py")
    )
    variables = set(re.findall(r'"(CADPOSE_[A-Z]+)"', code))
    assert variables
    assert variables == set(re.findall(r"^\| `(CADPOSE_[A-Z]+)`", page, re.MULTILINE))
    assert set(re.findall(r"^\| (\d+) \|", page, re.MULTILINE)) == {"0", "1", "2", "130"}
