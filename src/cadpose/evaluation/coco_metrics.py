"""Average precision as COCO defines it, by pycocotools: the code that published figures were made with."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cadpose.datasets.label import RunLengths
from cadpose.errors import DependencyError
from cadpose.evaluation.detection import SIZES, Found, PhotoOutcome, Truth
from cadpose.rle import text_from_runs

#: Detections of a photo that count, the surest first; COCO's own number.
MOST = 100


@dataclass(frozen=True)
class Average:
    """AP of one detector; None where there was nothing to find.

    Attributes:
        ap: Mean over categories and over IoU .50, .55 ... .95.
        ap50: Mean over categories at IoU .50.
        by_category: (ap, ap50) a category.
        by_size: (ap, ap50) a size.
    """

    ap: float | None
    ap50: float | None
    by_category: dict[str, tuple[float | None, float | None]]
    by_size: dict[str, tuple[float | None, float | None]]


def require_pycocotools() -> None:
    """Say before a long run that its AP could not be computed.

    Raises:
        DependencyError: pycocotools is not installed.
    """
    try:
        import pycocotools.cocoeval  # noqa: F401
    except ImportError as error:
        raise DependencyError(
            f"average precision needs pycocotools ({error}): pip install 'pycocotools>=2.0.8,<3', "
            "or cadpose[coco]"
        ) from error


def average_precision(
    outcomes: Sequence[PhotoOutcome],
    detector: str,
    categories: Sequence[str],
    smallest: float = 0.0,
    what: Literal["bbox", "segm"] = "bbox",
) -> Average:
    """COCO's AP of a detector over its detections down to the faint ones.

    Args:
        outcomes: Every photo's.
        detector: Whose.
        categories: Those that count.
        smallest: Objects of fewer pixels² are ignored, and so are detections of nothing that are smaller.
        what: Of boxes, or of masks; objects and detections without a mask are then left out.

    Raises:
        DependencyError: pycocotools is not installed.
    """
    require_pycocotools()
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    number = {category: i for i, category in enumerate(categories, 1)}
    images = [
        {"id": i, "width": outcome.size[0], "height": outcome.size[1]}
        for i, outcome in enumerate(outcomes, 1)
    ]
    truth, found = [], []
    for i, outcome in enumerate(outcomes, 1):
        truth += [
            # pycocotools puts iscrowd in the place of "ignore"; no range of areas holds one below 0, so that
            # an ignored object takes one detection, which then counts neither way.
            _entry(one, i, number) | {"area": -1.0 if one.ignored else one.area, "iscrowd": int(one.crowd)}
            for one in outcome.truth
            if what == "bbox" or one.mask is not None
        ]
        for one in outcome.answers[detector].faint:
            if what == "bbox" or one.mask is not None:
                entry = _entry(one, i, number)
                area = one.box.area if what == "bbox" or one.mask is None else _pixels(one.mask)
                found.append(entry | {"area": area, "iscrowd": 0, "score": one.score})

    def coco(annotations: list[dict[str, Any]]) -> Any:
        made = COCO()
        numbered = [{"id": i, **one} for i, one in enumerate(annotations, 1)]  # 0 would count as none
        made.dataset = {
            "images": images,
            "annotations": numbered,
            "categories": [{"id": i} for i in number.values()],
        }
        made.createIndex()
        return made

    # It tells its progress on stdout, which is for data.
    with contextlib.redirect_stdout(io.StringIO()):
        run = COCOeval(coco(truth), coco(found), what)
        sizes = [(name, max(low, smallest), high) for name, low, high in SIZES if high > smallest]
        run.params.areaRng = [[smallest, 1e10], *([low, high] for _, low, high in sizes)]
        run.params.areaRngLbl = ["all", *(name for name, *_ in sizes)]
        run.params.maxDets = [MOST]
        run.evaluate()
        run.accumulate()
    precision = run.eval["precision"][..., 0]  # (T, R, K, A), -1 where a category has no object of the size

    def both(part: Any) -> tuple[float | None, float | None]:
        return _mean(part), _mean(part[:1])

    ap, ap50 = both(precision[..., 0])
    return Average(
        ap,
        ap50,
        {category: both(precision[:, :, i - 1, 0]) for category, i in number.items()},
        {name: both(precision[..., a]) for a, (name, *_) in enumerate(sizes, 1)},
    )


def _mean(precision: Any) -> float | None:
    known = precision[precision > -1]
    # Their ratios have a tiny number added below: 1 would be 0.9999999999999999.
    return round(float(np.mean(known)), 9) if known.size else None


def _entry(one: Truth | Found, image: int, number: dict[str, int]) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "image_id": image,
        "category_id": number[one.category],
        "bbox": list(one.box.to_xywh()),
    }
    if one.mask is not None:
        counts = one.mask.counts
        text = counts if isinstance(counts, str) else text_from_runs(counts)
        entry["segmentation"] = {"size": list(one.mask.size), "counts": text.encode("ascii")}
    return entry


def _pixels(mask: RunLengths) -> float:
    return float(mask.decode().sum())
