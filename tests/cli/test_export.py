"""`cadpose export` and `cadpose import`."""

from __future__ import annotations

import json
import shutil
import sqlite3
from pathlib import Path

import pytest

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.registry import FORMATS
from cadpose.annotations.store import Author, Selection, Store
from cadpose.library.catalogue import Library
from tests.annotations.formats.made import Made, make
from tests.cli.invoking import cadpose, one_sentence, said


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, small_library: Library) -> Made:
    return make(tmp_path_factory.mktemp("photos"), small_library)


@pytest.fixture
def documents(made: Made, tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    for number, document in enumerate(made.documents):
        (folder / f"{number}.json").write_text(document.to_json(), encoding="utf-8")
    (folder / "other.json").write_text("{}")
    (folder / ".hidden.json").write_text("x")
    return folder


def read(folder: Path) -> list[AnnotationDocument]:
    told = [AnnotationDocument.from_json(p.read_text(encoding="utf-8")) for p in folder.glob("*.json")]
    return sorted(told, key=lambda document: document.photo.sha256)


@pytest.mark.parametrize("name", FORMATS)
def test_there_and_back(made: Made, documents: Path, tmp_path: Path, name: str) -> None:
    out, again = tmp_path / "out", tmp_path / "again"
    needs = ["--photos", made.folder, "--library", made.library.path]
    result = cadpose("export", name, "--from", documents, "--out", out, *needs, "--json")
    assert said(result) == {"format": name, "annotations": 4, "out": str(out)}
    assert out.is_dir() == FORMATS[name].folder
    result = cadpose("import", name, out, "--out", again, "--json")
    assert said(result)["photos"] == len(read(again)) >= 3
    counts = {document.photo.sha256: len(document.annotations) for document in made.documents}
    assert all(len(document.annotations) == counts[document.photo.sha256] for document in read(again))


def test_from_a_store_into_a_store(made: Made, tmp_path: Path) -> None:
    first, second = (f"sqlite:///{tmp_path / name}.db" for name in ("first", "second"))
    with Store(first) as store:
        for document in made.documents:
            store.add(document)
    file = tmp_path / "coco.json"
    result = cadpose("export", "coco", "--store", first, "--out", file)
    assert result.stdout == f"4 annotations: {file}\n"
    assert said(cadpose("import", "coco", file, "--store", second, "--json"))["changed"] == 4
    assert cadpose("import", "coco", file, "--store", second).stdout.startswith("4 photos, 0 new or changed")
    assert said(cadpose("import", "coco", file, "--store", first, "--json"))["changed"] == 0
    with Store(second) as store:
        assert [store.document(d.photo.sha256) for d in made.documents] == list(made.documents)


def test_choices(documents: Path, tmp_path: Path) -> None:
    for options, count, photos in (
        (["--category", "chair"], 1, 1),
        (["--category", "Car"], 3, 2),
        (["--verdict", "review"], 2, 2),
        (["--verdict", "review", "--verdict", "reject", "--category", "car"], 2, 2),
    ):
        file = tmp_path / "coco.json"
        result = cadpose("export", "coco", "--from", documents, "--out", file, "--force", "--json", *options)
        assert said(result)["annotations"] == count
        assert len(json.loads(file.read_text())["images"]) == photos


def test_what_people_decided_is_what_a_store_gives(made: Made, tmp_path: Path) -> None:
    url, file = f"sqlite:///{tmp_path / 'a.db'}", tmp_path / "coco.json"

    def exported(*verdicts: str) -> int:
        options = [word for verdict in verdicts for word in ("--verdict", verdict)]
        result = cadpose("export", "coco", "--store", url, "--out", file, "--force", "--json", *options)
        return int(said(result)["annotations"]) if result.exit_code == 0 else 0

    with Store(url) as store:
        store.add_many(made.documents)
        assert exported() == 4  # what a program alone rejected is among them
        items = store.queue(Selection(verdicts=("review",))).items
        assert len(items) == exported("review") == 2 and exported("reject") == 1
        store.decide(items[0].annotation_id, "reject", Author("Anna"), expected_version=None)
        assert (exported(), exported("review"), exported("reject")) == (3, 1, 2)
        store.decide(items[1].annotation_id, "accept", Author("Anna"), expected_version=None)
        assert (exported("review"), exported("accept"), exported("accept", "reject")) == (0, 1, 3)
        assert exported("undecided") == 1 and exported("edit") == 0
        # Photos and failures stay, unless a verdict is asked for.
        assert exported() == 3 and len(json.loads(file.read_text())["images"]) == 4


def test_an_import_names_its_author(made: Made, tmp_path: Path) -> None:
    url, file = f"sqlite:///{tmp_path / 'a.db'}", tmp_path / "tasks.json"
    with Store(url) as store:
        store.add_many(made.documents)
        item = store.queue(Selection(verdicts=("review",))).items[0]
        store.decide(item.annotation_id, "accept", Author("Anna"), expected_version=None)
    assert cadpose("export", "label-studio", "--store", url, "--out", file).exit_code == 0
    tasks = json.loads(file.read_text())
    for task in tasks:
        for region in task["predictions"][0]["result"]:
            if region["type"] == "choices":
                region["value"]["choices"] = ["reject"]
    file.write_text(json.dumps(tasks))
    told = ("import", "label-studio", file)
    assert cadpose(*told, "--out", tmp_path / "x", "--author", "Ben").exit_code == 2
    assert cadpose(*told, "--store", url, "--author", " ").exit_code == 2
    result = cadpose(*told, "--store", url, "--author", "Ben", "--json")
    with Store(url) as store:
        rejected = store.queue(Selection(verdicts=("reject",), decided_by="human")).items
        by = {store.history(item.annotation_id)[-1].author for item in rejected}
        assert {(a.name, a.tool) for a in by} == {("Ben", "cadpose import label-studio")}
        assert list(store.check()) == []
    assert len(rejected) == 2 and result.stderr.count("a person's accept no longer holds") == 1


def test_an_export_only_reads_the_store(tmp_path: Path) -> None:
    empty, file = tmp_path / "empty.db", tmp_path / "coco.json"
    empty.touch()
    one_sentence(cadpose("export", "coco", "--store", f"sqlite:///{empty}", "--out", file), "holds no store")
    with sqlite3.connect(empty) as connection:
        assert connection.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
    connection.close()
    script = Path(__file__).parents[1] / "annotations/database/first_store.sql"
    old = tmp_path / "old.db"
    with sqlite3.connect(old) as connection:
        connection.executescript(script.read_text(encoding="utf-8"))
    connection.close()
    one_sentence(
        cadpose("export", "coco", "--store", f"sqlite:///{old}", "--out", file), "cadpose db migrate"
    )
    assert not list(tmp_path.glob("old.db.before*")) and not file.exists()


def test_photos_and_places(made: Made, documents: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    library = ["--library", made.library.path]
    told = ("export", "bop", "--from", documents, "--out", out, *library)
    one_sentence(cadpose(*told), "--photos")
    one_sentence(cadpose(*told, "--photos", tmp_path), "a/street.png", tmp_path)
    one_sentence(cadpose(*told, "--photos", made.folder, "--library", tmp_path), "no CAD library")
    assert not out.exists()
    out.mkdir()
    (out / "mine").write_text("x")
    one_sentence(cadpose(*told, "--photos", made.folder), out, "not empty", "--force")
    assert (out / "mine").read_text() == "x"
    assert cadpose(*told, "--photos", made.folder, "--force").exit_code == 0
    assert not (out / "mine").exists() and (out / "models").is_dir()
    for place in (documents, made.folder, made.folder.parent):
        result = cadpose(*told[:5], place, *library, "--photos", made.folder, "--force")
        one_sentence(result, "cannot be replaced")
    assert (made.folder / "a/street.png").is_file()
    other = tmp_path / "others" / "a"
    other.mkdir(parents=True)
    (other / "street.png").write_bytes((made.folder / "b/street.png").read_bytes())
    result = cadpose(*told, "--photos", tmp_path / "others", "--force")
    one_sentence(result, "SHA-256 differs")


@pytest.mark.parametrize("name", ["bop", "coco"])
def test_an_import_leaves_what_it_reads(made: Made, documents: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    out = folder / "export"
    needs = ["--photos", made.folder, "--library", made.library.path]
    assert cadpose("export", name, "--from", documents, "--out", out, *needs).exit_code == 0
    before = sorted(folder.rglob("*"))
    for place in {folder, out} - ({out} if out.is_file() else set()):
        one_sentence(cadpose("import", name, out, "--out", place, "--force"), "cannot be replaced")
    assert sorted(folder.rglob("*")) == before


def test_an_export_leaves_the_library_that_is_taken_unless_told(
    made: Made, documents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = tmp_path / "library"
    shutil.copytree(made.library.path, library)
    monkeypatch.setenv("CADPOSE_LIBRARY", str(library))
    told = ("export", "bop", "--from", documents, "--photos", made.folder, "--force", "--out")
    one_sentence(cadpose(*told, library), "cannot be replaced")
    assert Library.open(library).models("car")


def test_mistakes(documents: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    for words in (
        ("export", "coco", "--out", file),
        ("export", "coco", "--out", file, "--from", documents, "--store", "sqlite:///x.db"),
        ("export", "yolo", "--from", documents, "--out", file),
        ("import", "coco", file),
        ("export", "coco", "--from", documents, "--out", file, "--verdict", "good"),
        ("export", "coco", "--out", file, "--from", documents, "--verdict", "accept"),
    ):
        assert cadpose(*words).exit_code == 2
    (tmp_path / "empty").mkdir()
    one_sentence(cadpose("export", "coco", "--from", tmp_path / "empty", "--out", file), "no annotation doc")
    one_sentence(cadpose("export", "coco", "--from", tmp_path / "none", "--out", file), "no file or folder")
    none = f"sqlite:///{tmp_path}/none.db"
    one_sentence(cadpose("export", "coco", "--store", none, "--out", file), "there is no store")
    assert not (tmp_path / "none.db").exists()
    one_sentence(cadpose("export", "coco", "--store", "::", "--out", file), "is not a database URL")
    for url in ("postgresql//me:secret@host/a", "postgresql://me:secret@host:x/a"):
        for verb in (("export", "coco", "--out", str(file)), ("db", "stats")):
            result = cadpose(*verb, "--store", url)
            one_sentence(result, "is not a database URL")
            assert "secret" not in result.output
    one_sentence(cadpose("export", "coco", "--from", documents, "--out", tmp_path), "name a file")
    file.write_text("mine")
    one_sentence(cadpose("export", "coco", "--from", documents, "--out", file), "there already")
    one_sentence(cadpose("import", "coco", file, "--out", tmp_path / "x"), file, "is not a COCO file")
    own = documents / "0.json"
    one_sentence(cadpose("export", "coco", "--from", own, "--out", own, "--force"), "read by this export")
    (documents / "bad.json").write_text('{"schema": "cadpose.annotation/1"}')
    one_sentence(
        cadpose("export", "csv", "--from", documents, "--out", tmp_path / "x.csv"), "bad.json is not a valid"
    )
    assert not (tmp_path / "x.csv").exists()
