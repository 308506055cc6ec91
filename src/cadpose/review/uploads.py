"""Photos that come from the page: streamed to a file of a chosen name, looked at, and put into the queue."""

from __future__ import annotations

import io
import os
import secrets
from collections.abc import AsyncIterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Annotated, BinaryIO

from fastapi import APIRouter, Path, Query, Request
from PIL import Image
from starlette.requests import ClientDisconnect

from cadpose.annotations.formats.target import portable_name
from cadpose.errors import InputError
from cadpose.library.storage import write_atomic
from cadpose.photos import MAX_BYTES, SUFFIXES, read_photo
from cadpose.review.answers import JobAnswer, JobsAnswer
from cadpose.review.desk import Desk
from cadpose.review.jobs import Job
from cadpose.review.models import Models
from cadpose.review.refusals import RefusedError
from cadpose.review.turns import Slow

#: What the files of uploads that are not whole begin with.
PART = ".upload-"
_AT_ONCE = 2**20
#: Real photographs that scikit-image carries, by what they show.
_EXAMPLES = {"cup": "coffee", "motorbike": "stereo_motorcycle"}


def upload_routes(desk: Desk) -> APIRouter:
    """``POST /api/photos``, the example, and ``/api/jobs``."""
    routes = APIRouter()

    @routes.post("/photos", status_code=202)
    async def upload(
        request: Request, name: Annotated[str, Query(max_length=1000)] = "photo.jpg"
    ) -> JobAnswer:
        desk.models.opened()
        desk.jobs.check_room()
        folder = uploads_folder(desk)
        part = folder / f"{PART}{secrets.token_hex(8)}"
        try:
            try:
                await _written(request.stream(), part, desk.slow)
            except ClientDisconnect:
                raise InputError("the upload was broken off") from None
            job = await desk.slow.run(_taken, desk, part, shown_name(name))
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)
        return job.answer()

    @routes.post("/photos/example", status_code=202)
    @desk.slow
    def example() -> JobAnswer:
        known = example_of(desk.models)
        if known is None:
            raise InputError(
                "there is no example here: pip install 'cadpose[demo]' brings photographs of a cup and a "
                "motorbike, and the library needs models of these"
            )
        import skimage.data

        picture = getattr(skimage.data, known)()
        rgb = picture[0] if isinstance(picture, tuple) else picture
        out = io.BytesIO()
        Image.fromarray(rgb).save(out, "PNG")
        part = uploads_folder(desk) / f"{PART}{secrets.token_hex(8)}"
        try:
            write_atomic(part, out.getvalue())
            return _taken(desk, part, f"{known}.png").answer()
        finally:
            part.unlink(missing_ok=True)

    @routes.get("/jobs")
    def jobs() -> JobsAnswer:
        return JobsAnswer(items=[job.answer() for job in desk.jobs.all()])

    @routes.get("/jobs/{job_id}")
    def job(job_id: Annotated[str, Path(pattern="^[0-9a-f]{16}$")]) -> JobAnswer:
        return desk.jobs.get(job_id).answer()

    return routes


def example_of(models: Models) -> str | None:
    """The example photograph of which the library has models; None where there is none."""
    if models.library is None or find_spec("skimage") is None:
        return None
    have = models.library.categories()
    return next((photo for category, photo in _EXAMPLES.items() if category in have), None)


def shown_name(name: str) -> str:
    """What to call a photo: a relative path of printable letters, as the page told it."""
    plain = "".join(c if c.isprintable() else "_" for c in portable_name(name))
    return plain[-300:].lstrip("/ ") or "photo"


def uploads_folder(desk: Desk) -> FilePath:
    """The folder, made."""
    folder = desk.photos.uploads
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def sweep_parts(folder: FilePath) -> None:
    """Delete what uploads of an earlier start left unfinished."""
    for part in folder.glob(f"{PART}*"):
        part.unlink(missing_ok=True)


async def _written(stream: AsyncIterator[bytes], part: FilePath, slow: Slow) -> None:
    """The stream into a file, stopped at the cap; the disk is waited for in threads, a megabyte at a time."""
    count, held = 0, bytearray()
    with await slow.run(part.open, "xb") as file:
        async for piece in stream:
            count += len(piece)
            if count > MAX_BYTES:
                raise RefusedError("too_large", f"the photo is larger than the {MAX_BYTES >> 20} MB allowed")
            held += piece
            if len(held) >= _AT_ONCE:
                await slow.run(file.write, held)
                held = bytearray()
        if not count:
            raise InputError("the photo is empty (0 bytes)")
        await slow.run(_ended, file, held)


def _ended(file: BinaryIO, last: bytearray) -> None:
    """Write the rest, and have it on the disk."""
    file.write(last)
    file.flush()
    os.fsync(file.fileno())


def _taken(desk: Desk, part: FilePath, name: str) -> Job:
    """A whole file: decoded once to see that it is a photo, moved to its place, put into the queue."""
    try:
        photo = read_photo(part)
    except InputError as error:
        raise InputError(str(error).replace(str(part), name)) from None
    suffix = FilePath(name).suffix.lower()
    place = part.with_name(f"{photo.sha256}{suffix if suffix in SUFFIXES else '.jpg'}")
    known = desk.photos.path(photo.sha256, name, walk=False)
    if known is None:
        part.replace(place)
        known = place
    return desk.jobs.add(known, name, photo.sha256)
