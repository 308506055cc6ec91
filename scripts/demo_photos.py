"""Write the demo's photographs: real ones that scikit-image carries, public domain or CC0."""

from __future__ import annotations

import sys
from pathlib import Path

import skimage.data
from PIL import Image


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    # Middlebury 2014 stereo set (CC0) and Rachel Michetti's coffee cup (CC0), see skimage/data/README.
    Image.fromarray(skimage.data.stereo_motorcycle()[0]).save(folder / "motorcycle.png")
    Image.fromarray(skimage.data.coffee()).save(folder / "coffee.png")


if __name__ == "__main__":
    main()
