"""Outcomes on disk, one JSON object a line as they come, so that a stopped evaluation can go on."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, cast, get_args

from cadpose.annotations.parts import plain_text
from cadpose.datasets.files import MAX_JSONL_BYTES, json_lines, read_bytes, read_json
from cadpose.datasets.labels import Label
from cadpose.errors import InputError
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.retrieval import Outcome, Rejection, Stage
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.records import Candidate, Rotation

#: Names within the folder.
SETTINGS, OUTCOMES = "settings.json", "outcomes.jsonl"


class OutcomeStore:
    """A folder that keeps an evaluation's settings and outcomes.

    Args:
        folder: Made where it is missing.
        settings: Everything that decides the outcomes, as JSON takes it.
        resume: Go on with a folder of the same settings.

    Raises:
        InputError: the folder holds outcomes and ``resume`` is not asked for, or those of other settings.
        OSError: the folder cannot be written.
    """

    def __init__(self, folder: Path, settings: Mapping[str, Any], resume: bool = False) -> None:
        self.folder = folder
        path = folder / SETTINGS
        told = json.loads(json.dumps(settings))
        if path.is_file():
            if not resume:
                raise InputError(
                    f"{folder} holds an evaluation already: add --resume, or name another folder"
                )
            before = read_json(path)
            if before != told:
                known = before if isinstance(before, dict) else {}
                other = [key for key in told if known.get(key) != told[key]] or sorted(set(known) - set(told))
                raise InputError(
                    f"{folder} was made with other settings ({', '.join(other)}): use the same, or another "
                    "folder"
                )
            return
        if (folder / OUTCOMES).exists():
            raise InputError(f"{folder} has outcomes and no {SETTINGS}: name another folder")
        write_atomic(path, (json.dumps(told, indent=1) + "\n").encode())

    def read(self, labels: Sequence[Label], library: Library, names: Collection[str]) -> dict[int, Outcome]:
        """Outcomes of an earlier run by the label's number; a line cut short counts as not there.

        Args:
            labels: What is evaluated.
            library: Where the models are.
            names: Everything that ranks.

        Raises:
            InputError: a line is not of these labels or names, or the file is too large.
            LibraryError: the library lacks a model.
        """
        path = self.folder / OUTCOMES
        if not path.is_file():
            return {}
        # What a killed run was writing has no end of line; the next line must not be glued to it.
        data = read_bytes(path, MAX_JSONL_BYTES)
        if not data.endswith(b"\n"):
            write_atomic(path, data[: data.rfind(b"\n") + 1])
        known = {}
        for line, entry in json_lines(path):
            try:
                number = entry["number"]
                # A bool is an int too, and -1 would be the last label.
                if type(number) is not int or not 0 <= number < len(labels):
                    raise ValueError(f"there is no photo number {number!r}")
                known[number] = outcome_from_json(entry, labels[number], library)
                if set(known[number].answers) != set(names):
                    raise ValueError(f"it has answers of {', '.join(known[number].answers) or 'nobody'}")
            except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
                raise InputError(
                    f"{path}: line {line} is no outcome of these photos ({error}), name another folder"
                ) from error
        return known

    def append(self, number: int, outcome: Outcome) -> None:
        """Keep the outcome of label number ``number``.

        Raises:
            OSError: it cannot be written.
        """
        line = json.dumps({"number": number, **outcome_to_json(outcome)}, allow_nan=False)
        with (self.folder / OUTCOMES).open("ab") as file:
            file.write(f"{line}\n".encode("ascii"))


def outcome_to_json(outcome: Outcome) -> dict[str, Any]:
    """``photo``, ``category``, ``cad``, ``box``, ``candidates``, ``rotation``, ``rotation_error`` (degrees),
    and by name under ``answers`` either ``rejected``, ``reason`` and ``measured`` or ``place`` (of the true
    model), ``probability``, ``needs_review`` and ``ranking``: id, score, azimuth, elevation, in-plane
    rotation.
    """
    label, rotation = outcome.label, outcome.rotation
    return {
        "photo": plain_text(label.photo.name),
        "category": plain_text(label.category),
        "cad": label.cad,
        "box": None if outcome.box is None else list(outcome.box.to_tuple()),
        "candidates": list(outcome.candidates),
        "rotation": None if rotation is None else _angles(rotation),
        "rotation_error": outcome.rotation_error,
        "answers": {name: _answer_to_json(outcome, name) for name in outcome.answers},
    }


def outcome_from_json(entry: Mapping[str, Any], label: Label, library: Library) -> Outcome:
    """What `outcome_to_json` told of a label.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: the entry is of another label, or is none.
        LibraryError: the library lacks a model.
    """
    if (entry["photo"], entry["cad"]) != (plain_text(label.photo.name), label.cad):
        raise ValueError(f"it is of {entry['photo']!r}")
    box, angles = entry["box"], entry["rotation"]
    return Outcome(
        label,
        {name: _answer_from_json(name, answer, library) for name, answer in entry["answers"].items()},
        tuple(entry["candidates"]),
        None if box is None else Box(*box),
        None if angles is None else Rotation(*angles),
        entry["rotation_error"],
    )


def _answer_to_json(outcome: Outcome, name: str) -> dict[str, Any]:
    answer = outcome.answers[name]
    if isinstance(answer, Rejection):
        return {"rejected": answer.stage, "reason": plain_text(answer.reason), "measured": answer.measured}
    return {
        "place": outcome.place(name),
        "probability": answer.probability,
        "needs_review": answer.needs_review,
        "ranking": [[c.cad.id, c.score, *_angles(c.rotation)] for c in answer.candidates],
    }


def _answer_from_json(name: str, entry: Mapping[str, Any], library: Library) -> Ranking | Rejection:
    if "rejected" in entry:
        if entry["rejected"] not in get_args(Stage):
            raise ValueError(f"there is no stage {entry['rejected']!r}")
        if not isinstance(entry["measured"], bool):
            raise ValueError(f"measured is {entry['measured']!r}")
        return Rejection(cast(Stage, entry["rejected"]), entry["reason"], entry["measured"])
    return Ranking(
        tuple(
            Candidate(library.get(cad), score, Rotation(*angles), {name: score})
            for cad, score, *angles in entry["ranking"]
        ),
        entry["probability"],
        entry["needs_review"],
    )


def _angles(rotation: Rotation) -> list[float]:
    return [rotation.azimuth, rotation.elevation, rotation.inplane]
