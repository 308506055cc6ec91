"""What is wrong with a file that does not hold what it should, in the words of its checks."""

from __future__ import annotations

from pydantic import ValidationError


def first_fault(error: ValidationError) -> str:
    """The first thing that the checks found, after its place: ``images.0.width: Field required``."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    where = ".".join(str(piece) for piece in first["loc"])
    return f"{where + ': ' if where else ''}{first['msg']}"
