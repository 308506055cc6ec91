"""Models made by formula: believable, varied, coloured shapes for categories of which a library has too few."""
