from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.similarity.delf import bundle as reader
from cadpose.similarity.delf.bundle import read_index, read_variables
from cadpose.similarity.delf.crc32c import crc32c, masked
from tests.similarity.delf.made import bundle, entry, header, number, part, table

# A SavedModel's variables written by TensorFlow 2.15: net/conv/weights and biases, scalar, step (int64).
INDEX = base64.b64decode(
    "AAAGCAEaAggBAA8PbmV0L2NvbnYvYmlhc2VzCAESBBICCAMoDDU3Rk1kCQcdd2VpZ2h0cwgBEhASAggCEgIIARICCAISAggDIAwo"
    "MDWqizPPAAYNc2NhbGFyCAESACA8KAQ1BjgnHwEDDXRlcAgJEgAgQCgINbvXnxEAAAAAAQAAAAAxCN7sAAAAAAEAAAAAwPKhsAAB"
    "A3QAggEAAAAAAQAAAAB3RNvjhwEIlAEPAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAFf7gIskdUfb"
)
DATA = base64.b64decode(
    "AADAPwAAEMBvEoM6AAAAACVJEj4lSZI+t23bPiVJEj9u2zY/t21bPwAAgD8lSZI/SZKkP27btj+SJMk/AAAAPwcAAAAAAAAA"
)
SMALL = {
    "a": np.arange(6, dtype=np.float32).reshape(2, 3),
    "a/b/c": np.array([0.5], np.float32),
    "a/b/d": np.full((1, 1, 4, 2), -3.0, np.float32),
    "scalar": np.array(7.0, np.float32),
    "void": np.empty((0, 3), np.float32),
}


def test_checksums_are_those_of_the_standard() -> None:
    # RFC 3720, B.4.
    assert crc32c(bytes(32)) == 0x8A9136AA
    assert crc32c(bytes(range(32))) == 0x46DD794E
    assert crc32c(b"123456789") == 0xE3069283
    assert crc32c(b"") == 0
    # Masking turns by 15 bits and adds a constant.
    assert masked(b"123456789") == (((0xE3069283 >> 15) | (0xE3069283 << 17)) + 0xA282EAD8) % 2**32


def test_reads_what_tensorflow_wrote() -> None:
    index = read_index(INDEX)
    assert index.shards == 1 and set(index.entries) == {
        "net/conv/biases",
        "net/conv/weights",
        "scalar",
        "step",
    }
    read = read_variables(index, [DATA], ["net/conv/biases", "net/conv/weights", "scalar"])
    weights = np.arange(12, dtype=np.float32).reshape(2, 1, 2, 3) / np.float32(7)
    np.testing.assert_array_equal(read["net/conv/weights"], weights)
    np.testing.assert_array_equal(read["net/conv/biases"], np.array([1.5, -2.25, 1e-3], np.float32))
    assert read["scalar"].shape == () and read["scalar"] == 0.5
    with pytest.raises(ValueError, match=r"step .*32-bit"):
        read_variables(index, [DATA], ["step"])
    with pytest.raises(ValueError, match="no variable other"):
        read_variables(index, [DATA], ["other"])


@pytest.mark.parametrize("shards", [1, 3])
@pytest.mark.parametrize("a_block", [1, 2, 100])
def test_reads_many_blocks_and_files(shards: int, a_block: int) -> None:
    index, files = bundle(SMALL, shards)
    told = read_index(index).entries
    assert {name: e.shape for name, e in told.items()} == {name: v.shape for name, v in SMALL.items()}
    read = read_variables(read_index(index), files, SMALL)
    for name, values in SMALL.items():
        np.testing.assert_array_equal(read[name], values)
    entries = {"": header()} | {f"net/unit_{i}/weights": entry((1,), 0, b"abcd") for i in range(40)}
    assert set(read_index(table(entries, a_block=a_block)).entries) == set(entries) - {""}


@given(st.integers(0, len(INDEX) - 1), st.integers(1, 255))
def test_a_changed_byte_of_the_index_never_gives_other_numbers(at: int, change: int) -> None:
    damaged = bytearray(INDEX)
    damaged[at] ^= change
    try:
        read = read_variables(read_index(bytes(damaged)), [DATA], ["net/conv/weights"])
    except ValueError:
        return
    right = read_variables(read_index(INDEX), [DATA], ["net/conv/weights"])
    np.testing.assert_array_equal(read["net/conv/weights"], right["net/conv/weights"])


@given(st.binary(max_size=200), st.integers(0, 255))
def test_any_blocks_content_is_read_or_refused(content: bytes, field: int) -> None:
    for entries in ({"": content}, {"": header(), "x": content}, {"": header() + number(field, 3)}):
        try:
            index = read_index(table(entries))
            read_variables(index, [DATA] * index.shards if index.shards < 9 else [], ["x"])
        except ValueError as error:
            assert str(error)


@pytest.mark.parametrize("length", [0, 47, 48, 100, len(INDEX) - 1])
def test_a_cut_index_is_refused(length: int) -> None:
    with pytest.raises(ValueError):
        read_index(INDEX[:length])


def test_damaged_data_are_refused() -> None:
    index, files = bundle(SMALL)
    other = bytearray(files[0])
    other[-1] ^= 1  # in the last variable
    with pytest.raises(ValueError, match="scalar is damaged"):
        read_variables(read_index(index), [bytes(other)], SMALL)
    assert set(read_variables(read_index(index), [bytes(other)], ["a", "a/b/d"])) == {"a", "a/b/d"}
    with pytest.raises(ValueError, match="data end within scalar"):
        read_variables(read_index(index), [files[0][:-2]], SMALL)
    with pytest.raises(ValueError, match="0 data files"):
        read_variables(read_index(index), [], SMALL)
    index, files = bundle({"a": np.array([1.0, np.nan], np.float32)})
    with pytest.raises(ValueError, match="not numbers"):
        read_variables(read_index(index), files, ["a"])


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ({"x": entry((1,), 0, b"abcd")}, "no header"),
        ({"": header(endianness=1)}, "big-endian"),
        ({"": header(oldest=2)}, "newer format"),
        ({"": header(), "x": entry((1,) * 9, 0, b"abcd")}, "9 dimensions"),
        ({"": header(), "x": entry((1,), 0, b"abcd")[:-2]}, "cut off"),
        ({"": header(), "k" * 5000: entry((1,), 0, b"abcd")}, "malformed"),
    ],
    ids=["no header", "endian", "version", "dimensions", "cut entry", "long key"],
)
def test_an_index_of_another_kind_is_refused(entries: dict[str, bytes], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        read_index(table(entries))


def test_entries_that_contradict_themselves_are_refused() -> None:
    data = b"abcdefgh"
    for wrong in (entry((3,), 0, data), entry((2,), 0, data, shard=1), entry((2**63, 2), 0, data)):
        index = read_index(table({"": header(), "x": wrong}))
        with pytest.raises(ValueError, match="contradicts"):
            read_variables(index, [data], ["x"])
    beyond = read_index(table({"": header(), "x": entry((2,), 2**40, data)}))
    with pytest.raises(ValueError, match="end within"):
        read_variables(beyond, [data], ["x"])
    sliced = read_index(table({"": header(), "x": entry((2,), 0, data) + part(7, b"")}))
    with pytest.raises(ValueError, match="slices"):
        read_variables(sliced, [data], ["x"])


def test_a_compressed_index_is_refused_with_the_reason() -> None:
    with pytest.raises(ValueError, match="compressed"):
        read_index(table({"": header()}, compression=1))


def test_an_index_cannot_grow_without_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = {"": header()} | {f"{i}": entry((1,), 0, b"abcd") for i in range(20)}
    monkeypatch.setattr(reader, "MAX_ENTRIES", 19)
    with pytest.raises(ValueError, match="more than 19"):
        read_index(table(entries))
    monkeypatch.setattr(reader, "MAX_INDEX_BYTES", 200)
    with pytest.raises(ValueError, match="an index of"):
        read_index(table(entries))
