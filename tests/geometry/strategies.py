"""What Hypothesis draws for the geometry tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.frames import FloatArray

azimuths = st.floats(0.0, 360.0, exclude_max=True)
elevations = st.floats(-90.0, 90.0)
inplanes = st.floats(-180.0, 180.0, exclude_min=True)
rotations = st.builds(rotation_from_angles, azimuths, elevations, inplanes)


@st.composite
def points(draw: st.DrawFn, count: int = 8) -> FloatArray:
    """(count, 3) points of an object with a bounding-box diagonal of at most 1, centred."""
    seed = draw(st.integers(0, 2**32 - 1))
    return np.random.default_rng(seed).uniform(-0.288, 0.288, (count, 3))
