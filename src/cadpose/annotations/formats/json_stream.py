"""JSON files longer than memory: arrays are written and read element by element."""

from __future__ import annotations

import codecs
import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, BinaryIO, Self

from cadpose.errors import InputError

#: Longest element that is read, in characters, and longest file, in bytes.
MAX_ELEMENT = 64_000_000
MAX_BYTES = 16 * 2**30
#: Most elements of a file.
MAX_ELEMENTS = 20_000_000
_CHUNK = 2**20
_AFTER = frozenset(",:]} \t\r\n")


def dumped(value: Any) -> str:
    """Compact JSON on one line."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(", ", ": "))


class JsonArrays:
    """A JSON object whose arrays grow side by side, one element a line; each grows in a file of its own.

    Args:
        path: The file, written when the block ends well.
        names: Of the arrays, in the order in which they are written.
    """

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        self._path = path
        self._parts: dict[str, IO[str]] = {}
        self._counts = dict.fromkeys(names, 0)
        self._open = ExitStack()
        for name in names:
            self._parts[name] = self._open.enter_context(
                tempfile.TemporaryFile("w+", encoding="utf-8", dir=path.parent)  # noqa: SIM115, closed with the stack
            )
        #: Keys that are written after the arrays.
        self.more: dict[str, Any] = {}

    def add(self, name: str, value: Any) -> int:
        """Append to an array; returns the element's number from 1."""
        separator = ",\n" if self._counts[name] else "\n"
        self._parts[name].write(separator + dumped(value))
        self._counts[name] += 1
        return self._counts[name]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._open:
            if kind is None:
                with self._path.open("w", encoding="utf-8") as out:
                    self._write(out)

    def _write(self, out: IO[str]) -> None:
        opening = "{\n"
        for name, part in self._parts.items():
            out.write(f"{opening}{json.dumps(name)}: [")
            part.seek(0)
            while chunk := part.read(_CHUNK):
                out.write(chunk)
            out.write("\n]")
            opening = ",\n"
        for name, value in self.more.items():
            out.write(f"{opening}{json.dumps(name)}: {dumped(value)}")
            opening = ",\n"
        out.write("\n}\n")


class JsonEntries:
    """One JSON array or object that grows, an entry a line.

    Args:
        path: The file; whole only when the block has ended.
        brackets: ``"[]"`` or ``"{}"``.
    """

    def __init__(self, path: Path, brackets: str = "[]") -> None:
        self._file = path.open("w", encoding="utf-8")
        self._file.write(brackets[0])
        self._end = brackets[1]
        self._count = 0

    def add(self, value: Any, key: str | None = None) -> None:
        """Append an element, or an entry of an object."""
        name = "" if key is None else f"{json.dumps(key)}: "
        self._file.write(f"{',' if self._count else ''}\n{name}{dumped(value)}")
        self._count += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._file:
            if kind is None:
                self._file.write(f"\n{self._end}\n")


def iter_json(path: Path, what: str) -> Iterator[tuple[str, Any]]:
    """The elements of a JSON array as ("", element); of an object (key, element of an array) or (key, value).

    Args:
        path: The file.
        what: What it should be, as ``"a COCO file"``, for the message.

    Raises:
        InputError: it cannot be read, is not such JSON, or is too large.
    """
    try:
        if not path.is_file():
            raise InputError(f"{path} cannot be read (no such file): name {what}")
        with path.open("rb") as file:
            yield from _Scanner(file, path, what).entries()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): name {what}") from error


class _Scanner:
    """Takes one value after the other from a buffer that is filled as needed."""

    def __init__(self, file: BinaryIO, path: Path, what: str) -> None:
        self._file, self._path, self._what = file, path, what
        self._decoder = json.JSONDecoder(parse_constant=_no_constant)
        self._utf8 = codecs.getincrementaldecoder("utf-8-sig")()
        self._buffer, self._at, self._read, self._taken = "", 0, 0, 0
        self._ended = False

    def entries(self) -> Iterator[tuple[str, Any]]:
        opening = self._sign()
        if opening == "[":
            yield from (("", value) for value in self._array())
        elif opening == "{":
            first = True
            while self._peek() != "}":
                if not first and self._sign() != ",":
                    raise self._wrong("a comma is missing")
                first = False
                key = self._value()
                if not isinstance(key, str) or self._sign() != ":":
                    raise self._wrong("a key is missing")
                if self._peek() == "[":
                    self._at += 1
                    for value in self._array():
                        yield key, value
                else:
                    yield key, self._value()
            self._at += 1
        else:
            raise self._wrong("it begins with no bracket")
        if self._peek():
            raise self._wrong("something follows its end")

    def _array(self) -> Iterator[Any]:
        first = True
        while self._peek() != "]":
            if not first and self._sign() != ",":
                raise self._wrong("a comma is missing")
            first = False
            self._taken += 1
            if self._taken > MAX_ELEMENTS:
                raise self._wrong(f"it has more than {MAX_ELEMENTS} entries")
            yield self._value()
        self._at += 1

    def _value(self) -> Any:
        self._peek()
        while True:
            try:
                value, end = self._decoder.raw_decode(self._buffer, self._at)
            except (ValueError, RecursionError) as error:
                if self._ended or not self._fill():
                    raise self._wrong(str(error)) from None
                continue
            # What reads as 0 may go on as 0.5 or 0e1: a value ends where one of these follows.
            if self._buffer[end : end + 1] in _AFTER or not self._fill():
                self._at = end
                return value

    def _sign(self) -> str:
        sign = self._peek()
        self._at += 1
        return sign

    def _peek(self) -> str:
        """The next character that is no blank, empty at the end."""
        while True:
            while self._at < len(self._buffer) and self._buffer[self._at] in " \t\r\n":
                self._at += 1
            if self._at < len(self._buffer):
                return self._buffer[self._at]
            if not self._fill():
                return ""

    def _fill(self) -> bool:
        """Read on; False at the end."""
        if self._ended:
            return False
        left = self._buffer[self._at :]
        if len(left) > MAX_ELEMENT:
            raise self._wrong(f"one of its entries is longer than {MAX_ELEMENT} characters, or is no JSON")
        # Twice as much each time, so that a long entry is not parsed over and over.
        data = self._file.read(max(_CHUNK, len(left)))
        self._read += len(data)
        if self._read > MAX_BYTES:
            raise self._wrong(f"it is larger than {MAX_BYTES >> 30} GiB")
        self._ended = not data
        try:
            self._buffer, self._at = left + self._utf8.decode(data, final=self._ended), 0
        except UnicodeDecodeError as error:
            raise self._wrong(str(error)) from None
        return True

    def _wrong(self, reason: str) -> InputError:
        told = "".join(c if c.isprintable() else "?" for c in reason[:160])
        return InputError(f"{self._path} is not {self._what} ({told}): export it again")


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is no number of JSON")
