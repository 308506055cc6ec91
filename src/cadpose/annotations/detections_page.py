"""The gallery page of ``cadpose detect``: every photo with what was found in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import PurePath
from urllib.parse import quote

from PIL import Image

from cadpose.annotations.page import data_uri, page, text
from cadpose.annotations.style import category_text, flags_of, jpeg_bytes
from cadpose.records import Detection


@dataclass(frozen=True, slots=True)
class FoundEntry:
    """A photo's place on the page.

    Attributes:
        name: The photo's file name.
        picture: File name of its picture, beside the page.
        thumbnail: JPEG of the picture.
        words: What was found, in words.
        flags: How many objects have each flag, in words.
        count: How many objects were found.
    """

    name: str
    picture: str
    thumbnail: bytes
    words: str
    flags: tuple[str, ...]
    count: int


def found_entry(
    photo: PurePath, picture: PurePath, image: Image.Image, detections: Sequence[Detection]
) -> FoundEntry:
    """Keep a small picture for ``found_html``, and what to say under it."""
    small = image.convert("RGB")
    small.thumbnail((500, 375), Image.Resampling.LANCZOS)
    words = " · ".join(
        f"{category_text(d.category, (name for name, _ in d.alternatives), d.unsure)} {d.score:.2f}"
        for d in detections
    )
    flags = Counter(flag for d in detections for flag in flags_of(d))
    told = tuple(f"{count} {flag}" for flag, count in flags.items())
    return FoundEntry(photo.name, picture.name, jpeg_bytes(small, quality=80), words, told, len(detections))


def found_html(entries: Iterable[FoundEntry], title: str = "cadpose detect") -> str:
    """The page; each entry links to the picture that lies beside it."""
    entries = list(entries)
    tiles = []
    for entry in entries:
        flags = "".join(f'<span class="flag">{text(flag)}</span>' for flag in entry.flags)
        tiles.append(
            f'<a href="{escape(quote("./" + entry.picture), quote=True)}"><figure>'
            f'<div class="tile"><img alt="" src="{data_uri("jpeg", entry.thumbnail)}"></div>'
            f"<figcaption>{text(entry.name)}{flags}"
            f"<span>{text(entry.words or 'no object found')}</span></figcaption></figure></a>"
        )
    photos, objects = len(entries), sum(entry.count for entry in entries)
    body = (
        f"<h1>{text(title)}</h1>"
        f'<p class="faint">{photos} photo{"" if photos == 1 else "s"}, '
        f"{objects} object{'' if objects == 1 else 's'} found</p>"
        f'<div class="gallery">{"".join(tiles)}</div>'
    )
    return page(title, body)
