"""The view in browsers of other kinds: without WebGL, with a touch screen, with a fine screen."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from tests.review.view_page import missing, view_page

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

WIDTH, HEIGHT = 640, 480
POSE = Pose4Dof(Rotation(40.0, 20.0, 5.0), 700.0, (320.0, 240.0))
CAR = "made/car/hatch.obj"


def test_without_webgl_it_says_so() -> None:
    with view_page(flags=["--disable-gpu", "--disable-3d-apis", "--no-sandbox"]) as page:
        assert page.page.evaluate("view.available") is False
        assert "no WebGL 2" in page.page.get_by_role("alert").first.text_content()
        assert page.page.evaluate("view.fitMask()") is None
        page.show(b"", POSE, WIDTH, HEIGHT)
        assert page.page.evaluate("view.setDisplay('mask', 1, 0.5); view.zoom") == 1


def test_fingers_turn_and_pinch(small_library: Library) -> None:
    with view_page(has_touch=True) as page:
        page.show(single_mesh_glb(small_library.mesh(CAR)), POSE, WIDTH, HEIGHT)
        session = page.page.context.new_cdp_session(page.page)

        def touch(kind: str, *points: tuple[float, float]) -> None:
            points_told = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points_told})

        touch("touchStart", (400, 300))
        touch("touchMove", (440, 300))
        touch("touchEnd")
        turned = page.page.evaluate("poses.at(-1)[0]")
        assert turned["azimuth"] < 35.0 and turned["focal_px"] == 700.0
        touch("touchStart", (350, 300), (450, 300))
        touch("touchMove", (325, 300), (475, 300))
        touch("touchMove", (330, 340), (470, 260))
        touch("touchEnd")
        pinched = page.page.evaluate("poses.at(-1)[0]")
        assert pinched["focal_px"] == pytest.approx(700 * np.hypot(140, 80) / 100, rel=0.02)
        assert pinched["inplane"] == pytest.approx(5 + np.degrees(np.arctan2(80, 140)), abs=1.0)
        assert pinched["principal_px"] == pytest.approx([320, 240], abs=1.0)


def test_a_fine_screen_is_drawn_finely(small_library: Library) -> None:
    with view_page(ratio=2.0) as page:
        page.show(single_mesh_glb(small_library.mesh(CAR)), POSE, WIDTH, HEIGHT)
        page.page.evaluate("view.setDisplay('mask', 1, null)")
        assert page.picture().shape == (1200, 1600, 3)
        assert page.page.evaluate(
            "() => { const c = document.querySelector('canvas'); return [c.width, c.height] }"
        ) == [
            1600,
            1200,
        ]
        page.page.set_viewport_size({"width": 500, "height": 400})
        page.page.wait_for_function("() => document.querySelector('canvas').width === 1000")
        assert page.page.evaluate("view.toScreen([320, 240])") == pytest.approx([250, 200])
        # The model is drawn about the photo's middle still.
        orange = np.abs(page.picture().astype(int) - (200, 150, 40)).sum(2) < 140
        rows, columns = np.nonzero(orange)
        assert abs(columns.mean() - 500) < 60 and abs(rows.mean() - 400) < 60
