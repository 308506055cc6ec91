"""Diagrams of a retrieval evaluation; each function gives the bytes of a PNG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cadpose.annotations.style import COLOURS, short
from cadpose.evaluation.figures import figure_png, new_figure
from cadpose.evaluation.retrieval_tables import RetrievalTables

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INK = "#181c21"
_ORANGE, _BLUE = ("#{:02x}{:02x}{:02x}".format(*COLOURS[i]) for i in (0, 1))


def measure_bars(tables: RetrievalTables) -> bytes:
    """Top-1 and top-3 of every measure with 95 % intervals, and what chance would give.

    Raises:
        ValueError: no measure ranked any photo.
    """
    shown = [table for table in tables.tables if table.total.used]
    if not shown:
        raise ValueError("no measure ranked any photo")
    figure, (axes,) = new_figure(size=(max(5.0, 1.6 + 0.75 * len(shown)), 4.4))
    for k, shift, colour in ((1, -0.2, _BLUE), (3, 0.2, _ORANGE)):
        rates = np.array([table.total.rate(k) for table in shown], float)
        spans = np.array([table.total.interval(k) for table in shown], float)
        at = np.arange(len(shown)) + shift
        axes.bar(at, 100 * rates, 0.38, color=colour, label=f"top-{k}")
        reach = 100 * np.abs(spans.T - rates)
        axes.errorbar(at, 100 * rates, yerr=reach, fmt="none", ecolor=_INK, elinewidth=1, capsize=3)
        for baseline in shown[0].baselines[:1]:
            level = 100 * (baseline.first if k == 1 else baseline.top3)
            axes.axhline(level, color=colour, lw=1, ls="--", label=f"top-{k} by {baseline.name}")
    _name(axes, [table.measure for table in shown])
    axes.set(ylim=(0, 103), ylabel="% of the photos that were ranked")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    axes.grid(axis="y", color="#e5e8eb", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_title(_kind(tables))
    return figure_png(figure)


def category_map(tables: RetrievalTables) -> bytes:
    """Top-1 by category and measure, in per cent, darker where it is higher.

    Raises:
        ValueError: there is no category.
    """
    names = [row.name for row in tables.tables[0].rows]
    if not names:
        raise ValueError("there is no category")
    values = np.array(
        [[100 * rate if (rate := row.rate(1)) is not None else np.nan for row in table.rows]
         for table in tables.tables]
    ).T  # fmt: skip
    figure, (axes,) = new_figure(
        size=(max(4.0, 1.8 + 0.8 * len(tables.tables)), max(2.2, 1.2 + 0.36 * len(names)))
    )
    axes.imshow(np.ma.masked_invalid(values), cmap="Blues", vmin=0, vmax=100, aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        told = "–" if np.isnan(value) else f"{value:.0f}"
        colour = "white" if value > 60 else _INK
        axes.annotate(told, (column, row), ha="center", va="center", fontsize=9, color=colour)
    _name(axes, [table.measure for table in tables.tables])
    axes.set_yticks(range(len(names)), [short(name, 24) for name in names])
    axes.tick_params(length=0)
    axes.set_title(f"Top-1 in %, {_kind(tables)}")
    return figure_png(figure)


def _name(axes: Axes, measures: Sequence[str]) -> None:
    """The measures below the axis, slanted where they would not fit."""
    names = [short(measure, 20) for measure in measures]
    if len(names) > 3:
        axes.set_xticks(range(len(names)), names, rotation=35, ha="right", rotation_mode="anchor")
    else:
        axes.set_xticks(range(len(names)), names)


def _kind(tables: RetrievalTables) -> str:
    return "SYNTHETIC photos" if tables.synthetic else "real photos"
