"""Errors that are a user's to mend: one clear sentence each, never a traceback on the command line."""

from __future__ import annotations


class CadposeError(Exception):
    """Anything that went wrong and can be told in one sentence, with the file and the mend.

    Examples:
        >>> from pathlib import Path
        >>> from cadpose import CadposeError, Library
        >>> try:
        ...     Library.open(Path("nowhere"))
        ... except CadposeError as error:
        ...     print(error)
        There is no CAD library at nowhere; add models with `cadpose library add PATH` (...).
    """


class InputError(CadposeError):
    """A photo, mesh, archive or label file that cannot be used."""


class LibraryError(CadposeError):
    """The CAD library is missing, empty, damaged or lacks what was asked for."""


class DependencyError(CadposeError):
    """An optional package, weight file or program is not there; the message says how to get it."""
