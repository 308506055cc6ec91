"""CAD model and rotation decided together, with a probability for the answer and for "none of these"."""
