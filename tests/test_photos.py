from __future__ import annotations

import hashlib
import logging
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from cadpose import photos
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.photos import crop_square, find_photos, read_photo


def gradient(height: int = 40, width: int = 60) -> NDArray[np.uint8]:
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x * 4, y * 6, np.full_like(x, 90)], axis=2).astype(np.uint8)


def bomb_png(width: int, height: int) -> bytes:
    """A header that claims width x height pixels, with hardly any data behind it."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(width + 1)))
        + chunk(b"IEND", b"")
    )


class TestReadPhoto:
    def test_plain_png_keeps_every_pixel_and_the_digest_of_the_file(self, tmp_path: Path) -> None:
        path = tmp_path / "a.png"
        Image.fromarray(gradient()).save(path)
        photo = read_photo(path)
        np.testing.assert_array_equal(photo.rgb, gradient())
        assert photo.name == str(path)
        assert photo.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
        assert photo.focal_35mm is None

    @pytest.mark.parametrize("orientation", range(1, 9))
    def test_exif_orientation_is_applied_once(self, tmp_path: Path, orientation: int) -> None:
        upright = gradient()
        # How a camera stores the upright picture under each orientation (EXIF 2.3, 4.6.4 A).
        stored = {
            1: upright,
            2: upright[:, ::-1],
            3: upright[::-1, ::-1],
            4: upright[::-1],
            5: upright.transpose(1, 0, 2),
            6: np.rot90(upright, 1),
            7: np.rot90(upright, 2).transpose(1, 0, 2),
            8: np.rot90(upright, -1),
        }[orientation]
        exif = Image.Exif()
        exif[274] = orientation
        for name in ("a.png", "a.jpg"):
            Image.fromarray(np.ascontiguousarray(stored)).save(tmp_path / name, exif=exif, quality=98)
            rgb = read_photo(tmp_path / name).rgb
            assert rgb.shape == upright.shape
            assert np.abs(rgb.astype(int) - upright).max() <= (0 if name == "a.png" else 12)

    def test_focal_length_in_35_mm_terms(self, tmp_path: Path) -> None:
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0xA405] = 28
        Image.fromarray(gradient()).save(tmp_path / "a.jpg", exif=exif)
        assert read_photo(tmp_path / "a.jpg").focal_35mm == 28.0

    def test_broken_exif_is_no_reason_to_refuse(self, tmp_path: Path) -> None:
        Image.fromarray(gradient()).save(tmp_path / "a.jpg", exif=b"Exif\x00\x00II*\x00\xff\xff\xff\xff")
        assert read_photo(tmp_path / "a.jpg").focal_35mm is None

    def test_grey_palette_cmyk_and_bilevel(self, tmp_path: Path) -> None:
        grey = gradient()[..., 0]
        Image.fromarray(grey).save(tmp_path / "l.png")
        np.testing.assert_array_equal(read_photo(tmp_path / "l.png").rgb, np.stack([grey] * 3, 2))
        flat = np.full((20, 30, 3), (200, 40, 90), np.uint8)
        Image.fromarray(flat).quantize(8).save(tmp_path / "p.png")
        np.testing.assert_array_equal(read_photo(tmp_path / "p.png").rgb, flat)
        Image.fromarray(flat).convert("CMYK").save(tmp_path / "c.jpg", quality=98)
        assert np.abs(read_photo(tmp_path / "c.jpg").rgb.astype(int) - flat).max() <= 4
        Image.fromarray(grey > 100).save(tmp_path / "b.png")
        np.testing.assert_array_equal(read_photo(tmp_path / "b.png").rgb[..., 1], (grey > 100) * 255)

    def test_sixteen_bits_are_scaled_not_cut(self, tmp_path: Path) -> None:
        deep = np.linspace(0, 65535, 600).reshape(20, 30).astype(np.uint16)
        for name in ("d.png", "d.tif"):
            Image.fromarray(deep).save(tmp_path / name)
            rgb = read_photo(tmp_path / name).rgb
            np.testing.assert_array_equal(rgb[..., 2], np.rint(deep / 257.0))

    def test_float_tiff(self, tmp_path: Path) -> None:
        Image.fromarray(np.full((4, 4), 0.5, np.float32)).save(tmp_path / "f.tif")
        assert (read_photo(tmp_path / "f.tif").rgb == 128).all()
        Image.fromarray(np.full((4, 4), np.nan, np.float32)).save(tmp_path / "n.tif")
        with pytest.raises(InputError, match=r"n\.tif"):
            read_photo(tmp_path / "n.tif")

    def test_transparency_shows_white(self, tmp_path: Path) -> None:
        rgba = np.zeros((4, 6, 4), np.uint8)
        rgba[:, 3:] = (10, 20, 30, 255)
        rgba[:, 2] = (0, 0, 0, 128)
        Image.fromarray(rgba).save(tmp_path / "a.png")
        rgb = read_photo(tmp_path / "a.png").rgb
        assert (rgb[:, :2] == 255).all() and (rgb[:, 3:] == (10, 20, 30)).all() and (rgb[:, 2] == 127).all()

    def test_animation_gives_its_first_frame_and_says_so(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        frames = [Image.fromarray(np.full((8, 8, 3), v, np.uint8)) for v in (250, 10)]
        for name in ("a.gif", "a.png", "a.webp"):
            caplog.clear()
            frames[0].save(tmp_path / name, save_all=True, append_images=frames[1:], lossless=True)
            with caplog.at_level(logging.WARNING):
                assert (read_photo(tmp_path / name).rgb > 240).all()
            assert name in caplog.text and "first" in caplog.text

    @pytest.mark.parametrize(
        ("name", "data", "told"),
        [
            ("empty.jpg", b"", "empty"),
            ("text.jpg", b"hello, I am not a photo", "not a photo"),
            ("400mp.png", bomb_png(20_000, 20_000), "limit of 50"),
            ("60mp.png", bomb_png(10_000, 6_000), "60 megapixels, more than the limit of 50"),
            ("script.eps", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "not a photo"),
        ],
    )
    def test_bad_files_get_one_sentence(self, tmp_path: Path, name: str, data: bytes, told: str) -> None:
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(InputError, match=told) as caught:
            read_photo(path)
        message = str(caught.value)
        assert str(path) in message and "\n" not in message and message.endswith(".")

    @pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "gif", "tif", "bmp"])
    def test_truncated(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a.{suffix}"
        noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
        Image.fromarray(noise).save(path)
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2])
        with pytest.raises(InputError, match=r"damaged|not a photo"):
            read_photo(path)

    @pytest.mark.filterwarnings("ignore")
    def test_flipped_bytes_never_escape_as_another_error(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(1)
        path = tmp_path / "a"
        for suffix in ("jpeg", "png", "webp", "gif", "tiff", "bmp", "ppm"):
            Image.fromarray(gradient(16, 16)).save(path, format=suffix)
            good = np.frombuffer(path.read_bytes(), np.uint8)
            for _ in range(40):
                bad = good.copy()
                bad[rng.integers(0, len(bad), 6)] = rng.integers(0, 256, 6)
                path.write_bytes(bad.tobytes())
                try:
                    read_photo(path)
                except InputError as error:
                    assert "\n" not in str(error)

    def test_missing_folder_and_too_many_bytes(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        with pytest.raises(InputError, match="there is no file"):
            read_photo(tmp_path / "none.jpg")
        with pytest.raises(InputError, match="is not a file"):
            read_photo(tmp_path)
        monkeypatch.setattr(photos, "MAX_BYTES", 100)
        (tmp_path / "big.jpg").write_bytes(bytes(101))
        with pytest.raises(InputError, match="limit"):
            read_photo(tmp_path / "big.jpg")


class TestFindPhotos:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        for name in ("img10.jpg", "img2.JPG", "b.png", "notes.txt", ".hidden.jpg", "deep/c.webp"):
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).touch()
        return tmp_path

    def names(self, paths: list[Path], folder: Path) -> list[str]:
        return [str(p.relative_to(folder)) for p in paths]

    def test_folder_in_natural_order(self, folder: Path) -> None:
        assert self.names(find_photos([str(folder)]), folder) == ["b.png", "img2.JPG", "img10.jpg"]
        assert "deep/c.webp" in self.names(find_photos([folder], recursive=True), folder)

    def test_glob_file_and_no_duplicates(self, folder: Path) -> None:
        found = find_photos([f"{folder}/img*", str(folder / "img2.JPG"), str(folder / "notes.txt")])
        assert self.names(found, folder) == ["img2.JPG", "img10.jpg", "notes.txt"]
        assert self.names(find_photos([f"{folder}/**/*.webp"]), folder) == ["deep/c.webp"]

    def test_brackets_in_an_existing_name(self, folder: Path) -> None:
        (folder / "x[1].jpg").touch()
        assert self.names(find_photos([folder / "x[1].jpg"]), folder) == ["x[1].jpg"]

    @pytest.mark.parametrize("arg", ["nothing.jpg", "*.bmp", "deep/empty"])
    def test_nothing_found(self, folder: Path, arg: str) -> None:
        (folder / "deep/empty").mkdir()
        with pytest.raises(InputError, match=r"[^\n]*\.$"):
            find_photos([folder / arg])
        with pytest.raises(InputError):
            find_photos([])


class TestCropSquare:
    def test_integer_box_at_scale_one_copies_pixels(self) -> None:
        image = np.random.default_rng(0).integers(0, 256, (50, 70, 3), dtype=np.uint8)
        crop = crop_square(image, Box(10, 20, 42, 36), size=32)
        np.testing.assert_array_equal(crop[8:24], image[20:36, 10:42])
        assert (crop[:8] == 255).all() and (crop[24:] == 255).all()

    def test_context_shows_the_photo_beside_the_box(self) -> None:
        image = np.random.default_rng(0).integers(0, 256, (50, 70, 3), dtype=np.uint8)
        crop = crop_square(image, Box(10, 20, 42, 36), size=32, context=True)
        np.testing.assert_array_equal(crop, image[12:44, 10:42])
        crop = crop_square(image, Box(10, 0, 42, 16), size=32, fill=7, context=True)
        assert (crop[:8] == 7).all()
        np.testing.assert_array_equal(crop[8:], image[:24, 10:42])

    def test_box_over_the_border_is_filled(self) -> None:
        crop = crop_square(np.zeros((40, 40, 3), np.uint8), Box(-20, 0, 20, 40), size=20)
        assert (crop[:, :10] == 255).all() and (crop[:, 10:] == 0).all()

    @settings(max_examples=40, deadline=None)
    @given(
        x0=st.floats(-7, 200),
        y0=st.floats(-7, 150),
        width=st.floats(8, 150),
        height=st.floats(8, 150),
        size=st.sampled_from([32, 64, 224]),
    )
    def test_sub_pixel_geometry(self, x0: float, y0: float, width: float, height: float, size: int) -> None:
        """A linear ramp, resampled anyhow, is the same ramp: each output pixel tells where it looked."""
        box = Box(x0, y0, x0 + width, y0 + height)
        y, x = np.mgrid[0:200, 0:240] + 0.5
        ramp = np.stack([x, y, np.full_like(x, 77)], 2).astype(np.uint8)  # values are floor(position)
        side = max(width, height)
        crop = crop_square(ramp, box, size=size).astype(float)
        (cx, cy), centre = box.centre, (np.arange(size) + 0.5 - size / 2) * side / size
        u, v = np.meshgrid(cx + centre, cy + centre)
        reach = max(side / size, 1.0) * 2 + 1  # away from the box's and the photo's borders
        inside = (u > max(box.x0, 0) + reach) & (u < min(box.x1, 240) - reach)
        inside &= (v > max(box.y0, 0) + reach) & (v < min(box.y1, 200) - reach)
        if inside.any():
            assert np.abs(crop[..., 0] - (u - 0.5))[inside].max() <= 1.0
            assert np.abs(crop[..., 1] - (v - 0.5))[inside].max() <= 1.0
        outside = (u < max(box.x0, 0) - side / size) | (v > min(box.y1, 200) + side / size)
        assert (crop[outside] == 255).all()

    def test_shrinking_averages(self) -> None:
        y, x = np.mgrid[0:512, 0:512]
        board = np.repeat((((x + y) % 2) * 255).astype(np.uint8)[..., None], 3, axis=2)
        crop = crop_square(board, Box(0, 0, 512, 512), size=64)
        assert np.abs(crop.astype(int) - 127).max() <= 2

    def test_mask_keeps_its_share_of_the_area_and_matches_the_picture(self) -> None:
        y, x = np.mgrid[0:300, 0:400] + 0.5
        disc = np.hypot(x - 210.3, y - 140.8) < 90
        box = Box(210.3 - 90, 140.8 - 90, 210.3 + 90, 140.8 + 90)
        crop = crop_square(disc, box, size=224)
        assert crop.dtype == np.bool_
        assert crop.mean() == pytest.approx(np.pi / 4, abs=0.01)
        picture = crop_square(np.repeat(disc[..., None] * np.uint8(255), 3, axis=2), box, 224, fill=0)
        assert ((picture[..., 0] >= 128) != crop).mean() < 0.002

    def test_agrees_with_a_framing_camera(self) -> None:
        """Points of an object, seen in the photo and in the framed image, fall on the same places."""
        rng = np.random.default_rng(3)
        points = rng.uniform(-0.4, 0.4, (60, 3))
        R = rotation_from_angles(35.0, 20.0, 5.0)[None]
        scene = Cameras.from_rotations(R, focal_px=500.0, width=640, height=480, principal_px=(300.2, 250.7))
        seen = scene.project(points)[0]
        box = Box(*seen.min(axis=0), *seen.max(axis=0))
        framed = Cameras.framing(R, points, size=224).project(points)[0]
        inner = [i for i in range(60) if (abs(framed[i] - 112) < 95).all()][:4]
        assert len(inner) == 4
        y, x = np.mgrid[0:480, 0:640] + 0.5
        v, u = np.mgrid[0:224, 0:224] + 0.5
        for i in inner:  # one blob at a time, found again by its middle
            blob = np.exp(-((x - seen[i, 0]) ** 2 + (y - seen[i, 1]) ** 2) / 8.0) * 255
            photo = np.repeat(blob[..., None], 3, axis=2).astype(np.uint8)
            crop = crop_square(photo, box, 224, fill=0, context=True)[..., 0].astype(float)
            middle = np.array([(u * crop).sum(), (v * crop).sum()]) / crop.sum()
            np.testing.assert_allclose(middle, framed[i], atol=0.06)

    def test_refuses_boxes_it_cannot_cut(self) -> None:
        image = np.zeros((20, 20, 3), np.uint8)
        with pytest.raises(ValueError, match="outside"):
            crop_square(image, Box(30, 30, 40, 40))
        with pytest.raises(ValueError, match="far larger"):
            crop_square(image, Box(-1e9, -1e9, 1e9, 1e9))

    def test_sliver(self) -> None:
        crop = crop_square(np.zeros((20, 3000, 3), np.uint8), Box(0, 10, 3000, 10.5), size=64)
        assert crop.shape == (64, 64, 3) and crop.min() >= 240
