"""What a worker process says to its parent, through a pipe that only the two of them have."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

from cadpose.batch.making import Making
from cadpose.batch.outcome import PhotoOutcome
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError


@dataclass(frozen=True)
class Ready:
    """The models are loaded.

    Attributes:
        making: What photos will be made with.
    """

    making: Making


@dataclass(frozen=True)
class Done:
    """A photo is done, or has failed."""

    outcome: PhotoOutcome


@dataclass(frozen=True)
class Logged:
    """A log record, its words put together.

    Attributes:
        fields: What :func:`logging.makeLogRecord` takes.
    """

    fields: dict[str, Any]


@dataclass(frozen=True)
class Broken:
    """Something that no photo can be annotated with: the run ends.

    Attributes:
        kind: Name of the error's class.
        text: What it says.
    """

    kind: str
    text: str

    def error(self) -> CadposeError:
        """The error to raise; what is no error of the user's is named."""
        for known in (InputError, LibraryError, DependencyError, CadposeError):
            if known.__name__ == self.kind:
                return known(self.text)
        return CadposeError(f"a worker failed ({self.kind}: {self.text}), --verbose tells more")


Message = Ready | Done | Logged | Broken


def logged(record: logging.LogRecord) -> Logged:
    """A log record as a message."""
    told = dict(vars(record))
    told |= {"msg": record.getMessage(), "args": None, "exc_info": None}
    if record.exc_info:
        told["msg"] += "\n" + logging.Formatter().formatException(record.exc_info)
    plain = (str, int, float, type(None))
    return Logged({key: value for key, value in told.items() if isinstance(value, plain)})
