from __future__ import annotations

import json
import zipfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.library import folder as folder_module
from cadpose.library.assets import Archive
from cadpose.library.catalogue import Library
from cadpose.library.folder import folder_items
from cadpose.library.importers import add_path, find_items
from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.shapenet import shapenet_items
from cadpose.library.sweethome3d import DEBIAN_FOLDER, licence_name, parse_properties, sweethome3d_items

from .builders import SQUARE, obj_box, png, write_sh3f

# A wedge whose low edge is its front (+z), as in Sweet Home 3D.
WEDGE = (
    "v -1 0 2\nv 1 0 2\nv -1 0 -2\nv 1 0 -2\nv -1 1 -2\nv 1 1 -2\n"
    "f 1 2 4 3\nf 3 4 6 5\nf 1 5 6 2\nf 1 3 5\nf 2 6 4\n"
)


def chair(**more: str) -> dict[str, str]:
    plain = {"name": "Chair", "category": "Living room", "model": "/a/chair.obj", "creator": "Someone"}
    return plain | {"width": "40.0", "depth": "50", "height": "90"} | more


# -- Sweet Home 3D -----------------------------------------------------------------------------------


def test_sweet_home_entry(tmp_path: Path) -> None:
    file = tmp_path / "Test.sh3f"
    write_sh3f(file, [chair()], {"a/chair.obj": WEDGE.encode()}, license="Creative Commons Attribution 3.0")
    library = Library.create(tmp_path / "library")
    assert add_path(library, file).added == ("Test/a/chair.obj",)
    model = library.get("Test/a/chair.obj")
    assert (model.name, model.category, model.licence) == ("Chair", "chair", "CC-BY-3.0")
    assert (model.creator, model.size_cm, model.source) == (
        "Someone",
        (40.0, 50.0, 90.0),
        "sweethome3d:Test.sh3f",
    )
    mesh = library.mesh(model)
    # Front is -z: the low edge lies there, the high back at +z.
    high = mesh.vertices[mesh.vertices[:, 1] > 0]
    assert (high[:, 2] > 0.1).all()


def test_model_rotation_is_applied(tmp_path: Path) -> None:
    # The file has z up; this takes its z to y and its y to -z.
    lying = WEDGE.replace("v -1 0 2\nv 1 0 2\nv -1 0 -2\nv 1 0 -2\nv -1 1 -2\nv 1 1 -2\n", "")
    points = [(-1, -2, 0), (1, -2, 0), (-1, 2, 0), (1, 2, 0), (-1, 2, 1), (1, 2, 1)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in points) + lying
    files = {"a/chair.obj": text.encode(), "b/chair.obj": WEDGE.encode()}
    entries = [chair(modelRotation="1 0 0 0 0 1 0 -1 0"), chair(model="b/chair.obj")]
    write_sh3f(tmp_path / "T.sh3f", entries, files)
    library = Library.create(tmp_path / "library")
    add_path(library, tmp_path / "T.sh3f")
    turned, plain = (library.mesh(f"T/{k}/chair.obj").vertices for k in "ab")
    assert np.allclose(sorted(map(tuple, turned)), sorted(map(tuple, plain)), atol=1e-6)


def test_textures_come_out_of_the_archive(tmp_path: Path) -> None:
    mtl = b"newmtl paint\nmap_Kd Wood.PNG\n"
    files = {"a/square.obj": SQUARE.encode(), "a/square.mtl": mtl, "a/wood.png": png((1, 2, 3))}
    write_sh3f(tmp_path / "T.sh3f", [chair(model="/a/square.obj")], files)
    library = Library.create(tmp_path / "library")
    assert not add_path(library, tmp_path / "T.sh3f").warnings
    texture = library.mesh("T/a/square.obj").materials[0].texture
    assert texture is not None
    assert texture[0, 0].tolist() == [1, 2, 3]


def test_bad_entries_are_told_and_the_others_go_on(tmp_path: Path) -> None:
    entries = [
        chair(),
        chair(model="../../outside.obj"),
        chair(model="/a/none.obj"),
        chair(model="/a/model.dae"),
        chair(model="/a/bad.obj"),
        chair(model="/a/other.obj", modelRotation="1 0 0 0 1 0 0 0 9"),
    ]
    files = {"a/chair.obj": WEDGE.encode(), "a/model.dae": b"<x/>", "a/bad.obj": b"f 1 2 3\n"}
    write_sh3f(tmp_path / "T.sh3f", entries, files | {"a/other.obj": WEDGE.encode()})
    report = add_path(Library.create(tmp_path / "library"), tmp_path / "T.sh3f")
    assert report.added == ("T/a/chair.obj",)
    told = " | ".join(reason for _, reason in report.failed)
    assert len(report.failed) == 5
    for word in ("outside", "none.obj", "not an OBJ", "bad.obj", "modelRotation"):
        assert word in told


def test_a_mtl_that_leaves_the_archive_folder_is_refused(tmp_path: Path) -> None:
    files = {"square.obj": SQUARE.encode(), "square.mtl": b"newmtl paint\nmap_Kd ../../../etc/passwd\n"}
    write_sh3f(tmp_path / "T.sh3f", [chair(model="square.obj")], files)
    report = add_path(Library.create(tmp_path / "library"), tmp_path / "T.sh3f")
    assert "outside" in report.failed[0][1]


def test_archives_that_unpack_to_gigabytes_are_refused(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.sh3f"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a/chair.obj", b"\0" * (64 << 20))
    assert bomb.stat().st_size < 200_000
    with pytest.raises(InputError, match="unpacks to 64 MiB"):
        sweethome3d_items(bomb)
    with pytest.raises(InputError, match="would unpack to"):
        Archive(bomb, replace(DEFAULT_LIMITS, archive_bytes=1 << 20))
    with pytest.raises(InputError, match="more than the 0"):
        Archive(bomb, replace(DEFAULT_LIMITS, archive_entries=0))


def test_an_entry_larger_than_it_says_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "liar.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("a.obj", b"x" * 5000)
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"size|damaged|unpacked"):
        Archive(path).read("a.obj", 1 << 20)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut off"])
def test_no_archive(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.sh3f").write_bytes(content)
    with pytest.raises(InputError, match="cannot be opened"):
        sweethome3d_items(tmp_path / "x.sh3f")


def test_archive_without_catalogue_and_missing_files(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.sh3f", "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(InputError, match="no Sweet Home 3D library"):
        sweethome3d_items(tmp_path / "x.sh3f")
    with pytest.raises(InputError, match="does not exist"):
        sweethome3d_items(tmp_path / "none.sh3f")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"holds no \.sh3f"):
        sweethome3d_items(tmp_path / "empty")


def test_one_bad_archive_of_several(tmp_path: Path) -> None:
    (tmp_path / "a.sh3f").write_bytes(b"rubbish")
    write_sh3f(tmp_path / "b.sh3f", [chair()], {"a/chair.obj": WEDGE.encode()})
    problems: list[str] = []
    assert [i.id for i in sweethome3d_items(tmp_path, problems)] == ["b/a/chair.obj"]
    assert len(problems) == 1


def test_java_properties() -> None:
    text = "# no\n! no\na = b\nc\\ d:e=f\\u00e9\n  long=one \\\n   two\nempty=\nnone\npath=C\\:\\\\x\n"
    assert parse_properties(text) == {
        "a": "b",
        "c d": "e=fé",
        "long": "one two",
        "empty": "",
        "none": "",
        "path": "C:\\x",
    }


def test_licences() -> None:
    assert licence_name("Public domain") == "CC0-1.0"
    assert licence_name("Creative Commons Attribution 3.0 United States license (c)") == "CC-BY-3.0-US"
    assert licence_name("Creative Commons Attribution-ShareAlike 4.0") == "CC-BY-SA-4.0"
    assert licence_name("") == "unknown"


@pytest.fixture(scope="module")
def debian() -> Path:
    if not list(DEBIAN_FOLDER.glob("*.sh3f")):
        pytest.skip(f"needs Debian's sweethome3d-furniture: no .sh3f file in {DEBIAN_FOLDER}")
    return DEBIAN_FOLDER


def test_debian_package(debian: Path) -> None:
    problems: list[str] = []
    items = sweethome3d_items(debian, problems)
    assert not problems
    assert len(items) == len({i.id for i in items}) == 820
    counts: dict[str, int] = {}
    for item in items:
        counts[item.category] = counts.get(item.category, 0) + 1
        assert item.licence in ("CC0-1.0", "CC-BY-3.0", "CC-BY-3.0-US")
        assert item.creator
        assert item.size_cm
    expected = {"car": 13, "bus": 2, "chair": 66, "table": 49, "bed": 18, "sofa": 22, "person": 29}
    assert {k: counts[k] for k in expected} == expected


def test_bench_gallery_is_cars(debian: Path, bench: Path) -> None:
    cars = {i.id for i in sweethome3d_items(debian) if i.category == "car"}
    assert set(json.loads((bench / "bench/cars/gallery.json").read_text())) <= cars


# -- ShapeNet ----------------------------------------------------------------------------------------


def shapenet_tree(root: Path, version: int) -> Path:
    """Two chairs, a desk chair of a child synset, a sofa and a thing without a category."""
    synsets = {"03001627": ["aa", "bb"], "03179701": ["cc"], "04256520": ["dd"], "99999999": ["ee"]}
    for synset, models in synsets.items():
        for model in models:
            folder = root / synset / model
            (folder / "images").mkdir(parents=True)
            (folder / "images" / "texture0.png").write_bytes(png((7, 8, 9)))
            inner = folder / "models" if version == 2 else folder
            inner.mkdir(exist_ok=True)
            name = "model_normalized" if version == 2 else "model"
            (inner / f"{name}.obj").write_text(SQUARE.replace("square.mtl", f"{name}.mtl"))
            where = "../images" if version == 2 else "./images"
            (inner / f"{name}.mtl").write_text(f"newmtl paint\nmap_Kd {where}/texture0.png\n")
    taxonomy = [
        {"synsetId": "03001627", "name": "chair", "children": [], "numInstances": 2},
        {"synsetId": "04379243", "name": "table", "children": ["03179701"], "numInstances": 1},
        {"synsetId": "03179701", "name": "desk,writing desk", "children": [], "numInstances": 1},
    ]
    (root / "taxonomy.json").write_text(json.dumps(taxonomy))
    return root


@pytest.mark.parametrize("version", [1, 2])
def test_shapenet(tmp_path: Path, version: int) -> None:
    root = shapenet_tree(tmp_path / "ShapeNetCore", version)
    library = Library.create(tmp_path / "library")
    report = add_path(library, root)
    assert not report.failed
    assert not report.warnings
    assert library.categories() == {"chair": 2, "other": 1, "sofa": 1, "table": 1}
    model = library.get("ShapeNetCore/03179701/cc")
    assert (model.name, model.source) == ("desk cc", f"shapenet:v{version}")
    mesh = library.mesh(model)
    texture = mesh.materials[0].texture
    assert texture is not None
    assert texture[0, 0].tolist() == [7, 8, 9]
    # ShapeNet's axes are the library's: nothing is turned.
    assert mesh.bounds[1][:2] == pytest.approx([0.5**0.5 / 2] * 2, abs=1e-6)
    assert len(add_path(library, root).unchanged) == 5


def test_shapenet_choice(tmp_path: Path) -> None:
    root = shapenet_tree(tmp_path, 2)
    assert len(shapenet_items(root, limit=1)) == 4
    only = shapenet_items(root, categories=("chair", "sofa"), limit={"chair": 1})
    assert [i.id for i in only] == ["ShapeNetCore/03001627/aa", "ShapeNetCore/04256520/dd"]
    (root / "03001627" / "aa" / "models" / "model_normalized.obj").unlink()
    problems: list[str] = []
    assert len(shapenet_items(root, problems=problems)) == 4
    assert "aa" in problems[0]
    with pytest.raises(InputError, match="no ShapeNetCore model"):
        shapenet_items(root, categories=("car",))


@pytest.mark.parametrize("content", ["{", "[1]", '[{"name": 1}]'])
def test_damaged_taxonomy(tmp_path: Path, content: str) -> None:
    (tmp_path / "taxonomy.json").write_text(content)
    with pytest.raises(InputError, match="taxonomy"):
        shapenet_items(tmp_path)


def test_no_shapenet(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no ShapeNetCore"):
        shapenet_items(tmp_path)


# -- folders -----------------------------------------------------------------------------------------


def test_folder_with_table(tmp_path: Path) -> None:
    root = tmp_path / "mine"
    (root / "Couches").mkdir(parents=True)
    (root / "Couches" / "one.obj").write_text(obj_box(3, 1, 1))
    (root / "chair_agam.obj").write_text(obj_box(1, 2, 1))
    (root / "thing.obj").write_text(obj_box(1, 1, 4))
    (root / "notes.txt").write_text("not a mesh")
    (root / "models.csv").write_text(
        "file,name,category,front,up,license,creator\n"
        "thing.obj,The thing,stool,+x,+y,CC0-1.0,Me\n"
        "*,,,,,CC-BY-4.0,\n"
        "gone.obj,,,,,,\n../out.obj,,,,,,\n"
    )
    problems: list[str] = []
    items = {i.id: i for i in folder_items(root, problems=problems)}
    assert {k: i.category for k, i in items.items()} == {
        "mine/Couches/one.obj": "sofa",
        "mine/chair_agam.obj": "chair",
        "mine/thing.obj": "chair",
    }
    thing = items["mine/thing.obj"]
    assert (thing.name, thing.licence, thing.creator) == ("The thing", "CC0-1.0", "Me")
    assert items["mine/chair_agam.obj"].licence == "CC-BY-4.0"
    # Front +x: the file's x becomes -z.
    assert np.allclose(np.array(thing.R_s_from_file).reshape(3, 3) @ [1, 0, 0], [0, 0, -1])
    assert len(problems) == 2


def test_a_changed_material_or_texture_file_is_a_changed_model(tmp_path: Path) -> None:
    root = tmp_path / "mine"
    (root / "tex").mkdir(parents=True)
    (root / "bed").mkdir()
    material = "newmtl paint\nKd 1 0 0\n"
    (root / "chair.obj").write_text(SQUARE.replace("square.mtl", "mats.mtl"))
    (root / "mats.mtl").write_text(material)
    (root / "tex" / "wood.png").write_bytes(png((1, 2, 3)))
    (root / "gone.mtl").symlink_to(root / "nowhere.mtl")
    (root / "bed" / "bed.obj").write_text(obj_box(1, 1, 2))
    (root / "plain.stl").write_bytes(b"solid")

    def prints() -> dict[str, str]:
        return {i.id: i.fingerprint for i in folder_items(root)}

    library = Library.create(tmp_path / "library")
    library.add(folder_items(root)[:2])
    first = prints()
    assert prints() == first
    (root / "mats.mtl").write_text(material.replace("1 0 0", "0 0 1") + "\n")
    changed = prints()
    assert {k for k in first if changed[k] != first[k]} == {"mine/chair.obj"}
    report = library.add(folder_items(root)[:2])
    assert (report.updated, report.unchanged) == (("mine/chair.obj",), ("mine/bed/bed.obj",))
    assert library.mesh("mine/chair.obj").materials[0].rgba[:3] == (0.0, 0.0, 1.0)
    (root / "tex" / "wood.png").write_bytes(png((1, 2, 3), (9, 9)))
    assert prints()["mine/chair.obj"] != changed["mine/chair.obj"]
    # Neither the table nor hidden files are parts of a model, and where the folder lies changes nothing.
    before = prints()
    (root / "models.csv").write_text("file,name\n")
    (root / ".DS_Store").write_text("x")
    root.rename(tmp_path / "moved")
    assert [i.fingerprint for i in folder_items(tmp_path / "moved")] == list(before.values())


def test_side_files_are_capped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_module, "_MOST_SIDE_FILES", 3)
    for name in ("a.obj", "b.mtl", "c.mtl", "sub/d.png", "sub/e.png", "sub/more/f.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    told = folder_module._side_files(tmp_path).splitlines()
    assert [line.split(":")[0] for line in told] == ["./b.mtl", "./c.mtl", "sub/d.png"]


def test_folder_errors(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no mesh"):
        folder_items(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        find_items(tmp_path / "none")
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(InputError, match="no mesh file"):
        find_items(tmp_path / "a.txt")
    (tmp_path / "a.obj").write_text(WEDGE)
    (tmp_path / "models.csv").write_bytes(b"name\n\xff\xfe")
    with pytest.raises(InputError, match=r"models\.csv"):
        folder_items(tmp_path)
    (tmp_path / "models.csv").write_text("name,category\nx,y\n")
    with pytest.raises(InputError, match="column named file"):
        folder_items(tmp_path)
    (tmp_path / "models.csv").write_text("file,front\na.obj,sideways\n")
    problems: list[str] = []
    assert folder_items(tmp_path, problems=problems) == []
    assert "sideways" in problems[0]


def test_a_mesh_that_links_out_of_its_folder_is_told_and_the_others_go_on(tmp_path: Path) -> None:
    for name in ("store", "chairs", "chairs/kept"):
        (tmp_path / name).mkdir()
    (tmp_path / "store" / "abc.obj").write_text(WEDGE)
    (tmp_path / "chairs" / "kept" / "real.obj").write_text(WEDGE)
    (tmp_path / "chairs" / "out.obj").symlink_to(tmp_path / "store" / "abc.obj")
    (tmp_path / "chairs" / "within.obj").symlink_to(tmp_path / "chairs" / "kept" / "real.obj")
    report = add_path(Library.create(tmp_path / "library"), tmp_path / "chairs")
    assert report.added == ("chairs/kept/real.obj", "chairs/within.obj")
    ((name, reason),) = report.failed
    assert name == "chairs/out.obj"
    assert reason.startswith(f"{tmp_path / 'chairs' / 'out.obj'} is a link out of {tmp_path / 'chairs'}")


def test_single_file_and_choice(tmp_path: Path) -> None:
    (tmp_path / "sofa.obj").write_text(WEDGE)
    (tmp_path / "bed.obj").write_text(WEDGE)
    assert [i.category for i in find_items(tmp_path / "sofa.obj")] == ["sofa"]
    assert [i.category for i in find_items(tmp_path, categories=("bed",))] == ["bed"]
    assert [i.category for i in find_items(tmp_path, category="car", limit=1)] == ["car"]
    with pytest.raises(InputError, match="categories asked for"):
        find_items(tmp_path, categories=("car",))


def test_shared_models_are_found_by_their_names(bench: Path) -> None:
    counts = Counter(item.category for item in folder_items(bench / "cad" / "base_meshes_cc0"))
    assert counts.total() == 33
    known = {"bag": 1, "bench": 8, "bottle": 11, "chair": 5, "clock": 1, "microwave": 1, "table": 4}
    assert {k: counts[k] for k in known} == known
