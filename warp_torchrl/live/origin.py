"""Which websockets the page accepts: those of its own pages, and of programs that are no browsers.

A browser lets any page that is open in it connect to this machine, and tells in ``Origin`` whose page it is. viser
checks no origin, and hands its server no check of ours; so its call to ``websockets`` is given one.
"""

import http
import ipaddress
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

_Process = Callable[[ServerConnection, Request], Response | None]
_starting = threading.Lock()


def is_own(origin: str | None, asked: str | None, host: str) -> bool:
    """Return whether a websocket is of a page that this server served, or of no browser.

    Args:
        origin: Header ``Origin``: of whose page; None where no browser asks.
        asked: Header ``Host``: what the browser takes this server for.
        host: The network interface that is served. On one of this machine alone, what a browser asks for must be a name
            of this machine too: else a name of somebody's that is pointed at this machine would do.
    """
    if _is_this_machine(host) and not _is_this_machine(urlsplit(f"//{asked or ''}").hostname or ""):
        return False
    return origin is None or (asked is not None and origin.lower() == f"http://{asked}".lower())


@contextmanager
def only_own(host: str) -> Iterator[None]:
    """Let the server that viser starts within this context refuse all others, with status 403.

    Args:
        host: The network interface that it serves.

    Raises:
        RuntimeError: If viser started none in the way that it is known to: it would be a server without the check.
    """
    usual, checked = websockets.asyncio.server.serve, []

    def serve(*given: Any, process_request: _Process | None = None, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Response | None:
            headers = request.headers
            is_page = headers.get("Upgrade") is None
            if not is_page and not is_own(_one(headers, "Origin"), _one(headers, "Host"), host):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "This page is of another server.\n")
            return None if process_request is None else process_request(connection, request)

        checked.append(True)
        return usual(*given, process_request=process, **options)

    with _starting:
        websockets.asyncio.server.serve = serve  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = usual  # type: ignore[misc]
    if not checked:
        raise RuntimeError("this version of viser starts its server in another way: origins are not checked")


def _one(headers: Any, name: str) -> str | None:
    """Return a header; several of a name are none that fits."""
    values = headers.get_all(name)
    return None if not values else ", ".join(values)


def _is_this_machine(name: str) -> bool:
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return name.lower() == "localhost"
