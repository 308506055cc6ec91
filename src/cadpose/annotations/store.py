"""An SQLite store of annotation documents: one transaction a photo, the same run again changes nothing."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import sqlalchemy as sa
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from cadpose.annotations import tables
from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import SCHEMA, AnnotationDocument, FailurePart
from cadpose.annotations.parts import DetectionPart, PhotoPart, RotationPart
from cadpose.errors import CadposeError
from cadpose.records import Annotation

_BUSY_SECONDS = 60
_T = TypeVar("_T")
_P = TypeVar("_P", AnnotationPart, FailurePart)


@dataclass(frozen=True, slots=True)
class StoredPhoto:
    """A row of the photos table.

    Attributes:
        sha256: Digest of the photo's bytes, the key.
        name: Its name when it was last written.
        width: Pixels.
        height: Pixels.
    """

    sha256: str
    name: str
    width: int
    height: int


class Store:
    """Annotation documents in an SQLite file, which is made with its folder where it is missing.

    Several processes may write at once: each photo is one transaction, written ahead (WAL) and synced.

    Args:
        url: ``"sqlite:///file.db"`` (relative path) or ``"sqlite:////srv/file.db"`` (absolute);
            ``"sqlite://"`` keeps everything in memory.

    Raises:
        CadposeError: the URL is not SQLite's, or the file cannot be made, opened or written.
    """

    def __init__(self, url: str) -> None:
        self._engine = _engine(url)
        self._place = self._engine.url.database or "memory"
        with self._told("open"), self._begin() as connection:
            tables.metadata.create_all(connection)
            _add_missing_columns(connection)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._engine.dispose()

    def add(self, document: AnnotationDocument) -> bool:
        """Write a photo's document, replacing what the store held of that photo.

        Returns:
            Whether anything was written: False where the store holds the same document already,
            timings aside.

        Raises:
            CadposeError: the file cannot be written; the photo's former document is kept.
        """
        rows = _rows(document)
        with self._told("write"), self._begin() as connection:
            sha256 = document.photo.sha256
            held = sa.select(tables.PHOTOS.c.content_sha256).where(tables.PHOTOS.c.sha256 == sha256)
            if connection.scalar(held) == rows[0][1][0]["content_sha256"]:
                return False
            # The rows below the photo go with it (ON DELETE CASCADE).
            connection.execute(sa.delete(tables.PHOTOS).where(tables.PHOTOS.c.sha256 == sha256))
            for table, values in rows:
                if values:
                    connection.execute(sa.insert(table), values)
        return True

    def photos(self) -> list[StoredPhoto]:
        """All photos, by name."""
        p = tables.PHOTOS.c
        query = sa.select(p.sha256, p.name, p.width, p.height).order_by(p.name, p.sha256)
        return [StoredPhoto(*row) for row in self._read(lambda connection: connection.execute(query).all())]

    def document(self, photo_sha256: str) -> AnnotationDocument | None:
        """The document of one photo exactly as it was added, or None."""
        t = tables

        def read(connection: sa.Connection) -> AnnotationDocument | None:
            photo = connection.execute(sa.select(t.PHOTOS).where(t.PHOTOS.c.sha256 == photo_sha256)).first()
            if photo is None:
                return None
            found, failed = (
                connection.scalars(
                    sa.select(table.c.document)
                    .where(table.c.photo_sha256 == photo_sha256)
                    .order_by(table.c.position)
                ).all()
                for table in (t.ANNOTATIONS, t.FAILURES)
            )
            return AnnotationDocument(
                schema=photo.schema_version,
                photo=PhotoPart(name=photo.name, sha256=photo.sha256, size=(photo.width, photo.height)),
                annotations=tuple(_part(AnnotationPart, part) for part in found),
                failures=tuple(_part(FailurePart, part) for part in failed),
            )

        return self._read(read)

    def annotations(self, category: str | None = None, cad_id: str | None = None) -> list[Annotation]:
        """Annotations of a detected category, of a chosen CAD model, of both, or all; by photo name."""
        p, a = tables.PHOTOS.c, tables.ANNOTATIONS.c
        query = (
            sa.select(p.sha256, p.name, p.width, p.height, a.document)
            .join_from(tables.PHOTOS, tables.ANNOTATIONS)
            .order_by(p.name, p.sha256, a.position)
        )
        if category is not None:
            query = query.where(a.category == category)
        if cad_id is not None:
            query = query.where(a.cad_id == cad_id)

        def read(connection: sa.Connection) -> list[Annotation]:
            return [
                _part(AnnotationPart, row.document).record(
                    PhotoPart(name=row.name, sha256=row.sha256, size=(row.width, row.height))
                )
                for row in connection.execute(query)
            ]

        return self._read(read)

    def _read(self, read: Callable[[sa.Connection], _T]) -> _T:
        with self._told("read"), self._engine.begin() as connection:
            return read(connection)

    @contextmanager
    def _begin(self) -> Iterator[sa.Connection]:
        with self._engine.execution_options(writes=True).begin() as connection:
            yield connection

    @contextmanager
    def _told(self, what: str) -> Iterator[None]:
        try:
            yield
        except (SQLAlchemyError, sqlite3.Error, ValueError) as error:
            reason = str(getattr(error, "orig", None) or error).splitlines()[0]
            raise CadposeError(
                f"cannot {what} the store {self._place}: {reason}; choose another file with --store"
            ) from None


def _engine(url: str) -> sa.Engine:
    hint = "write it as sqlite:///file.db"
    try:
        parsed = sa.make_url(url)
    except ArgumentError:
        raise CadposeError(f"{url!r} is not a database URL: {hint}") from None
    if parsed.drivername not in ("sqlite", "sqlite+pysqlite"):
        raise CadposeError(f"the store cannot be a {parsed.drivername} database: {hint}")
    if parsed.database and parsed.database != ":memory:":
        try:
            Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            raise CadposeError(f"cannot make the folder of the store {parsed.database}: {error}") from None
    engine = sa.create_engine(parsed, connect_args={"timeout": _BUSY_SECONDS})

    @sa.event.listens_for(engine, "connect")
    def _connected(connection: Any, _: object) -> None:
        # Python's driver would begin transactions by its own rules; _begun does it instead.
        connection.isolation_level = None
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"):
            connection.execute(f"PRAGMA {pragma}")

    @sa.event.listens_for(engine, "begin")
    def _begun(connection: sa.Connection) -> None:
        # A writer takes the lock at once: one that read first could not wait for another writer.
        writes = connection.get_execution_options().get("writes")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _add_missing_columns(connection: sa.Connection) -> None:
    """Bring the tables of an earlier version's store up to date; its rows get null or the default."""
    for column in tables.ADDED_LATER:
        held = {known["name"] for known in sa.inspect(connection).get_columns(column.table.name)}
        if column.name not in held:
            written = sa.schema.CreateColumn(column).compile(dialect=connection.dialect)
            connection.exec_driver_sql(f"ALTER TABLE {column.table.name} ADD COLUMN {written}")


def _part(model: type[_P], stored: Any) -> _P:
    # Through JSON text, because in strict mode only there a list stands for a tuple.
    return model.model_validate_json(json.dumps(stored))


def _digest(*values: Any) -> str:
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _rows(document: AnnotationDocument) -> list[tuple[sa.Table, list[dict[str, Any]]]]:
    """Every table's rows of one document, parents first."""
    photo, data = document.photo, document.model_dump(mode="json", by_alias=True)
    untimed = [{k: v for k, v in part.items() if k != "seconds"} for part in data["annotations"]]
    ids = [_digest(photo.sha256, position, part) for position, part in enumerate(untimed)]
    photo_row = {
        "sha256": photo.sha256,
        "name": photo.name,
        "width": photo.size[0],
        "height": photo.size[1],
        "schema_version": SCHEMA,
        "content_sha256": _digest(data | {"annotations": untimed}),
    }
    annotations, candidates, hypotheses = [], [], []
    for position, (key, part) in enumerate(zip(ids, document.annotations, strict=True)):
        pose = part.pose
        rows: dict[str, Any] = {"annotation_id": key}
        annotations.append(
            {
                "id": key,
                "photo_sha256": photo.sha256,
                "position": position,
                **_found(part.detection),
                "source": part.detection.source,
                **_angles(pose),
                "focal_px": pose.focal_px,
                "principal_x": pose.principal_px[0],
                "principal_y": pose.principal_px[1],
                "t_z": pose.t_z,
                "cad_id": part.cad.id,
                "cad_name": part.cad.name,
                "box_iou": part.box_iou,
                "mask_iou": part.mask_iou,
                "cad_probability": part.candidates[0].probability,
                "none_probability": part.none_probability,
                "cad_needs_review": part.cad_needs_review,
                "document": data["annotations"][position],
            }
        )
        candidates += [
            rows
            | {
                "rank": candidate.rank,
                "cad_id": candidate.cad.id,
                "cad_name": candidate.cad.name,
                "cad_category": candidate.cad.category,
                "score": candidate.score,
                **_angles(candidate.rotation),
                "measures": candidate.measures,
                "probability": candidate.probability,
            }
            for candidate in part.candidates
        ]
        hypotheses += [
            rows
            | {
                "rank": rank,
                **_angles(h.rotation),
                "score": h.score,
                "probability": h.probability,
                "expected_error": h.expected_error,
                "needs_review": h.needs_review,
            }
            for rank, h in enumerate(part.hypotheses, start=1)
        ]
    failures = [
        {
            "photo_sha256": photo.sha256,
            "position": position,
            **_found(failure.detection),
            "stage": failure.stage,
            "reason": failure.reason,
            "document": data["failures"][position],
        }
        for position, failure in enumerate(document.failures)
    ]
    return [
        (tables.PHOTOS, [photo_row]),
        (tables.ANNOTATIONS, annotations),
        (tables.CANDIDATES, candidates),
        (tables.HYPOTHESES, hypotheses),
        (tables.FAILURES, failures),
    ]


def _found(detection: DetectionPart) -> dict[str, Any]:
    box = dict(zip(("box_x0", "box_y0", "box_x1", "box_y1"), detection.box, strict=True))
    flags = {"truncated": detection.truncated, "tiny": detection.tiny, "unsure": detection.unsure}
    return {"category": detection.category, "score": detection.score, **box, **flags}


def _angles(rotation: RotationPart) -> dict[str, float]:
    return {"azimuth": rotation.azimuth, "elevation": rotation.elevation, "inplane": rotation.inplane}
