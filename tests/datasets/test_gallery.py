from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cadpose.datasets.gallery import Gallery, read_gallery, write_gallery
from cadpose.errors import InputError


def write(folder: Path, content: object) -> Path:
    path = folder / "gallery.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_a_plain_list(tmp_path: Path) -> None:
    path = write(tmp_path, ["b", "a", "b"])
    assert read_gallery(path) == Gallery(path, ("b", "a"), {})


def test_lists_by_category_and_words_for_it(tmp_path: Path) -> None:
    path = write(tmp_path, {"Motorcycles": ["m", "m"], "motorbike": ["n"], "car": ["c"]})
    found = read_gallery(path)
    assert found.ids == ("m", "n", "c")
    assert found.category_of == {"m": "motorbike", "n": "motorbike", "c": "car"}


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "gallery.json"
    write_gallery(path, {"car": ("é", "b"), "chair": ("c",)})
    assert read_gallery(path) == Gallery(path, ("é", "b", "c"), {"é": "car", "b": "car", "c": "chair"})


@pytest.mark.parametrize(
    "wrong", [{}, [], ["a", 1], [""], "[", [["a"]], {"car": []}, {"car": "a"}, {"car": {"a": 1}}, 3]
)
def test_a_file_that_is_no_gallery(tmp_path: Path, wrong: object) -> None:
    with pytest.raises(InputError, match=r"gallery\.json") as caught:
        read_gallery(write(tmp_path, wrong))
    assert "\n" not in str(caught.value)


def test_a_model_of_two_categories(tmp_path: Path) -> None:
    path = write(tmp_path, {"car": ["a"], "truck": ["b", "a"]})
    with pytest.raises(InputError, match=re.escape(f"{path}: names a under car and under truck")):
        read_gallery(path)
