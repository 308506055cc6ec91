"""Arrays of dicts that NumPy stored as a pickle, read without running the pickle.

A pickle is a program that may call anything. This reads its instructions as data: dicts, lists, tuples, text
and numbers are built, NumPy's own arrays and scalars are decoded from their bytes, and every other call is an
error. No name is looked up and nothing is imported.
"""

from __future__ import annotations

import io
import pickletools
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.files import first_line, read_bytes
from cadpose.errors import InputError

#: Largest .npz file and largest array in it: annotations of one photo take some kB.
MAX_BYTES = 4 * 2**20
MAX_UNPACKED = 16 * 2**20
MAX_VALUES = 1_000_000
MAX_DEPTH = 20
#: NumPy's builders, whose module has moved; those of objects are decoded here.
_MODULES = ("numpy", "numpy.core.multiarray", "numpy._core.multiarray")
_BUILDERS = ("_reconstruct", "ndarray", "dtype", "scalar")
_MARK = object()


@dataclass
class _Call:
    """A NumPy builder's name, what it was called with, and the state it was given."""

    name: str
    arguments: tuple[Any, ...] = ()
    state: Any = None
    called: bool = field(default=False)


def read_object_array(path: Path, name: str) -> list[Any]:
    """The elements of one array of Python objects in an .npz file, as plain values.

    Numbers are int or float, arrays flat lists of them.

    Raises:
        InputError: the file cannot be read, is too large, lacks the array, or holds what is not data.
    """
    try:
        raw = io.BytesIO(read_bytes(path, MAX_BYTES))
        with zipfile.ZipFile(raw) as archive, archive.open(f"{name}.npy") as member:
            data = member.read(MAX_UNPACKED + 1)
        if len(data) > MAX_UNPACKED:
            raise InputError(f"{path}: {name} unpacks to more than {MAX_UNPACKED >> 20} MiB")
        stream = io.BytesIO(data)
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("its header is of an unknown version")
        shape, _, kind = np.lib.format.read_array_header_1_0(stream)
        if 0 in shape:  # NumPy makes an empty list an array of numbers
            return []
        if kind != np.dtype(object):
            raise ValueError(f"{name} is no array of objects")
        value = _Plain().of(_interpret(stream.read()))
    except InputError:
        raise
    except Exception as error:  # damaged archives and instructions fail in any way at all
        raise InputError(
            f"{path}: is not an annotation file that can be read ({first_line(error)})"
        ) from error
    return value if isinstance(value, list) else [value]


def _interpret(data: bytes) -> Any:
    """Run the instructions of a pickle on a stack of inert values."""
    stack: list[Any] = []
    memo: dict[int, Any] = {}

    def since_mark() -> list[Any]:
        at = len(stack) - 1 - next(i for i, v in enumerate(reversed(stack)) if v is _MARK)
        items = stack[at + 1 :]
        del stack[at:]
        return items

    for opcode, found, _ in pickletools.genops(data):
        argument: Any = found
        match opcode.name:
            case "PROTO" | "FRAME":
                pass
            case "STOP":
                return stack.pop()
            case "MARK":
                stack.append(_MARK)
            case "NONE":
                stack.append(None)
            case "NEWTRUE" | "NEWFALSE":
                stack.append(opcode.name == "NEWTRUE")
            case (
                "BININT" | "BININT1" | "BININT2" | "LONG1" | "BINFLOAT" | "BINUNICODE" | "SHORT_BINUNICODE"
                | "BINBYTES" | "SHORT_BINBYTES"
            ):  # fmt: skip
                stack.append(argument)
            case "EMPTY_LIST":
                stack.append([])
            case "EMPTY_DICT":
                stack.append({})
            case "EMPTY_TUPLE":
                stack.append(())
            case "TUPLE":
                stack.append(tuple(since_mark()))
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                count = int(opcode.name[-1])
                stack[-count:] = [tuple(stack[-count:])]
            case "APPEND":
                item = stack.pop()
                _as(list, stack[-1]).append(item)
            case "APPENDS":
                items = since_mark()
                _as(list, stack[-1]).extend(items)
            case "SETITEM":
                key, item = stack[-2:]
                del stack[-2:]
                _as(dict, stack[-1])[_as(str, key)] = item
            case "SETITEMS":
                items = since_mark()
                target = _as(dict, stack[-1])
                for key, item in zip(items[::2], items[1::2], strict=True):
                    target[_as(str, key)] = item
            case "BINPUT" | "LONG_BINPUT":
                memo[argument] = stack[-1]
            case "MEMOIZE":
                memo[len(memo)] = stack[-1]
            case "BINGET" | "LONG_BINGET":
                stack.append(memo[argument])
            case "GLOBAL":
                stack.append(_builder(*argument.split(" ")))
            case "STACK_GLOBAL":
                module, attribute = stack[-2:]
                stack[-2:] = [_builder(module, attribute)]
            case "REDUCE":
                arguments = _as(tuple, stack.pop())
                builder = _as(_Call, stack.pop())
                if builder.called:
                    raise ValueError("a value is called")
                stack.append(_Call(builder.name, arguments, called=True))
            case "BUILD":
                state = stack.pop()
                _as(_Call, stack[-1]).state = state
            case _:
                raise ValueError(f"the instruction {opcode.name} is not data")
    raise ValueError("it ends too early")


def _builder(module: Any, name: Any) -> _Call:
    if module not in _MODULES or name not in _BUILDERS:
        raise ValueError(f"{module}.{name} is not data")
    return _Call(name)


def _as(kind: type[Any], value: Any) -> Any:
    if not isinstance(value, kind):
        raise ValueError(f"a {kind.__name__} was expected")
    return value


class _Plain:
    """Inert values to dicts, lists, text and numbers; counted, for one value may stand in many places."""

    def __init__(self) -> None:
        self.left = MAX_VALUES

    def of(self, value: Any, depth: int = 0) -> Any:
        self.left -= 1
        if depth > MAX_DEPTH or self.left < 0:
            raise ValueError("it holds too many values or nests them too deeply")
        if isinstance(value, dict):
            return {key: self.of(item, depth + 1) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [self.of(item, depth + 1) for item in value]
        if not isinstance(value, _Call):
            return value
        if value.name == "scalar":
            kind, data = value.arguments
            return self.numbers(data, kind)[0]
        if value.name == "_reconstruct":
            _, _, kind, _, content = _as(tuple, value.state)
            if isinstance(content, list):
                return [self.of(item, depth + 1) for item in content]
            return self.numbers(content, kind)
        raise ValueError(f"a {value.name} is not data")

    def numbers(self, data: Any, kind: Any) -> list[Any]:
        self.left -= len(_as(bytes, data))
        numbers: list[Any] = np.frombuffer(data, _dtype(kind)).tolist()
        return numbers


def _dtype(value: Any) -> np.dtype[Any]:
    """Of numbers only; the byte order is told apart from the name."""
    call = _as(_Call, value)
    name = _as(str, call.arguments[0])
    if call.name != "dtype" or name[:1] not in set("biuf") or len(name) > 3:
        raise ValueError(f"the type {name[:20]!r} is not of numbers")
    order = call.state[1] if isinstance(call.state, tuple) else "="
    dtype: np.dtype[Any] = np.dtype((">" if order == ">" else "<") + name)
    return dtype
