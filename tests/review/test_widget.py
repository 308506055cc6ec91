"""The notebook's widget as anywidget runs it, in headless Chromium: all from traits, nothing fetched."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from cadpose.rle import encode_mask, text_from_runs
from tests.review.view_page import ViewPage, missing, pose_told, view_page

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

WIDTH, HEIGHT = 400, 300
POSE = Pose4Dof(Rotation(40.0, 20.0, 5.0), 500.0, (200.0, 150.0))

# A model as anywidget gives it: bytes are DataViews with an offset of their own.
MODEL = """([photo, glb, pose, rle]) => {
  view.dispose();
  const bytes = (text) => {
    const raw = Uint8Array.from(" " + atob(text), (c) => c.charCodeAt(0));
    return new DataView(raw.buffer, 1);
  };
  const traits = { photo_png: bytes(photo), model_glb: bytes(glb), mask_rle: rle };
  Object.assign(traits, { pose, display: "mask", opacity: 0.8 });
  const heard = {};
  window.saved = [];
  window.model = {
    get: (name) => traits[name],
    set: (name, value) => { traits[name] = value; },
    on: (name, use) => { heard[name] = use; },
    off: (name) => { delete heard[name]; },
    save_changes: () => saved.push({ ...traits.pose, display: traits.display }),
    change(name, value) { traits[name] = value; heard[`change:${name}`](); },
    heard,
  };
  window.stop = widget.render({ model, el: place });
}"""


@pytest.fixture
def shown(small_library: Library) -> Iterator[ViewPage]:
    mesh = small_library.mesh("made/car/hatch.obj")
    mask = Rasteriser().render(mesh, POSE.to_cameras(WIDTH, HEIGHT)).mask[0]
    out = io.BytesIO()
    Image.new("RGB", (WIDTH, HEIGHT), (90, 140, 90)).save(out, "PNG")
    photo, glb = (base64.b64encode(data).decode() for data in (out.getvalue(), single_mesh_glb(mesh)))
    rle = {"size": [HEIGHT, WIDTH], "counts": text_from_runs(encode_mask(mask))}
    with view_page() as page:
        page.page.evaluate(MODEL, [photo, glb, pose_told(POSE), rle])
        page.page.wait_for_function("() => document.querySelector('select')?.value === 'mask'")
        page.page.wait_for_timeout(1500)
        yield page
        assert page.said == []


def test_it_shows_all_and_tells_the_pose_both_ways(shown: ViewPage) -> None:
    page = shown.page
    picture = np.array(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
    # Model and mask agree: white, and hardly the colours of one without the other.
    white = (picture.min(2) > 150).sum()
    blue = ((picture[..., 2] - picture[..., 0]) > 80).sum()
    assert white > 10_000 and blue < 0.05 * white
    assert "az 40.0° el 20.0° ip 5.0° f 500 px" in page.inner_text("#view")

    page.mouse.move(400, 200)
    page.mouse.down()
    page.mouse.move(460, 200, steps=4)
    page.mouse.up()
    assert page.evaluate("saved.at(-1).azimuth") < 35
    page.evaluate("model.change('pose', {...model.get('pose'), azimuth: 100})")
    assert "az 100.0°" in page.inner_text("#view")
    page.get_by_label("Display").select_option("outline")
    page.wait_for_function("() => saved.at(-1).display === 'outline'")


def test_it_leaves_nothing_behind(shown: ViewPage) -> None:
    assert shown.page.evaluate("stop(); place.childElementCount") == 0
    assert shown.page.evaluate("Object.keys(model.heard).length") == 0
