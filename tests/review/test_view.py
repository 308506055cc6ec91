"""What hands, keys and the graphics card do to the view, in headless Chromium."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from tests.review.view_page import ViewPage, missing, pose_told, view_page

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

WIDTH, HEIGHT = 640, 480
POSE = Pose4Dof(Rotation(40.0, 20.0, 5.0), 700.0, (320.0, 240.0))
CAR = "made/car/hatch.obj"


def photo_png() -> bytes:
    """Grey-green, darker to the right."""
    rows = np.broadcast_to(np.linspace(200, 60, WIDTH).astype(np.uint8), (HEIGHT, WIDTH))
    out = io.BytesIO()
    Image.fromarray(np.dstack([rows // 2, rows, rows // 2])).save(out, "PNG")
    return out.getvalue()


@pytest.fixture(scope="module")
def opened() -> Iterator[ViewPage]:
    with view_page() as page:
        yield page
        assert page.said == []


@pytest.fixture
def shown(opened: ViewPage, small_library: Library) -> ViewPage:
    """A car on the photo, everything as at the start."""
    opened.files["/photo.png"] = photo_png
    opened.show(single_mesh_glb(small_library.mesh(CAR)), POSE, WIDTH, HEIGHT)
    opened.page.evaluate(
        """async ([w, h]) => {
            await view.setPhoto("/photo.png", w, h);
            view.setDisplay("blend", 0.62, null); view.setBefore(null); view.focusOn(null);
            poses.length = wipes.length = 0;
        }""",
        [WIDTH, HEIGHT],
    )
    return opened


def told(shown: ViewPage) -> tuple[list[dict[str, float]], list[bool]]:
    pairs = shown.page.evaluate("poses")
    return [pose for pose, _ in pairs], [done for _, done in pairs]


def drag(shown: ViewPage, start: tuple[float, float], by: tuple[float, float], button: str = "left") -> None:
    mouse = shown.page.mouse
    mouse.move(*start)
    mouse.down(button=button)
    mouse.move(start[0] + by[0], start[1] + by[1], steps=6)
    mouse.up(button=button)


def test_dragging_turns_and_says_when_it_is_done(shown: ViewPage) -> None:
    drag(shown, (400, 300), (80, 0))
    poses, done = told(shown)
    assert done == [False] * 6 + [True]
    # To the right: the front comes from its left side.
    assert -45 < poses[-1]["azimuth"] - 40.0 < -10
    assert poses[-1]["elevation"] == pytest.approx(20.0, abs=3.0)
    assert poses[-1]["inplane"] == 5.0 and poses[-1]["focal_px"] == 700.0
    drag(shown, (400, 300), (0, 60))
    assert told(shown)[0][-1]["elevation"] > 30.0


def test_keys_and_buttons_choose_what_a_drag_does(shown: ViewPage) -> None:
    page = shown.page
    page.keyboard.down("Shift")
    drag(shown, (600, 300), (0, -120))
    page.keyboard.up("Shift")
    rolled = told(shown)[0][-1]
    assert rolled["inplane"] > 20 and rolled["azimuth"] == 40.0
    scale = page.evaluate("view.toScreen([1, 0])[0] - view.toScreen([0, 0])[0]")
    drag(shown, (400, 300), (30, -20), button="right")
    moved = told(shown)[0][-1]
    assert moved["principal_px"] == pytest.approx([320 + 30 / scale, 240 - 20 / scale], abs=1e-6)
    page.keyboard.down("Alt")
    drag(shown, (400, 300), (-30, 20))
    page.keyboard.up("Alt")
    assert told(shown)[0][-1]["principal_px"] == pytest.approx([320, 240], abs=1e-6)


def test_the_wheel_changes_the_focal_length_or_enlarges_the_photo(shown: ViewPage) -> None:
    page = shown.page
    page.mouse.move(400, 300)
    page.mouse.wheel(0, -120)
    page.wait_for_function("() => poses.some(([, done]) => done)")
    assert 700 < told(shown)[0][-1]["focal_px"] < 760
    count = len(told(shown)[0])
    before = page.evaluate("view.toPhoto([500, 200])")
    page.mouse.move(500, 200)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -300)
    page.keyboard.up("Control")
    page.wait_for_function("() => view.zoom > 1.3")
    assert page.evaluate("view.toPhoto([500, 200])") == pytest.approx(before)
    assert len(told(shown)[0]) == count


def test_the_photo_is_panned_by_the_middle_button_and_by_space(shown: ViewPage) -> None:
    page = shown.page
    page.evaluate("view.zoomBy(3)")
    before = page.evaluate("view.toPhoto([0, 0])")
    drag(shown, (400, 300), (60, 30), button="middle")
    middle = page.evaluate("view.toPhoto([0, 0])")
    assert middle[0] < before[0] and middle[1] < before[1]
    page.keyboard.down("Space")
    drag(shown, (400, 300), (-60, -30))
    page.keyboard.up("Space")
    assert page.evaluate("view.toPhoto([0, 0])") == pytest.approx(before)
    assert told(shown) == ([], [])


def test_small_objects_can_be_seen_large(shown: ViewPage) -> None:
    shown.page.evaluate("view.focusOn([300, 200, 330, 220])")
    left, top = shown.page.evaluate("view.toScreen([300, 200])")
    right, bottom = shown.page.evaluate("view.toScreen([330, 220])")
    assert right - left > 400 and bottom - top > 250
    assert left > 0 and top > 0 and right < 800 and bottom < 600


def test_the_divider_shows_before_and_after_and_is_moved_by_hand_and_key(shown: ViewPage) -> None:
    page = shown.page
    page.evaluate("p => { view.setBefore(p); view.setDisplay('mask', 1, 0.5) }", pose_told(POSE))
    turned = Pose4Dof(Rotation(220.0, 20.0, 5.0), 350.0, (320.0, 240.0))
    page.evaluate("p => view.setPose(p)", pose_told(turned))
    wide = shown.picture()
    divider = page.get_by_role("slider", name="Divider between before and after")
    box = divider.bounding_box()
    page.mouse.move(box["x"] + 12, 100)
    page.mouse.down()
    page.mouse.move(200, 100, steps=4)
    page.mouse.up()
    assert page.evaluate("wipes.at(-1)") == pytest.approx(0.25, abs=0.01)
    assert divider.get_attribute("aria-valuenow") == "25"
    small = shown.picture()
    # Where only the small model is, the large one of before was: what is drawn on the left is before.
    orange = [(np.abs(p[:, :390].astype(int) - (210, 150, 20)).sum(2) < 150).sum() for p in (wide, small)]
    assert orange[0] > 1.5 * orange[1] > 0
    divider.focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("wipes.at(-1)") == pytest.approx(0.27, abs=0.011)


def test_displays_show_what_they_say(shown: ViewPage, small_library: Library) -> None:
    page = shown.page
    seen = {}
    for display in ("photo", "blend", "outline", "wireframe", "mask", "difference"):
        page.evaluate("name => view.setDisplay(name, 1, null)", display)
        seen[display] = shown.picture().astype(int)
    scale = page.evaluate("view.toScreen([1, 0])[0] - view.toScreen([0, 0])[0]")
    left, top = page.evaluate("view.toScreen([0, 0])")
    mask = Rasteriser().render(small_library.mesh(CAR), POSE.to_cameras(WIDTH, HEIGHT)).mask[0]
    rows, columns = np.nonzero(mask)
    x, y = round(left + columns.mean() * scale), round(top + rows.mean() * scale)
    for display, picture in seen.items():
        changed = np.abs(picture - seen["photo"]).sum(2) > 12
        inside = changed[round(top + rows.min() * scale) : y, x - 40 : x + 40].mean()
        assert (inside > 0) == (display != "photo"), display
        assert (inside > 0.5) == (display in ("blend", "mask", "difference")), (display, inside)
        outside = changed[round(top) + 4 : round(top) + 12, 100:300].mean()
        assert (outside > 0.9) == (display in ("mask", "difference")), (display, outside)


def test_colours_are_the_rasterisers(shown: ViewPage, small_library: Library) -> None:
    """At full opacity a blend is 0.85 of the rasteriser's colour and 0.15 of the tint, as in overlays."""
    shown.page.evaluate("view.setDisplay('blend', 1, null)")
    picture = shown.picture().astype(float)
    scale = shown.page.evaluate("view.toScreen([1, 0])[0] - view.toScreen([0, 0])[0]")
    left, top = shown.page.evaluate("view.toScreen([0, 0])")
    # The photo's pixels at the page's: a camera of the page's size.
    pose = Pose4Dof(POSE.rotation, POSE.focal_px * scale, (320 * scale + left, 240 * scale + top))
    views = Rasteriser().render(small_library.mesh(CAR), pose.to_cameras(800, 600))
    wanted = 0.85 * views.rgb[0] + 0.15 * np.array((255, 128, 0))
    inside = views.alpha[0] == 255
    # Without the outline's neighbourhood.
    for _ in range(4):
        inside[1:-1, 1:-1] &= inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    assert inside.sum() > 10_000
    error = np.abs(picture - wanted)[inside].max(1)
    assert np.median(error) <= 2.0
    assert (error <= 6.0).mean() > 0.97


def test_a_lost_graphics_card_comes_back(shown: ViewPage) -> None:
    before = shown.picture()
    shown.page.evaluate(
        """() => {
            const gl = document.querySelector("canvas").getContext("webgl2");
            window.lose = gl.getExtension("WEBGL_lose_context");
            lose.loseContext();
        }"""
    )
    notice = shown.page.get_by_role("alert").first
    notice.wait_for(state="visible")
    assert "graphics card was reset" in notice.text_content()
    shown.page.evaluate("lose.restoreContext()")
    notice.wait_for(state="hidden")
    assert np.abs(shown.picture().astype(int) - before).max() <= 2
    # three tells of both in the console.
    assert all("Context" in line for line in shown.said), shown.said
    shown.said.clear()


def test_what_cannot_be_loaded_is_told(shown: ViewPage) -> None:
    catch = "promise => promise.then(() => '', (error) => error.message)"
    page = shown.page
    assert page.evaluate(f"({catch})(view.setModel('/none.glb'))") == "the model could not be loaded (404)"
    assert page.evaluate(f"({catch})(view.setPhoto('/none.png', 5, 5))") == "the photo could not be loaded"
    shown.files["/bad.glb"] = lambda: b"no model at all, though it is long enough"
    assert page.evaluate(f"({catch})(view.setModel('/bad.glb'))") == "the model is no binary glTF file"
    assert all("404" in line for line in shown.said)
    shown.said.clear()


def test_the_last_of_two_models_is_shown(shown: ViewPage, small_library: Library) -> None:
    for name in ("made/car/hatch.obj", "made/chair/plain.obj"):
        shown.files[f"/{name}"] = partial(single_mesh_glb, small_library.mesh(name))
    shown.page.evaluate(
        "Promise.all([view.setModel('/made/car/hatch.obj'), view.setModel('/made/chair/plain.obj')])"
    )
    wanted = (
        Rasteriser()
        .render(small_library.mesh("made/chair/plain.obj"), POSE.to_cameras(WIDTH, HEIGHT))
        .mask[0]
    )
    assert (shown.silhouette() ^ wanted).sum() < 0.005 * wanted.sum()


def test_it_leaves_nothing_behind(shown: ViewPage) -> None:
    """Views come and go: more than a browser keeps graphics contexts for."""
    left = shown.page.evaluate(
        """() => {
            const other = document.createElement("div");
            document.body.append(other);
            for (let i = 0; i < 20; i++) new PhotoView(other, { onPose() {} }).dispose();
            return other.childElementCount;
        }"""
    )
    assert left == 0
    assert shown.silhouette().any()
