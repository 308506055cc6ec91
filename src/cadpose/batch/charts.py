"""Plots of the run report as inline SVG: nothing to install, nothing to load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.annotations.page import text
from cadpose.batch.figures import StageTime

_WIDTH, _ROW, _LABEL = 560, 24, 120


def time_chart(times: Sequence[StageTime]) -> str:
    """Bars of what each stage takes: dark to the median, light to the 90th percentile."""
    longest = max((one.p90 for one in times), default=0.0) or 1.0
    room = _WIDTH - _LABEL - 150
    rows = []
    for number, one in enumerate(times):
        y = number * _ROW + 4
        light, dark = room * one.p90 / longest, room * min(one.median, one.p90) / longest
        rows.append(
            f'<text x="{_LABEL - 8}" y="{y + 12}" text-anchor="end">{text(one.stage)}</text>'
            f'<rect class="light" x="{_LABEL}" y="{y}" width="{light:.1f}" height="16"/>'
            f'<rect class="dark" x="{_LABEL}" y="{y}" width="{dark:.1f}" height="16"/>'
            f'<text x="{_LABEL + light + 6:.1f}" y="{y + 12}">{one.median:.3f} s, p90 {one.p90:.3f} s</text>'
        )
    return _svg("".join(rows), len(times) * _ROW + 8, "Seconds a photo by stage")


def histogram(values: Sequence[float], name: str) -> str:
    """How many values of [0, 1] fall into each twentieth."""
    counts, _ = np.histogram(np.clip(values, 0.0, 1.0), bins=20, range=(0.0, 1.0))
    most, height, step = max(int(counts.max()), 1), 110, (_WIDTH - 40) / 20
    bars = "".join(
        f'<rect class="dark" x="{20 + i * step + 1:.1f}" y="{14 + height * (1 - n / most):.1f}" '
        f'width="{step - 2:.1f}" height="{height * n / most:.1f}"><title>{n}</title></rect>'
        for i, n in enumerate(counts.tolist())
    )
    ticks = "".join(
        f'<text x="{20 + i * step:.1f}" y="{height + 30}" text-anchor="middle">{i / 20:.2g}</text>'
        for i in range(0, 21, 5)
    )
    return _svg(f'<text x="20" y="10">{text(name)}, most {most}</text>{bars}{ticks}', height + 36, name)


def share_bar(parts: Sequence[tuple[str, int]]) -> str:
    """One bar cut into named parts, as wide as they are many."""
    whole = sum(number for _, number in parts) or 1
    x, cuts = 0.0, []
    for number, (name, size) in enumerate(parts):
        width = _WIDTH * size / whole
        cuts.append(
            f'<rect class="part{number}" x="{x:.1f}" y="0" width="{width:.1f}" height="18">'
            f"<title>{text(name)}: {size}</title></rect>"
        )
        x += width
    return _svg("".join(cuts), 18, ", ".join(f"{name} {size}" for name, size in parts))


def _svg(body: str, height: int, name: str) -> str:
    label = f'role="img" aria-label="{text(name)}"'
    return f'<svg class="chart" viewBox="0 0 {_WIDTH} {height}" {label}>{body}</svg>'
