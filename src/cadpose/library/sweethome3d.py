"""Sweet Home 3D furniture libraries: .sh3f files, or a folder of them such as Debian's package installs.

A .sh3f is a zip of OBJ models and ``PluginFurnitureCatalog.properties``, which lists them by number.
After ``modelRotation`` a model has y up and its front towards +z; units are centimetres.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

import numpy as np

from cadpose.errors import InputError, LibraryError
from cadpose.geometry.frames import R_s_from_front_plus_z
from cadpose.library.assets import Archive, contained_path
from cadpose.library.class_map import category_from_sweethome3d
from cadpose.library.importing import IDENTITY, ImportItem, open_archive
from cadpose.library.limits import MIB
from cadpose.library.storage import sha256_of
from cadpose.library.sweethome3d_exceptions import corrected, read_exceptions

DEBIAN_FOLDER = Path("/usr/share/sweethome3d/furniture")
"""Where Debian's ``sweethome3d-furniture`` puts its libraries."""

_CATALOGUES = ("PluginFurnitureCatalog.properties", "FurnitureCatalog.properties")


def sweethome3d_items(path: Path, problems: list[str] | None = None) -> list[ImportItem]:
    """The models that one .sh3f file, or every .sh3f file of a folder, lists, corrected by our table.

    Args:
        path: A .sh3f file or a folder that holds some.
        problems: Entries that cannot be imported are told here, one sentence each, and left out.

    Raises:
        InputError: nothing of the kind is there, or an archive is refused.
    """
    told = problems if problems is not None else []
    if path.is_dir():
        files = sorted(path.glob("*.sh3f"))
        if not files:
            raise InputError(f"{path} holds no .sh3f file.")
        items: list[ImportItem] = []
        for file in files:
            try:
                items += _items_of(file, told)
            except InputError as error:
                # One bad archive of several: the others go on.
                told.append(str(error))
        if not items:
            raise InputError(told[0] if told else f"{path} lists no model.")
        return items
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    return _items_of(path, told)


def _items_of(file: Path, problems: list[str]) -> list[ImportItem]:
    archive = open_archive(file)
    listing = next((n for n in map(archive.find, _CATALOGUES) if n), None)
    if listing is None:
        raise InputError(f"{file} is no Sweet Home 3D library: {_CATALOGUES[0]} is not in it.")
    values = parse_properties(archive.read(listing, 16 * MIB).decode("latin-1"))
    library_licence = values.get("license", "")
    by_folder: dict[str, list[str]] = {}
    for name in archive.names():
        by_folder.setdefault(posixpath.dirname(name), []).append(name)
    items: list[ImportItem] = []
    numbers = sorted(int(k[6:]) for k in values if re.fullmatch(r"model#\d{1,6}", k))
    for number in numbers:
        try:
            items.append(_item(file, archive, values, number, library_licence, by_folder))
        except InputError as error:
            problems.append(str(error))
    return corrected(items, read_exceptions())


def _item(
    file: Path,
    archive: Archive,
    values: dict[str, str],
    number: int,
    library_licence: str,
    by_folder: dict[str, list[str]],
) -> ImportItem:
    def get(key: str) -> str:
        return values.get(f"{key}#{number}", "").strip()

    written = get("model").lstrip("/")
    inside = contained_path(written, "", file.name)
    member = archive.find(inside) if inside else None
    if member is None:
        raise InputError(f"{file}: model {number} names {written[:120]!r}, which is not in the archive.")
    if not member.lower().endswith(".obj"):
        raise InputError(f"{file}: model {number} ({member}) is not an OBJ file, which is all that is read.")
    name = get("name") or posixpath.basename(posixpath.dirname(member)) or member
    cad_id = f"{file.stem}/{member}"
    # CRCs of the model's folder stand for its content: reading them costs nothing.
    content = "\n".join(archive.checksum(n) for n in by_folder[posixpath.dirname(member)])
    rotation = R_s_from_front_plus_z @ np.array(_rotation(get("modelRotation"), cad_id)).reshape(3, 3)
    return ImportItem(
        id=cad_id,
        name=name,
        category=category_from_sweethome3d(get("category"), name, member),
        container=str(file.resolve()),
        member=member,
        fingerprint=sha256_of(content.encode()),
        R_s_from_file=tuple(float(x) for x in rotation.ravel()),
        source=f"sweethome3d:{file.name}",
        licence=licence_name(get("license") or library_licence),
        creator=get("creator"),
        size_cm=_size([get("width"), get("depth"), get("height")]),
    )


def _rotation(text: str, cad_id: str) -> tuple[float, ...]:
    if not text:
        return IDENTITY
    try:
        values = tuple(float(x) for x in text.split())
    except ValueError:
        values = ()
    matrix = np.array(values if len(values) == 9 else [np.nan] * 9).reshape(3, 3)
    if not np.isfinite(matrix).all() or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3):
        raise InputError(f"{cad_id}: modelRotation {text[:80]!r} is not a rotation matrix.")
    return values


def _size(texts: list[str]) -> tuple[float, float, float] | None:
    try:
        width, depth, height = (float(t) for t in texts)
    except ValueError:
        return None
    fine = all(np.isfinite(x) and x > 0 for x in (width, depth, height))
    return (width, depth, height) if fine else None


def licence_name(text: str) -> str:
    """An SPDX-like name for the free text of a catalogue's ``license``."""
    low = text.lower()
    if not low:
        return "unknown"
    if "public domain" in low or "cc0" in low or "cc-0" in low:
        return "CC0-1.0"
    if "creative commons" in low or "cc-by" in low or "cc by" in low:
        kind = "CC-BY"
        kind += "-NC" if "noncommercial" in low.replace("-", "").replace(" ", "") else ""
        kind += "-SA" if "share" in low else ""
        kind += "-ND" if "noderiv" in low.replace("-", "").replace(" ", "") else ""
        version = re.search(r"\b(\d\.\d)\b", low)
        return f"{kind}-{version.group(1) if version else 'unknown'}" + (
            "-US" if "united states" in low else ""
        )
    if "free art" in low:
        return "LAL-1.3"
    return " ".join(text.split())[:60]


_ESCAPES = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}


def parse_properties(text: str) -> dict[str, str]:
    """A Java properties file (java.util.Properties.load) as a dictionary; the last of equal keys wins."""
    values: dict[str, str] = {}
    pending = ""
    for raw in text.splitlines():
        line = pending + raw.lstrip(" \t\f")
        pending = ""
        if not line or line[0] in "#!":
            continue
        # An odd number of backslashes at the end joins the next line.
        if (len(line) - len(line.rstrip("\\"))) % 2:
            pending = line[:-1]
            continue
        match = re.match(r"((?:\\.|[^\\:= \t\f])*)[ \t\f]*[:=]?[ \t\f]*(.*)", line, re.DOTALL)
        if match:
            values[_unescape(match.group(1))] = _unescape(match.group(2))
    return values


def _unescape(text: str) -> str:
    def one(match: re.Match[str]) -> str:
        code = match.group(1)
        if len(code) == 5:
            return chr(int(code[1:], 16))
        return _ESCAPES.get(code, code)

    return re.sub(r"\\(u[0-9a-fA-F]{4}|.)", one, text)


def installed_package() -> Path:
    """Folder of the installed Debian package ``sweethome3d-furniture``.

    Raises:
        LibraryError: it is not installed.
    """
    if not any(DEBIAN_FOLDER.glob("*.sh3f")):
        raise LibraryError(
            f"Sweet Home 3D's models are not in {DEBIAN_FOLDER}: "
            "install them with `apt-get install sweethome3d-furniture`."
        )
    return DEBIAN_FOLDER
