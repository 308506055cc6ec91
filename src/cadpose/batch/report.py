"""The report of a run, ``report.html``: what it gave, what it cost, where it went wrong, and its gallery."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from cadpose.annotations.page import page, text
from cadpose.batch.charts import histogram, share_bar, time_chart
from cadpose.batch.figures import Case, FailedPhoto, RunFigures, iou_of
from cadpose.batch.gallery import count, gallery_html, tile_html
from cadpose.batch.record import PhotoRecord

#: Lines of a list of reasons or of failed photos; the rest is counted.
_LINES = 100
_STYLE = """<style>
.chart{width:100%;max-width:640px;font:12px system-ui,sans-serif;margin:10px 0}
.chart text{fill:var(--ink)}.dark{fill:#2f7dd1}.light{fill:#a9cbef}
.part0{fill:#3f9d5a}.part1{fill:#e2b33c}.part2{fill:#d1493f}.part3{fill:#9aa3ad}
.key{display:inline-block;width:10px;height:10px;border-radius:2px;margin:0 5px 0 14px}
.key0{background:#3f9d5a}.key1{background:#e2b33c}.key2{background:#d1493f}.key3{background:#9aa3ad}
summary{cursor:pointer;padding:8px 0;font-weight:600}td.words{text-align:left}
.numbers{display:flex;flex-wrap:wrap;gap:8px 34px;margin:14px 0}
.numbers b{display:block;font-size:24px;font-variant-numeric:tabular-nums}
</style>"""


@dataclass(frozen=True)
class Pace:
    """How fast this run is; earlier ones that it resumes are not counted.

    Attributes:
        photos: Photos that were annotated or failed in this run.
        seconds: Since its first photo was begun.
        how: For example ``"by 2 workers"``.
        running: The run goes on.
    """

    photos: int
    seconds: float
    how: str
    running: bool = False


def report_html(
    figures: RunFigures, pace: Pace, finished: Sequence[tuple[str, PhotoRecord]], title: str = "cadpose"
) -> str:
    """The page; ``finished`` is stem and record of each finished photo."""
    parts = [
        _STYLE,
        f"<h1>{text(title)}: report of a run</h1>",
        _headline(figures, pace),
        _yields(figures),
        _trust(figures),
        _times(figures),
        _failures(figures),
        _worst("Lowest confidence", figures.least_sure, "confidence"),
        _worst("Lowest IoU", figures.least_iou, "IoU"),
        '<h2>All photos</h2><p class="faint">Also alone in <a href="./index.html">index.html</a></p>',
        gallery_html([tile_html(stem, record) for stem, record in finished]),
    ]
    return page(f"{title}: report", "\n".join(parts), pictures_beside=True)


def _headline(f: RunFigures, pace: Pace) -> str:
    numbers = {
        "photos": f.planned,
        "finished": f.finished,
        "failed": len(f.failed),
        "not done yet": f.pending,
        "same bytes as another": f.copies,
        "objects annotated": f.annotated,
    }
    shown = "".join(
        f"<div><b>{number:,}</b>{name}</div>"
        for name, number in numbers.items()
        if number or name in ("photos", "finished", "failed")
    )
    if pace.photos:
        rate = pace.photos / max(pace.seconds, 1e-9)
        told = (
            f"This run did {count(pace.photos, 'photo')} in {_duration(pace.seconds)} {pace.how}: "
            f"{rate:.2f} a second, {3600 * rate:,.0f} an hour."
        )
    else:
        told = "This run had nothing left to do."
    going = " It is still running." if pace.running else ""
    return f'<div class="numbers">{shown}</div><p>{text(told + going)}</p>'


def _yields(f: RunFigures) -> str:
    rows = [
        ("photos", f.planned, f.planned),
        ("read and looked at", f.finished, f.planned),
        ("with an object", f.finished - f.empty, f.planned),
        ("objects found or told", f.found, f.found),
        ("objects annotated", f.annotated, f.found),
        ("objects that need no review", f.annotated - f.doubtful, f.found),
    ]
    body = "".join(
        f"<tr><td>{text(name)}</td><td>{number:,}</td><td>{_share(number, whole)}</td></tr>"
        for name, number, whole in rows
    )
    categories = "".join(
        f"<tr><td>{text(name)}</td><td>{number:,}</td></tr>"
        for name, number in f.categories.most_common(_LINES)
    )
    return f"<h2>Yield by stage</h2><table><tr><th></th><th>number</th><th>share</th></tr>{body}</table>" + (
        f"<details><summary>By category</summary><table>{categories}</table></details>" if categories else ""
    )


def _trust(f: RunFigures) -> str:
    if not f.annotated:
        return ""
    names = ("auto_accept", "review", "reject", "none")
    parts = [(name, f.verdicts.get(name, 0)) for name in names]
    key = "".join(
        f'<span class="key key{i}"></span>{"no verdict" if name == "none" else name} {number:,}'
        for i, (name, number) in enumerate(parts)
    )
    charts = [histogram(f.ious, "IoU of the silhouette (of the box where there is no mask)")]
    if f.confidences:
        charts.append(histogram(f.confidences, "confidence"))
    review = f"{count(f.doubtful, 'object')} of {f.annotated:,} need{'s' * (f.doubtful == 1)} review."
    return (
        f"<h2>Trust</h2><p>{text(review)}</p>{share_bar(parts)}<p>{key}</p>"
        f'<div class="charts">{"".join(charts)}</div>'
    )


def _times(f: RunFigures) -> str:
    if not f.times:
        return ""
    rows = "".join(
        f"<tr><td>{text(one.stage)}</td><td>{one.median:.3f}</td><td>{one.p90:.3f}</td>"
        f"<td>{one.share:.1%}</td></tr>"
        for one in f.times
    )
    return (
        '<h2>Time by stage</h2><p class="faint">Seconds a photo, of the photos that have the stage; '
        f"dark to the median, light to the 90th percentile</p>{time_chart(f.times)}"
        f"<table><tr><th>stage</th><th>median s</th><th>p90 s</th><th>share</th></tr>{rows}</table>"
    )


def _failures(f: RunFigures) -> str:
    if not f.failed and not f.left_out:
        return ""
    photos = Counter((one.stage, _without_name(one)) for one in f.failed)
    parts = ["<h2>What failed</h2>"]
    for name, reasons in (("Photos", photos), ("Objects", f.left_out)):
        if not reasons:
            continue
        rows = "".join(
            f'<tr><td>{text(stage)}</td><td>{number:,}</td><td class="words">{text(reason)}</td></tr>'
            for (stage, reason), number in reasons.most_common(_LINES)
        )
        head = f"<tr><th>{name}: stage</th><th>number</th><th></th></tr>"
        parts.append(f"<table>{head}{rows}</table>{_rest(len(reasons))}")
    if f.failed:
        names = "".join(f"<li>{text(one.reason)}</li>" for one in f.failed[:_LINES])
        parts.append(
            f"<details><summary>{count(len(f.failed), 'photo')} that failed</summary><ul>{names}</ul>"
            f"{_rest(len(f.failed))}</details>"
        )
    return "".join(parts)


def _worst(title: str, cases: Sequence[Case], what: str) -> str:
    if not cases:
        return ""
    tiles = []
    for case in cases:
        found = case.found
        value = found.confidence if what == "confidence" else iou_of(found)
        note = f"{found.category} · {found.cad_name} · {what} {value:.2f}"
        tiles.append(tile_html(case.stem, case.record, note))
    return f"<h2>{title}</h2>{gallery_html(tiles)}"


def _without_name(failed: FailedPhoto) -> str:
    """A reason as it is the same for many photos."""
    return failed.reason.removeprefix(f"{failed.photo}: ").replace(failed.photo, "the photo")


def _rest(number: int) -> str:
    return f'<p class="faint">and {number - _LINES:,} more</p>' if number > _LINES else ""


def _share(number: int, whole: int) -> str:
    return f"{number / whole:.1%}" if whole else ""


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
