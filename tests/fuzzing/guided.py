"""The same readers under atheris, which changes files so that they reach code that none reached before."""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path
from typing import Any

from cadpose.errors import CadposeError
from tests.fuzzing.running import MEGABYTES, SECONDS


def run(family: str, inputs: int, seed: int) -> None:
    """Run atheris on a family until it has read ``inputs`` files or found something; it ends the process.

    Raises:
        SystemExit: atheris is not installed, or the run has ended.
    """
    try:
        atheris: Any = importlib.import_module("atheris")
    except ImportError:
        raise SystemExit("atheris is not installed: `pip install atheris` (Python 3.11 to 3.13)") from None
    # Only what is imported in here is watched: all of what is loaded would take minutes to prepare.
    with atheris.instrument_imports(include=["cadpose"]):
        from tests.fuzzing.families import FAMILIES
    if family not in FAMILIES:
        raise SystemExit(f"there is no family {family}")
    folder = Path(tempfile.mkdtemp(prefix="cadpose-atheris-"))
    targets = FAMILIES[family](folder)
    corpus = folder / "corpus"
    corpus.mkdir()
    for number, target in enumerate(targets):
        # The first byte says which file it is.
        (corpus / f"{number:03}").write_bytes(bytes([number]) + target.data)

    def read(data: bytes) -> None:
        if not data:
            return
        target = targets[data[0] % len(targets)]
        target.path.write_bytes(data[1:])
        try:
            target.read()
        except CadposeError:
            pass
        finally:
            target.path.write_bytes(target.data)

    words = [sys.argv[0], f"-runs={inputs}", f"-seed={seed + 1}", f"-timeout={int(SECONDS)}"]
    words += [f"-rss_limit_mb={2 * MEGABYTES}", f"-artifact_prefix={family}-", str(corpus)]
    atheris.Setup(words, read)
    atheris.Fuzz()
