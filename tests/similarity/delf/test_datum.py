from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from cadpose.similarity.delf import datum as reader
from cadpose.similarity.delf.datum import read_datum
from tests.similarity.delf.made import datum, number, part, varint


@given(arrays(np.float32, array_shapes(max_dims=4, max_side=6), elements=st.floats(-1e6, 1e6, width=32)))
def test_arrays_come_back(array: np.ndarray) -> None:
    read = read_datum(datum(array))
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, array)


def test_long_sides_come_back() -> None:
    array = np.arange(600, dtype=np.float32).reshape(2, 300)
    np.testing.assert_array_equal(read_datum(datum(array)), array)


def test_the_bytes_of_the_format() -> None:
    # The example of datum.proto: 3 x 2, packed.
    values = [1.1, 2.2, 3.3, 4.4, 5.5, 6.6]
    stored = b"\x0a\x04\x0a\x02\x03\x02" + b"\x12\x1a\x0a\x18" + struct.pack("<6f", *values)
    np.testing.assert_array_equal(read_datum(stored), np.array(values, np.float32).reshape(3, 2))
    # The same not packed, as a parser must also take it.
    loose = part(1, number(1, 3) + number(1, 2))
    loose += part(2, b"".join(bytes([1 << 3 | 5]) + struct.pack("<f", v) for v in values))
    np.testing.assert_array_equal(read_datum(loose), read_datum(stored))


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (datum(np.ones(4, np.float32))[:-3], "cut off"),
        (part(1, part(1, varint(3))) + part(2, part(1, bytes(8))), r"2 numbers for the shape \(3,\)"),
        (part(1, part(1, varint(2))) + part(2, part(1, bytes(7))), "cut off"),
        (part(3, part(1, bytes(8))), "field 3"),
        (datum(np.array([np.inf], np.float32)), "not numbers"),
        (part(1, part(1, varint(1) * 9)) + part(2, part(1, bytes(4))), "more than 8 dimensions"),
        (b"\xff" * 20, "cut off or too long"),
    ],
)
def test_damaged_files_are_refused(data: bytes, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        read_datum(data)


def test_sizes_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    stored = datum(np.ones(8, np.float32).reshape((1,) * 7 + (8,)))
    assert read_datum(stored).ndim == 8
    monkeypatch.setattr(reader, "MAX_BYTES", len(stored) - 1)
    with pytest.raises(ValueError, match="more than 0 MiB"):
        read_datum(stored)


def test_numbers_one_by_one_are_not_an_array_each(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty seconds for 2 MB it took."""
    loose = (bytes([1 << 3 | 5]) + struct.pack("<f", 0.5)) * 1000
    made: list[int] = []
    real = np.frombuffer
    monkeypatch.setattr(np, "frombuffer", lambda *args: made.append(1) or real(*args))  # type: ignore[func-returns-value]
    read = read_datum(part(1, number(1, 1000)) + part(2, loose))
    np.testing.assert_array_equal(read, np.full(1000, 0.5, np.float32))
    assert len(made) == 1


@given(st.binary(max_size=100))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        read_datum(data)
    except ValueError as error:
        assert str(error)
