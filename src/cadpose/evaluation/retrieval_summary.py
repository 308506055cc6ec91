"""From every photo's outcome to the tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from cadpose.evaluation.calibration import brier_score, expected_calibration_error
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.published import TABLE_4, TABLES_1_TO_3
from cadpose.evaluation.rank_counts import RankCounts, Rates
from cadpose.evaluation.retrieval import Outcome, Rejection
from cadpose.evaluation.retrieval_inputs import is_synthetic
from cadpose.evaluation.retrieval_tables import (
    Certainty,
    MeasureTable,
    MethodTable,
    Rejected,
    RetrievalTables,
)

#: Probability from which a first candidate is accepted, unless told or flagged by the measure itself.
ACCEPT = 0.9
#: A rotation is right within this angle, degrees.
RIGHT_DEGREES = 30.0
_PLACES = (1, 2, 3)


def retrieval_tables(
    outcomes: Sequence[Outcome],
    names: Sequence[str],
    *,
    dataset: str,
    rotation: str,
    boxes: str,
    accept: float = ACCEPT,
    drawn_with: str = "",
    notes: Sequence[str] = (),
    measure_notes: Mapping[str, str] | None = None,
    beside_paper: bool = False,
) -> RetrievalTables:
    """All tables of one evaluation.

    Args:
        outcomes: Every photo's.
        names: Measures and rankers, in order.
        dataset: What to call the photos.
        rotation, boxes: Where they came from, in words.
        accept: See `ACCEPT`.
        drawn_with: What drew synthetic photos, where known.
        notes: Further sentences.
        measure_notes: A sentence on a measure, by name.
        beside_paper: Show the paper's tables too: of the measures that it has, and its comparison.

    Raises:
        InputError: there are real and synthetic photos.
    """
    synthetic = is_synthetic([outcome.label for outcome in outcomes], dataset)
    told = list(notes)
    if lost := sum(bool(o.candidates) and o.label.cad not in o.candidates for o in outcomes):
        told.append(f"{lost} photos whose true model is not among the candidates count as missed.")
    errors = [o.rotation_error for o in outcomes if o.rotation_error is not None]
    beside: list[MeasureTable | MethodTable] = []
    if beside_paper:
        # "delf-sm2" is the paper's SM2 too.
        bare = {name.rpartition("-")[2] for name in names}
        beside += [table for name, table in TABLES_1_TO_3.items() if name in bare]
        beside.append(TABLE_4)
    return RetrievalTables(
        dataset=dataset,
        synthetic=synthetic,
        rotation=rotation,
        boxes=boxes,
        tables=tuple(measure_table(outcomes, n, accept, (measure_notes or {}).get(n, "")) for n in names),
        drawn_with=drawn_with if synthetic else "",
        within_30=(sum(e <= RIGHT_DEGREES for e in errors), len(errors)) if errors else None,
        notes=tuple(told),
        beside=tuple(beside),
    )


def measure_table(
    outcomes: Sequence[Outcome], name: str, accept: float = ACCEPT, note: str = ""
) -> MeasureTable:
    """One measure's table: a row a category, in alphabetical order."""
    categories = sorted({o.label.category for o in outcomes})
    states = any(_probability(o, name) is not None for o in outcomes)
    rows = tuple(
        _counts([o for o in outcomes if o.label.category == c], name, c, accept, states) for c in categories
    )
    total = _counts(outcomes, name, "all", accept, states)
    used = [o for o in outcomes if isinstance(o.answers[name], Ranking)]
    models = [[o for o in used if o.label.cad == cad] for cad in sorted({str(o.label.cad) for o in used})]
    means = [
        _mean("macro mean of categories", [row.rates for row in rows]),
        _mean("macro mean of true models", [_counts(some, name, "", accept, False).rates for some in models]),
    ]
    return MeasureTable(
        measure=name,
        rows=rows,
        total=total,
        means=tuple(mean for mean in means if mean is not None),
        baselines=(_chance(used), _majority(used)) if used else (),
        rejected=_rejected(outcomes, name),
        certainty=_certainty(used, name, accept),
        note=note,
    )


def _probability(outcome: Outcome, name: str) -> float | None:
    answer = outcome.answers[name]
    return answer.probability if isinstance(answer, Ranking) else None


def _counts(outcomes: Sequence[Outcome], name: str, row: str, accept: float, states: bool) -> RankCounts:
    used = [o for o in outcomes if isinstance(o.answers[name], Ranking)]
    places = Counter(o.place(name) for o in used)
    taken = [o for o in used if isinstance(a := o.answers[name], Ranking) and a.accepted(accept)]
    right = sum(o.place(name) == 1 for o in taken)
    accepted = (len(taken), right) if states else (None, None)
    return RankCounts(row, len(outcomes), len(used), *(places[k] for k in _PLACES), *accepted)


def _mean(name: str, rates: Sequence[Rates | None]) -> Rates | None:
    known = [(r.first, r.second, r.third) for r in rates if r is not None]
    return Rates(name, *(float(v) for v in np.mean(known, axis=0))) if known else None


def _chance(used: Sequence[Outcome]) -> Rates:
    """Candidates in random order; where the true one is not among them nothing is found."""
    shares = [
        [float(o.label.cad in o.candidates and k <= len(o.candidates)) / len(o.candidates) for k in _PLACES]
        for o in used
    ]
    return Rates("chance", *(float(v) for v in np.mean(shares, axis=0)))


def _majority(used: Sequence[Outcome]) -> Rates:
    """Always the models that are most often the true one of their category, which only the labels tell."""
    hits = np.zeros(len(_PLACES))
    for category in {o.label.category for o in used}:
        truths = Counter(
            o.label.cad for o in used if o.label.category == category and o.label.cad in o.candidates
        )
        for place, (_, photos) in enumerate(truths.most_common(len(_PLACES))):
            hits[place] += photos
    return Rates("most frequent model", *(float(v) for v in hits / len(used)))


def _rejected(outcomes: Sequence[Outcome], name: str) -> tuple[Rejected, ...]:
    reasons = Counter(answer for o in outcomes if isinstance(answer := o.answers[name], Rejection))
    ordered = sorted(reasons.items(), key=lambda item: (-item[1], item[0].stage, item[0].reason))
    return tuple(Rejected(answer.stage, answer.reason, photos) for answer, photos in ordered)


def _certainty(used: Sequence[Outcome], name: str, accept: float) -> Certainty | None:
    stated = [(p, o.place(name) == 1) for o in used if (p := _probability(o, name)) is not None]
    if not stated:
        return None
    chances, right = [p for p, _ in stated], [hit for _, hit in stated]
    return Certainty(accept, expected_calibration_error(chances, right), brier_score(chances, right))
