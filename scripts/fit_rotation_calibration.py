"""Fit what turns the embedded estimator's evidence into a probability, on synthetic photos of unseen models.

    python scripts/fit_rotation_calibration.py TRAINING_LIBRARY OUT.json --backgrounds DIR

The photos show held-out models (`training/data/held-out.json`), which no weights have seen. Each is asked
about twice: with the model shown among those that vote, as who looks for one's own CAD models has it, and
without. No real photo takes part. The first hypothesis is the answer, right if it is within 30° of the truth
modulo symmetry.
"""

from __future__ import annotations

import numpy as np
from unseen_photos import UnseenPhotos, main_box

from cadpose.geometry.angles import rotation_from_angles
from cadpose.library.storage import write_atomic
from cadpose.photos import crop_square
from cadpose.pipeline import Annotator
from cadpose.rotation.calibration import WITHIN, Calibration
from cadpose.rotation.embedded import FEATURES, EmbeddedRotation
from cadpose.training.synth.options import SynthOptions

#: Precision that answers without a flag are to have on these photos. Drawn objects are harder to tell than
#: photographed ones: what has it here has more on real photos.
PRECISION = 0.95
#: Categories whose models have a front that can be told. What is all but round, as most lamps and bottles, is
#: right by chance.
FRONTED = ("bed", "cabinet", "car", "chair", "sofa")
#: Photos as a person takes them of one object: mostly whole, large and sharp. Training photos are harder, and
#: what is never sure of itself on them says little about real ones.
LIKE_REAL = SynthOptions(
    size=256, fill=(0.6, 0.95), warp=0.5, redress=0.3, company=0.05, occluder=0.05, truncate=0.0, degrade=0.15
)


def main() -> None:
    photos = UnseenPhotos.told(__doc__, 640)
    annotator = Annotator()
    estimator = annotator.rotation
    assert isinstance(estimator, EmbeddedRotation)
    rows: list[tuple[str, bool, float, np.ndarray]] = []
    for photo in photos.drawn(LIKE_REAL):
        shown, box = photo.objects[0], main_box(photo)
        if shown.category not in FRONTED or box is None:
            continue
        others = [m for m in annotator.library.representatives(shown.category, 10) if m.id != shown.cad]
        r = shown.rotation
        truth = rotation_from_angles(r.azimuth, r.elevation, r.inplane)
        own = annotator.library.get(shown.cad)
        for pool in (others, [own, *others[:9]]):
            found = estimator.propose(crop_square(photo.rgb, box), pool)
            error = shown.symmetry.about().geodesic_degrees(found.R_cv_from_s[0], truth)
            rows.append((shown.category, own in pool, float(error), found.features[0]))
    X, error = np.stack([row[3] for row in rows]), np.array([row[2] for row in rows])
    fitted = Calibration.fit(X, error, FEATURES, target_precision=PRECISION)
    write_atomic(photos.out, fitted.to_json().encode())
    right, kept = error <= WITHIN, ~fitted.needs_review(X)
    for category in (*FRONTED, None):
        for among in (False, True):
            of = np.array([row[0] == (category or row[0]) and row[1] == among for row in rows])
            voted = "with its model" if among else "without"
            share = f"{right[of].mean():.1%} within {WITHIN:.0f}°"
            print(f"{category or 'all'}, {voted}: {of.sum()} photos, {share}")
    print(f"without a flag: {kept.mean():.1%}, of these right: {right[kept].mean():.1%}")
    print(f"mean probability: {fitted.probability(X).mean():.1%}, right: {right.mean():.1%}")


if __name__ == "__main__":
    main()
