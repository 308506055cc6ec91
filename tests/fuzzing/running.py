"""Feeding damaged files to a reader in a process of its own, and telling whatever is no clear refusal.

A reader may give its result or raise CadposeError. Anything else fails: another exception, the end of the
process, more than the seconds or the memory that one file may take.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import resource
import shutil
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random

from cadpose.errors import CadposeError
from tests.fuzzing.mutations import mutated

#: What one file may take.
SECONDS, MEGABYTES = 5.0, 1024
_REPORT_EVERY = 0.2


@dataclass(frozen=True)
class Target:
    """One file of a family.

    Attributes:
        path: Where it lies while it is read.
        data: As it is right.
        read: Reads it, or the whole that it belongs to.
    """

    path: Path
    data: bytes
    read: Callable[[], object]


#: Writes a family's files into a folder; what may be damaged of them.
Make = Callable[[Path], list[Target]]


@dataclass
class Outcome:
    """What a run found.

    Attributes:
        family: Its name.
        inputs: Files that were read.
        refused: Those that were refused in a sentence; the others gave a result.
        slowest: Seconds of the slowest.
        megabytes: What the process grew by at most.
        failures: A line each.
        seconds: The whole run.
    """

    family: str
    inputs: int = 0
    refused: int = 0
    slowest: float = 0.0
    megabytes: float = 0.0
    failures: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def to_json(self) -> dict[str, object]:
        """All of it."""
        return asdict(self)


def fuzz(
    family: str, make: Make, inputs: int, seed: int = 0, kept: Path | None = None, most_failures: int = 20
) -> Outcome:
    """Read ``inputs`` damaged files of a family.

    Args:
        family: Its name.
        make: Its files.
        inputs: How many; the same numbers and seed give the same files.
        seed: Of the damage.
        kept: Folder for files that failed; None keeps none.
        most_failures: Ends after so many.
    """
    outcome, start, first = Outcome(family), time.monotonic(), 0
    with tempfile.TemporaryDirectory(prefix="cadpose-fuzz-") as folder:
        for target in _targets(make, Path(folder) / "told"):
            _read(target)  # a right file that is refused is the family's own mistake
        while first < inputs and len(outcome.failures) < most_failures:
            first = _process(outcome, make, Path(folder), (first, inputs, seed), kept, most_failures)
    outcome.seconds = round(time.monotonic() - start, 1)
    return outcome


def _process(
    outcome: Outcome,
    make: Make,
    folder: Path,
    span: tuple[int, int, int],
    kept: Path | None,
    most_failures: int,
) -> int:
    """Read files in one process until it ends or has failed often; the number of the next one."""
    first, inputs, seed = span
    here, there = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(
        target=_read_all, args=(there, make, folder, span), daemon=True
    )
    process.start()
    there.close()
    number, since = first, time.monotonic()
    failure = ""
    while True:
        # A process that is stopped by the machine's load has not hung: twice the limit ends it.
        if here.poll(2 * SECONDS):
            try:
                message = here.recv()
            except EOFError:
                process.join()
                if number < inputs and not failure:
                    failure = f"the process ended ({process.exitcode})"
                break
            number, since = message["number"], time.monotonic()
            outcome.inputs += message["inputs"]
            outcome.refused += message["refused"]
            outcome.slowest = max(outcome.slowest, message["slowest"])
            outcome.megabytes = max(outcome.megabytes, message["megabytes"])
            if message["failure"]:
                _tell(outcome, message["name"], message["data"], (number - 1, seed), message["failure"], kept)
                if len(outcome.failures) >= most_failures:
                    process.kill()
                    process.join()
                    break
        elif time.monotonic() - since > 2 * SECONDS:
            failure = f"it took more than {2 * SECONDS:g} s"
            process.kill()
            process.join()
            break
    here.close()
    if failure:
        # Reports come late: which file it was, the next process finds by reading one at a time.
        number = _culprit(outcome, make, folder, (number, inputs, seed), failure, kept)
    return number


def _culprit(
    outcome: Outcome, make: Make, folder: Path, span: tuple[int, int, int], failure: str, kept: Path | None
) -> int:
    first, inputs, seed = span
    for number in range(first, inputs):
        process = multiprocessing.get_context("fork").Process(
            target=_read_all, args=(None, make, folder, (number, number + 1, seed)), daemon=True
        )
        process.start()
        process.join(2 * SECONDS)
        outcome.inputs += 1
        if process.exitcode != 0:
            process.kill()
            process.join()
            target, data = damaged(_targets(make, folder / "told"), number, seed)
            _tell(outcome, target.path.name, data, (number, seed), failure, kept)
            return number + 1
    outcome.failures.append(f"after {first}: {failure}, and none of the files did it again alone")
    return inputs


def _tell(
    outcome: Outcome, file: str, data: bytes, which: tuple[int, int], failure: str, kept: Path | None
) -> None:
    number, seed = which
    outcome.failures.append(f"{file} {number}: {failure}")
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        name = f"{outcome.family}-{seed}-{number}{Path(file).suffix}"
        (kept / name).write_bytes(data)
        (kept / f"{name}.txt").write_text(f"{file}\n{failure}\n", encoding="utf-8")


def damaged(targets: list[Target], number: int, seed: int) -> tuple[Target, bytes]:
    """The file of that number."""
    random = Random(f"{seed} {number}")
    target = random.choice(targets)
    return target, mutated(target.data, [other.data for other in targets], random)


def _targets(make: Make, folder: Path) -> list[Target]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return make(folder)


def _read_all(connection: Connection | None, make: Make, folder: Path, span: tuple[int, int, int]) -> None:
    first, inputs, seed = span
    logging.disable(logging.CRITICAL)
    targets = _targets(make, folder / "read")
    for target in targets:
        _read(target)  # what is loaded once is not the files' memory
    resource.setrlimit(resource.RLIMIT_AS, (_virtual() + MEGABYTES * 2**20, resource.RLIM_INFINITY))
    resting, told = _peak(), time.monotonic()
    count = refused = 0
    slowest = 0.0
    for number in range(first, inputs):
        target, data = damaged(targets, number, seed)
        target.path.write_bytes(data)
        start = time.monotonic()
        failure = ""
        try:
            target.read()
        except CadposeError as error:
            refused += 1
            if "\n" in str(error).strip():
                failure = f"its refusal has several lines: {error!r}"
        except BaseException as error:
            failure = f"{type(error).__name__}: {json.dumps(str(error)[:200])} {_where(error)}"
        seconds = time.monotonic() - start
        slowest, count = max(slowest, seconds), count + 1
        if not failure and seconds > SECONDS:
            failure = f"it took {seconds:.1f} s"
        target.path.write_bytes(target.data)
        if connection is None:
            continue
        if failure or number + 1 == inputs or time.monotonic() - told > _REPORT_EVERY:
            told = time.monotonic()
            connection.send(
                {
                    "number": number + 1,
                    "inputs": count,
                    "refused": refused,
                    "slowest": round(slowest, 3),
                    "megabytes": round(max(0.0, _peak() - resting), 1),
                    "failure": failure,
                    "name": target.path.name,
                    "data": data if failure else b"",
                }
            )
            count = refused = 0


def _read(target: Target) -> None:
    target.path.write_bytes(target.data)
    target.read()


def _where(error: BaseException) -> str:
    """The last lines of ours that it passed through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if "cadpose" in f.filename] or frames
    return " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in ours[:-4:-1])


def _virtual() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
