from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cadpose.encoder import lite0
from cadpose.errors import DependencyError, InputError
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.registry import measures
from cadpose.similarity.triplet import VARIABLE, TripletMeasure
from cadpose.similarity.triplet_framing import Framing
from tests.similarity.shapes import five_views, photo_of

FRAMING = Framing(side=64, longer=48)


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both encoders random and alike."""
    torch = pytest.importorskip("torch")
    from cadpose.training.triplet.export import export_onnx
    from cadpose.training.triplet.network import TwoEncoders

    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("network") / "triplet.onnx"
    export_onnx(TwoEncoders(width=4), FRAMING, path)
    return path


def test_scores_are_torchs_distances(network: Path) -> None:
    torch = pytest.importorskip("torch")
    from cadpose.training.triplet.network import TwoEncoders

    torch.manual_seed(0)
    encoders = TwoEncoders(width=4).eval()
    views, crop = five_views(), photo_of(1)
    mask = views.mask[1]
    measure: SimilarityMeasure = TripletMeasure(network)
    scores = measure.score(crop, mask, views)
    with torch.no_grad():
        a, b = encoders(
            torch.from_numpy(FRAMING.photo(crop, mask)[None]), torch.from_numpy(FRAMING.renders(views))
        )
    assert scores.dtype == np.float64
    np.testing.assert_allclose(scores, -(a - b).norm(dim=1).numpy(), atol=1e-4)


def test_the_same_picture_is_nearest(network: Path) -> None:
    """The encoders being alike, a render as the photo has distance 0."""
    views, measure = five_views(), TripletMeasure(network)
    for k in range(5):
        scores = measure.score(views.over(0)[k], views.mask[k], views)
        assert scores.argmax() == k and scores[k] == pytest.approx(0.0, abs=1e-3)
        assert (scores <= 0).all() and (scores >= -2).all()


def test_without_a_mask_the_aspect_tells_where_the_box_ends(network: Path) -> None:
    views, measure = five_views(), TripletMeasure(network)
    crop = photo_of(0)
    beside = crop.copy()
    beside[:40] = beside[-40:] = 128  # what the pipeline puts there
    aspect = 224 / 144
    np.testing.assert_array_equal(
        measure.score(crop, None, views, aspect=aspect), measure.score(beside, None, views, aspect=aspect)
    )
    assert not np.array_equal(measure.score(crop, None, views), measure.score(beside, None, views))


def test_many_renders(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    views, measure, crop = five_views(), TripletMeasure(network), photo_of(3)
    whole = measure.score(crop, None, views)
    monkeypatch.setattr("cadpose.similarity.triplet._CHUNK", 2)
    np.testing.assert_allclose(measure.score(crop, None, views), whole, atol=1e-6)


def test_it_has_its_name(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(network))
    made = measures(lite0(), seed=0)["triplet"]()
    assert isinstance(made, TripletMeasure)
    assert made.name == "triplet" and made.path == network and made.framing == FRAMING


def test_it_runs_without_torch(network: Path) -> None:
    program = (
        "import sys; sys.modules['torch'] = None\n"
        "import numpy as np\n"
        "from pathlib import Path\n"
        "from cadpose.records import Views\n"
        "from cadpose.similarity.triplet import TripletMeasure\n"
        "n = np.zeros\n"
        "views = Views(n((2, 9, 9, 3), np.uint8), n((2, 9, 9), np.uint8), n((2, 9, 9), np.float32))\n"
        "print(len(TripletMeasure(Path(sys.argv[1])).score(n((9, 9, 3), np.uint8), None, views)))\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program, str(network)], capture_output=True, text=True, check=True
    )
    assert run.stdout == "2\n"


def test_networks_that_are_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(DependencyError, match=r"cadpose train triplet.*CADPOSE_TRIPLET"):
        TripletMeasure()
    monkeypatch.setenv(VARIABLE, str(tmp_path / "none.onnx"))
    with pytest.raises(DependencyError, match=r"none\.onnx"):
        TripletMeasure()


@pytest.mark.parametrize("fixed", [0, 1])
def test_a_first_axis_that_is_not_free_is_told_of(network: Path, tmp_path: Path, fixed: int) -> None:
    onnx = pytest.importorskip("onnx")
    model = onnx.load(str(network))
    model.graph.input[fixed].type.tensor_type.shape.dim[0].dim_value = 2
    onnx.save(model, str(tmp_path / "fixed.onnx"))
    measure = TripletMeasure(tmp_path / "fixed.onnx")
    with pytest.raises(InputError, match=r"fixed\.onnx: takes 2 (photos|renders) at once"):
        measure.score(photo_of(0), None, five_views())


def test_a_network_that_fails_when_run_is_told_of(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing:
        def run(self, *args: object) -> None:
            raise RuntimeError("a reshape of another size\nthan it should have")

    measure = TripletMeasure(network)
    monkeypatch.setitem(measure.__dict__, "_loaded", (Failing(), FRAMING))
    with pytest.raises(InputError, match=r"fails on 5 renders \(RuntimeError\)"):
        measure.score(photo_of(0), None, five_views())


def test_files_that_are_no_such_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    crop, views = photo_of(0), five_views()
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(InputError, match=r"text\.onnx: is no ONNX network"):
        TripletMeasure(tmp_path / "text.onnx").score(crop, None, views)
    from importlib.resources import files

    lite = Path(str(files("cadpose") / "data" / "weights" / "lite0-trunk.onnx"))
    with pytest.raises(InputError, match="another network"):
        TripletMeasure(lite).score(crop, None, views)
    monkeypatch.setattr("cadpose.similarity.triplet.MAX_BYTES", 5)
    with pytest.raises(InputError, match="larger than"):
        TripletMeasure(tmp_path / "text.onnx").score(crop, None, views)
