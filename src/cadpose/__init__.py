"""cadpose: which CAD model is the object in this photo, and how is it turned?"""

from __future__ import annotations

__version__ = "0.1.0"
