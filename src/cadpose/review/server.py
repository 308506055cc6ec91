"""Starting and stopping: a socket on this machine, uvicorn on it, and one address to open."""

from __future__ import annotations

import errno
import ipaddress
import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import uvicorn
from starlette.types import ASGIApp

from cadpose.errors import CadposeError
from cadpose.review.security import Access, allowed_hosts

#: Names under which this machine's own browser may ask.
LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: Seconds that requests under way have to end after Ctrl-C.
_GRACE = 3


@dataclass(frozen=True)
class Opened:
    """A socket that listens, and who may ask on it.

    Attributes:
        listener: The socket.
        access: Token, hosts and cookie of this start.
        url: The address with its token.
    """

    listener: socket.socket
    access: Access
    url: str


def is_loopback(host: str) -> bool:
    """Whether an address or name is this machine's own only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def open_socket(host: str, port: int) -> Opened:
    """Listen on an address; port 0 takes a free one.

    Raises:
        CadposeError: the port is taken, or the address is none of this machine's.
    """
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise CadposeError(f"cannot serve on {host}: {_reason(error)}; choose another --host") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(place)
        listener.listen(512)
    except (OSError, OverflowError) as error:
        listener.close()
        if getattr(error, "errno", None) == errno.EADDRINUSE:
            raise CadposeError(
                f"port {port} of {host} is in use: choose another --port, or 0 for a free one"
            ) from None
        raise CadposeError(
            f"cannot serve on {host}, port {port}: {_reason(error)}; choose another --host or --port"
        ) from None
    port = int(listener.getsockname()[1])
    token = secrets.token_urlsafe(32)
    access = Access(token, allowed_hosts(_names(host), port), f"cadpose_review_{port}")
    shown = "127.0.0.1" if _is_wildcard(host) else _plain(host)
    where = f"[{shown}]" if ":" in shown else shown
    return Opened(listener, access, f"http://{where}:{port}/?token={token}")


def serve(app: ASGIApp, opened: Opened, up: Callable[[], None]) -> None:
    """Serve until Ctrl-C or a termination signal; requests under way are finished.

    Args:
        app: The application.
        opened: The socket.
        up: Called once when requests are answered.

    Raises:
        KeyboardInterrupt: it was stopped by Ctrl-C.
    """
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        server_header=False,
        # Addresses in the logs are the socket's own: no proxy's word counts.
        proxy_headers=False,
        timeout_graceful_shutdown=_GRACE,
        ws="none",
    )
    try:
        _Server(config, up).run(sockets=[opened.listener])
    finally:
        opened.listener.close()


class _Server(uvicorn.Server):
    """Tells when it is up."""

    def __init__(self, config: uvicorn.Config, up: Callable[[], None]) -> None:
        super().__init__(config)
        self._up = up

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._up()


def _names(host: str) -> set[str]:
    """What the Host header may say of the machine."""
    names = {*LOOPBACK, _plain(host)}
    if _is_wildcard(host):
        name = socket.gethostname()
        names |= {name, socket.getfqdn()}
        with suppress(OSError):
            names |= {str(entry[4][0]) for entry in socket.getaddrinfo(name, None)}
    return names


def _plain(host: str) -> str:
    """An address as browsers write it: IPv6 short and in small letters."""
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return host.lower()


def _is_wildcard(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
