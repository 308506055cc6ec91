"""Another CAD model in the place of an object of a photo (docs/replace.md)."""
