from __future__ import annotations

import io
import struct
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cadpose.datasets import matlab
from cadpose.datasets.matlab import read_struct
from cadpose.errors import InputError
from tests.datasets.trees import thing, write_mat

NUMBERS = st.sampled_from([np.float64, np.float32, np.uint8, np.int16, np.int32, np.bool_]).flatmap(
    lambda kind: arrays(kind, st.tuples(st.integers(0, 4), st.integers(0, 4)))
)


def written(value: Any, compress: bool = False) -> bytes:
    out: Any = io.BytesIO()
    scipy.io.savemat(out, {"other": np.eye(2), "record": value}, do_compression=compress)
    return bytes(out.getvalue())


@given(a=NUMBERS, text=st.text("abc 19é", max_size=9), compress=st.booleans())
def test_what_scipy_writes_is_read(
    a: Any, text: str, compress: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("mat") / "a.mat"
    cell = np.empty((1, 2), object)
    cell[0, 0], cell[0, 1] = a, text
    path.write_bytes(written({"a": a, "text": text, "cell": cell, "inner": {"b": a.T}}, compress))
    found = read_struct(path, "record")
    finite = np.nan_to_num(a.astype(float))
    assert np.array_equal(np.nan_to_num(found["a"]), finite.ravel())
    assert found["text"] == text.rstrip("\0")
    assert np.array_equal(np.nan_to_num(found["cell"][0]), finite.ravel())
    assert np.array_equal(np.nan_to_num(found["inner"][0]["b"]), finite.T.ravel())


def test_struct_arrays_are_lists(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write_mat(path, [thing(), thing(**{"class": "chair"})])
    objects = read_struct(path, "record")["objects"]
    assert [item["class"] for item in objects] == ["car", "chair"]
    assert objects[0]["bbox"] == [11.0, 21.0, 110.0, 70.0]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[:60], "no(t a)? .mat file|is not a .mat file"),
        (lambda data: data[:124] + b"\x00\x02" + data[126:], "version 7.3"),
        (lambda data: data[:-40], "ends too early|holds no struct"),
        (lambda data: data.replace(b"record", b"recorb"), "holds no struct"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, change: Any, told: str) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(change(written({"a": np.eye(2)})))
    with pytest.raises(InputError, match=told):
        read_struct(path, "record")


def test_more_values_than_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(written({"a": np.zeros((40, 40))}))
    monkeypatch.setattr(matlab, "MAX_VALUES", 1000)
    with pytest.raises(InputError, match="more than 1000 values"):
        read_struct(path, "record")


def test_nesting_has_an_end(tmp_path: Path) -> None:
    value: Any = {"a": 1.0}
    for _ in range(20):
        value = {"a": value}
    path = tmp_path / "a.mat"
    path.write_bytes(written(value))
    with pytest.raises(InputError, match="nested too deeply"):
        read_struct(path, "record")


def test_a_struct_of_very_many_fields_is_refused_at_once(tmp_path: Path) -> None:
    # The empty struct holds no value that could be counted, but its names alone fill what may be unpacked.
    path = tmp_path / "a.mat"
    data = written({"abc": 1.0})
    names = b"a" * (16 * 2**20)
    at = data.index(b"record")
    head = data[: at + 8]
    start = head.rindex(struct.pack("<I", 14))
    length = struct.pack("<HHI", 5, 4, 1)
    body = head[start + 8 :] + length + struct.pack("<II", 1, len(names)) + names
    path.write_bytes(data[:128] + _packed(struct.pack("<II", 14, len(body)) + body))
    assert path.stat().st_size < 100_000
    begun = time.monotonic()
    with pytest.raises(InputError, match="more than 1000 fields"):
        read_struct(path, "record")
    assert time.monotonic() - begun < 5.0


def _packed(element: bytes) -> bytes:
    packed = zlib.compress(element)
    return struct.pack("<II", 15, len(packed)) + packed
