"""The report of a retrieval evaluation: one self-contained page with tables, diagrams and examples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PIL import Image

from cadpose.annotations.page import data_uri, jpeg_uri, page, text
from cadpose.evaluation.rank_counts import RankCounts, Rates
from cadpose.evaluation.retrieval import Outcome
from cadpose.evaluation.retrieval_figures import category_map, measure_bars
from cadpose.evaluation.retrieval_strips import draw_strip, examples, strip_of
from cadpose.evaluation.retrieval_tables import MeasureTable, MethodTable, RetrievalTables
from cadpose.library.storage import write_atomic
from cadpose.pipeline import Annotator

#: Examples of each measure.
GOOD, BAD = 3, 5
_ROW = tuple[str, ...]

Examples = Mapping[str, tuple[Sequence[Image.Image], Sequence[Image.Image]]]


def draw_examples(
    annotator: Annotator,
    outcomes: Sequence[Outcome],
    names: Sequence[str],
    progress: Callable[[], None] = lambda: None,
) -> Examples:
    """Strips of right and of wrong answers by measure.

    Args:
        annotator: Draws the models.
        outcomes: Every photo's.
        names: Measures.
        progress: Told of each measure.
    """
    drawn = {}
    for name in names:
        good, bad = (
            [draw_strip(strip) for o in some if (strip := strip_of(annotator, o, name)) is not None]
            for some in examples(outcomes, name, GOOD, BAD)
        )
        drawn[name] = (good, bad)
        progress()
    return drawn


def write_retrieval_report(
    path: Path, tables: RetrievalTables, strips: Examples, facts: Mapping[str, str]
) -> None:
    """Write the page; whole or not at all.

    Args:
        path: The HTML file.
        tables: What is told.
        strips: From `draw_examples`.
        facts: Further facts for the page's head, name to value.

    Raises:
        DependencyError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    body = [f"<h1>{text(tables.title)}</h1><dl>"]
    told = {"Data set": tables.dataset, **tables.facts(), **facts}
    body += [f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in told.items() if value]
    body.append("</dl>")
    body += [f"<p>{text(note)}</p>" for note in tables.notes]
    if any(table.total.used for table in tables.tables):
        body.append('<div class="charts">')
        body.append(_chart("Top-1 and top-3 by measure, bars of 95 %", measure_bars(tables)))
        if len(tables.tables[0].rows) > 1:
            body.append(_chart("Top-1 by category and measure", category_map(tables)))
        body.append("</div>")
    if len(tables.tables) > 1:
        body.append(_methods(tables.comparison()))
    for table in tables.tables:
        body.append(_measure(table))
        good, bad = strips.get(table.measure, ((), ()))
        for title, some in (("Right", good), ("Wrong", bad)):
            if some:
                body.append(f"<p>{title}: the photo and the first candidates, the true one framed green.</p>")
                body += [f'<img class="sheet" alt="{title} answer" src="{jpeg_uri(one)}">' for one in some]
    for other in tables.beside:
        body.append(_methods(other) if isinstance(other, MethodTable) else _measure(other))
    write_atomic(path, page(tables.title, "\n".join(body)).encode())


def _chart(caption: str, png: bytes) -> str:
    return (
        f'<figure><img alt="{text(caption)}" src="{data_uri("png", png)}">'
        f"<figcaption>{text(caption)}</figcaption></figure>"
    )


def _measure(table: MeasureTable) -> str:
    accepts = table.total.accepted is not None
    rows: list[_ROW] = [
        ("Category", "photos", "1st rank", "2nd rank", "3rd rank", "Top-3", "top-1", "95 %", "top-3", "95 %")
        + (("accepted", "of them right") if accepts else ())
    ]
    rows += [(f"{row.name} ({row.used})", *_cells(row, accepts)) for row in table.rows]
    rows.append((f"Total ({table.total.used})", *_cells(table.total, accepts)))
    if table.total.rates is not None:
        rows.append(_rates(table.total.rates))
    rows += [_rates(rates) for rates in (*table.means, *table.baselines)]
    told = [f"Yield: {table.total.used} of {table.total.photos} photos."]
    if (ends := table.total.end_to_end(1)) is not None and table.total.used < table.total.photos:
        low, high = table.total.end_to_end_interval(1) or (0.0, 1.0)
        told.append(f"Of all photos: top-1 {ends:.1%} [{low:.1%}, {high:.1%}], top-3 {_share(table, 3)}.")
    if (c := table.certainty) is not None:
        told.append(f"Accepted from a probability of {c.threshold:g}. ECE {c.ece:.3f}, Brier {c.brier:.3f}.")
    told += [table.note] if table.note else []
    rejected = "".join(
        f"<dt>{one.photos} at {text(one.stage)}</dt><dd>{text(one.reason)}</dd>"
        for one in table.rejected[:20]
    )
    heading = table.caption or f"Measure {table.measure}"
    return f"<h2>{text(heading)}</h2>{_html(rows)}<p>{text(' '.join(told))}</p>" + (
        f"<dl>{rejected}</dl>" if rejected else ""
    )


def _methods(table: MethodTable) -> str:
    heads = (
        "Method",
        "photos",
        "1st rank",
        "2nd rank",
        "3rd rank",
        "Top-3",
        "top-1",
        "95 %",
        "top-3",
        "95 %",
    )
    rows = [(f"{row.name} ({row.used})", *_cells(row, False)) for row in table.rows]
    return f"<h2>{text(table.caption)}</h2>{_html([heads, *rows])}"


def _cells(row: RankCounts, accepts: bool) -> _ROW:
    cells = [str(n) for n in (row.photos, row.first, row.second, row.third, row.top(3))]
    for k in (1, 3):
        rate, span = row.rate(k), row.interval(k)
        cells += ["–" if rate is None else f"{rate:.1%}"]
        cells += ["–" if span is None else f"{span[0]:.1%} to {span[1]:.1%}"]
    if accepts:
        cells += [str(row.accepted), "–" if row.precision is None else f"{row.precision:.1%}"]
    return tuple(cells)


def _rates(rates: Rates) -> _ROW:
    numbers = (rates.first, rates.second, rates.third, rates.top3)
    return (rates.name[:1].upper() + rates.name[1:], "", *(f"{number:.2%}" for number in numbers))


def _share(table: MeasureTable, k: int) -> str:
    value = table.total.end_to_end(k)
    return "–" if value is None else f"{value:.1%}"


def _html(rows: Sequence[_ROW]) -> str:
    width = max(map(len, rows))
    lines = []
    for tag, row in zip(("th", *["td"] * (len(rows) - 1)), rows, strict=True):
        cells = (*row, *[""] * (width - len(row)))
        lines.append("<tr>" + "".join(f"<{tag}>{text(cell)}</{tag}>" for cell in cells) + "</tr>")
    return f"<table>{''.join(lines)}</table>"
