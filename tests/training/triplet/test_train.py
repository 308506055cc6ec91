from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch

from cadpose.datasets.labels import mask_in_photo, object_in_photo
from cadpose.errors import InputError, LibraryError
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.photos import crop_square
from cadpose.records import Views
from cadpose.rendering.raster import Rasteriser
from cadpose.similarity.triplet import TripletMeasure
from cadpose.training.checkpoints import read_checkpoint
from cadpose.training.triplet import train as module
from cadpose.training.triplet.data import Pictures, Shown, shown, training_examples
from cadpose.training.triplet.export import export_onnx
from cadpose.training.triplet.network import TwoEncoders
from cadpose.training.triplet.options import TripletOptions, TripletReport
from cadpose.training.triplet.train import photo_losses, train
from cadpose.training.triplet.validate import candidates, validate
from tests.training.triplet.made import TINY, write_photos

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def labels(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_photos(small_library, tmp_path_factory.mktemp("photos"))


@pytest.fixture(scope="module")
def library(small_library: Library) -> Library:
    return Library.open(small_library.path)


def run(labels: Path, library: Library, out: Path, **told: Any) -> TripletReport:
    options: dict[str, Any] = {"data": labels, "library": library.path, "out": out, "init": "random"}
    options |= {"workers": 2, "mining": True} | told
    return train(TripletOptions(**options), lambda done, total: None, TINY)


@pytest.fixture(scope="module")
def whole(labels: Path, library: Library, tmp_path_factory: pytest.TempPathFactory) -> TripletReport:
    return run(labels, library, tmp_path_factory.mktemp("whole"), validation=labels)


def network_of(report: TripletReport) -> TwoEncoders:
    network, content = TwoEncoders(TINY.width), read_checkpoint(report.checkpoint)
    network.photo.load_state_dict(content["photo"])
    network.render.load_state_dict(content["render"])
    return network.eval()


def test_what_a_training_leaves(whole: TripletReport) -> None:
    rows = [json.loads(line) for line in whole.curves.read_text().splitlines()]
    assert rows == whole.epochs and [row["epoch"] for row in rows] == [1, 2, 3]
    for row in rows:
        assert 0 < row["loss"] < 2 and 0 <= row["violations"] <= 1 and row["rate"] == TINY.rate
    assert (whole.initial, whole.photos, whole.unmasked) == ("random", 5, 0)
    assert whole.validation is not None and whole.validation["n"] == 5
    assert rows[-1]["val_top1"] == whole.validation["top1"] and rows[-1]["val_top3"] == 1.0
    assert set(whole.validation["classes"]) == {"car", "chair"}
    assert whole.difference <= 1e-4
    assert sorted(path.name for path in whole.network.parent.iterdir()) == [
        "checkpoint.pt", "curves.jsonl", "triplet.onnx",
    ]  # fmt: skip


def test_the_same_seed_gives_the_same_curve_and_another_does_not(
    labels: Path, library: Library, whole: TripletReport, tmp_path: Path
) -> None:
    again = run(labels, library, tmp_path / "again", epochs=1, workers=1, validation=labels)
    assert again.epochs == whole.epochs[:1]
    other = run(labels, library, tmp_path / "other", epochs=1, seed=1)
    assert other.epochs[0]["loss"] != again.epochs[0]["loss"]


def test_resumed_equals_uninterrupted(
    labels: Path, library: Library, whole: TripletReport, tmp_path: Path
) -> None:
    run(labels, library, tmp_path, epochs=1, validation=labels)
    # The weights to start from are not looked at again, nor told otherwise.
    resumed = run(labels, library, tmp_path, resume=True, validation=labels, init="none.pth")
    assert resumed.epochs == whole.epochs and resumed.initial == "random"
    a, b = read_checkpoint(resumed.checkpoint), read_checkpoint(whole.checkpoint)
    assert a["kept"] == b["kept"]
    for part in ("photo", "render"):
        assert all(torch.equal(value, b[part][key]) for key, value in a[part].items())
    assert resumed.network.read_bytes() == whole.network.read_bytes()
    done = run(labels, library, tmp_path, resume=True, validation=labels)  # nothing is left to do
    assert done.epochs == whole.epochs and done.validation == resumed.validation


def test_interrupted_within_an_epoch(
    labels: Path, library: Library, whole: TripletReport, tmp_path: Path
) -> None:
    def stop(done: int, total: int) -> None:
        assert total == 9  # five photos, two a step, three epochs
        if done == 5:
            raise KeyboardInterrupt

    options = TripletOptions(
        data=labels, out=tmp_path, library=library.path, validation=labels, init="random", mining=True
    )
    with pytest.raises(KeyboardInterrupt):
        train(options, stop, TINY)
    assert len((tmp_path / "curves.jsonl").read_text().splitlines()) == 1
    assert run(labels, library, tmp_path, resume=True, validation=labels).epochs == whole.epochs


def test_what_cannot_be_resumed_or_overwritten(
    labels: Path, library: Library, whole: TripletReport, tmp_path: Path
) -> None:
    out = whole.checkpoint.parent
    with pytest.raises(InputError, match="--resume"):
        run(labels, library, out)
    with pytest.raises(InputError, match="leave out --resume"):
        run(labels, library, tmp_path / "none", resume=True)
    with pytest.raises(InputError, match="other mining, seed"):
        run(labels, library, out, resume=True, seed=9, mining=False)
    with pytest.raises(InputError, match="other data"):
        run(write_photos(library, tmp_path / "more", 2), library, out, resume=True)
    content = read_checkpoint(whole.checkpoint)
    damages: tuple[dict[str, Any], ...] = (
        {"kept": [[9]] * 5}, {"kept": [1] * 5}, {"kept": None}, {"initial": 3}, {"optimiser": {}},
    )  # fmt: skip
    for wrong in damages:
        torch.save(content | wrong, tmp_path / "checkpoint.pt")
        with pytest.raises(InputError, match="damaged"):
            run(labels, library, tmp_path, resume=True)
    del content["render"]["features.0.bias"]
    torch.save(content, tmp_path / "checkpoint.pt")
    with pytest.raises(InputError, match=r"no features\.0\.bias"):
        run(labels, library, tmp_path, resume=True)


def test_mining_brings_the_nearest_negatives_back(
    labels: Path, library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[list[list[int]]] = []
    near: list[dict[int, list[int]]] = []
    real_epoch = module._epoch

    def watched(examples: Any, order: Any, negatives: Any, *rest: Any) -> Iterator[Shown]:
        drawn.append([list(own) for own in negatives])
        return shown(examples, order, negatives, *rest)

    def epoch(*told: Any) -> Any:
        row, found = real_epoch(*told)
        near.append(found)
        return row, found

    monkeypatch.setattr(module, "shown", watched)
    monkeypatch.setattr(module, "_epoch", epoch)
    run(labels, library, tmp_path / "mined")
    models = library.models()
    examples = training_examples(labels, library)
    for negatives in drawn:
        for example, own in zip(examples, negatives, strict=True):
            assert len(set(own)) == 3 and example.cad not in [models[i] for i in own]
    for before, after, found in zip(drawn, drawn[1:], near, strict=False):
        for i in range(5):
            assert len(found[i]) == 2 and set(found[i]) <= set(before[i]) and after[i][:2] == found[i]
    del drawn[:], near[:]
    run(labels, library, tmp_path / "plain", mining=False)
    assert any(drawn[1][i][:2] != near[0][i] for i in range(5))


def test_the_nearest_are_those_of_smallest_distance(labels: Path, library: Library) -> None:
    torch.manual_seed(2)
    network = TwoEncoders(TINY.width)
    pictures = Pictures(library, Rasteriser(), TINY.framing)
    examples, models = training_examples(labels, library), library.models()
    negatives = [[(i + 3) % 5, (i + 1) % 5, (i + 4) % 5, (i + 2) % 5] for i in range(5)]
    photos = list(shown(examples, range(5), negatives, models, pictures, 2))
    still = torch.optim.SGD(network.parameters(), 0.0)
    row, near = module._epoch(network, still, iter(photos), TINY, 2, lambda done, total: None, 0, 3)
    losses = []
    for photo in photos:
        loss, apart = photo_losses(network, photo, TINY.margin)
        losses.append(loss.detach())
        far = dict(zip(photo.models, apart[1:].tolist(), strict=True))
        assert near[photo.index] == sorted(far, key=far.__getitem__)[: TINY.mined]
    assert row["loss"] == pytest.approx(float(torch.cat(losses).mean()), rel=1e-5)


def test_it_learns_a_small_set_by_heart(labels: Path, library: Library) -> None:
    torch.manual_seed(0)
    network = TwoEncoders(TINY.width)
    pictures = Pictures(library, Rasteriser(), TINY.framing)
    examples, models = training_examples(labels, library), library.models()
    negatives = [[j for j in range(5) if models[j].id != x.cad.id] for x in examples]
    photos = list(shown(examples, range(5), negatives, models, pictures, 2))
    optimiser = torch.optim.SGD(network.parameters(), TINY.rate, momentum=TINY.momentum)
    losses = []
    for _ in range(40):
        optimiser.zero_grad()
        loss = torch.cat([photo_losses(network, photo, TINY.margin)[0] for photo in photos]).mean()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.25 * losses[0]
    for photo in photos:
        _, apart = photo_losses(network, photo, TINY.margin)
        assert apart.argmin() == 0
    assert validate(network, examples, pictures, 2)["top1"] == 1.0


def test_frozen_blocks_stay_as_they_were(labels: Path, library: Library, tmp_path: Path) -> None:
    few = run(labels, library, tmp_path, trained_blocks=1, epochs=1)
    torch.manual_seed(0)
    start, end = TwoEncoders(TINY.width).state_dict(), network_of(few).state_dict()
    for key, value in end.items():
        assert torch.equal(value, start[key]) == (int(key.split(".")[2]) < 24), key


def test_a_network_that_answers_everything_alike_is_no_good_one(labels: Path, library: Library) -> None:
    network = TwoEncoders(2)
    with torch.no_grad():
        for encoder in (network.photo, network.render):
            for name, parameter in encoder.named_parameters():
                parameter.copy_(torch.zeros_like(parameter) + ("bias" in name))
    examples = training_examples(labels, library)
    table = validate(network, examples, Pictures(library, Rasteriser(), TINY.framing), 2)
    assert table["top1"] == 0.0
    # Three cars, two chairs.
    assert table["chance"] == pytest.approx((3 / 3 + 2 / 2) / 5)
    assert table["classes"]["car"]["n"] == 3 and table["classes"]["car"]["top3"] == 1.0


def test_candidates_hold_the_true_model_once(library: Library) -> None:
    for cad in library.models():
        pool = candidates(library, cad)
        assert pool[0] == cad and len({m.id for m in pool}) == len(pool)
        assert {m.category for m in pool} == {cad.category}


def test_the_exported_network_is_torchs(whole: TripletReport, tmp_path: Path) -> None:
    network = network_of(whole)
    network.train()
    assert export_onnx(network, TINY.framing, tmp_path / "a.onnx") <= 1e-4
    assert network.training
    assert (tmp_path / "a.onnx").read_bytes() == whole.network.read_bytes()
    session = onnxruntime.InferenceSession(str(tmp_path / "a.onnx"))
    rng = np.random.default_rng(3)
    images = [rng.integers(0, 256, (n, 48, 48, 3), np.uint8) for n in (2, 5)]
    found = session.run(None, {"photos": images[0], "renders": images[1]})
    with torch.no_grad():
        wanted = network(*(torch.from_numpy(x) for x in images))
    for a, b in zip(found, wanted, strict=True):
        np.testing.assert_allclose(a, b.numpy(), atol=1e-4)


def test_the_measure_sees_what_the_training_saw(whole: TripletReport, labels: Path, library: Library) -> None:
    """The pipeline's crops, masks and renders give the distances that the network was trained on."""
    network, renderer = network_of(whole), Rasteriser()
    examples, models = training_examples(labels, library), library.models()
    pictures = Pictures(library, renderer, TINY.framing)
    measure = TripletMeasure(whole.network)
    for seen in shown(examples, range(5), [list(range(5))] * 5, models, pictures, 1):
        label, R = examples[seen.index].label, examples[seen.index].R_cv_from_s
        photo, box = object_in_photo(label)
        mask = mask_in_photo(label, photo)
        assert mask is not None
        views = Views.joined(
            [
                renderer.render(library.mesh(m), Cameras.framing(R, library.mesh(m).hull, size=224))
                for m in models
            ]
        )
        crop = crop_square(photo.rgb, box, 224, fill=128)
        scores = measure.score(crop, crop_square(mask, box, 224), views, aspect=box.width / box.height)
        with torch.no_grad():
            _, apart = photo_losses(network, seen, 0.1)
        np.testing.assert_allclose(-scores, apart[1:].numpy(), atol=0.01)


def test_photos_without_masks_are_told(labels: Path, library: Library, tmp_path: Path) -> None:
    bare = labels.with_name("bare.jsonl")
    entries = [json.loads(line) for line in labels.read_text().splitlines()]
    bare.write_text(
        "\n".join(json.dumps(e | ({"mask": None} if i < 2 else {})) for i, e in enumerate(entries))
    )
    assert run(bare, library, tmp_path, epochs=1).unmasked == 2


def test_another_renderer_may_draw(labels: Path, library: Library, tmp_path: Path) -> None:
    class Watched(Rasteriser):
        drawn = 0

        def render(self, mesh: Mesh, cameras: Cameras) -> Views:
            Watched.drawn += 1
            return super().render(mesh, cameras)

    options = TripletOptions(data=labels, out=tmp_path, library=library.path, init="random", epochs=1)
    train(options, lambda done, total: None, TINY, Watched())
    assert Watched.drawn == 5 * (1 + 3)


def test_what_cannot_be_trained_on(labels: Path, library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(LibraryError, match="no CAD library"):
        train(
            TripletOptions(data=labels, out=out, library=tmp_path / "none", init="random"),
            lambda done, total: None,
            TINY,
        )
    with pytest.raises(InputError, match=r"none\.jsonl"):
        run(tmp_path / "none.jsonl", library, out)
    with pytest.raises(InputError, match=r"vgg\.pth"):
        run(labels, library, out, init=str(tmp_path / "vgg.pth"))
    assert not out.exists()
    wrongs: tuple[dict[str, Any], ...] = (
        {"epochs": 0}, {"batch_size": 0}, {"seed": -1}, {"workers": -1}, {"renderer": "pov"},
    )  # fmt: skip
    for wrong in wrongs:
        with pytest.raises(ValueError, match=r"at least|none of"):
            TripletOptions(data=labels, out=out, **wrong)
    with pytest.raises(InputError, match="diverged"):
        train(
            TripletOptions(data=labels, out=out, library=library.path, init="random"),
            lambda done, total: None,
            replace(TINY, rate=1e30, weight_decay=1.0),
        )
