"""The best few models that an index finds, drawn at the photo's own rotation and ranked once more."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import lite0
from cadpose.errors import LibraryError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.photos import crop_square
from cadpose.records import CadModel, Rotation, Views
from cadpose.rendering.raster import Rasteriser
from cadpose.similarity.index.describe import framing
from cadpose.similarity.index.library_index import COSINE_WEIGHT, Match
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.ranking import rank_candidates
from cadpose.similarity.small_maps import SIDE, SmallAligned

log = logging.getLogger(__name__)

#: How many models are drawn.
DRAWN = 10


class DrawnRanking:
    """Draws models and compares them with a photo.

    Args:
        library: Where their meshes are.
        threads: Threads that draw.
        device: Where the encoder runs.
    """

    def __init__(self, library: Library, threads: int = 2, device: str = "cpu") -> None:
        self._library, self._threads = library, threads
        self._raster = Rasteriser()
        self._measure = SmallAligned(lite0(device))

    def rank(
        self,
        matches: Sequence[Match],
        rgb: NDArray[np.uint8],
        box: Box,
        rotations: Sequence[Rotation],
        count: int = DRAWN,
    ) -> list[Match]:
        """The same matches, the first ``count`` of them in the order in which their renders say.

        Without a rotation the order stays as it is. A model that has left the library since the index was
        made, or cannot be drawn, is passed over.
        """
        first = matches[:count]
        if not rotations or not first:
            return list(matches)
        R = np.stack([rotation.to_matrix() for rotation in rotations])
        with ThreadPoolExecutor(self._threads) as pool:
            drawn = [one for one in pool.map(lambda match: self._drawn(match.cad, R), first) if one]
        rest = matches[count:]
        if not drawn:
            return list(rest)
        cads = [cad for cad, _ in drawn]
        views = {cad.id: view for cad, view in drawn}
        candidates = rank_candidates(
            crop_square(rgb, box, SIDE, fill=BACKGROUND),
            None,
            box.width / box.height,
            cads,
            [rotations] * len(cads),
            render=lambda cad, _: views[cad.id],
            chooser=self._measure,
            measure=self._measure,
        )
        by_id = {match.cad: match for match in first}
        again = [
            replace(
                by_id[c.cad.id], score=c.score + COSINE_WEIGHT * by_id[c.cad.id].cosine, rotation=c.rotation
            )
            for c in candidates
        ]
        # What was not drawn comes after, and its scores, of another measure, are kept below.
        if rest:
            lift = max(match.score for match in rest) - min(match.score for match in again)
            again = [replace(match, score=match.score + max(lift, 0.0)) for match in again]
        return [*sorted(again, key=lambda match: -match.score), *rest]

    def _drawn(self, cad_id: str, R_cv_from_s: FloatArray) -> tuple[CadModel, Views] | None:
        """A model and its renders, or None where there are none."""
        try:
            cad = self._library.get(cad_id)
            scene = self._raster.scene(self._library.mesh(cad))
            return cad, self._raster.render_scene(scene, framing(scene, R_cv_from_s, SIDE))
        except (LibraryError, ValueError) as error:
            log.warning("%s is passed over: %s", cad_id, error)
            return None
