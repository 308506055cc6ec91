"""The annotation database: one transaction a photo, the same run again changes nothing, nothing is lost.

The tables and what they mean are told in docs/database.md; the work is done in ``annotations/database``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from cadpose.annotations.database import deciding, failing, reading, writing
from cadpose.annotations.database.checking import Problem, problems
from cadpose.annotations.database.counting import stats
from cadpose.annotations.database.engine import Database
from cadpose.annotations.database.layout import prepare
from cadpose.annotations.database.merging import MergeReport, merge
from cadpose.annotations.database.results import (
    TRUSTED,
    Author,
    ConflictError,
    DecisionVerdict,
    Page,
    QueueItem,
    Region,
    StoredAnnotation,
    StoredDecision,
    StoredFailure,
    StoredPhoto,
)
from cadpose.annotations.database.reviewing import Reviewing, reviewing
from cadpose.annotations.database.selection import UNDECIDED, Selection, count, not_rejected, page, verdict_is
from cadpose.annotations.document import AnnotationDocument
from cadpose.records import Annotation, CadModel, Pose4Dof

__all__ = [
    "TRUSTED",
    "UNDECIDED",
    "Author",
    "ConflictError",
    "DecisionVerdict",
    "MergeReport",
    "Page",
    "Problem",
    "QueueItem",
    "Region",
    "Reviewing",
    "Selection",
    "Store",
    "StoredAnnotation",
    "StoredDecision",
    "StoredFailure",
    "StoredPhoto",
]


class Store:
    """Annotation documents and the decisions on them, in an SQLite file or a PostgreSQL database.

    Several processes may write at once: each photo is one transaction. An SQLite file is written ahead (WAL)
    and synced, and made with its folder where it is missing.

    Args:
        url: ``"sqlite:///file.db"`` (relative path) or ``"sqlite:////srv/file.db"`` (absolute);
            ``"sqlite://"`` keeps everything in memory; ``"postgresql+psycopg://user@host/database"``.
        create: Make a missing SQLite file, and the tables in an empty database; without it these are errors.
        migrate: What to do with a store of an earlier version: migrate it (True), refuse it (False), or by
            default migrate an SQLite file, keeping a copy beside it, and refuse on a server.

    Attributes:
        revision_found: Revision of the tables as they were found, empty for a new store.
        backup: The copy that was kept of an older file, or None.

    Raises:
        CadposeError: the URL is neither's, or the store cannot be made, opened, migrated or written, or a
            newer version of cadpose made it.
        DependencyError: PostgreSQL is asked for and psycopg is not installed.
    """

    def __init__(self, url: str, *, create: bool = True, migrate: bool | None = None) -> None:
        self._database = Database(url, create=create)
        try:
            layout = prepare(self._database, migrate, create)
        except BaseException:
            self._database.close()
            raise
        self.revision_found: str = layout.found
        self.backup: Path | None = layout.backup

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def place(self) -> str:
        """The file, or the server's address without its password."""
        return self._database.place

    def close(self) -> None:
        """Close the file or the connections."""
        self._database.close()

    # -- documents -------------------------------------------------------------------------------

    def add(self, document: AnnotationDocument, author: Author | None = None) -> bool:
        """Write a photo's document in one transaction.

        What the store held of that photo and this document does not repeat becomes history. Where a person
        decided on a former answer that one goes on holding; see docs/database.md.

        Args:
            document: The photo's.
            author: Whose word the verdicts of annotations new to the store are: by default the program's that
                annotated. A person's holds like any other decision of one.

        Returns:
            Whether anything was written: False where the store holds the same document already,
            timings aside.

        Raises:
            CadposeError: the store cannot be written; what it held of the photo is kept.
        """
        return writing.add_documents(self._database, [document], author or writing.ANNOTATE) == 1

    def add_many(self, documents: Iterable[AnnotationDocument]) -> int:
        """Write documents, a hundred a transaction; how many were not there already.

        Raises:
            CadposeError: the store cannot be written; whole hundreds were.
        """
        return writing.add_documents(self._database, documents)

    def photos(self, limit: int | None = None) -> list[StoredPhoto]:
        """All photos, or the first so many, by name."""
        with self._database.reading() as connection:
            return reading.photos(connection, limit)

    def photo(self, photo_sha256: str) -> StoredPhoto | None:
        """One photo, None where the store holds none of that digest."""
        with self._database.reading() as connection:
            return reading.photo(connection, photo_sha256)

    def document(self, photo_sha256: str, *, original: bool = False) -> AnnotationDocument | None:
        """The document of one photo, or None.

        Args:
            photo_sha256: Digest of the photo's bytes.
            original: Exactly as it was last added, without what people decided since.
        """
        with self._database.reading() as connection:
            return reading.document(connection, photo_sha256, original)

    def iter_documents(
        self, *, original: bool = False, verdicts: tuple[str, ...] = (), rejected: bool = True
    ) -> Iterator[AnnotationDocument]:
        """Every document, by name of its photo; memory does not grow with their number.

        Args:
            original: Exactly as they were last added, without what people decided since.
            verdicts: Only annotations of which any of these holds, also ``"undecided"``; all when empty.
            rejected: Whether to give annotations that a person rejected.

        Raises:
            InputError: an unknown verdict.
        """
        where = [verdict_is(Selection(verdicts=verdicts).verdicts)] if verdicts else []
        return reading.iter_documents(
            self._database, original, where if rejected else [*where, not_rejected()]
        )

    # -- annotations -----------------------------------------------------------------------------

    def annotations(
        self, category: str | None = None, cad_id: str | None = None, *, original: bool = False
    ) -> list[Annotation]:
        """Annotations of a detected category, of a chosen CAD model, of both, or all; by photo name."""
        return list(self.iter_annotations(Selection(category=category, cad_id=cad_id), original=original))

    def iter_annotations(
        self, selection: Selection | None = None, *, original: bool = False
    ) -> Iterator[Annotation]:
        """Annotations, by photo name; memory does not grow with their number.

        Args:
            selection: Which; all that hold unless told, rejected ones too.
            original: The machine's pose and model, without what people changed.
        """
        return (found.annotation for found in self.iter_stored(selection, original=original))

    def iter_stored(
        self, selection: Selection | None = None, *, original: bool = False
    ) -> Iterator[StoredAnnotation]:
        """The same with each one's key, version and verdict."""
        return reading.iter_stored(self._database, selection or Selection(), original)

    def stored(self, annotation_id: str, *, original: bool = False) -> StoredAnnotation | None:
        """One annotation, also one that is history; None where there is none."""
        with self._database.reading() as connection:
            return reading.stored(connection, annotation_id, original)

    def standing(self, photo_sha256: str) -> list[StoredAnnotation]:
        """Annotations of a photo that hold."""
        with self._database.reading() as connection:
            return reading.standing(connection, photo_sha256)

    def items(self, photo_sha256: str) -> list[QueueItem]:
        """The same as lists show them: quicker, since no document is read."""
        with self._database.reading() as connection:
            return reading.items(connection, photo_sha256)

    def former(self, photo_sha256: str) -> list[StoredAnnotation]:
        """Annotations of a photo that do not hold any more, because another run or person said otherwise."""
        with self._database.reading() as connection:
            return reading.former(connection, photo_sha256)

    def queue(self, selection: Selection | None = None, *, after: str | None = None, limit: int = 50) -> Page:
        """A page of annotations, the least confident first, those that tell no confidence before them.

        A deep page takes no longer than the first. Annotations that are added meanwhile neither repeat nor
        hide others.

        Args:
            selection: Which.
            after: ``Page.after`` of the page before; None for the first one.
            limit: At most so many, 1 to 1000.

        Raises:
            InputError: ``after`` is no such key, or the limit is out of range.
        """
        with self._database.reading() as connection:
            return page(connection, selection or Selection(), after, limit)

    def count(self, selection: Selection | None = None) -> int:
        """How many annotations the selection takes."""
        with self._database.reading() as connection:
            return count(connection, selection or Selection())

    # -- decisions -------------------------------------------------------------------------------

    def decide(
        self,
        annotation_id: str,
        verdict: DecisionVerdict,
        author: Author,
        *,
        expected_version: int | None,
        reason: str = "",
        note: str = "",
        pose: Pose4Dof | None = None,
        cad: CadModel | None = None,
        region: Region | None = None,
        measures: Mapping[str, float] | None = None,
    ) -> int:
        """Say what is to be done with an annotation.

        Args:
            annotation_id: Its key.
            verdict: ``accept``, ``reject``, ``edit``, ``auto_accept``, ``review`` (look again) or ``skip``.
            author: Who or what says so. A program is refused where a person has decided.
            expected_version: The version that was looked at; None takes whatever is there.
            reason: Why, in a word or two.
            note: Anything else.
            pose: With ``edit``: the right pose.
            cad: With ``edit``: the right model.
            region: With ``edit``: the right box, and mask if there is one.
            measures: With ``edit``: ``box_iou`` and ``mask_iou`` of what was set.

        Returns:
            The annotation's new version.

        Raises:
            ConflictError: somebody else decided meanwhile, another run took the annotation's place, or a
                program would overrule a person.
            InputError: no such annotation or verdict, an edit without a change, or a region that does not
                fit the photo.
            CadposeError: the store cannot be written.
        """
        with self._database.writing() as connection:
            return deciding.decide(
                connection,
                annotation_id,
                verdict,
                author,
                expected_version,
                reason=reason,
                note=note,
                pose=pose,
                cad=cad,
                region=region,
                measures=measures,
            )

    def history(self, annotation_id: str) -> list[StoredDecision]:
        """Every decision on an annotation, the first one first; the program's own verdict is one."""
        with self._database.reading() as connection:
            return deciding.history(connection, annotation_id)

    # -- photos that failed ----------------------------------------------------------------------

    def add_failure(self, name: str, sha256: str | None, stage: str, reason: str) -> None:
        """Write that a photo could not be annotated; adding its document later takes it away.

        Args:
            name: Its path as it was given.
            sha256: Digest of its bytes, None where they could not be read.
            stage: Where it ended.
            reason: One sentence.
        """
        with self._database.writing() as connection:
            failing.add_failure(connection, name, sha256, stage, reason)

    def photo_failures(self) -> list[StoredFailure]:
        """Photos that failed and have not been annotated since, by name."""
        with self._database.reading() as connection:
            return failing.failures(connection)

    # -- the whole -------------------------------------------------------------------------------

    def check(self) -> Iterator[Problem]:
        """Read everything again and tell what is damaged; nothing is changed."""
        return problems(self._database)

    def stats(self) -> dict[str, dict[str, int]]:
        """Counts by category, verdict, model, licence, version, author and stage."""
        with self._database.reading() as connection:
            return stats(connection)

    def reviewing(self, now: datetime | None = None) -> Reviewing:
        """How far people have come, how fast they are, and how much they agree.

        Args:
            now: The moment that the last hour is counted back from, UTC; the present one unless told.
        """
        with self._database.reading() as connection:
            return reviewing(connection, now)

    def merge(self, other: Store) -> MergeReport:
        """Take over everything of another store, whole or not at all; twice changes nothing more.

        Raises:
            CadposeError: either store cannot be read or written.
        """
        return merge(self._database, other._database)
