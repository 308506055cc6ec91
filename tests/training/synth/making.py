"""Generators over the small library."""

from __future__ import annotations

from typing import Any

from cadpose.library.catalogue import Library
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe

#: One object a photo as the model is, nothing before or beside it.
PLAIN: dict[str, Any] = {
    "warp": 0.0,
    "redress": 0.0,
    "company": 0.0,
    "occluder": 0.0,
    "truncate": 0.0,
    "shadow": 0.0,
    "degrade": 0.0,
}


def recipe_of(library: Library, seed: int = 3, **options: Any) -> Recipe:
    return Recipe.from_library(library, options=SynthOptions(**{"size": 96, **options}), seed=seed)


def generator_of(library: Library, seed: int = 3, **options: Any) -> SynthGenerator:
    return recipe_of(library, seed, **options).generator()
