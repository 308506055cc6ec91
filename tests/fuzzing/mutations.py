"""Damaging bytes: a few random changes of a valid file, as a disk, a network or an enemy would make them."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable, Sequence
from copy import deepcopy
from random import Random
from typing import Any

#: Whole numbers that readers stumble over.
_NUMBERS = (0, 1, -1, 2, 127, 128, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1)
_TOKENS = (
    b"0", b"-1", b"1e999", b"-1e-999", b"nan", b"inf", b"99999999999999999999", b"1e308", b"0x10", b"",
    b"\xff\xfe", b"\x00", b"../../../etc/passwd", b"/dev/zero", b"%s%n", b"'; --",
)  # fmt: skip
_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1e308, -1e308, 2**63, 10**400, 0.1, "", "x" * 300, "../../../etc/passwd",
    "/dev/zero", "\ud800", "\x00", [], {}, [[]], [0] * 20, {"a": {}},
)  # fmt: skip
_WORD = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|[A-Za-z_]{2,}")
_MOST_BYTES = 1 << 20

Change = Callable[[bytearray, Sequence[bytes], Random], bytearray]


def mutated(data: bytes, others: Sequence[bytes], random: Random) -> bytes:
    """``data`` after one to six changes; ``others`` are files that pieces are taken from."""
    if random.random() < 0.4 and data[:1] in (b"{", b"["):
        found = _mutated_json(data, random)
        if found is not None:
            data = found
            if random.random() < 0.7:
                return data
    out = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
        out = random.choice(_CHANGES)(out, others, random)
    return bytes(out[:_MOST_BYTES])


def _flip(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    for _i in range(random.choice((1, 1, 4, 16))):
        if data:
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return data


def _number(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    kind = random.choice(("B", "<H", ">H", "<I", ">I", "<Q", "<f"))
    value = random.choice(_NUMBERS)
    if kind == "<f":
        packed = struct.pack(kind, random.choice((float("nan"), float("inf"), 1e38, -1.0, 0.0)))
    else:
        packed = struct.pack(kind, value % (1 << 8 * struct.calcsize(kind)))
    if len(data) >= len(packed):
        at = _place(data, random, len(packed))
        data[at : at + len(packed)] = packed
    return data


def _delete(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    at, many = _place(data, random), random.choice((1, 2, 8, 64, 1024))
    del data[at : at + many]
    return data


def _repeat(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    at, many = _place(data, random), random.choice((1, 8, 64, 512))
    data[at:at] = data[at : at + many] * random.choice((1, 1, 2, 64))
    return data


def _insert(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    at = _place(data, random)
    data[at:at] = random.randbytes(random.choice((1, 4, 32)))
    return data


def _cut(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    return data[: _place(data, random)]


def _splice(data: bytearray, others: Sequence[bytes], random: Random) -> bytearray:
    other = random.choice(others)
    if other:
        start = random.randrange(len(other))
        piece = other[start : start + random.choice((4, 32, 256, 4096))]
        at = _place(data, random)
        data[at : at + len(piece) * random.randrange(2)] = piece
    return data


def _word(data: bytearray, _: Sequence[bytes], random: Random) -> bytearray:
    """Another number or word where one stands in text."""
    start = _place(data, random)
    found = _WORD.search(data, start, start + 200)
    if found:
        data[found.start() : found.end()] = random.choice(_TOKENS)
    return data


_CHANGES: tuple[Change, ...] = (_flip, _number, _delete, _repeat, _insert, _cut, _splice, _word, _word)


def _place(data: bytearray, random: Random, room: int = 0) -> int:
    """Somewhere, in every third case near the start, where the headers are."""
    most = max(1, len(data) - room)
    return random.randrange(min(most, 128) if random.random() < 0.35 else most)


def _mutated_json(data: bytes, random: Random) -> bytes | None:
    """One to three values replaced, taken away, doubled or moved, still JSON."""
    try:
        value = json.loads(data)
    except ValueError:
        return None
    for _ in range(random.choice((1, 1, 2, 3))):
        places = list(_places(value))
        if not places:
            break
        holder, key = random.choice(places)
        action = random.random()
        if action < 0.55:
            holder[key] = deepcopy(random.choice(_VALUES))
        elif action < 0.7:
            del holder[key]
        elif action < 0.85:
            other, at = random.choice(places)
            holder[key] = other[at] if not isinstance(other[at], dict | list) else json.loads("[]")
        elif isinstance(holder, list):
            holder.append(json.loads(json.dumps(holder[key], default=str)))
        else:
            holder[random.choice(("id", "x", ""))] = deepcopy(random.choice(_VALUES))
    return json.dumps(value).encode("utf-8", "surrogatepass")


def _places(value: Any) -> Any:
    """(holder, key) of every value inside."""
    if isinstance(value, dict | list):
        keys = range(len(value)) if isinstance(value, list) else list(value)
        for key in keys:
            yield value, key
            yield from _places(value[key])
