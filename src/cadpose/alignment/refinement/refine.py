"""Render and compare: from a pose that is nearly right to one that fits, never to a worse one.

1. The trained network looks at photo and drawn pose together and tells what to change; the changed pose is
   drawn and looked at again, three times.
2. ``full`` only: BOBYQA (Powell 2009, from NLopt) climbs the likeness from the best of these over rotation,
   focal length and offset, within bounds.
3. Focal length and offset are fitted to silhouette and outline, without drawing again: with rotation and
   distance fixed the silhouette only scales and shifts (Eq. 9).

Of all poses that were drawn the one with the highest likeness is the answer, so it is never worse than the
start by that score.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import cv2
import nlopt
import numpy as np
from numpy.typing import NDArray

from cadpose.alignment.refinement.crop import ObjectCrop
from cadpose.alignment.refinement.likeness import Likeness, Look, Weights
from cadpose.alignment.refinement.network import RefinementNetwork
from cadpose.alignment.refinement.steps import Seen, in_virtual_camera, observable, stepped
from cadpose.encoder import SIDE, Lite0
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.poses import Pose4Dof
from cadpose.records import Refinement, Views

#: Ways to refine.
MODES = ("off", "fast", "full")
#: Times that the network is asked.
LOOKS = 3
#: Poses that BOBYQA may draw.
CLIMB = 80
#: How far it may go from where it begins: radians, ln f, shares of the crop's side.
BOUNDS = np.array([0.3, 0.3, 0.2, 0.12, 0.06, 0.06])
#: Its first steps.
_FIRST = np.array([0.06, 0.06, 0.04, 0.03, 0.015, 0.015])
#: The same of the silhouette's fit: ln f, shares of the side.
_PLACE_BOUNDS, _PLACE_FIRST, _PLACE_TRIALS = np.array([0.25, 0.12, 0.12]), np.array([0.04, 0.02, 0.02]), 60

#: A model of diagonal 1 reaches half of it from its middle.
_LEAST_DISTANCE = 0.5

Render = Callable[[Cameras], Views]


@dataclass(frozen=True)
class Refined:
    """A refined pose.

    Attributes:
        pose: The pose.
        record: What was changed, and the angle that the network expects to be left.
    """

    pose: Pose4Dof
    record: Refinement


class Refiner:
    """Refines poses.

    Args:
        encoder: Lite0.
        network: Tells steps; None leaves the first part out.
        weights: Of the likeness.
    """

    def __init__(
        self, encoder: Lite0, network: RefinementNetwork | None = None, weights: Weights | None = None
    ) -> None:
        self.encoder, self.network, self.weights = encoder, network, weights

    def refine(
        self,
        crop: ObjectCrop,
        start: Pose4Dof,
        render: Render,
        mode: str = "fast",
        *,
        symmetry: SymmetryGroup | None = None,
        seen: Seen = in_virtual_camera,
        turn: bool = True,
    ) -> Refined:
        """The pose near ``start`` at which the model looks most like the photo.

        Args:
            crop: The object.
            start: A pose whose model lies before the camera.
            render: Draws the model.
            mode: ``"fast"`` or ``"full"``.
            symmetry: Of the model: what a turn does not change is left as it is.
            seen: How a pose is seen; in the photo's own camera where that is known.
            turn: Whether the rotation may change; one that is known may not.

        Raises:
            ValueError: the mode is another word, or the start cannot be drawn.
        """
        if mode not in MODES[1:]:
            raise ValueError(f"a refinement is fast or full, not {mode!r}")
        likeness = Likeness(crop, self.encoder, self.weights)
        search = _Search(crop, likeness, render, seen, SymmetryGroup.sphere() if not turn else symmetry)
        search.begin(start)
        error = None if self.network is None else _advised(search, self.network)
        if mode == "full":
            _climb(search)
        _placed(search)
        record = Refinement(mode, start, search.start_score, search.best.score, search.drawn, error)
        return Refined(search.pose, record)


class _Search:
    """The poses drawn so far, of which the best is kept."""

    def __init__(
        self,
        crop: ObjectCrop,
        likeness: Likeness,
        render: Render,
        seen: Seen,
        symmetry: SymmetryGroup | None,
    ) -> None:
        self.crop, self.likeness, self.render = crop, likeness, render
        self.seen, self.symmetry = seen, symmetry
        self.side, self.drawn = crop.square.width, 0

    def begin(self, start: Pose4Dof) -> None:
        """Draw the start."""
        self.pose, self.best = start, self.look(start)
        self.start_score = self.best.score

    def look(self, pose: Pose4Dof) -> Look:
        """Draw a pose and compare it.

        Raises:
            ValueError: the model's unit ball reaches the camera.
        """
        cameras = self.seen(pose)
        if float(np.linalg.norm(cameras.t_cv[0])) <= _LEAST_DISTANCE:
            raise ValueError("the model reaches the camera")
        self.drawn += 1
        return self.likeness.of(self.render(self.crop.cameras(cameras)))

    def tried(self, pose: Pose4Dof) -> Look | None:
        """As :meth:`look`, keeping the pose where it is the best; None where it cannot be drawn."""
        try:
            found = self.look(pose)
        except ValueError:  # the model reaches behind the camera
            return None
        if found.score > self.best.score:
            self.pose, self.best = pose, found
        return found

    def changed(self, pose: Pose4Dof, step: FloatArray) -> Pose4Dof:
        """A pose changed by what of a step can be seen."""
        return stepped(pose, observable(step, pose, self.symmetry), self.side)


def _advised(search: _Search, network: RefinementNetwork) -> float:
    """Follow the network's advice; what it expected to be left after the last."""
    pose, look, error = search.pose, search.best, 180.0
    for _ in range(LOOKS):
        advice = network.advise(search.likeness.map16, look.map16, look.cover)
        pose = search.changed(pose, np.clip(advice.step, -BOUNDS, BOUNDS))
        error = advice.expected_error
        found = search.tried(pose)
        if found is None:
            break
        look = found
    return error


def _climb(search: _Search) -> None:
    begin = search.pose

    def score(x: FloatArray, _: FloatArray) -> float:
        look = search.tried(search.changed(begin, np.asarray(x)))
        return -10.0 if look is None else look.score

    _bobyqa(score, BOUNDS, _FIRST, CLIMB)


def _placed(search: _Search) -> None:
    """Focal length and offset by the silhouette of the best pose, scaled and shifted in the crop."""
    crop, pose = search.crop, search.pose
    if crop.mask is None or not search.best.alpha.any():
        return
    alpha = search.best.alpha
    corner = np.array([crop.square.x0, crop.square.y0])
    fixed = (np.array(pose.principal_px) - corner) * crop.scale

    def score(x: FloatArray, _: FloatArray) -> float:
        return search.likeness.of_silhouette(_scaled(alpha, fixed, float(np.exp(x[0])), SIDE * x[1:]))

    x = _bobyqa(score, _PLACE_BOUNDS, _PLACE_FIRST, _PLACE_TRIALS)
    search.tried(stepped(pose, np.concatenate([np.zeros(3), x]), search.side))


def _scaled(
    alpha: NDArray[np.float32], fixed: FloatArray, scale: float, shift: FloatArray
) -> NDArray[np.float32]:
    """A silhouette enlarged about a point of the crop and shifted, in pixels of the crop."""
    # Of pixel centres: (c + 0.5 - fixed) · scale + fixed + shift - 0.5.
    offset = (1.0 - scale) * (fixed - 0.5) + shift
    matrix = np.array([[scale, 0.0, offset[0]], [0.0, scale, offset[1]]])
    return np.asarray(cv2.warpAffine(alpha, matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR), np.float32)


def _bobyqa(
    score: Callable[[FloatArray, FloatArray], float], bounds: FloatArray, first: FloatArray, trials: int
) -> FloatArray:
    """(n,) the best of ``trials`` points about 0."""
    best, value = np.zeros(len(bounds)), -np.inf

    def kept(x: FloatArray, gradient: FloatArray) -> float:
        nonlocal best, value
        found = score(x, gradient)
        if found > value:
            best, value = np.array(x), found
        return found

    optimiser = nlopt.opt(nlopt.LN_BOBYQA, len(bounds))
    optimiser.set_lower_bounds(-bounds)
    optimiser.set_upper_bounds(bounds)
    optimiser.set_initial_step(first)
    optimiser.set_xtol_abs(first / 50.0)
    optimiser.set_maxeval(trials)
    optimiser.set_max_objective(kept)
    # Where it cannot do better in floating point the best point is known.
    with suppress(nlopt.RoundoffLimited):
        optimiser.optimize(np.zeros(len(bounds)))
    return best
