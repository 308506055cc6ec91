"""Strips, cards and the gallery."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.card import card_html
from cadpose.annotations.document import AnnotationDocument, Failure, document_from
from cadpose.annotations.strip import draw_strips
from cadpose.annotations.style import COLOURS, object_crop, standing_text
from cadpose.geometry.boxes import Box
from cadpose.records import Candidate, Detection, Photo, Rotation
from tests.annotations.factory import make_annotation, make_cad, make_failure, make_photo, make_views
from tests.html_page import Page

HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>&amp;{{7*7}}"


def make_card(photo: Photo, document: AnnotationDocument) -> str:
    renders = [make_views(len(part.candidates), 64, 64) for part in document.annotations]
    return card_html(photo, document, Image.fromarray(photo.rgb), renders)


def assert_inert(html: str) -> None:
    allowed = {"html", "head", "meta", "title", "style", "body", "h1", "h2", "p", "img", "section", "div"}
    allowed |= {"figure", "figcaption", "span", "dl", "dt", "dd", "a"}
    page = Page(html)
    assert {tag for tag, _ in page.tags} <= allowed
    for tag, attrs in page.tags:
        assert not any(name.startswith("on") for name in attrs)
        if tag == "img":
            assert re.match(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+$", attrs["src"] or "")
        if tag == "a":
            assert re.match(r"\./[A-Za-z0-9%._~-]+$", attrs["href"] or "")
    assert "http://" not in html
    assert "https://" not in html
    assert "default-src 'none'" in html


def test_a_strip_shows_the_crop_and_the_candidates_in_rank_order() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)
    views = make_views([(60, 20), (20, 60), (40, 40)], 64, 64)
    strip = np.asarray(draw_strips(photo, [(annotation, views)]))
    red = np.abs(strip.astype(int) - (200, 40, 40)).max(axis=-1) < 12
    columns = np.flatnonzero(red.any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 20) + 1)
    shapes = [(len(group), int(red[:, group].any(axis=1).sum())) for group in groups]
    assert len(shapes) == 3
    wide, tall, square = shapes
    assert wide[0] > 2 * wide[1]
    assert tall[1] > 2 * tall[0]
    assert abs(square[0] - square[1]) <= 2
    # The first one wears the object's colour.
    frame = np.abs(strip.astype(int) - COLOURS[0]).max(axis=-1) < 4
    assert groups[0][0] > np.flatnonzero(frame.any(axis=0)).min() > 180
    assert np.flatnonzero(frame.any(axis=0)).max() < groups[1][0]


def test_a_strip_has_a_row_an_object_and_at_most_ten_candidates() -> None:
    photo = make_photo()
    many = make_annotation(
        photo, candidates=tuple(Candidate(make_cad(i), 1.0, Rotation(0, 0)) for i in range(14))
    )
    one = draw_strips(photo, [(many, make_views(10, 32, 32))])
    two = draw_strips(photo, [(many, make_views(14, 32, 32)), (many, make_views(4, 32, 32))])
    assert one.width == two.width
    assert two.height > 1.8 * one.height
    assert draw_strips(photo, []).height > 20
    for bad in (15, 0):
        views = make_views(bad, 32, 32) if bad else make_views(1, 32, 32)
        if not bad:
            views = type(views)(views.rgb[:0], views.alpha[:0], views.depth[:0])
        with pytest.raises(ValueError, match="do not fit"):
            draw_strips(photo, [(many, views)])


def test_a_crop_holds_the_box_with_its_aspect() -> None:
    rgb = np.zeros((80, 120, 3), np.uint8)
    rgb[20:40, 30:90] = 255
    crop = object_crop(Photo(rgb), Box(30, 20, 90, 40), 170, margin=0.0)
    assert crop.size == (170, 57)
    assert np.asarray(crop)[5:-5, 5:-5].min() > 230
    around = np.asarray(object_crop(Photo(rgb), Box(30, 20, 90, 40), 170))
    assert around[0].max() < 100
    assert object_crop(Photo(rgb), Box(500, 500, 600, 600), 50).size == (50, 50)


def test_a_card_shows_everything_in_one_file() -> None:
    photo = make_photo()
    document = document_from(photo, [make_annotation(photo), make_annotation(photo)], [make_failure()])
    html = make_card(photo, document)
    assert_inert(html)
    page = Page(html)
    # The overlay, and a crop and three candidates for each object.
    assert len(page.pictures()) == 1 + 2 * (1 + 3)
    for text in (
        "photos/street.jpg", "2 objects annotated", "car / bus / van · CAD 0", "CAD 2",
        "1 · chance 0.50", "3 · chance 0.06",
        "azimuth 312.4°, elevation 8.1°, in-plane -1.5°", "box 0.93, silhouette 0.81",
        "CC-BY-3.0 · A. Maker · Sweet Home 3D Set.sh3f", "the library has no zebra",
    ):  # fmt: skip
        assert text in page.text, text
    assert "prefers-color-scheme:dark" in html


def test_hostile_names_stay_text() -> None:
    photo = make_photo(HOSTILE)
    cad = make_cad(name=HOSTILE, id=HOSTILE, category=HOSTILE, licence=HOSTILE, creator=HOSTILE)
    detection = Detection(Box(1, 2, 30, 40), HOSTILE, source=HOSTILE, alternatives=((HOSTILE, 0.1),))
    annotation = make_annotation(
        photo,
        detection=detection,
        candidates=(Candidate(cad, 1.0, Rotation(0, 0), {HOSTILE: 1.0}),),
        seconds={HOSTILE: 1.0},
        provenance={HOSTILE: HOSTILE},
    )
    document = document_from(photo, [annotation], [Failure(detection, HOSTILE, HOSTILE)])
    html = make_card(photo, document)
    assert_inert(html)
    assert HOSTILE in Page(html).text


def test_renders_that_do_not_fit_are_refused() -> None:
    photo = make_photo()
    document = document_from(photo, [make_annotation(photo)])
    overlay = Image.fromarray(photo.rgb)
    with pytest.raises(ValueError, match="0 renders do not fit 1"):
        card_html(photo, document, overlay, [])
    with pytest.raises(ValueError, match="4 views do not fit 3"):
        card_html(photo, document, overlay, [make_views(4, 32, 32)])


def test_a_card_tells_how_sure_the_rotation_is() -> None:
    photo = make_photo()
    doubtful = make_annotation(photo)
    found = dataclasses.replace(doubtful.detection, rotation=None)
    first, second = doubtful.hypotheses
    sure = dataclasses.replace(first, probability=0.93, expected_error=7.4, needs_review=False)
    cases = {
        "probability 0.60 within 30°, expected error 24°": (found, (first, second)),
        "probability 0.93 within 30°, expected error 7°": (found, (sure, second)),
        "share 0.40 among 1 rotation": (found, (second,)),
        "the rotation was given": (doubtful.detection, (second,)),
    }
    for text, (detection, hypotheses) in cases.items():
        annotation = make_annotation(
            photo, detection=detection, hypotheses=hypotheses, cad_needs_review=False
        )
        document = document_from(photo, [annotation])
        card = make_card(photo, document)
        assert_inert(card)
        assert text in Page(card).text
        assert ("needs review" in Page(card).text) == hypotheses[0].needs_review


def test_a_card_tells_how_sure_the_model_is() -> None:
    photo = make_photo()
    first = dataclasses.replace(make_annotation(photo).hypotheses[0], needs_review=False)
    cases: list[tuple[float | None, bool, str]] = [
        (0.3125, False, "0.50 to be the object's own, 0.31 that none of these is"),
        (0.75, True, "none of these; 0.50 to be the object's own, 0.75"),
        (None, False, ""),
    ]
    for none, flagged, told in cases:
        annotation = make_annotation(
            photo, hypotheses=(first,), none_probability=none, cad_needs_review=flagged
        )
        document = document_from(photo, [annotation])
        shown = Page(make_card(photo, document)).text
        assert told in shown and ("Model's chance" in shown) == bool(told)
        assert ("needs review" in shown) == flagged


def test_a_candidate_stands_by_its_chance_or_its_score() -> None:
    assert standing_text(1, 1.154, 0.8) == "1 · chance 0.80"
    assert standing_text(2, 1.154, None) == "2 · score 1.154"


def test_a_card_tells_the_detections_flags() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)  # truncated and unsure, with two alternatives
    document = document_from(photo, [annotation], [make_failure()])
    shown = Page(make_card(photo, document)).text
    assert "unsure: car / bus / van · CAD 0" in shown and "truncated" in shown
    assert "zebra 0.50 · tiny" in shown
    plain = dataclasses.replace(annotation.detection, truncated=False, unsure=False)
    document = document_from(photo, [dataclasses.replace(annotation, detection=plain)])
    shown = Page(make_card(photo, document)).text
    assert "car · CAD 0" in shown and not any(word in shown for word in ("unsure", "truncated", "tiny"))
