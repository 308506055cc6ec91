"""``GET /api/export/{format}``: the formats of `cadpose export`, a folder as a zip file."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.registry import FORMATS, export
from cadpose.annotations.formats.sources import Sources, documents_of_store
from cadpose.annotations.store import Selection
from cadpose.errors import InputError
from cadpose.review.answers import FormatTold
from cadpose.review.desk import Desk
from cadpose.review.refusals import not_found
from cadpose.review.turns import Turn

#: Package that a format needs, and the extra that brings it.
_EXTRAS = {"parquet": ("pyarrow", "parquet"), "usd": ("pxr", "usd")}
#: Formats that hold the photos and the models.
_WHOLE = ("bop", "pix3d", "fiftyone", "gltf", "usd")
_ENDINGS = {"parquet": ".parquet", "csv": ".csv"}
_TYPES = {
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".parquet": "application/vnd.apache.parquet",
    ".zip": "application/zip",
}
#: Photos of the store that are looked for to tell whether photos are at hand.
_SAMPLE = 3
_PATIENCE = 30.0


@dataclass(frozen=True, eq=False)
class FoundPhotos(Sources):
    """Photos that are found by content.

    Attributes:
        find: Gives a photo's file by digest and name; None where it is not at hand.
    """

    find: Callable[[str, str], FilePath | None] = field(default=lambda sha256, name: None, kw_only=True)

    def photo_path(self, document: AnnotationDocument) -> FilePath:
        """The photo's file.

        Raises:
            InputError: it is not at hand.
        """
        path = self.find(document.photo.sha256, document.photo.name)
        if path is None:
            raise InputError(
                f"this format holds the photos, and {document.photo.name} is not at hand: start "
                "`cadpose review` with --photos and its folder"
            )
        return path


def export_routes(desk: Desk) -> APIRouter:
    """The route."""
    routes = APIRouter()
    turn = Turn(_PATIENCE, "another export is being written: try again in a moment")

    @routes.get("/export/{name}")
    async def exported(
        request: Request,
        name: Annotated[str, Path(max_length=40)],
        verdict: Annotated[list[str] | None, Query(max_length=20)] = None,
    ) -> FileResponse:
        if name not in FORMATS:
            raise not_found(f"there is no such format: choose {', '.join(FORMATS)}")
        chosen = Selection(verdicts=tuple(verdict or ())).verdicts
        async with turn.of(request):
            return await desk.slow.run(written, name, chosen)

    def written(name: str, chosen: tuple[str, ...]) -> FileResponse:
        if reason := needs(desk, name):
            raise InputError(reason)
        folder = FilePath(tempfile.mkdtemp(prefix="cadpose-export-"))
        try:
            file = _written(desk, name, chosen, folder)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return FileResponse(
            file,
            media_type=_TYPES[file.suffix],
            filename=file.name,
            background=BackgroundTask(shutil.rmtree, folder, ignore_errors=True),
        )

    return routes


def formats_told(desk: Desk) -> list[FormatTold]:
    """Every format, with what it needs that is not there."""
    return [FormatTold(name=f.name, title=f.what, needs=needs(desk, f.name)) for f in FORMATS.values()]


def needs(desk: Desk, name: str) -> str:
    """Why a format cannot be made here; empty where it can, as far as a quick look tells."""
    package, extra = _EXTRAS.get(name, ("", ""))
    if package and find_spec(package) is None:
        return f"it needs {package}, which is not installed: pip install 'cadpose[{extra}]'"
    if name in _WHOLE and desk.models.library is None:
        return "it holds the CAD models, and no library is opened: start with --library"
    if name in _WHOLE:
        some = desk.store.photos(_SAMPLE)
        if some and not any(desk.photos.path(photo.sha256, photo.name) for photo in some):
            return "it holds the photos, and they are not at hand: start with --photos and their folder"
    return ""


def _written(desk: Desk, name: str, verdicts: tuple[str, ...], folder: FilePath) -> FilePath:
    kind = FORMATS[name]
    library = None if desk.models.library is None else desk.models.library.path
    sources = FoundPhotos(library, find=lambda sha256, name: desk.photos.path(sha256, name, patience=30.0))
    out = folder / f"cadpose-{name}{'' if kind.folder else _ENDINGS.get(name, '.json')}"
    try:
        export(name, documents_of_store(desk.url, verdicts), out, sources)
    except InputError as error:
        # Of the command line's advice the page knows nothing.
        if "there is no annotation to export" in str(error):
            raise InputError("there is no annotation of that choice to export") from None
        raise
    if not kind.folder:
        return out
    packed = folder / f"{out.name}.zip"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as zipped:
        for path in sorted(out.rglob("*")):
            if path.is_file():
                zipped.write(path, f"{out.name}/{path.relative_to(out).as_posix()}")
    shutil.rmtree(out)
    return packed
