from __future__ import annotations

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.library import sweethome3d
from cadpose.library.importing import ImportItem
from cadpose.library.normalise import rotation_from_axes
from cadpose.library.sweethome3d import DEBIAN_FOLDER, sweethome3d_items
from cadpose.library.sweethome3d_exceptions import ModelException, corrected, read_exceptions


def test_each_model_has_one_exception_a_problem() -> None:
    exceptions = read_exceptions()
    assert len({(e.id, e.problem) for e in exceptions}) == len(exceptions) > 0


@pytest.mark.parametrize(
    "wrong",
    [("a", "colour", "red"), ("a", "front", "north"), ("a", "category", "spaceship"), ("a", "unfit", "")],
)
def test_a_wrong_exception_is_refused(wrong: tuple[str, str, str]) -> None:
    with pytest.raises(InputError):
        ModelException(*wrong)


def item(name: str) -> ImportItem:
    # A file with its front at +z, as Sweet Home 3D's are.
    R = tuple(float(x) for x in rotation_from_axes("+z", "+y").ravel())
    return ImportItem(id=name, name=name, category="table", container="", R_s_from_file=R)


def test_exceptions_turn_and_rename() -> None:
    exceptions = (
        ModelException("turned", "front", "+x"),
        ModelException("bed", "category", "bed"),
        ModelException("heap", "unfit", "several objects"),
    )
    names = ("plain", "turned", "bed", "heap")
    plain, turned, bed, heap = corrected(map(item, names), exceptions)
    assert plain == item("plain") and heap == item("heap")
    assert bed.category == "bed" and bed.R_s_from_file == plain.R_s_from_file
    # What lay along the library's +x, which is the file's -x, is the front now.
    R = np.array(turned.R_s_from_file).reshape(3, 3)
    np.testing.assert_allclose(R @ [-1, 0, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(R @ [0, 1, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.skipif(not any(DEBIAN_FOLDER.glob("*.sh3f")), reason="needs sweethome3d-furniture")
def test_an_import_puts_right_what_the_table_names(monkeypatch: pytest.MonkeyPatch) -> None:
    right = {i.id: i for i in sweethome3d_items(DEBIAN_FOLDER)}
    monkeypatch.setattr(sweethome3d, "read_exceptions", lambda: ())
    plain = {i.id: i for i in sweethome3d_items(DEBIAN_FOLDER)}
    told = {p: {e.id for e in read_exceptions() if e.problem == p} for p in ("front", "category", "unfit")}
    assert set(plain) == set(right) and set().union(*told.values()) <= set(right)
    assert {i for i in right if right[i].category != plain[i].category} == told["category"]
    assert {i for i in right if right[i].R_s_from_file != plain[i].R_s_from_file} == told["front"]
