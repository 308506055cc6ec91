"""A contact sheet of a folder of synthetic photos, so that a person can look at what was made."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from cadpose.annotations.style import colour_of, font, short
from cadpose.datasets.labels import Label, iter_labels
from cadpose.photos import read_photo
from cadpose.records import Pose4Dof

#: The axes that are drawn: the object's own right (red), up (green), front (blue), a third of its diagonal.
_AXES = np.array([[0.0, 0.0, 0.0], [0.35, 0.0, 0.0], [0.0, 0.35, 0.0], [0.0, 0.0, -0.35]])
_AXIS_COLOURS = ((230, 40, 40), (40, 190, 60), (50, 90, 240))
_GAP = 4


def sheet(labels: Path, most: int = 48, columns: int = 8, side: int = 224) -> Image.Image:
    """Photos spread evenly over a label file, each with boxes, axes and angles.

    Args:
        labels: The label file of :func:`~cadpose.training.synth.writer.write_photos`.
        most: Photos at most.
        columns: Photos a row.
        side: Side of a photo on the sheet in pixels.

    Raises:
        InputError: the label file or a photo cannot be read.
        ValueError: there is no label, or a number is below 1.
    """
    photos = [list(group) for _, group in groupby(iter_labels(labels), key=lambda label: label.photo)]
    if not photos or min(most, columns, side) < 1:
        raise ValueError("a sheet needs a labelled photo, and numbers of at least 1")
    chosen = np.unique(np.linspace(0, len(photos) - 1, min(most, len(photos))).round().astype(np.int64))
    columns = min(columns, len(chosen))
    rows = -(-len(chosen) // columns)
    out = Image.new("RGB", (columns * (side + _GAP) + _GAP, rows * (side + _GAP) + _GAP), (32, 32, 32))
    for place, number in enumerate(chosen):
        at = (_GAP + place % columns * (side + _GAP), _GAP + place // columns * (side + _GAP))
        out.paste(_marked(photos[number], side), at)
    return out


def _marked(labels: list[Label], side: int) -> Image.Image:
    """A photo with what is true of it."""
    photo = read_photo(labels[0].photo)
    scale = side / max(photo.width, photo.height)
    picture = Image.fromarray(photo.rgb).resize((round(photo.width * scale), round(photo.height * scale)))
    draw = ImageDraw.Draw(picture)
    size = max(9, side // 18)
    for i, label in enumerate(labels):
        colour = colour_of(i)
        if label.box is not None:
            corners = np.array(label.box.to_tuple()) * scale
            draw.rectangle([(corners[0], corners[1]), (corners[2], corners[3])], outline=colour)
        rotation = label.rotation
        if rotation is None or label.focal_px is None or label.principal_px is None or label.t_cv is None:
            continue
        pose = Pose4Dof(rotation, label.focal_px, label.principal_px, label.t_cv[2])
        ends = pose.project(_AXES) * scale
        for end, axis_colour in zip(ends[1:], _AXIS_COLOURS, strict=True):
            draw.line([*map(tuple, (ends[0], end))], fill=axis_colour, width=max(1, side // 110))
        flags = "".join(letter for letter, on in (("t", label.truncated), ("o", label.occluded)) if on)
        text = (
            f"{short(label.category, 14)} {rotation.azimuth:.0f} {rotation.elevation:+.0f}"
            f" {rotation.inplane:+.0f} {flags}"
        )
        where = (2, 1 + i * (size + 2))
        draw.text(where, text.strip(), fill=colour, font=font(size), stroke_width=1, stroke_fill=(0, 0, 0))
    return picture
