"""Who may ask: this machine's browser with the token of this start, from the page's own origin.

A plain ASGI layer before everything else: the Host header (against DNS rebinding), the token, Origin and
Sec-Fetch-Site (against other pages' requests), sizes of bodies, and the headers of every answer.
"""

from __future__ import annotations

import hashlib
import hmac
import logging
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from urllib.parse import parse_qs

from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from cadpose.photos import MAX_BYTES
from cadpose.review.refusals import refusal

log = logging.getLogger(__name__)

#: Longest JSON body: a drawn mask of a large photo fits many times over.
MAX_JSON_BYTES = 4 * 2**20
#: Where bodies may be as long as a photo.
UPLOAD_PATH = "/api/photos"
SAFE = ("GET", "HEAD")
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; font-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
_HEADERS: tuple[tuple[bytes, bytes], ...] = (
    (b"content-security-policy", CONTENT_SECURITY_POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)
_NO_STORE = (b"cache-control", b"no-store")


@dataclass(frozen=True)
class Access:
    """Who is let in.

    Attributes:
        token: The secret of this start, as the address and scripts tell it.
        hosts: What the Host header may say, ports included.
        cookie: Name of the cookie: cookies are shared by all ports of a host.
    """

    token: str = field(repr=False)
    hosts: frozenset[str]
    cookie: str = "cadpose_review"

    def is_token(self, told: str) -> bool:
        """Compared in a time that tells nothing."""
        return hmac.compare_digest(told.encode(errors="replace"), self.token.encode())

    @property
    def cookie_value(self) -> str:
        """Another secret than the token: servers on other ports of this host are sent the cookie too."""
        return hmac.new(self.token.encode(), b"cadpose review cookie", hashlib.sha256).hexdigest()

    def is_cookie_value(self, told: str) -> bool:
        """Compared in a time that tells nothing."""
        return hmac.compare_digest(told.encode(errors="replace"), self.cookie_value.encode())


class Guard:
    """Lets through what may come in.

    Args:
        app: What is guarded.
        access: Who is let in.
    """

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app, self.access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            return  # a WebSocket is closed without a word
        heads = _Heads(scope["headers"])
        answer = self._refusal(scope, heads)
        if answer is not None:
            await answer(scope, receive, _with_headers(send, scope["path"]))
            return
        most = MAX_BYTES if scope["path"] == UPLOAD_PATH else MAX_JSON_BYTES
        if heads.length() > most:
            answer = refusal("too_large", f"the request is longer than the {most >> 20} MB allowed")
            await answer(scope, receive, _with_headers(send, scope["path"]))
            return
        if scope["path"] != UPLOAD_PATH:
            # An upload counts its own bytes as it writes them.
            body = await _read_capped(receive, most)
            if body is None:
                answer = refusal("too_large", f"the request is longer than the {most >> 20} MB allowed")
                await answer(scope, receive, _with_headers(send, scope["path"]))
                return
            receive = _replay(body, receive)
        await self.app(scope, receive, _with_headers(send, scope["path"]))

    def _refusal(self, scope: Scope, heads: _Heads) -> Response | None:
        path, method = scope["path"], scope["method"]
        is_api = path.startswith("/api/")
        hosts = heads.all(b"host")
        if len(hosts) != 1 or hosts[0].lower() not in self.access.hosts:
            return _told("this page is served under its own address only", is_api)
        origins = heads.all(b"origin")
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return _told("another page may not ask this server", is_api)
        bearer, cookie = self._bearer(heads), self._has_cookie(heads)
        if not is_api:
            told = parse_qs(scope["query_string"].decode("latin-1")).get("token")
            if path == "/" and method in SAFE and told:
                return self._welcome(told[0])
            if not (bearer or cookie):
                sentence = "Open the address with its token that `cadpose review` printed on its start."
                return PlainTextResponse(sentence + "\n", 401)
            return None
        if not (bearer or cookie):
            sentence = "open the page by the address with its token that `cadpose review` printed"
            answer = refusal("forbidden", sentence)
            answer.status_code = 401
            return answer
        if not bearer:
            # A browser: it tells where a request comes from, and must where something is changed.
            site = heads.all(b"sec-fetch-site")
            if any(told not in ("same-origin", "none") for told in site):
                return _told("another page may not ask this server", True)
            if method not in SAFE and not origins:
                return _told("a request that changes something has to tell its Origin", True)
        return None

    def _welcome(self, token: str) -> Response:
        if not self.access.is_token(token):
            return PlainTextResponse("This token is not the one of this start of `cadpose review`.\n", 401)
        answer = RedirectResponse("/", 303)
        answer.set_cookie(
            self.access.cookie, self.access.cookie_value, path="/", httponly=True, samesite="strict"
        )
        return answer

    def _bearer(self, heads: _Heads) -> bool:
        told = heads.all(b"authorization")
        if len(told) != 1:
            return False
        scheme, _, token = told[0].partition(" ")
        return scheme.lower() == "bearer" and self.access.is_token(token.strip())

    def _has_cookie(self, heads: _Heads) -> bool:
        # As browsers do it: other programs' cookies on this host may be anything between two semicolons.
        for piece in ";".join(heads.all(b"cookie")).split(";"):
            name, _, value = piece.partition("=")
            if name.strip() == self.access.cookie and self.access.is_cookie_value(value.strip()):
                return True
        return False


@dataclass(frozen=True)
class _Heads:
    pairs: Sequence[tuple[bytes, bytes]]

    def all(self, name: bytes) -> list[str]:
        return [value.decode("latin-1") for key, value in self.pairs if key == name]

    def length(self) -> int:
        told = self.all(b"content-length")
        return int(told[0]) if told and told[0].isdecimal() else 0


def _told(sentence: str, is_api: bool) -> Response:
    return refusal("forbidden", sentence) if is_api else PlainTextResponse(f"{sentence}.\n", 403)


async def _read_capped(receive: Receive, most: int) -> bytes | None:
    """The whole body; None where it is longer."""
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return bytes(body)  # the client has gone
        body += message.get("body", b"")
        if len(body) > most:
            return None
        if not message.get("more_body", False):
            return bytes(body)


def _replay(body: bytes, receive: Receive) -> Receive:
    """A body that has been read, then whatever else comes."""
    given = False

    async def again() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


def _with_headers(send: Send, path: str) -> Send:
    """Every answer carries the headers; unless it says how long it keeps, it is not to be kept."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            own: list[tuple[bytes, bytes]] = list(message.get("headers", []))
            names = {name.lower() for name, _ in own}
            added: Iterable[tuple[bytes, bytes]] = (h for h in (*_HEADERS, _NO_STORE) if h[0] not in names)
            message = {**message, "headers": [*own, *added]}
        await send(message)

    return sent


def allowed_hosts(names: Collection[str], port: int) -> frozenset[str]:
    """Host headers of some names or addresses (IPv6 without brackets) and a port."""
    hosts = set()
    for name in names:
        shown = f"[{name}]" if ":" in name else name.lower()
        hosts.add(f"{shown}:{port}")
        if port == 80:
            hosts.add(shown)
    return frozenset(hosts)
