from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cadpose.annotations.formats import json_stream
from cadpose.annotations.formats.json_stream import JsonArrays, JsonEntries, iter_json
from cadpose.errors import InputError

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
TEXTS = st.sampled_from([None, 1])


def entries(value: Any) -> list[tuple[str, Any]]:
    if isinstance(value, list):
        return [("", item) for item in value]
    return [
        (key, item) for key, told in value.items() for item in (told if isinstance(told, list) else [told])
    ]


@given(st.lists(VALUES) | st.dictionaries(st.text(), VALUES), st.sampled_from([None, 2]), st.booleans())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_reads_what_json_reads(tmp_path: Path, value: Any, indent: int | None, ascii_only: bool) -> None:
    path = tmp_path / "a.json"
    text = json.dumps(value, indent=indent, ensure_ascii=ascii_only)
    path.write_bytes(text.encode("utf-8", "surrogatepass") if ascii_only else text.encode("utf-8", "replace"))
    expected = json.loads(path.read_bytes())
    for chunk in (1, 7, 2**20):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(json_stream, "_CHUNK", chunk)
            assert list(iter_json(path, "a file")) == entries(expected)


def test_arrays_grow_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with JsonArrays(path, ["a", "b"]) as file:
        assert [file.add("a", {"x": 1.5}), file.add("b", "é"), file.add("a", None)] == [1, 1, 2]
        file.more["c"] = {"k": [1]}
    assert json.loads(path.read_text()) == {"a": [{"x": 1.5}, None], "b": ["é"], "c": {"k": [1]}}
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(ZeroDivisionError), JsonArrays(tmp_path / "b.json", ["a"]) as file:
        file.add("a", 1 / 0)
    assert list(tmp_path.iterdir()) == [path]


def test_entries(tmp_path: Path) -> None:
    for brackets, value in (("[]", [1, 2]), ("{}", {"a": 1, "b": 2}), ("[]", []), ("{}", {})):
        path = tmp_path / "a.json"
        with JsonEntries(path, brackets) as file:
            for key, item in value.items() if isinstance(value, dict) else ((None, v) for v in value):
                file.add(item, key)
        assert json.loads(path.read_text()) == value


def test_numbers_that_json_cannot_carry(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"), JsonEntries(tmp_path / "a.json") as file:
        file.add(float("nan"))


@pytest.mark.parametrize(
    "content",
    [
        b"", b"  ", b"3", b'"a"', b"[1 2]", b"[1,]", b"[1", b'{"a" 1}', b'{"a": 1 "b": 2}', b'{"a": [1',
        b"[]]",
        b"[1] x", b"\xff", b"[NaN]", b"[Infinity]", b"[" * 100_000, b'{"a": ', b"{1: 2}", b'["\xe9"]',
    ],
)  # fmt: skip
def test_what_is_no_json(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not a thing") as caught:
        list(iter_json(path, "a thing"))
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(["x" * 500, 1, 2, 3]))
    monkeypatch.setattr(json_stream, "_CHUNK", 10)
    for name, most, words in (
        ("MAX_ELEMENT", 100, "longer than 100"),
        ("MAX_ELEMENTS", 3, "more than 3 entries"),
        ("MAX_BYTES", 400, "larger than"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(json_stream, name, most)
            with pytest.raises(InputError, match=words):
                list(iter_json(path, "a file"))
    assert len(list(iter_json(path, "a file"))) == 4


def test_what_is_no_file(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none", tmp_path / "a\0b"):
        with pytest.raises(InputError, match="cannot be read"):
            list(iter_json(path, "a file"))
