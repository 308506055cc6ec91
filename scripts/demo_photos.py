"""Write the demo's photographs, two real ones that the scikit-image package carries."""

from __future__ import annotations

import sys
from pathlib import Path

import skimage.data
from PIL import Image


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    # The motorcycle is from the Middlebury 2014 stereo set (Scharstein et al., GCPR 2014), the coffee cup by
    # Rachel Michetti (CC0); docs/pictures/README.md has what is known of their licences.
    Image.fromarray(skimage.data.stereo_motorcycle()[0]).save(folder / "motorcycle.png")
    Image.fromarray(skimage.data.coffee()).save(folder / "coffee.png")


if __name__ == "__main__":
    main()
