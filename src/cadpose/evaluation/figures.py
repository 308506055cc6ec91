"""Diagrams of a rotation evaluation on matplotlib's Agg canvas; each function gives the bytes of a PNG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cadpose.annotations.style import COLOURS, short
from cadpose.errors import DependencyError
from cadpose.evaluation.calibration import (
    expected_calibration_error,
    reliability_bins,
    risk_coverage,
    unflagged_precision,
)
from cadpose.evaluation.confidence import BINS, ERROR_EDGES, RIGHT_DEGREES, Answers
from cadpose.evaluation.rotation import RotationResult
from cadpose.evaluation.statistics import wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Azimuth bins of the confusion, 15 degrees each, the first one around 0.
AZIMUTH_BINS = 24
#: Categories with a line of their own, the most frequent ones.
MOST_LINES = len(COLOURS)
_SIZE, _DPI = (6.4, 4.6), 150
_INK, _FAINT = "#181c21", "#8a929b"
_ORANGE, _BLUE, _GREEN, _RED = ("#{:02x}{:02x}{:02x}".format(*COLOURS[i]) for i in (0, 1, 2, 7))


def require_matplotlib() -> None:
    """Say before a long run that its diagrams could not be drawn.

    Raises:
        DependencyError: matplotlib is not installed.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise DependencyError(
            f"a report needs matplotlib ({error}): pip install 'matplotlib>=3.9,<4', or cadpose[report]"
        ) from error


def reliability_diagram(answers: Answers) -> bytes:
    """Stated probability against the share that was right, and how often each was stated.

    Raises:
        ValueError: there is no answer.
    """
    p, right = answers.probability, answers.right
    figure, (above, below) = new_figure(2, height_ratios=(4, 1), sharex=True)
    above.plot([0, 1], [0, 1], color=_FAINT, lw=1, ls="--", label="calibrated")
    wide = reliability_bins(p, right, BINS, "equal-width")
    above.plot(
        wide.confidence, wide.accuracy, "o", mfc="none", color=_FAINT, ms=6, label="bins of equal width"
    )
    # Few photos make few groups, or each would hold but one or two.
    bins = int(np.clip(len(p) // 5, 1, BINS))
    mass = reliability_bins(p, right, bins, "equal-mass")
    spans = np.array(
        [wilson_interval(round(a * n), int(n)) for a, n in zip(mass.accuracy, mass.count, strict=True)]
    )
    reach = np.abs(spans.T - mass.accuracy)
    label = f"{len(mass.count)} groups of like size, 95 %"
    above.errorbar(
        mass.confidence,
        mass.accuracy,
        yerr=reach,
        fmt="o-",
        color=_BLUE,
        lw=1.5,
        ms=5,
        capsize=3,
        label=label,
    )
    above.set(ylim=(-0.03, 1.03), ylabel=f"share within {RIGHT_DEGREES:g}°")
    above.legend(loc="upper left", frameon=False, fontsize=8)
    ece = expected_calibration_error(p, right, BINS)
    above.set_title(f"Reliability: ECE {ece:.3f}, {len(p)} photos")
    below.hist(p, np.linspace(0, 1, 21).tolist(), color=_BLUE, alpha=0.6)
    below.set(xlim=(-0.02, 1.02), xlabel="probability of the first hypothesis", ylabel="photos")
    return figure_png(figure)


def error_histogram(answers: Answers) -> bytes:
    """How many photos have which error; bars are as wide on paper though not in degrees."""
    counts = np.histogram(answers.error, ERROR_EDGES)[0]
    figure, (axes,) = new_figure()
    edges = np.array(ERROR_EDGES, float)
    colours = np.where(edges[1:] <= 10, _GREEN, np.where(edges[1:] <= 30, _BLUE, _ORANGE))
    at = np.arange(len(counts))
    axes.bar(at + 0.5, counts, 0.92, color=colours.tolist())
    for x, count in zip(at, counts, strict=True):
        if count:
            axes.annotate(str(count), (x + 0.5, count), ha="center", va="bottom", fontsize=8, color=_INK)
    for mark in (10, 30):
        axes.axvline(ERROR_EDGES.index(mark), color=_INK, lw=1, ls="--")
        share = (answers.error <= mark).mean() if len(answers) else 0.0
        axes.annotate(
            f" ≤ {mark}°: {share:.0%}", (ERROR_EDGES.index(mark), 0.97), xycoords=("data", "axes fraction"),
            va="top", fontsize=9, color=_INK,
        )  # fmt: skip
    # Few wrong ones among many right ones should be seen as well.
    axes.set_yscale("symlog", linthresh=10, linscale=1.0)
    axes.set_ylim(0, max(12.0, 2.0 * counts.max(initial=0)))
    axes.yaxis.set_major_formatter("{x:.0f}")
    axes.set_xticks(np.arange(len(edges)), [f"{edge:g}" for edge in edges], fontsize=8)
    axes.set(xlim=(0, len(counts)), xlabel="error in degrees", ylabel="photos")
    axes.set_title("Errors")
    return figure_png(figure)


def azimuth_counts(results: Sequence[RotationResult]) -> NDArray[np.int64]:
    """(24, 24) photos by bin of the true (row) and of the estimated azimuth (column)."""
    counts = np.zeros((AZIMUTH_BINS, AZIMUTH_BINS), np.int64)
    for r in results:
        if r.estimate is not None and r.label.azimuth is not None and np.isfinite(r.error):
            true, found = (
                round(azimuth * AZIMUTH_BINS / 360.0) % AZIMUTH_BINS
                for azimuth in (r.label.azimuth, r.estimate.azimuth)
            )
            counts[true, found] += 1
    return counts


def azimuth_confusion(results: Sequence[RotationResult]) -> bytes:
    """Heat map of true against estimated azimuth; answers that face the other way lie on the dotted lines."""
    counts = azimuth_counts(results)
    figure, (axes,) = new_figure(size=(5.8, 5.2))
    shown = np.ma.masked_equal(counts, 0)
    image = axes.imshow(shown, cmap="viridis_r", origin="lower", vmin=0, vmax=max(1, int(counts.max())))
    axes.set_facecolor("#f2f4f6")
    bar = figure.colorbar(image, ax=axes, shrink=0.8, label="photos")
    bar.outline.set_visible(False)
    n, half = AZIMUTH_BINS, AZIMUTH_BINS // 2
    axes.plot([-0.5, n - 0.5], [-0.5, n - 0.5], color=_INK, lw=0.6)
    for shift in (-half, half):
        axes.plot([-0.5 + shift, n - 0.5 + shift], [-0.5, n - 0.5], color=_RED, lw=0.9, ls=":")
    ticks = np.arange(0, n, n // 8)
    names = [f"{360 * tick // n}°" for tick in ticks]
    axes.set_xticks(ticks, names, fontsize=8)
    axes.set_yticks(ticks, names, fontsize=8)
    axes.set(xlim=(-0.5, n - 0.5), ylim=(-0.5, n - 0.5), xlabel="estimated azimuth", ylabel="true azimuth")
    axes.set_title("Azimuth: estimated against true")
    axes.tick_params(length=0)
    return figure_png(figure)


def error_curves(results: Sequence[RotationResult]) -> bytes:
    """Share of photos below each error: all, and the most frequent categories."""
    errors: dict[str, list[float]] = {}
    for r in results:
        if np.isfinite(r.error):
            errors.setdefault(r.label.category, []).append(r.error)
    figure, (axes,) = new_figure()
    frequent = sorted(errors, key=lambda name: (-len(errors[name]), name))
    for i, name in enumerate(frequent[:MOST_LINES]):
        label = f"{short(name, 24)} ({len(errors[name])})"
        colour = np.array(COLOURS[i]) / 255
        axes.step(*_steps(errors[name]), where="post", color=colour, lw=1.4, label=label)
    everything = [error for some in errors.values() for error in some]
    if len(errors) != 1:
        axes.step(*_steps(everything), where="post", color=_INK, lw=2, label=f"all ({len(everything)})")
    for mark in (10, 30):
        axes.axvline(mark, color=_FAINT, lw=1, ls="--")
    axes.set_xscale("function", functions=(lambda x: np.sqrt(np.abs(x)), np.square))
    ticks = (0, 2, 5, 10, 20, 30, 60, 90, 120, 150, 180)
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set(xlim=(0, 180), ylim=(0, 1.02), xlabel="error in degrees", ylabel="share of photos")
    axes.grid(axis="y", color="#e5e8eb", lw=0.8)
    axes.legend(loc="lower right", frameon=False, fontsize=8)
    axes.set_title("Share of photos below an error")
    return figure_png(figure)


def risk_coverage_curve(answers: Answers) -> bytes:
    """Share of wrong answers when only the most probable are kept, and where the review flag stands.

    Raises:
        ValueError: there is no answer.
    """
    right = answers.right
    curve, ideal = risk_coverage(answers.probability, right), risk_coverage(right.astype(float), right)
    figure, (axes,) = new_figure()
    axes.axhline(curve.risk[-1], color=_FAINT, lw=1, ls="--", label="no order")
    axes.plot(ideal.coverage, ideal.risk, color=_FAINT, lw=1, ls=":", label="perfect order")
    axes.plot(curve.coverage, curve.risk, color=_BLUE, lw=1.8, label="by probability")
    # Where nothing is calibrated nothing is flagged either, and the dot would mean nothing.
    flagged = answers.flagged if answers.calibrated else np.ones_like(answers.flagged)
    precision, coverage = unflagged_precision(right, flagged)
    if precision is not None:
        label = f"not flagged: {precision:.1%} right of {coverage:.0%}"
        axes.plot([coverage], [1.0 - precision], "o", color=_ORANGE, ms=8, label=label)
    top = max(0.05, float(curve.risk.max()), 0.0 if precision is None else 1.0 - precision)
    axes.set(xlim=(0, 1.01), ylim=(-0.02 * top, 1.35 * top))
    axes.set(xlabel="share of photos kept", ylabel=f"share of those with an error above {RIGHT_DEGREES:g}°")
    axes.legend(loc="upper left", frameon=False, fontsize=8)
    axes.grid(color="#e5e8eb", lw=0.8)
    axes.set_title(f"Risk and coverage: area {curve.area:.3f}")
    return figure_png(figure)


def _steps(errors: Sequence[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ordered = np.sort(np.array([0.0, *errors]))
    return np.append(ordered, 180.0), np.append(np.arange(len(ordered)), len(errors)) / max(1, len(errors))


def new_figure(
    rows: int = 1, size: tuple[float, float] = _SIZE, **options: Any
) -> tuple[Figure, tuple[Axes, ...]]:
    """An empty figure with axes below one another, in the style of all our diagrams.

    Raises:
        DependencyError: matplotlib is not installed.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    # Not through pyplot: no window system, and nothing that outlives the call.
    figure = Figure(figsize=size, dpi=_DPI, layout="constrained", facecolor="white")
    if "height_ratios" in options:
        options["gridspec_kw"] = {"height_ratios": options.pop("height_ratios")}
    axes = tuple(np.atleast_1d(figure.subplots(rows, **options)).tolist())
    for each in axes:
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
    return figure, axes


def figure_png(figure: Figure) -> bytes:
    """The bytes of a PNG; the same figure is always the same file."""
    out = io.BytesIO()
    # Without the date and the version.
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()
