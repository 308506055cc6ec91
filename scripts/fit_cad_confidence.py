"""Fit what turns the joint ranking's evidence into chances, on synthetic photos of unseen models.

    python scripts/fit_cad_confidence.py TRAINING_LIBRARY OUT.json --backgrounds DIR --photos 420

The photos show held-out models (`training/data/held-out.json`), warped, with other colours and blurred, as no
CAD model is the object itself. Each is ranked twice by the default annotator: with the model shown among the
candidates, and without. No real photo takes part. Run it again after a change of the rotation network or of
the ranking; it takes about a second and a half a photo on one core.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from unseen_photos import UnseenPhotos, main_box

from cadpose.geometry.angles import rotation_from_angles
from cadpose.library.storage import write_atomic
from cadpose.photos import crop_square
from cadpose.pipeline import SIDE, Annotator
from cadpose.similarity.joint.confidence import EVIDENCE, Confidence
from cadpose.similarity.local_features import BACKGROUND
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.records import SynthPhoto

#: Precision that answers without a flag are to have on these photos, if the true model is a candidate.
PRECISION = 0.97
#: A drawn photo of a model is far more like its render than a photo of a real thing is. Warps, other colours
#: and worse pictures than a person takes stand in for that.
FAR_FROM_RENDERS = SynthOptions(
    size=256, fill=(0.55, 0.95), warp=1.0, redress=0.65, company=0.1, occluder=0.1, truncate=0.0, degrade=0.3
)


@dataclass(frozen=True, eq=False)
class Ranked:
    """One ranking whose truth is known.

    Attributes:
        category: Of the model shown.
        among: Whether it was a candidate.
        right: Whether the first candidate is it.
        evidence: (F,) what the ranking saw.
        before: Rotation error of the estimator's first hypothesis, degrees modulo the model's symmetry.
        after: That of the first candidate.
    """

    category: str
    among: bool
    right: bool
    evidence: NDArray[np.float64]
    before: float
    after: float


def rankings(annotator: Annotator, photo: SynthPhoto) -> Iterator[Ranked]:
    """The photo's main object ranked with its model among the candidates and without."""
    shown = photo.objects[0]
    box = main_box(photo)
    if box is None:
        return
    own = annotator.library.get(shown.cad)
    others = [m for m in annotator.library.representatives(own.category, 11) if m.id != own.id]
    r = shown.rotation
    truth = rotation_from_angles(r.azimuth, r.elevation, r.inplane)
    plain = crop_square(photo.rgb, box, SIDE)
    grey = crop_square(photo.rgb, box, SIDE, fill=BACKGROUND)
    for among, pool in ((True, [own, *others[:9]]), (False, others[:10])):
        if len(pool) < 2:
            continue
        guesses = annotator.rotation.estimate(plain, pool)
        found, evidence = annotator.joint.compare(grey, plain, box.width / box.height, pool, guesses)
        before, after = (
            float(shown.symmetry.about().geodesic_degrees(rotation.to_matrix(), truth))
            for rotation in (guesses[0].rotation, found[0].rotation)
        )
        yield Ranked(own.category, among, found[0].cad.id == own.id, evidence.values, before, after)


def show(rows: list[Ranked], fitted: Confidence) -> None:
    """How often the first is right, how well the chances tell, and what the rotation gained."""
    X = np.stack([row.evidence for row in rows])
    among, right = np.array([row.among for row in rows]), np.array([row.right for row in rows])
    none, first = fitted.none.probability(X), fitted.first.probability(X)
    for category in sorted({row.category for row in rows}):
        of = among & np.array([row.category == category for row in rows])
        print(f"{category}: {of.sum()} photos, {right[of].mean():.1%} right")
    for name, model in (("none of these", fitted.none), ("the first, if any", fitted.first)):
        weights = ", ".join(f"{n} {w:+.2f}" for n, w in zip(EVIDENCE, model.weights, strict=True))
        print(f"{name}: {weights}")
    print(f"with the model: {right[among].mean():.1%} right, mean chance {first[among].mean():.1%}")
    kept = among & (first >= fitted.threshold)
    share = kept.sum() / among.sum()
    print(f"from {fitted.threshold:.3f}: {share:.1%}, of these right {right[kept].mean():.1%}")
    said = none > 0.5
    print(f"none of these: said of {said[among].mean():.1%} with, of {said[~among].mean():.1%} without")
    for name, errors in (("before", [r.before for r in rows]), ("after", [r.after for r in rows])):
        error = np.array(errors)[among]
        print(
            f"rotation {name}: median {np.median(error):.1f}°, {np.mean(error <= 10):.1%} within 10°, "
            f"{np.mean(error <= 30):.1%} within 30°"
        )


def main() -> None:
    photos = UnseenPhotos.told(__doc__, 400)
    annotator = Annotator()
    rows = [row for photo in photos.drawn(FAR_FROM_RENDERS) for row in rankings(annotator, photo)]
    fitted = Confidence.fit(
        np.stack([row.evidence for row in rows]),
        [row.among for row in rows],
        [row.right for row in rows],
        target_precision=PRECISION,
    )
    write_atomic(photos.out, fitted.to_json().encode())
    show(rows, fitted)


if __name__ == "__main__":
    main()
