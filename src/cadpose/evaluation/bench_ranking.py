"""What a joint ranking is made of: milliseconds by part, warm, spread over no threads."""

from __future__ import annotations

from collections.abc import Callable

from cadpose.backends import GalleryTemplates
from cadpose.encoder import SIDE, Lite0
from cadpose.evaluation.bench_rotation import median_ms
from cadpose.evaluation.bench_stages import bench_category
from cadpose.geometry.boxes import Box
from cadpose.photos import crop_square
from cadpose.pipeline import Annotator
from cadpose.records import Photo
from cadpose.similarity.joint.ranker import DRAWN, JointRanker
from cadpose.similarity.local_features import BACKGROUND
from cadpose.threads import on_one_thread


def bench_ranking(annotator: Annotator, photo: Photo, box: Box, repeats: int) -> dict[str, float]:
    """Median milliseconds of the joint ranking's parts, one thread, galleries in memory.

    ``cached views`` looks at all candidates about the estimator's hypotheses, ``drawn`` draws and matches the
    best few, ``whole`` is one ranking after the rotation estimate.

    Raises:
        ValueError: the annotator's joint ranking has a source of another kind.
    """
    known = annotator.joint.source
    if not isinstance(known, GalleryTemplates):
        raise ValueError("only a joint ranking over galleries is timed")
    library = annotator.library
    category = bench_category(library)
    cads = library.representatives(category, annotator.candidate_count)
    guesses = annotator.estimate_rotation(photo, box, category, cads)
    encoder = Lite0(threads=1)
    source = GalleryTemplates(known.galleries, encoder, known.mesh)
    ranker = JointRanker(source, annotator.render_framed, encoder, shared=annotator.joint.shared)
    plain, aspect = crop_square(photo.rgb, box, SIDE), box.width / box.height
    crop = crop_square(photo.rgb, box, SIDE, fill=BACKGROUND)
    rotations = ranker.look(plain, aspect, cads, guesses).rotations
    parts: dict[str, Callable[[], object]] = {
        "cached views": lambda: ranker.look(plain, aspect, cads, guesses),
        "drawn": lambda: ranker.drawn(crop, aspect, cads[:DRAWN], rotations[:DRAWN]),
        "whole": lambda: ranker.rank(crop, plain, aspect, cads, guesses),
    }
    with on_one_thread():
        return {name: median_ms(work, repeats) for name, work in parts.items()}
