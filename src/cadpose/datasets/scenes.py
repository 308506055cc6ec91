"""Photos in which every object of certain categories is labelled: what a detector is measured on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_coco, category_or_word
from cadpose.records import Mask, Photo


@dataclass(frozen=True, eq=False)
class TrueObject:
    """One labelled object, or a crowd of them.

    Attributes:
        box: Around what is seen of it, in pixels.
        category: Library category, or the data set's own word where the library has none.
        area: Pixels² by which it counts as small or large: as the data set tells, else the box's.
        ignored: Difficult: neither to be found nor to be missed.
        crowd: Many objects in one label; ignored too, however many detections lie in it.
        mask: Gives the (H, W) mask of what is seen of it; raises InputError. None where there is none.

    Raises:
        ValueError: the area is not above 0.
    """

    box: Box
    category: str
    area: float
    ignored: bool = False
    crowd: bool = False
    mask: Callable[[Photo], Mask] | None = None

    def __post_init__(self) -> None:
        if not self.area > 0:
            raise ValueError(f"the area {self.area} of a labelled object must be above 0")


@dataclass(frozen=True, eq=False)
class Scene:
    """One photo with all its labels.

    Attributes:
        photo: Its path.
        objects: Gives the labelled objects, once the photo is decoded: some labels are shares of its size.
            Raises InputError where they do not fit the photo.
    """

    photo: Path
    objects: Callable[[Photo], Sequence[TrueObject]]


@dataclass(frozen=True, eq=False)
class SceneSet:
    """A labelled data set.

    Attributes:
        kind: ``"coco"``, ``"yolo"``, ``"labels"`` or ``"pix3d"``.
        name: What to call it.
        scenes: Its photos.
        categories: What it labels: library categories, or its own words where the library has none.
        synthetic: The photos were drawn.
    """

    kind: str
    name: str
    scenes: Sequence[Scene]
    categories: frozenset[str]
    synthetic: bool = False


def library_word(name: str) -> str:
    """The library category of a data set's class name; a name of none stands for itself."""
    return category_from_coco(name) or category_or_word(name)


def whole_box(photo: Photo) -> Box:
    """The whole photo."""
    return Box(0.0, 0.0, float(photo.width), float(photo.height))
