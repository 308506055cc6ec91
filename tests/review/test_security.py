"""Who is let in, and what is refused at the door."""

from __future__ import annotations

import socket
from typing import Any
from urllib.parse import urlsplit

import pytest
from starlette.testclient import TestClient

from cadpose.errors import CadposeError
from cadpose.photos import MAX_BYTES
from cadpose.review.security import CONTENT_SECURITY_POLICY, MAX_JSON_BYTES, allowed_hosts
from cadpose.review.server import is_loopback, open_socket
from tests.review.serving import ORIGIN, PORT, TOKEN, Served, access

_COOKIE = f"cadpose_review_{PORT}={access().cookie_value}"


def ask(shared: Served, method: str, path: str, **heads: str | None) -> Any:
    """A request with these headers alone: the client's own cookie and Origin are left out."""
    told = {name.replace("_", "-"): value for name, value in heads.items() if value is not None}
    return bare(shared).request(method, path, headers=told, follow_redirects=False)


def bare(shared: Served) -> TestClient:
    """A client without cookie and Origin."""
    return TestClient(shared.client.app, base_url=ORIGIN)


def test_the_token_opens_the_page(shared: Served) -> None:
    answer = ask(shared, "GET", f"/?token={TOKEN}")
    assert answer.status_code == 303 and answer.headers["location"] == "/"
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(_COOKIE) and "HttpOnly" in cookie and "samesite=strict" in cookie.lower()
    answer = ask(shared, "GET", "/", cookie=_COOKIE)
    assert answer.status_code == 200 and "text/html" in answer.headers["content-type"]


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", f"/?token={TOKEN}x", "/static/app.js"])
def test_without_the_token_there_is_one_sentence(shared: Served, path: str) -> None:
    answer = ask(shared, "GET", path)
    assert answer.status_code == 401 and answer.text.count("\n") == 1 and "set-cookie" not in answer.headers


@pytest.mark.parametrize(
    "heads",
    [
        {},
        {"cookie": f"cadpose_review_{PORT}=wrong"},
        {"cookie": f"other={access().cookie_value}"},
        # Neither of the two secrets stands for the other.
        {"cookie": f"cadpose_review_{PORT}={TOKEN}"},
        {"authorization": f"Bearer {access().cookie_value}"},
        {"cookie": "\x00=;;"},
        {"authorization": "Bearer wrong"},
        {"authorization": f"Basic {TOKEN}"},
        {"authorization": TOKEN},
        {"authorization": "Bearer ümlaut"},
    ],
)
def test_the_api_needs_the_token(shared: Served, heads: dict[str, str]) -> None:
    encoded: Any = {name: value.encode() for name, value in heads.items()}
    answer = ask(shared, "GET", "/api/session", **encoded)
    assert answer.status_code == 401 and answer.json()["kind"] == "forbidden"
    # Nor does the token in the address open the API.
    assert ask(shared, "GET", f"/api/session?token={TOKEN}").status_code == 401


def test_the_cookie_is_no_token(shared: Served) -> None:
    assert ask(shared, "GET", f"/?token={access().cookie_value}").status_code == 401
    assert TOKEN not in access().cookie_value and len(access().cookie_value) == 64


@pytest.mark.parametrize(
    "other", ['a={"x":1}', "a=b c", "[x]=1", "theme", "=", "a=b=c", 'q="; x', "expires=Mon, 1 Jan", "ü=ü", ""]
)
def test_cookies_of_other_programs_do_not_matter(shared: Served, other: str) -> None:
    for line in (f"{other}; {_COOKIE}", f"{_COOKIE}; {other}", f"{other};{_COOKIE} ;{other}"):
        raw: Any = line.encode()
        assert ask(shared, "GET", "/api/session", cookie=raw).status_code == 200


def test_a_bearer_needs_no_origin(shared: Served) -> None:
    key = shared.ids()[0]
    bearer = f"Bearer {TOKEN}"
    assert ask(shared, "GET", "/api/session", authorization=bearer).status_code == 200
    answer = ask(shared, "POST", f"/api/annotations/{key}/decisions", authorization=bearer)
    assert answer.status_code == 422  # let in, and without a body


@pytest.mark.parametrize(
    "host",
    [
        "evil.example", f"evil.example:{PORT}", "127.0.0.1", "127.0.0.1:80", f"127.0.0.1:{PORT}.evil", "",
        f"a@127.0.0.1:{PORT}",
    ],
)  # fmt: skip
@pytest.mark.parametrize("path", ["/", f"/?token={TOKEN}", "/api/session"])
def test_other_hosts_are_refused(shared: Served, host: str, path: str) -> None:
    assert ask(shared, "GET", path, host=host, cookie=_COOKIE).status_code == 403


def test_every_name_of_this_machine_is_served(shared: Served) -> None:
    for host in (f"127.0.0.1:{PORT}", f"localhost:{PORT}", f"LOCALHOST:{PORT}", f"[::1]:{PORT}"):
        assert ask(shared, "GET", "/api/session", host=host, cookie=_COOKIE).status_code == 200


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "null",
        f"https://127.0.0.1:{PORT}",
        "http://127.0.0.1",
        f"http://localhost:{PORT}",
    ],
)
def test_a_foreign_origin_is_refused(shared: Served, origin: str) -> None:
    for method, path in (("GET", "/api/session"), ("POST", "/api/snap"), ("POST", "/api/photos")):
        for heads in ({"cookie": _COOKIE}, {"authorization": f"Bearer {TOKEN}"}):
            answer = ask(shared, method, path, origin=origin, **heads)
            assert answer.status_code == 403 and answer.json()["kind"] == "forbidden"


def test_a_change_has_to_tell_its_origin(shared: Served) -> None:
    answer = ask(shared, "POST", "/api/photos/example", cookie=_COOKIE)
    assert answer.status_code == 403 and "Origin" in answer.json()["error"]
    answer = ask(shared, "POST", "/api/snap", cookie=_COOKIE, origin=ORIGIN)
    assert answer.status_code == 422


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_sites_are_refused(shared: Served, site: str) -> None:
    answer = ask(shared, "GET", "/api/session", cookie=_COOKIE, sec_fetch_site=site)
    assert answer.status_code == 403
    answer = ask(shared, "GET", "/api/session", cookie=_COOKIE, sec_fetch_site="same-origin")
    assert answer.status_code == 200


def test_every_answer_has_the_headers(shared: Served) -> None:
    answers = [
        shared.client.get("/"),
        shared.client.get("/api/session"),
        shared.client.get("/api/nothing"),
        ask(shared, "GET", "/api/session"),
        ask(shared, "GET", "/", host="evil.example"),
    ]
    for answer in answers:
        assert answer.headers["content-security-policy"] == CONTENT_SECURITY_POLICY
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["cache-control"] in ("no-store", "no-cache")
        assert "access-control-allow-origin" not in answer.headers
    assert "unsafe" not in CONTENT_SECURITY_POLICY


def test_long_bodies_are_refused(shared: Served) -> None:
    key = shared.ids()[0]
    body = b'{"note": "' + b"x" * MAX_JSON_BYTES + b'"}'
    for content in (body, iter([body[: MAX_JSON_BYTES // 2], body[MAX_JSON_BYTES // 2 :]])):
        answer = shared.client.post(f"/api/annotations/{key}/decisions", content=content)
        assert answer.status_code == 413 and answer.json()["kind"] == "too_large"
    answer = shared.client.post("/api/photos", headers={"content-length": str(MAX_BYTES + 1)}, content=b"x")
    assert answer.status_code == 413


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"null", b"\xff\xfe", b"[" * 100_000, b'{"verdict": "accept"}', b'{"__proto__": 1}'],
)
def test_bodies_that_are_no_request(shared: Served, body: bytes) -> None:
    key = shared.ids()[0]
    for path in (f"/api/annotations/{key}/decisions", "/api/snap"):
        answer = shared.client.post(path, content=body, headers={"content-type": "application/json"})
        assert answer.status_code == 422 and answer.json()["kind"] == "bad_input", answer.text
        assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize(
    "path",
    [
        "/static/../../../pyproject.toml", "/static/..%2f..%2fserver.py", "/static/%2e%2e/app.py",
        "/static//etc/passwd", "/static/app.js%00.html", "/../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
        "/static/", "/etc/passwd", "//etc/passwd", "/api/photos/..%2f..%2fetc%2fpasswd/image",
        "/api/export/..%2fcoco", "/api/jobs/..%2f..",
    ],
)  # fmt: skip
def test_no_path_leads_out(shared: Served, path: str) -> None:
    answer = shared.client.get(path)
    assert answer.status_code == 404 and answer.json() == {
        "error": answer.json()["error"], "kind": "not_found",
    }  # fmt: skip


def test_methods_that_are_not_there(shared: Served) -> None:
    for method in ("PUT", "DELETE", "PATCH"):
        assert shared.client.request(method, "/api/queue").status_code == 405
    assert shared.client.get("/docs").status_code == 404
    assert shared.client.get("/openapi.json").status_code == 404


def test_host_names() -> None:
    assert allowed_hosts(["::1", "Box.Local"], 9) == {"[::1]:9", "box.local:9"}
    assert allowed_hosts(["localhost"], 80) == {"localhost", "localhost:80"}
    assert all(map(is_loopback, ("127.0.0.1", "127.8.0.1", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "10.0.0.1", "box", "")))


@pytest.mark.parametrize(
    ("host", "shown"),
    [
        ("127.0.0.1", "127.0.0.1"), ("127.0.0.2", "127.0.0.2"), ("LocalHost", "localhost"),
        ("::1", "[::1]"), ("0:0:0:0:0:0:0:1", "[::1]"), ("0000::0001", "[::1]"), ("0.0.0.0", "127.0.0.1"),
    ],
)  # fmt: skip
def test_the_address_that_is_printed_is_served(host: str, shown: str) -> None:
    try:
        opened = open_socket(host, 0)
    except CadposeError as error:
        pytest.skip(f"this machine has no {host}: {error}")
    with opened.listener:
        place = urlsplit(opened.url).netloc
        assert place == f"{shown}:{opened.listener.getsockname()[1]}"
        assert place in opened.access.hosts


def test_addresses_in_capitals_are_served(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bound to another address, as no machine has this one."""
    bind = socket.socket.bind
    monkeypatch.setattr(socket.socket, "bind", lambda self, place: bind(self, ("::1", 0)))
    try:
        opened = open_socket("FD00:0:0::00AB", 0)
    except CadposeError as error:
        pytest.skip(f"this machine has no IPv6: {error}")
    with opened.listener:
        place = urlsplit(opened.url).netloc
        assert place.startswith("[fd00::ab]:") and place in opened.access.hosts
