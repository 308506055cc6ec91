"""What the page's unit tests check against is what Python gives now."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.review.web_numbers import FILES, FOLDER


@pytest.mark.parametrize("name", sorted(FILES))
def test_the_pages_fixtures_are_pythons_numbers(name: str) -> None:
    told = json.loads((FOLDER / name).read_text(encoding="utf-8"))
    assert_alike(told, json.loads(json.dumps(FILES[name]())), name)


def assert_alike(told: Any, made: Any, where: str) -> None:
    if isinstance(made, dict):
        assert told.keys() == made.keys(), where
        for key, value in made.items():
            assert_alike(told[key], value, f"{where}/{key}")
    elif isinstance(made, list):
        assert len(told) == len(made), where
        for i, value in enumerate(made):
            assert_alike(told[i], value, f"{where}/{i}")
    elif isinstance(made, float):
        assert told == pytest.approx(made, abs=1e-9), where
    else:
        assert told == made, where
