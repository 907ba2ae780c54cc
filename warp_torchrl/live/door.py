"""Connection filter of a page's server: requests and messages are checked before viser receives them.

viser accepts every connection and acts on every message, and has no option for a check. So its call to ``websockets``
receives a socket that listens already, and connections that check requests and messages.
"""

import asyncio
import http
import logging
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response
from websockets.protocol import State

from warp_torchrl.live.access import Access
from warp_torchrl.system.foreign_text import plain_text

MOST_MESSAGE_BYTES = 64 * 1024
"""Of a message: a page sends less than a thousandth of it."""
MOST_CONNECTIONS = 256
"""At a time; beyond it the oldest of those that have not shown a token yet is closed."""
MOST_MESSAGES = 200.0
"""A second of one browser, which sends at most 50; more wait on its side."""
LOG = logging.getLogger("warp_torchrl.live")
arrived: ContextVar[object] = ContextVar("arrived")
"""The connection that viser serves in the present task."""

_Process = Callable[[ServerConnection, Request], Response | None]
_Handler = Callable[[ServerConnection], Awaitable[None]]
_BURST = 50.0  # messages that may come at once
_starting = threading.Lock()


class Door:
    """Connection filter of one server.

    Args:
        listener: A socket that is bound.
        access: Access rule.
        screen: Takes a connection and one message of it, in the server's thread, and returns whether viser receives the
            message. It raises nothing.
    """

    def __init__(self, listener: socket.socket, access: Access, screen: Callable[[object, bytes], bool]) -> None:
        self._listener, self._access, self._screen = listener, access, screen

    @contextmanager
    def hung(self) -> Iterator[None]:
        """Let the server that viser starts within this context have this door.

        Raises:
            RuntimeError: If viser started none in the way that it is known to: it would be a server without a door.
        """
        usual, used = websockets.asyncio.server.serve, []

        def serve(handler: _Handler, *where: object, process_request: _Process | None = None, **options: Any) -> Any:
            used.append(True)
            own = {
                "sock": self._listener,
                "process_request": self._process(process_request),
                "create_connection": self._connection(),
                "max_size": MOST_MESSAGE_BYTES,
                "logger": _quiet_logger(),
            }
            return usual(_arriving(handler), **(options | own))

        with _starting:
            websockets.asyncio.server.serve = serve  # type: ignore[assignment, misc]
            try:
                yield
            finally:
                websockets.asyncio.server.serve = usual  # type: ignore[misc]
        if not used:
            raise RuntimeError("this version of viser starts its server in another way: nobody would be kept out")

    def _process(self, process_request: _Process | None) -> _Process:
        access = self._access

        def process(connection: ServerConnection, request: Request) -> Response | None:
            refusal = access.refusal(request.path, request.headers)
            if refusal is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, refusal)
            answer = None if process_request is None else process_request(connection, request)
            if answer is not None:
                answer.headers.update(_page_headers(request.headers["Host"]))
                if access.has_token(request.path):
                    answer.headers["Set-Cookie"] = access.cookie
            return answer

        return process

    def _connection(self) -> type[ServerConnection]:
        screen = self._screen

        class Connection(ServerConnection):
            """A connection whose messages are checked before they are read."""

            _free_from = 0.0

            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                super().connection_made(transport)
                there = self.server.handlers
                if len(there) > MOST_CONNECTIONS:  # who has shown a token stays
                    next((each for each in there if each.state is State.CONNECTING), self).transport.abort()

            async def recv(self, decode: bool | None = None) -> bytes:  # type: ignore[override]
                while True:
                    message = await super().recv(decode=False)
                    await self._wait_its_turn()
                    if screen(self, message):
                        return message

            async def _wait_its_turn(self) -> None:
                now = time.monotonic()
                self._free_from = max(now, self._free_from) + 1.0 / MOST_MESSAGES
                await asyncio.sleep(max(0.0, self._free_from - now - _BURST / MOST_MESSAGES))

        return Connection


def _arriving(handler: _Handler) -> _Handler:
    async def handle(connection: ServerConnection) -> None:
        arrived.set(connection)
        await handler(connection)

    return handle


def _page_headers(asked: str) -> dict[str, str]:
    """Return a page's headers: it loads nothing from other servers, and no other page can embed it."""
    own = f"'self' ws://{asked} data: blob:"
    return {
        "Content-Security-Policy": f"default-src {own} 'unsafe-inline' 'unsafe-eval'; frame-src 'none'; "
        "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
        "X-Content-Type-Options": "nosniff",
    }


def _quiet_logger() -> logging.Logger:
    """Return a logger that reports, in one line, failures of accepted connections, and nothing of refused ones."""
    logger = LOG.getChild("connections")
    logger.setLevel(logging.ERROR)
    if not logger.filters:
        logger.addFilter(_in_one_line)
    return logger


def _in_one_line(record: logging.LogRecord) -> bool:
    error = record.exc_info[1] if record.exc_info else None
    told = record.getMessage()
    record.msg, record.args, record.exc_info = f"{told}: {plain_text(f'{type(error).__name__}: {error}')}", (), None
    return told == "connection handler failed"
