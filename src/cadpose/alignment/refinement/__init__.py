"""Render and compare: the four degrees of freedom, and the offset, brought to where the model fits best."""
