"""Access to the page's server: its token, cookie and origin.

Every user of a machine can connect to its loopback interface, and so can any page that is open in a browser there. The
token keeps out other users. The header ``Origin`` names the server of the page that sends a request; the check of it
keeps out other pages.
"""

import hmac
import ipaddress
import re
import secrets
from collections.abc import Iterable
from dataclasses import dataclass, field
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers

TOKEN_VARIABLE = "WARP_TORCHRL_TOKEN"
"""Environment variable that names a token."""
_TOKEN = re.compile(r"[A-Za-z0-9_-]{8,200}")
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
_NO_TOKEN = "This page needs the address that its command printed, with the token.\n"
_FOREIGN = "This page is of another server.\n"


def new_token() -> str:
    """Return a token that nobody can guess."""
    return secrets.token_urlsafe(24)


def check_token(token: str) -> None:
    """Check a token that a user chose.

    Raises:
        ValueError: If it is short, or cannot stand in an address.
    """
    if not _TOKEN.fullmatch(token):
        raise ValueError(f"token must be 8 to 200 letters, digits, - and _, got {len(token)} characters")


@dataclass(frozen=True, kw_only=True)
class Access:
    """Access rule of a server.

    The first request carries the token. The response sets a cookie, which the browser sends with all later requests.
    The cookie is another secret, and belongs to this server only.

    Attributes:
        host: The network interface that is served.
        port: Port of the server. All servers of a machine share cookies, so the port is part of the cookie's name.
        token: Secret that a browser or a program must send.
    """

    host: str
    port: int
    token: str
    _session: str = field(default_factory=new_token, repr=False)

    @property
    def cookie(self) -> str:
        """Return the header that gives the cookie to a browser."""
        return f"{self._cookie}={self._session}; Path=/; HttpOnly; SameSite=Strict"

    def refusal(self, path: str, headers: Headers) -> str | None:
        """Return why a request is refused, a page or a websocket; None lets it in.

        Args:
            path: Of the request, with what follows its question mark.
            headers: Of the request.
        """
        if not is_own(_one(headers, "Origin"), _one(headers, "Host"), self.host):
            return _FOREIGN
        return None if self.has_token(path) or self._has_cookie(headers) else _NO_TOKEN

    def has_token(self, path: str) -> bool:
        """Return whether a request's path has the token."""
        try:
            given = parse_qs(path.partition("?")[2], max_num_fields=20).get("token", ())
        except ValueError:
            return False
        return _holds(given, self.token)

    def _has_cookie(self, headers: Headers) -> bool:
        pairs = (each.strip().partition("=") for line in headers.get_all("Cookie") for each in line.split(";"))
        return _holds([value for name, _, value in pairs if name == self._cookie], self._session)

    @property
    def _cookie(self) -> str:
        return f"warp_torchrl_{self.port}"


def is_own(origin: str | None, asked: str | None, host: str) -> bool:
    """Return whether a request comes from a page of this server, from no page yet, or from no browser.

    Args:
        origin: Header ``Origin``: the server of the page that sends the request; None without a browser, or for a page
            itself.
        asked: Header ``Host``: the name that the browser uses for this server.
        host: The network interface that is served. If it is reached from this machine only, the name that the browser
            uses must be a name of this machine too: somebody could point another name at this machine.
    """
    if asked is None or not _HOST.fullmatch(asked):
        return False
    if is_this_machine(host) and not is_this_machine(urlsplit(f"//{asked}").hostname or ""):
        return False
    return origin is None or origin.lower() == f"http://{asked}".lower()


def is_this_machine(name: str) -> bool:
    """Return whether a name or an address is reached from this machine alone."""
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return name.lower() == "localhost"


def _holds(given: Iterable[str], secret: str) -> bool:
    return any(hmac.compare_digest(each.encode(errors="surrogateescape"), secret.encode()) for each in given)


def _one(headers: Headers, name: str) -> str | None:
    """Return a header; several of a name are none that fits."""
    values = headers.get_all(name)
    return None if not values else ", ".join(values)
