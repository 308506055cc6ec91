"""Models made by formula: varied, coloured shapes for categories of which a library has too few."""
