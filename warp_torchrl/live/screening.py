"""Screening of browsers' messages: what no page sends does not reach the server, and the browser is informed."""

from collections.abc import Mapping
from weakref import WeakKeyDictionary

import viser

from warp_torchrl.live import incoming
from warp_torchrl.live.door import LOG
from warp_torchrl.live.panel.panel import notify
from warp_torchrl.system.foreign_text import plain_text

_MOST_TOLD = 20  # refused messages of one connection that are told


class Screen:
    """Screen of the messages that arrive; it runs in the server's thread.

    Args:
        clients: The browsers by connection, as they come and leave.
    """

    def __init__(self, clients: Mapping[object, viser.ClientHandle]) -> None:
        self._clients = clients
        self._refusals: WeakKeyDictionary[object, int] = WeakKeyDictionary()  # by connection

    def __call__(self, connection: object, message: bytes) -> bool:
        """Return whether viser receives a message; the browser is informed of a refused one."""
        client = self._clients.get(connection)
        try:
            incoming.check(message, None if client is None else client.gui)
        except Exception as error:  # a fault of the check lets nothing in
            self._refuse(connection, client, error)
            return False
        return True

    def _refuse(self, connection: object, client: viser.ClientHandle | None, error: Exception) -> None:
        count = self._refusals[connection] = self._refusals.get(connection, 0) + 1
        if isinstance(error, incoming.Misfit):
            incoming.put_back(error.control)
        if count > _MOST_TOLD:
            return
        line = plain_text(str(error))
        who = "a browser" if client is None else f"browser {client.client_id}"
        LOG.warning("%s: %s%s", who, line, "; more of it is not told" * (count == _MOST_TOLD))
        if client is not None:
            notify(client, line, mistake=True)
