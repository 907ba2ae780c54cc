"""Address of a page: host, port and token."""

import socket
from dataclasses import dataclass, field, replace

from warp_torchrl.live.access import Access, check_token, is_this_machine, new_token
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class Address:
    """Where a page is served.

    Attributes:
        host: Network interface, by address or name; the default is reachable from this machine alone.
        port: 0 takes any that is free.
        token: What a browser or a program must know; the default is new for each page.

    Raises:
        ValueError: If the host is empty, which would be every interface, the port is out of its range, or the token is
            short.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    token: str = field(default_factory=new_token, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, port=(0, 65535))
        if not self.host.strip():
            raise ValueError(f"host must be an address or a name, such as 127.0.0.1, got {self.host!r}")
        check_token(self.token)

    @property
    def is_local(self) -> bool:
        """Return whether it is reached from this machine alone."""
        return is_this_machine(self.host)

    @property
    def url(self) -> str:
        """Return the address for a browser, with the token; of all interfaces that of this machine."""
        here = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        return f"http://{f'[{here}]' if ':' in here else here}:{self.port}/?token={self.token}"

    def listen(self) -> tuple[socket.socket, "Address", Access]:
        """Return a socket bound to the address, the address with its real port, and the access rule.

        Raises:
            ConfigError: If the port is taken, or the host is none of this machine's.
        """
        listener = None
        try:
            found = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_STREAM)
            family, *_, where = min(found, key=lambda each: each[0] != socket.AF_INET)
            listener = socket.socket(family, socket.SOCK_STREAM)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(where)
        except (OSError, UnicodeError) as error:
            if listener is not None:
                listener.close()
            raise ConfigError(
                f"port {self.port} cannot be used on {self.host} ({getattr(error, 'strerror', None) or error}): choose "
                "another, port=NUMBER"
            ) from None
        bound, port = listener.getsockname()[:2]
        host = self.host if self.host == "localhost" else bound
        return listener, replace(self, host=host, port=port), Access(host=bound, port=port, token=self.token)
