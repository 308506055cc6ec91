"""One photo with its placed CAD models as a 3-D scene: glTF and USD (docs/export-scenes.md)."""
