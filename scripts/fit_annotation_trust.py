"""Fit what tells how far an annotation can be trusted, on synthetic photos of unseen models.

    python scripts/fit_annotation_trust.py TRAINING_LIBRARY OUT.json --backgrounds DIR --photos 400

The photos show held-out models (`training/data/held-out.json`), warped and with other colours, as no CAD
model is the object itself. Each is annotated twice in its true box: with the model shown among the
candidates, and without. No real photo takes part. Run it again after a change of rotation, ranking or
refinement.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from unseen_photos import UnseenPhotos, main_box

from cadpose.alignment.trust import FEATURES, RIGHT_DEGREES, RIGHT_IOU, Trust, features_of
from cadpose.geometry.boxes import mask_iou
from cadpose.library.storage import write_atomic
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.records import SynthPhoto

#: Share of the accepted that is to be right, and of the rejected that may be.
PRECISION, WASTE = 0.95, 0.1
PHOTOS = SynthOptions(
    size=320, fill=(0.5, 0.95), warp=0.6, redress=0.5, company=0.15, occluder=0.1, truncate=0.0, degrade=0.25
)


@dataclass(frozen=True, eq=False)
class Annotated:
    """One annotation whose truth is known.

    Attributes:
        category: Of the model shown.
        among: Whether it was a candidate.
        features: (F,) what the stages say.
        error: Rotation error in degrees, modulo the model's symmetry.
        iou: Of silhouette and true mask.
        own: Whether the first candidate is the model shown.
    """

    category: str
    among: bool
    features: NDArray[np.float64]
    error: float
    iou: float
    own: bool

    @property
    def right(self) -> bool:
        """As :mod:`cadpose.alignment.trust` defines it."""
        near = self.error <= RIGHT_DEGREES and self.iou >= RIGHT_IOU
        return near and (self.own or not self.among)


def annotations(annotator: Annotator, drawn: SynthPhoto) -> Iterator[Annotated]:
    """The photo's main object annotated with its model among the candidates and without."""
    shown = drawn.objects[0]
    height, width = drawn.rgb.shape[:2]
    box = main_box(drawn)
    if box is None:
        return
    photo = Photo(drawn.rgb, str(drawn.index))
    own = annotator.library.get(shown.cad)
    others = [m for m in annotator.library.representatives(own.category, 11) if m.id != own.id]
    for among, pool in ((True, [own, *others[:9]]), (False, others[:10])):
        if len(pool) < 2:
            continue
        found = annotator.annotate_object(photo, Detection(box, own.category), pool)
        told = features_of(found)
        if told is None:
            continue
        pose = found.pose
        silhouette = annotator.render_pose(found.cad, pose, width, height).mask[0]
        error = shown.symmetry.geodesic_degrees(pose.rotation.to_matrix(), shown.rotation.to_matrix())
        overlap = mask_iou(silhouette, shown.mask)
        yield Annotated(own.category, among, told, float(error), overlap, found.cad.id == own.id)


def show(rows: list[Annotated], fitted: Trust) -> None:
    """How often annotations are right, and how well the confidence tells."""
    X = np.stack([row.features for row in rows])
    right, among = np.array([row.right for row in rows]), np.array([row.among for row in rows])
    p = fitted.model.probability(X)
    for category in sorted({row.category for row in rows}):
        of = np.array([row.category == category for row in rows])
        print(f"{category}: {of.sum()} annotations, {right[of].mean():.1%} right, told {p[of].mean():.1%}")
    weights = ", ".join(f"{n} {w:+.2f}" for n, w in zip(FEATURES, fitted.model.weights, strict=True))
    print(f"weights: {weights}")
    for name, some in (("with the model", among), ("without", ~among)):
        print(f"{name}: {right[some].mean():.1%} right, mean confidence {p[some].mean():.1%}")
    accepted, rejected = p >= fitted.accept, p < fitted.reject
    for name, at, some in (("accepted", fitted.accept, accepted), ("rejected", fitted.reject, rejected)):
        share = f"{right[some].mean():.1%} right" if some.any() else "none"
        print(f"{name} ({at:.3f}): {some.mean():.1%}, {share}")
    bins = np.array_split(np.argsort(p), 10)
    print(
        "confidence and share right by tenths:",
        ", ".join(f"{p[b].mean():.2f}/{right[b].mean():.2f}" for b in bins),
    )


def main() -> None:
    photos = UnseenPhotos.told(__doc__, 400)
    annotator = Annotator(refine="fast")
    rows = [row for photo in photos.drawn(PHOTOS) for row in annotations(annotator, photo)]
    fitted = Trust.fit(
        np.stack([row.features for row in rows]),
        [row.right for row in rows],
        precision=PRECISION,
        waste=WASTE,
    )
    write_atomic(photos.out, fitted.to_json().encode())
    show(rows, fitted)


if __name__ == "__main__":
    main()
