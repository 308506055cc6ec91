"""How well the confidence of whole annotations holds on labelled photos.

    python scripts/check_annotation_trust.py cars/pairs.json --gallery cars/gallery.json

Every labelled object is annotated in its labelled box with the gallery's models to choose among. Whether
the annotation is right is decided as cadpose.alignment.trust defines it; where no mask is labelled, the
silhouette is compared with the estimated one, which says less.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from cadpose.alignment.trust import RIGHT_DEGREES, RIGHT_IOU, Trust
from cadpose.cli.output import progress_bar
from cadpose.datasets.gallery import read_gallery
from cadpose.datasets.label import mask_in_photo, object_in_photo
from cadpose.evaluation.retrieval_inputs import choose_labels, gallery_candidates
from cadpose.evaluation.rotation import rotation_error
from cadpose.evaluation.statistics import wilson_interval
from cadpose.geometry.boxes import mask_iou
from cadpose.pipeline import Annotator
from cadpose.records import Detection


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("labels", type=Path)
    parser.add_argument("--gallery", type=Path, required=True)
    parser.add_argument("--refine", choices=("fast", "full"), default="fast")
    told = parser.parse_args()
    labels = choose_labels(told.labels)
    annotator = Annotator(refine=told.refine)
    candidates = gallery_candidates(annotator.library, read_gallery(told.gallery))
    rows = []
    with progress_bar("photos", len(labels)) as bar:
        for label in labels:
            photo, box = object_in_photo(label)
            found = annotator.annotate_object(photo, Detection(box, label.category), list(candidates(label)))
            truth = mask_in_photo(label, photo)
            truth = found.detection.mask if truth is None else truth
            assert truth is not None and found.confidence is not None
            silhouette = annotator.render_pose(found.cad, found.pose, photo.width, photo.height).mask[0]
            error = rotation_error(label, found.pose.rotation, annotator.library.symmetry(found.cad))
            right = (
                error <= RIGHT_DEGREES,
                mask_iou(silhouette, truth) >= RIGHT_IOU,
                found.cad.id == label.cad,
            )
            rows.append((found.confidence, found.verdict, *right))
            bar.advance(bar.tasks[0].id)
    p = np.array([row[0] for row in rows])
    parts = np.array([row[2:] for row in rows])
    right = parts.all(axis=1)
    shares = ", ".join(
        f"{name} {share:.1%}"
        for name, share in zip(("rotation", "silhouette", "model"), parts.mean(axis=0), strict=True)
    )
    print(f"{len(rows)} annotations: right {right.mean():.1%} ({shares}); mean confidence {p.mean():.1%}")
    for verdict in ("auto_accept", "review", "reject"):
        of = np.array([row[1] == verdict for row in rows])
        low, high = wilson_interval(int(right[of].sum()), int(of.sum()))
        share = f"right {right[of].mean():.1%} [{low:.1%}, {high:.1%}]" if of.any() else ""
        print(f"{verdict}: {of.mean():.1%} {share}")
    groups = np.array_split(np.argsort(p), 10)
    ece = sum(len(g) / len(p) * abs(p[g].mean() - right[g].mean()) for g in groups)
    accept = Trust.shipped().accept
    print(f"expected calibration error over ten groups {ece:.3f}; accepted from {accept:.3f}")


if __name__ == "__main__":
    main()
