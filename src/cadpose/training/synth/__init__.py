"""Synthetic photos with exact labels: CAD models, changed and lit at random, over real or made backdrops."""
