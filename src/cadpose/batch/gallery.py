"""The gallery of a run: a tile a photo, its picture a small file beside the page, loaded when it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import PurePosixPath
from urllib.parse import quote

from cadpose.annotations.page import page, text
from cadpose.annotations.style import short
from cadpose.batch.record import PhotoRecord

#: Tiles a part; the others stay folded.
_PART = 240


def tile_html(stem: str, record: PhotoRecord, note: str = "") -> str:
    """A photo's tile: its thumbnail, its name, what was found; a link to its card.

    Args:
        stem: What the names of its outputs begin with.
        record: What was found.
        note: A line in place of what was found.
    """
    models = " · ".join(f"{found.category}: {short(found.cad_name, 40)}" for found in record.objects)
    flag = '<span class="flag">needs review</span>' if any(o.doubtful for o in record.objects) else ""
    return (
        f'<a href="{_address(f"{stem}.card.html")}"><figure><div class="tile">'
        f'<img alt="" loading="lazy" src="{_address(f"thumbnails/{stem}.jpg")}"></div>'
        f"<figcaption>{text(PurePosixPath(record.photo).name)}{flag}"
        f"<span>{text(note or models or 'no object was annotated')}</span></figcaption></figure></a>"
    )


def gallery_html(tiles: Sequence[str]) -> str:
    """All tiles; beyond some hundred in parts that are unfolded one by one."""
    if len(tiles) <= _PART:
        return _grid(tiles)
    parts = []
    for start in range(0, len(tiles), _PART):
        part = tiles[start : start + _PART]
        shown = " open" if start == 0 else ""
        these = f"{start + 1:,} to {start + len(part):,}"
        parts.append(f"<details{shown}><summary>{these}</summary>{_grid(part)}</details>")
    return "".join(parts)


def index_html(finished: Sequence[tuple[str, PhotoRecord]], title: str = "cadpose") -> str:
    """The gallery page of a run: stem and record of each finished photo."""
    objects = sum(len(record.objects) for _, record in finished)
    told = f"{count(len(finished), 'photo')}, {count(objects, 'object')} annotated"
    tiles = [tile_html(stem, record) for stem, record in finished]
    body = f'<h1>{text(title)}</h1><p class="faint">{told} · <a href="./report.html">report</a></p>'
    return page(title, body + gallery_html(tiles), pictures_beside=True)


def count(number: int, what: str) -> str:
    """``1 photo``, ``2,000 photos``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _grid(tiles: Sequence[str]) -> str:
    return f'<div class="gallery">{"".join(tiles)}</div>'


def _address(name: str) -> str:
    return escape(quote("./" + name), quote=True)
