from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.photos import crop_square
from cadpose.rendering.raster import Rasteriser
from cadpose.rendering.scene import build_scene
from cadpose.training.lite.augment import NOTHING, Augmentation, crops, flawed
from cadpose.training.lite.objective import Targets
from cadpose.training.synth.records import SynthObject
from cadpose.training.synth.views import camera_on
from tests.training.synth.making import PLAIN, generator_of

Silhouette = NDArray[np.bool_]


def silhouettes(library: Library, count: int) -> list[SynthObject]:
    generator = generator_of(library, **PLAIN, fill=(0.5, 0.6))
    return [generator.photo(i).objects[0] for i in range(count)]


def cut(found: SynthObject, options: Augmentation, seed: int) -> tuple[Silhouette, NDArray[np.float64]]:
    """Silhouette in the crop of a wide box, and the angles told for it."""
    photo = np.where(found.mask, 0, 255).astype(np.uint8)
    box = torch.tensor([found.box.to_tuple()])
    middle, reach = (box[:, :2] + box[:, 2:]) / 2, 0.85 * (box[:, 2:] - box[:, :2]).amax()
    wide = torch.cat([middle - reach, middle + reach], dim=1)
    r = found.rotation
    targets = Targets(torch.tensor([[r.azimuth, r.elevation, r.inplane]]), torch.tensor([1]))
    photos = torch.from_numpy(np.tile(photo, (1, 3, 1, 1)))
    # A box that reaches beyond the photo would be cut; that of what is seen is taken as it is.
    options = replace(options, visible_box=1.0, context=1.0)
    picture, told = crops(photos, wide, wide, targets, options, torch.Generator().manual_seed(seed))
    return picture[0, 0].numpy() < 128, told.angles[0].double().numpy()


def drawn(library: Library, found: SynthObject, angles: NDArray[np.float64], like: Silhouette) -> Silhouette:
    """The model at these angles, where and as large as the other silhouette."""
    scene, box = build_scene(library.mesh(found.cad)), Box.from_mask(like)
    camera, _ = camera_on(
        rotation_from_angles(*angles),
        scene.coordinates,
        longer_px=max(box.width, box.height),
        centre_px=((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2),
        t_z=found.t_z,
        size=224,
    )
    mask: Silhouette = Rasteriser().render(library.mesh(found.cad), camera).mask[0]
    return mask


def iou(a: Silhouette, b: Silhouette) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_the_label_follows_mirror_and_turn(small_library: Library) -> None:
    changes = replace(NOTHING, flip=0.5, turn=1.0, turn_degrees=35.0)
    kept, were = [], []
    for i, found in enumerate(silhouettes(small_library, 10)):
        seen, angles = cut(found, changes, seed=i)
        assert not (seen[0] | seen[-1] | seen[:, 0] | seen[:, -1]).any()
        kept.append(iou(seen, drawn(small_library, found, angles, seen)))
        r = found.rotation
        old = np.array([r.azimuth, r.elevation, r.inplane])
        were.append(iou(seen, drawn(small_library, found, old, seen)))
        assert angles[1] == np.float32(r.elevation)
    assert min(kept) > 0.93, kept
    assert np.mean(were) < 0.8, were


def test_mirrored_and_not(small_library: Library) -> None:
    (found,) = silhouettes(small_library, 1)
    plain, was = cut(found, NOTHING, 0)
    mirrored, now = cut(found, replace(NOTHING, flip=1.0), 0)
    assert iou(plain[:, ::-1], mirrored) > 0.97
    np.testing.assert_allclose(now, was * (-1, 1, -1), atol=1e-4)


def test_without_changes_the_crop_is_the_pipelines() -> None:
    rng = np.random.default_rng(2)
    small = rng.integers(0, 255, (12, 12, 3)).astype(np.float32)
    photo = np.kron(small, np.ones((10, 10, 1), np.float32)).astype(np.uint8)
    box = Box(20.0, 30.0, 90.0, 84.0)
    rect = torch.tensor([box.to_tuple()])
    targets = Targets(torch.tensor([[10.0, 20.0, 30.0]]), torch.tensor([1]))
    picture, told = crops(
        torch.from_numpy(photo.transpose(2, 0, 1)[None].copy()),
        rect, rect, targets, NOTHING, torch.Generator().manual_seed(0),
    )  # fmt: skip
    expected = crop_square(photo, box).transpose(2, 0, 1).astype(np.float64)
    apart = np.abs(picture[0].numpy() - expected)
    # Cubic there, linear here: they differ at edges only, and nowhere in what is white beside the box.
    assert np.median(apart) < 1.0 and apart.mean() < 6.0
    assert np.array_equal(picture[0].numpy()[:, :20], np.full((3, 20, 224), 255.0))
    assert torch.equal(told.angles, targets.angles)


def test_flaws_keep_shape_and_range_and_depend_on_the_seed_alone() -> None:
    picture = torch.rand((6, 3, 64, 64), generator=torch.Generator().manual_seed(1)) * 255
    every = Augmentation(small=1.0, blur=1.0, noise=1.0, erase=1.0, grey=0.5)
    one, again, other = (flawed(picture, every, torch.Generator().manual_seed(s)) for s in (5, 5, 6))
    assert one.shape == picture.shape and float(one.min()) >= 0 and float(one.max()) <= 255
    assert torch.equal(one, again) and not torch.equal(one, other)
    assert torch.equal(flawed(picture, NOTHING, torch.Generator().manual_seed(5)), picture)
