from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import pytest

from cadpose.datasets.labels import Label
from cadpose.errors import CadposeError
from cadpose.evaluation.rotation import evaluate_rotation, rotation_result, rotation_table
from cadpose.evaluation.symmetry import label_symmetry
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from cadpose.records import Rotation, RotationHypothesis

BOTTLE, TABLE = SymmetryGroup.revolution(), SymmetryGroup.cyclic(2)


def label(
    azimuth: float, elevation: float | None = None, category: str = "car", cad: str | None = None
) -> Label:
    return Label(Path("a.png"), category, cad=cad, azimuth=azimuth, elevation=elevation)


def test_a_whole_label_modulo_symmetry() -> None:
    turned = Rotation(190.0, 30.0)
    plain = rotation_result(label(10.0, 30.0), turned)
    assert plain.error == pytest.approx(180.0)
    assert plain.azimuth_error == pytest.approx(180.0)
    forgiven = rotation_result(label(10.0, 30.0), turned, symmetry=TABLE)
    assert forgiven.error == pytest.approx(0, abs=1e-5)
    assert forgiven.azimuth_error == pytest.approx(0, abs=1e-5)
    # Elevation and in-plane rotation of a bottle still count.
    leaning = rotation_result(label(10.0, 30.0), Rotation(77.0, 45.0), symmetry=BOTTLE)
    assert leaning.error == pytest.approx(15.0)
    assert leaning.azimuth_error == pytest.approx(0, abs=1e-5)
    trivial = rotation_result(label(10.0, 30.0), Rotation(77.0, 45.0), symmetry=SymmetryGroup.trivial())
    assert trivial.error == pytest.approx(rotation_result(label(10.0, 30.0), Rotation(77.0, 45.0)).error)


def test_azimuth_alone_modulo_turns_about_the_vertical() -> None:
    for group, error in ((None, 170.0), (TABLE, 10.0), (BOTTLE, 0.0), (SymmetryGroup.cyclic(4), 10.0)):
        result = rotation_result(label(5.0), Rotation(175.0, 40.0, 20.0), symmetry=group)
        assert result.error == pytest.approx(error, abs=1e-5)
    # A half turn about another axis has no azimuth.
    lying = SymmetryGroup.cyclic(2, (1.0, 0.0, 0.0))
    assert rotation_result(label(5.0), Rotation(175.0, 0.0), symmetry=lying).error == pytest.approx(170.0)


def test_hypotheses_and_the_table() -> None:
    def estimate(_: Label) -> Sequence[RotationHypothesis]:
        return [RotationHypothesis(Rotation(a, 0.0), 1.0, 0.5) for a in (180.0, 270.0)]

    labels = [label(0.0, 0.0, "table"), label(0.0, 0.0, "car")]
    groups = {"table": TABLE, "car": None}
    results = evaluate_rotation(labels, estimate, CadposeError, symmetry=lambda one: groups[one.category])
    assert results[0].hypothesis_errors == pytest.approx((0.0, 90.0), abs=1e-5)
    table = rotation_table(results)
    assert (table["symmetric"], table["acc30"], table["flips"]) == (1, 0.5, 0.5)
    assert (table["classes"]["car"]["symmetric"], table["classes"]["table"]["symmetric"]) == (0, 1)
    plain = rotation_table(evaluate_rotation(labels, estimate, CadposeError))
    assert (plain["symmetric"], plain["acc30"]) == (0, 0.0)


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder = tmp_path_factory.mktemp("symmetry")
    (folder / "made" / "table").mkdir(parents=True)
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in itertools.product((0, 3), (0, 2), (0, 1)))
    sides = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (folder / "made" / "table" / "box.obj").write_text(corners + "".join(f"f {side}\n" for side in sides))
    library = Library.create(folder / "library")
    add_path(library, folder / "made")
    return library


def test_by_the_labelled_model_by_category_or_not_at_all(boxes: Library) -> None:
    (model,) = boxes.models()
    named, other = label(0.0, category="bottle", cad=model.id), label(0.0, category="bottle", cad="gone")
    unnamed = label(0.0, category="car")

    def names(source: str) -> list[str | None]:
        of = label_symmetry(boxes, source)  # type: ignore[arg-type]
        groups = [of(one) for one in (named, other, unnamed)]
        return [None if group is None else group.name for group in groups]

    assert names("none") == [None, None, None]
    assert names("cad") == ["D2", None, None]
    assert names("category") == ["D2", "revolution", "trivial"]
