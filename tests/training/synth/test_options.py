from __future__ import annotations

from typing import Any

import pytest

from cadpose.training.synth.options import SynthOptions


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": 16}, "32 to 4096"),
        ({"series": 0}, "at least 1"),
        ({"shapes": 0}, "at least 1"),
        ({"company": 1.5}, r"company is a chance in \[0, 1\]"),
        ({"truncate": -0.1}, "truncate is a chance"),
        ({"fill": (0.9, 0.4)}, "fill must be a range"),
        ({"distance": (0.1, 3.0)}, "distance must be a range"),
        ({"warp": -1.0}, "warp must not be negative"),
    ],
)
def test_options_out_of_range(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SynthOptions(**wrong)
