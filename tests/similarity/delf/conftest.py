from __future__ import annotations

import pytest

from cadpose.similarity.delf.parameters import Parameters
from tests.similarity.delf.made import made_variables


@pytest.fixture(scope="session")
def made() -> Parameters:
    """A network of DELF's shape with made-up weights: not DELF."""
    return Parameters.from_variables("made-up", *made_variables())
