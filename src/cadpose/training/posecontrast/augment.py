"""The crops of one photo that a training step sees, on the CPU with Pillow.

From one jittered crop come the query, a copy turned by 15° to either side and a mirrored copy, each with
its own label; from a second, independent jitter comes the positive of the contrast. Colours change
independently in all four. Verified in the authors' published code (src/dataset/vp_data.py, data_utils.py):
the ranges and chances, that the turned copy is turned within its crop, that blur touches only objects
larger than 224 px and never the positive, and that the lighting noise is added after the normalisation.
Taken otherwise: the longer side is always 224 px, which the authors' truncation misses by a few pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageEnhance, ImageFilter

from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.records import Rotation
from cadpose.rotation.bins import flip_labels, labels_from_angles, turn_labels

#: Side of a crop in pixels.
SIDE = 224
#: By which share of its size each edge of a box moves at most.
BOX_JITTER = 0.1
#: Brightness, contrast and saturation lie within 1 ± this.
COLOUR_JITTER = 0.5
COLOUR_CHANCE = 0.8
GREY_CHANCE = 0.2
BLUR_CHANCE = 0.5
#: Radii of the blur in pixels of the photo.
BLUR_RADII = (1, 2, 3, 4)
#: Turn of the turned copy, degrees.
TURN = 15
#: Deviation of the lighting noise, and ImageNet's principal colours: variances, and axes by column.
LIGHTING = 0.1
PCA_VALUES = np.array([0.2175, 0.0188, 0.0045])
PCA_VECTORS = np.array([[-0.5675, 0.7192, 0.4009], [-0.5808, -0.0045, -0.8140], [-0.5836, -0.6948, 0.4203]])


@dataclass(frozen=True, eq=False)
class Views:
    """The four crops of one photo.

    Attributes:
        images: (4, 224, 224, 3) uint8 RGB: query, turned, mirrored, positive.
        lighting: (4, 3) float32 to be added to the normalised channels of each.
        labels: (3, 3) int64 labels of query, turned and mirrored; the positive has the query's.

    Raises:
        ValueError: the shapes are not such.
    """

    images: NDArray[np.uint8]
    lighting: NDArray[np.float32]
    labels: NDArray[np.int64]

    def __post_init__(self) -> None:
        shapes = (self.images.shape, self.lighting.shape, self.labels.shape)
        if shapes != ((4, SIDE, SIDE, 3), (4, 3), (3, 3)):
            raise ValueError(f"views of shapes {shapes}")


def training_views(rgb: NDArray[np.uint8], box: Box, rotation: Rotation, rng: np.random.Generator) -> Views:
    """Draw the crops of one labelled photo.

    Args:
        rgb: (H, W, 3) photo.
        box: The object's rectangle in it.
        rotation: What is true of the object.
        rng: All randomness comes from here.
    """
    photo = Image.fromarray(rgb)
    blurred = photo
    if min(box.width, box.height) > SIDE and rng.random() < BLUR_CHANCE:
        reach = 4 * max(BLUR_RADII)
        blurred = _blurred_around(photo, box, float(rng.choice(BLUR_RADII)), reach)
    crop = blurred.crop(_whole(jittered_box(box, rng), photo.size))
    positive = photo.crop(_whole(jittered_box(box, rng), photo.size))
    turn = int(rng.choice((-TURN, TURN)))
    label = labels_from_angles(rotation.azimuth, rotation.elevation, rotation.inplane)
    crops = (crop, crop.rotate(turn), crop.transpose(Image.Transpose.FLIP_LEFT_RIGHT), positive)
    return Views(
        images=np.stack([np.asarray(recoloured(letterboxed(c), rng)) for c in crops]),
        lighting=np.stack([lighting_noise(rng) for _ in crops]).astype(np.float32),
        labels=np.concatenate([label, turn_labels(label, turn), flip_labels(label)]),
    )


def plain_view(rgb: NDArray[np.uint8], box: Box) -> NDArray[np.uint8]:
    """(224, 224, 3) crop without any change, for evaluation."""
    photo = Image.fromarray(rgb)
    return np.asarray(letterboxed(photo.crop(_whole(box, photo.size))))


def jittered_box(box: Box, rng: np.random.Generator) -> Box:
    """The box with each edge moved by up to a tenth of its size, independently."""
    moves = rng.uniform(-BOX_JITTER, BOX_JITTER, 4) * (box.width, box.height, box.width, box.height)
    return Box(box.x0 + moves[0], box.y0 + moves[1], box.x1 + moves[2], box.y1 + moves[3])


def letterboxed(crop: Image.Image) -> Image.Image:
    """Scaled with its aspect kept until the longer side is 224 px, black beside it."""
    scale = SIDE / max(crop.size)
    size = (max(1, round(crop.width * scale)), max(1, round(crop.height * scale)))
    square = Image.new("RGB", (SIDE, SIDE))
    square.paste(
        crop.resize(size, Image.Resampling.BILINEAR), ((SIDE - size[0] + 1) // 2, (SIDE - size[1] + 1) // 2)
    )
    return square


def recoloured(image: Image.Image, rng: np.random.Generator) -> Image.Image:
    """Brightness, contrast and saturation in random order, then sometimes grey."""
    if rng.random() < COLOUR_CHANCE:
        changes = (ImageEnhance.Brightness, ImageEnhance.Contrast, ImageEnhance.Color)
        factors = rng.uniform(1.0 - COLOUR_JITTER, 1.0 + COLOUR_JITTER, len(changes))
        for i in rng.permutation(len(changes)):
            image = changes[i](image).enhance(float(factors[i]))
    if rng.random() < GREY_CHANCE:
        image = image.convert("L").convert("RGB")
    return image


def lighting_noise(rng: np.random.Generator) -> FloatArray:
    """(3,) offset along ImageNet's principal colours (Krizhevsky et al., 2012), for normalised channels."""
    return np.asarray(PCA_VECTORS @ (rng.normal(0.0, LIGHTING, 3) * PCA_VALUES))


def _blurred_around(photo: Image.Image, box: Box, radius: float, reach: int) -> Image.Image:
    """The photo blurred where a jittered box and the blur's own reach can see, which is faster than all."""
    wide = Box(
        box.x0 - BOX_JITTER * box.width - reach,
        box.y0 - BOX_JITTER * box.height - reach,
        box.x1 + BOX_JITTER * box.width + reach,
        box.y1 + BOX_JITTER * box.height + reach,
    )
    window = _whole(wide, photo.size)
    blurred = photo.copy()
    blurred.paste(photo.crop(window).filter(ImageFilter.GaussianBlur(radius)), window[:2])
    return blurred


def _whole(box: Box, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Whole pixels of a box within a photo of (width, height), at least one."""
    x0 = min(max(round(box.x0), 0), size[0] - 1)
    y0 = min(max(round(box.y0), 0), size[1] - 1)
    return x0, y0, max(min(round(box.x1), size[0]), x0 + 1), max(min(round(box.y1), size[1]), y0 + 1)
