"""Every verb as a newcomer meets it: help, tables, JSON, exit codes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from cadpose.annotations.store import Store
from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from tests.cli.invoking import cadpose, given, said
from tests.library.builders import write_sh3f
from tests.small_library import Shot, save, shoot

VERBS: tuple[list[str], ...] = (
    [],
    ["annotate"],
    ["detect"],
    ["evaluate"],
    ["evaluate", "rotation"],
    ["evaluate", "retrieval"],
    ["experiment"],
    ["experiment", "paper"],
    ["library"],
    ["library", "add"],
    ["library", "list"],
    ["library", "check"],
    ["library", "show"],
    ["library", "symmetry"],
    ["doctor"],
    ["bench"],
    ["synth"],
    ["blender"],
    ["blender", "setup"],
)


@pytest.fixture(scope="module")
def hatch(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))


@pytest.fixture
def photo(hatch: Shot, tmp_path: Path) -> Path:
    return save(tmp_path / "photos" / "street.png", hatch.photo.rgb)


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_help(verb: Sequence[str]) -> None:
    result = cadpose(*verb, "--help")
    assert result.exit_code == 0 and "Usage: " in result.stdout and not result.stderr
    assert " ".join(verb) in result.stdout


@pytest.mark.parametrize("verb", [[], ["evaluate"], ["library"], ["blender"], ["nonsense"], ["annotate"]])
def test_half_a_command_is_wrong_usage(verb: Sequence[str]) -> None:
    result = cadpose(*verb)
    assert result.exit_code == 2 and "Usage: " in result.output


def test_version() -> None:
    assert re.fullmatch(r"cadpose \d+\.\d+\.\d+\n", cadpose("--version").stdout)


# -- annotate --------------------------------------------------------------------------------------


def test_annotate_names_model_and_pose(
    small_library: Library, photo: Path, hatch: Shot, tmp_path: Path
) -> None:
    out, store = tmp_path / "out", tmp_path / "all.db"
    common = ["--library", small_library.path, "--out", out, *given(hatch)]
    result = cadpose("annotate", photo, *common, "--store", f"sqlite:///{store}")
    assert result.exit_code == 0 and result.stderr == ""
    assert "street.png" in result.stdout and "hatch" in result.stdout and "35° +12° +4°" in result.stdout
    assert str(out / "index.html") in result.stdout
    assert {p.name for p in out.iterdir()} == {
        "index.html",
        "report.html",
        "journal.jsonl",
        "thumbnails",
        *(f"street.{kind}" for kind in ("json", "overlay.png", "candidates.png", "card.html")),
    }
    with Store(f"sqlite:///{store}") as opened:
        assert [a.cad.name for a in opened.annotations()] == ["hatch"]

    (told,) = said(cadpose("annotate", photo, *common, "--resume", "--json"))
    assert told["photo"] == str(photo) and told["error"] is None and told["resumed"] is True
    assert told["document"] == str(out / "street.json") and told["failures"] == []
    (found,) = told["annotations"]
    assert found["cad"] == "made/car/hatch.obj" and found["category"] == "car"
    assert (found["azimuth"], found["elevation"], found["inplane"]) == pytest.approx((35, 12, 4))
    assert found["focal_px"] == pytest.approx(hatch.focal_px, rel=0.02)
    assert found["box_iou"] > 0.95 and found["mask_iou"] > 0.85


def test_a_whole_turn_is_told_as_none(
    small_library: Library, photo: Path, hatch: Shot, tmp_path: Path
) -> None:
    common = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch)[:4]]
    result = cadpose("annotate", photo, *common, "--rotation", "359.7,12,4")
    assert result.exit_code == 0 and " 0° +12° +4°" in result.stdout


def test_no_object_found_is_no_failure_and_says_so(small_library: Library, tmp_path: Path) -> None:
    """The real detector on a grey picture."""
    grey = tmp_path / "grey.png"
    Image.new("RGB", (320, 240), (128, 128, 128)).save(grey)
    arguments = [grey, "--library", small_library.path, "--out", tmp_path / "out"]
    result = cadpose("annotate", *arguments)
    assert result.exit_code == 0 and "no object found" in result.stdout and not result.stderr
    assert json.loads((tmp_path / "out" / "grey.json").read_text())["annotations"] == []
    (told,) = said(cadpose("annotate", *arguments, "--json"))
    assert told["annotations"] == told["failures"] == [] and told["error"] is None
    result = cadpose("detect", grey)
    assert result.exit_code == 0 and "no object found" in result.stdout
    assert said(cadpose("detect", grey, "--json")) == [
        {"photo": str(grey), "error": None, "picture": None, "detections": []}
    ]


def test_category_without_cad(small_library: Library, photo: Path, hatch: Shot, tmp_path: Path) -> None:
    arguments = ["annotate", photo, "--library", small_library.path, "--out", tmp_path / "out"]
    result = cadpose(*arguments, *given(hatch, "zebra"))
    assert result.exit_code == 1 and "left out" in result.stdout
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"cadpose: {photo}: zebra left out: the library has no CAD model of")
    result = cadpose(*arguments, "--category", "zebra")
    assert result.exit_code == 1 and "no CAD model of category 'zebra'" in result.stderr


def test_box_without_category_is_named_by_lite0(
    small_library: Library, photo: Path, hatch: Shot, tmp_path: Path
) -> None:
    box, rotation = given(hatch)[:2], given(hatch)[4:]
    result = cadpose(
        "annotate",
        photo,
        "--library",
        small_library.path,
        "--out",
        tmp_path / "out",
        *box,
        *rotation,
        "--json",
    )
    (told,) = said(result)
    named = [part["category"] for part in told["annotations"] + told["failures"]]
    assert len(named) == 1 and named[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--rotation", "1,2"], "--rotation belongs to --box"),
        (["--box", "1,2,3"], "x0,y0,x1,y1"),
        (["--box", "9,9,1,1"], "is empty"),
        (["--box", "0,0,9,9", "--rotation", "1,95"], "outside -90 to 90"),
        (["--box", "0,0,9,9", "--category", "car", "--category", "chair"], "given 2 times for 1 objects"),
        (["--polygon", "1,2 3,4"], "three or more corners"),
        (
            ["--polygon", "1,1 9,1 9,9", "--rotation", "1,2", "--rotation", "3,4"],
            "given 2 times for 1 objects",
        ),
        (["--mask", "m.png", "--detections", "x.json"], "not both"),
        (["--box", "0,0,9,9", "--detections", "x.json"], "not both"),
        (["--similarity", "nonsense"], "none of joint, aligned, fused"),
        (["--align", "nonsense"], "'box', 'paper', 'mask'"),
        (["--renderer", "nonsense"], "'raster'"),
        (["--device", "gpu"], "'cpu', 'cuda'"),
        (["--candidates", "0"], "equal to 1"),
        (["--seed", "-1"], "equal to 0"),
        (["--nonsense"], "No such option"),
    ],
)
def test_wrong_usage(arguments: list[str], says: str) -> None:
    result = cadpose("annotate", "photo.jpg", *arguments)
    assert result.exit_code == 2 and result.stdout == ""
    # Rich's frame breaks lines.
    assert says in re.sub(r"[\s│]+", " ", result.stderr)


# -- library ---------------------------------------------------------------------------------------


def test_library_add_list_check_show(model_files: Path, tmp_path: Path) -> None:
    library = tmp_path / "library"
    result = cadpose("library", "add", model_files, "--library", library)
    assert result.exit_code == 0 and result.stdout == (
        f"5 added, 0 updated, 0 unchanged, 0 failed, 0 mended: {library}\n"
    )
    told = said(cadpose("library", "add", model_files, "--library", library, "--json"))
    assert len(told["unchanged"]) == 5 and told["added"] == []

    told = said(cadpose("library", "list", "--library", library, "--json"))
    assert told == {"path": str(library), "models": 5, "categories": {"car": 3, "chair": 2}}
    told = said(cadpose("library", "list", "--category", "chair", "--library", library, "--json"))
    assert [model["id"] for model in told] == ["made/chair/plain.obj", "made/chair/throne.glb"]
    assert said(cadpose("library", "check", "--library", library, "--json"))["problems"] == []

    sheet = tmp_path / "sheet.png"
    for category in ([], ["chair"]):
        result = cadpose("library", "show", *category, "--library", library, "--out", sheet)
        assert result.exit_code == 0 and result.stdout == f"{sheet}\n"
        Image.open(sheet).load()
        sheet.unlink()

    next((library / "meshes").glob("*/*.npz")).unlink()
    result = cadpose("library", "check", "--library", library)
    assert result.exit_code == 1 and "is missing; add the model again" in result.stdout


@pytest.mark.parametrize("verb", ["list", "show"])
def test_library_without_that_category(small_library: Library, tmp_path: Path, verb: str) -> None:
    option = [] if verb == "show" else ["--category"]
    result = cadpose("library", verb, *option, "zebra", "--library", small_library.path)
    assert result.exit_code == 1 and "'zebra'" in result.stderr and not result.stdout


def test_tables_in_a_pipe_are_as_wide_as_they_need_and_names_are_plain_text(tmp_path: Path) -> None:
    name, box = "[/bold] a chair \x1b[31m with a name " + "x" * 90, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    path = tmp_path / "models.sh3f"
    write_sh3f(path, [{"name": name, "category": "Chair", "model": "/a.obj"}], {"a.obj": box})
    library = tmp_path / "library"
    assert cadpose("library", "add", path, "--library", library).exit_code == 0
    for width in ("40", "80"):
        result = cadpose(
            "library", "list", "--category", "chair", "--library", library, env={"COLUMNS": width}
        )
        assert result.exit_code == 0
        assert name.replace("\x1b", "?") in result.stdout
        assert "\x1b" not in result.stdout


# -- evaluate, bench, doctor -----------------------------------------------------------------------


@pytest.fixture
def labels(photo: Path, hatch: Shot) -> Callable[..., Path]:
    r = hatch.rotation
    label = {
        "photo": photo.name,
        "category": "car",
        "cad": "made/car/hatch.obj",
        "box": list(hatch.box.to_tuple()),
        "azimuth": r.azimuth,
        "elevation": r.elevation,
        "inplane": r.inplane,
    }

    def write(*changes: dict[str, Any]) -> Path:
        path = photo.parent / "labels.json"
        path.write_text(json.dumps([label | change for change in changes]))
        return path

    return write


def test_evaluate_when_nothing_can_be_evaluated(small_library: Library, labels: Callable[..., Path]) -> None:
    arguments = ["evaluate", "rotation", labels({"photo": "gone.png"}), "--library", small_library.path]
    result = cadpose(*arguments, "--json")
    table = said(result)
    assert result.exit_code == 1
    assert table["n"] == 0 and table["yield"] == 0.0
    assert table["mederr"] is None and table["classes"]["car"]["mederr"] is None
    assert "gone.png" in result.stderr and result.stderr.count("\n") == 1
    result = cadpose(*arguments)
    assert result.exit_code == 1 and " - " in result.stdout and "180" not in result.stdout


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read"),
        ("{", "is not valid JSON"),
        ("{}", "expected a JSON array"),
        ("[]", "holds no label"),
        ('[{"category": "car"}]', "entry 0 has no photo"),
        ('[{"photo": "a.png"}]', "entry 0 has no category"),
        ('[{"photo": "a.png", "category": "car", "box": [1, 2]}]', "entry 0"),
        ('[{"photo": "a.png", "category": "car", "azimuth": "left"}]', "azimuth must be a number"),
    ],
)
def test_label_files_that_cannot_be_used(
    small_library: Library, tmp_path: Path, content: str | None, says: str
) -> None:
    path = tmp_path / "labels.json"
    if content is not None:
        path.write_text(content)
    for verb in ("rotation", "retrieval"):
        result = cadpose("evaluate", verb, path, "--library", small_library.path)
        assert result.exit_code == 1 and not result.stdout
        assert str(path) in result.stderr and result.stderr.count("\n") == 1
    assert says in result.stderr


def test_doctor(small_library: Library, tmp_path: Path) -> None:
    result = cadpose("doctor", "--json", env={"CADPOSE_LIBRARY": str(small_library.path)})
    checks = {check["name"]: check for check in said(result)}
    assert result.exit_code == 0 and checks["CAD library"]["status"] == "ok"
    result = cadpose("doctor", env={"CADPOSE_LIBRARY": str(tmp_path)})
    assert result.exit_code == 1 and "cadpose library add" in result.stdout


def test_blender_that_is_not_set_up(small_library: Library, photo: Path, hatch: Shot, tmp_path: Path) -> None:
    arguments = ["--library", small_library.path, "--out", tmp_path / "out", "--renderer", "blender"]
    result = cadpose(
        "annotate", photo, *arguments, *given(hatch), env={"CADPOSE_BLENDER": str(tmp_path / "none")}
    )
    assert result.exit_code == 1 and "cadpose blender setup" in result.stderr
    assert result.stderr.count("\n") == 1
