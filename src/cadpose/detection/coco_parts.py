"""Pieces of COCO's object-detection JSON that detections and labelled data sets share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from cadpose.detection.polygons import mask_from_polygons
from cadpose.records import Mask, Photo
from cadpose.rle import decode_mask, runs_from_text

Number = Annotated[float, Field(allow_inf_nan=False)]
Side = Annotated[int, Field(ge=1, le=1_000_000)]


class CocoModel(BaseModel):
    """Any piece; keys that it does not name are passed over."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class CocoImage(CocoModel):
    """An entry of ``images``; sides in pixels."""

    id: int
    file_name: Annotated[str, Field(min_length=1, max_length=4096)]
    width: Side | None = None
    height: Side | None = None


class CocoCategory(CocoModel):
    """An entry of ``categories``."""

    id: int
    name: Annotated[str, Field(min_length=1, max_length=200)]


class CocoRuns(CocoModel):
    """Run lengths of a mask of ``size`` (height, width)."""

    size: tuple[Side, Side]
    counts: list[int] | str


class CocoAnnotation(CocoModel):
    """What every entry of ``annotations`` has; ``bbox`` is x, y, width, height in pixels."""

    image_id: int
    category_id: int
    bbox: tuple[Number, Number, Number, Number]
    segmentation: list[list[Number]] | CocoRuns | None = None
    iscrowd: int = 0


def segmentation_mask(segmentation: list[list[float]] | CocoRuns, photo: Photo) -> Mask:
    """(H, W) mask of the photo's size.

    Raises:
        ValueError: the outline cannot be decoded, or is of another size than its photo.
    """
    if not isinstance(segmentation, CocoRuns):
        return mask_from_polygons(photo.height, photo.width, segmentation)
    size = photo.height, photo.width
    if segmentation.size != size:
        raise ValueError(f"it has another size than its photo, {segmentation.size} and not {size}")
    counts = segmentation.counts
    return decode_mask(size, runs_from_text(counts) if isinstance(counts, str) else counts)
