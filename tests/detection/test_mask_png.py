from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cadpose.detection import mask_png, reading
from cadpose.detection.mask_png import read_masks
from cadpose.errors import InputError
from cadpose.records import Photo

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8), name="img_1.jpg")


def ids() -> NDArray[np.uint8]:
    made = np.zeros((40, 60), np.uint8)
    made[5:20, 10:30] = 1
    made[20:35, 30:50] = 2
    return made


def saved(tmp_path: Path, pixels: NDArray[Any], mode: str | None = None) -> Path:
    path = tmp_path / "img_1.png"
    image = Image.fromarray(pixels)
    if mode == "P":
        image = Image.fromarray(pixels, "L").convert("P")
        image.putpalette([v for i in range(256) for v in (i * 7 % 256, i * 11 % 256, 255 - i)])
        # Convert keeps grey levels as indices, but be sure of it.
        assert (np.asarray(image) == pixels).all()
    image.save(path)
    return path


@pytest.mark.parametrize("value", [1, 128, 255])
def test_one_value_is_one_object(tmp_path: Path, value: int) -> None:
    truth = ids() > 0
    for pixels in (truth.astype(np.uint8) * value, truth, truth.astype(np.uint16) * (value * 256)):
        (mask,) = read_masks(saved(tmp_path, pixels), PHOTO)
        np.testing.assert_array_equal(mask, truth)


def test_values_are_objects_in_grey_16_bits_palette_and_grey_as_colour(tmp_path: Path) -> None:
    shapes: list[tuple[NDArray[Any], str | None]] = [
        (ids(), None),
        (ids().astype(np.uint16) * 300, None),
        (ids(), "P"),
        (np.repeat(ids()[..., None], 3, axis=2), None),
        (np.dstack([ids(), ids(), ids(), np.full_like(ids(), 255)]), None),
    ]
    for pixels, mode in shapes:
        masks = read_masks(saved(tmp_path, pixels, mode), PHOTO)
        assert len(masks) == 2
        for number, mask in enumerate(masks, start=1):
            assert mask.dtype == np.bool_
            np.testing.assert_array_equal(mask, ids() == number)


def test_background_alone_is_no_object(tmp_path: Path) -> None:
    assert read_masks(saved(tmp_path, np.zeros((40, 60), np.uint8)), PHOTO) == []


def test_the_void_of_a_palette_image_is_no_object(tmp_path: Path) -> None:
    pixels = ids()
    pixels[0] = 255
    assert len(read_masks(saved(tmp_path, pixels, "P"), PHOTO)) == 2
    assert len(read_masks(saved(tmp_path, pixels), PHOTO)) == 3
    alone = np.where(ids() > 0, 255, 0).astype(np.uint8)
    assert len(read_masks(saved(tmp_path, alone, "P"), PHOTO)) == 1


def soft() -> NDArray[np.uint8]:
    return np.tile(np.linspace(0, 255, 60).astype(np.uint8), (40, 1))


@pytest.mark.parametrize(
    ("pixels", "told"),
    [
        (np.zeros((60, 40), np.uint8), "40 x 60 pixels but img_1.jpg has 60 x 40"),
        (np.dstack([ids(), ids(), ids() * 0]), "in colour"),
        (np.dstack([ids()] * 4), "transparent"),
        (soft(), "soft edges"),
        (np.arange(2400, dtype=np.uint16).reshape(40, 60), "2399 values"),
    ],
)
def test_what_is_no_mask_gets_one_sentence(tmp_path: Path, pixels: NDArray[Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        read_masks(saved(tmp_path, pixels), PHOTO)
    assert "img_1.png" in str(caught.value) and "\n" not in str(caught.value)


def bomb() -> bytes:
    """A PNG of 50000 x 50000 pixels in a few bytes."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", 50_000, 50_000, 8, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0")) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def jpeg() -> bytes:
    out = io.BytesIO()
    Image.fromarray(ids()).save(out, "JPEG")
    return out.getvalue()


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"no picture", jpeg(), bomb()])
def test_files_that_are_no_png(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "img_1.png"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"img_1\.png") as caught:
        read_masks(path, PHOTO)
    assert "\n" not in str(caught.value)


def test_cut_short_missing_and_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    path = saved(tmp_path, rng.integers(0, 2, (40, 60)).astype(np.uint8))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="damaged"):
        read_masks(path, PHOTO)
    with pytest.raises(InputError, match="cannot be read"):
        read_masks(tmp_path / "none.png", PHOTO)
    with pytest.raises(InputError, match="cannot be read"):
        read_masks(tmp_path, PHOTO)
    path = saved(tmp_path, ids())
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 60 * 40)
    with pytest.raises(InputError, match="2 masks"):
        read_masks(path, PHOTO)
    monkeypatch.setattr(mask_png, "MAX_BYTES", 10)
    with pytest.raises(InputError, match="limit"):
        read_masks(path, PHOTO)
