"""Many small photos out of a few: resized, cut, mirrored and relit, no two of the same bytes."""

from __future__ import annotations

import argparse
import io
import os
import sys
from pathlib import Path

import numpy as np
from PIL import Image

#: Every photo's size, and the box that the object is said to fill.
SIZE = (256, 192)
#: What `cadpose annotate` is told of them, so that a photo takes little: box, rotation, two models, no mask.
OPTIONS = ["--box", "10,10,246,182", "--category", "car", "--rotation", "320,5", "--masks", "none"]
OPTIONS += ["--candidates", "2"]


def bench_photos() -> list[Path]:
    """The photos of cars that come with the benchmark."""
    bench = os.environ.get("CADPOSE_BENCH")
    if not bench:
        sys.exit("set CADPOSE_BENCH to the folder that holds bench/cars/photos, or name --from")
    return sorted((Path(bench) / "bench" / "cars" / "photos").iterdir())


def make_photos(sources: list[Path], folder: Path, count: int, seed: int = 0) -> list[Path]:
    """Write ``count`` photos; those that are there stay."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for number in range(count):
        path = folder / f"{number:05}.jpg"
        made.append(path)
        if path.exists():
            continue
        random = np.random.default_rng([seed, number])
        with Image.open(sources[number % len(sources)]) as image:
            image.draft("RGB", (512, 512))
            image = image.convert("RGB")
        shares = random.uniform(0.0, 0.06, 4)
        box = (
            shares[0] * image.width,
            shares[1] * image.height,
            (1 - shares[2]) * image.width,
            (1 - shares[3]) * image.height,
        )
        pixels = np.asarray(image.resize(SIZE, Image.Resampling.BILINEAR, box=box), np.float64)
        if random.random() < 0.5:
            pixels = pixels[:, ::-1]
        pixels = pixels * random.uniform(0.8, 1.2) + random.normal(0.0, 2.0, pixels.shape)
        out = io.BytesIO()
        Image.fromarray(np.clip(pixels, 0, 255).astype(np.uint8)).save(out, "JPEG", quality=85)
        beside = path.with_suffix(".part")
        beside.write_bytes(out.getvalue())
        beside.replace(path)
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photos", type=int, default=2000)
    parser.add_argument("--from", dest="sources", type=Path, help="folder of photos; the benchmark's cars")
    options = parser.parse_args()
    sources = bench_photos() if options.sources is None else sorted(options.sources.iterdir())
    made = make_photos(sources, options.folder, options.photos)
    print(f"{len(made)} photos in {options.folder}")


if __name__ == "__main__":
    main()
