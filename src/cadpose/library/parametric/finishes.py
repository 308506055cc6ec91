"""Looks that many things on wheels and in kitchens share."""

from __future__ import annotations

from cadpose.library.parametric.paints import plain

CHROME = plain((0.80, 0.81, 0.83), "chrome")
STEEL = plain((0.48, 0.49, 0.51), "steel")
BLACK = plain((0.08, 0.08, 0.085), "black")
WHITE = plain((0.92, 0.92, 0.91), "white")
DARK_GLASS = plain((0.06, 0.065, 0.075), "dark glass")
LENS = plain((0.93, 0.95, 0.97), "headlight")
RED_LIGHT = plain((0.76, 0.03, 0.03), "tail light")
AMBER = plain((0.95, 0.55, 0.08), "indicator")
