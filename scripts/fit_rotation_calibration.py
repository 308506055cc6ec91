"""Fit what turns the embedded estimator's evidence into a probability, on synthetic photos of unseen models.

    python scripts/fit_rotation_calibration.py TRAINING_LIBRARY OUT.json --backgrounds DIR

The photos show held-out models (`training/data/held-out.json`), which no weights have seen; the model shown
is taken out of the models that vote, as the object of a real photo is seldom in the library. No real photo
takes part. The first hypothesis of a photo is its answer, right if it is within 30° of the truth modulo
symmetry.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from cadpose.cli.output import progress_bar
from cadpose.geometry.angles import rotation_from_angles
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.photos import crop_square
from cadpose.pipeline import Annotator
from cadpose.rotation.calibration import WITHIN, Calibration
from cadpose.rotation.embedded import FEATURES, EmbeddedRotation
from cadpose.training.lite.sources import head_options, sources
from cadpose.training.synth.options import SynthOptions

#: Precision that answers without a flag are to have.
PRECISION = 0.98
_LEAST_VISIBLE, _LEAST_SIDE = 0.5, 40.0
#: Categories whose models have a front that can be told. What is all but round, as most lamps and bottles, is
#: right by chance.
FRONTED = ("bed", "cabinet", "car", "chair", "sofa")
#: Photos as a person takes them of one object: mostly whole, large and sharp. Training photos are harder, and
#: what is never sure of itself on them says little about real ones.
LIKE_REAL = SynthOptions(
    size=256, fill=(0.6, 0.95), warp=0.5, redress=0.3, company=0.05, occluder=0.05, truncate=0.0, degrade=0.15
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("library", type=Path, help="as scripts/make_training_library.py makes it")
    parser.add_argument("out", type=Path)
    parser.add_argument("--backgrounds", type=Path)
    parser.add_argument("--photos", type=int, default=640)
    parser.add_argument("--first", type=int, default=0, help="number of the first photo")
    told = parser.parse_args()
    unseen = sources(Library.open(told.library), told.backgrounds, head_options, 0).unseen
    if unseen is None:
        parser.error(f"{told.library} has no held-out model")
    annotator = Annotator()
    estimator = annotator.rotation
    assert isinstance(estimator, EmbeddedRotation)
    features, errors, first = [], [], []
    generator = replace(unseen, options=LIKE_REAL).generator()
    with progress_bar("photos", told.photos) as bar:
        for i in range(told.first, told.first + told.photos):
            bar.advance(bar.tasks[0].id)
            photo = generator.photo(i)
            if not photo.objects or photo.objects[0].category not in FRONTED:
                continue
            shown = photo.objects[0]
            box = shown.box.clipped(photo.rgb.shape[1], photo.rgb.shape[0])
            if box is None or shown.visible < _LEAST_VISIBLE or max(box.width, box.height) < _LEAST_SIDE:
                continue
            pool = [m for m in annotator.library.representatives(shown.category, 10) if m.id != shown.cad]
            found = estimator.propose(crop_square(photo.rgb, box), pool)
            r = shown.rotation
            truth = rotation_from_angles(r.azimuth, r.elevation, r.inplane)
            group = shown.symmetry.about()
            errors.append(
                group.geodesic_degrees(found.R_cv_from_s, np.broadcast_to(truth, found.R_cv_from_s.shape))
            )
            features.append(found.features)
            first.append(np.arange(len(found.scores)) == 0)
    X, error, is_first = np.concatenate(features), np.concatenate(errors), np.concatenate(first)
    fitted = Calibration.fit(X[is_first], error[is_first], FEATURES, target_precision=PRECISION)
    write_atomic(told.out, fitted.to_json().encode())
    kept = is_first & ~fitted.needs_review(X)
    right = error <= WITHIN
    print(f"{is_first.sum()} photos, first answers within {WITHIN:.0f}°: {right[is_first].mean():.1%}")
    print(f"without a flag: {kept.sum() / is_first.sum():.1%}, of these right: {right[kept].mean():.1%}")
    print(f"mean probability of first answers: {fitted.probability(X[is_first]).mean():.1%}")


if __name__ == "__main__":
    main()
