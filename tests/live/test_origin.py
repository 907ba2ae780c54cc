"""Which pages of a browser the server lets in."""

import socket

import pytest

pytest.importorskip("viser", reason="needs the extra live")

from tests.live.conftest import SMALL
from warp_torchrl.live.match import Setting
from warp_torchrl.live.origin import is_own, only_own
from warp_torchrl.live.page import Address, Page

HERE, EVERYWHERE = "127.0.0.1", "0.0.0.0"


@pytest.mark.parametrize(
    ("origin", "asked", "host", "own"),
    [
        (None, "127.0.0.1:8080", HERE, True),
        ("http://127.0.0.1:8080", "127.0.0.1:8080", HERE, True),
        ("http://localhost:9000", "localhost:9000", HERE, True),  # through a tunnel of ssh
        ("http://[::1]:8080", "[::1]:8080", "::1", True),
        ("http://evil.example", "127.0.0.1:8080", HERE, False),
        ("http://localhost:3000", "127.0.0.1:8080", HERE, False),
        ("http://127.0.0.1:3000", "127.0.0.1:8080", HERE, False),
        ("null", "127.0.0.1:8080", HERE, False),
        ("http://evil.example:8080", "evil.example:8080", HERE, False),  # a name that is pointed at this machine
        ("http://127.0.0.1:8080, http://evil.example", "127.0.0.1:8080", HERE, False),
        ("http://127.0.0.1:8080", None, HERE, False),
        ("http://lab.example:8080", "lab.example:8080", EVERYWHERE, True),
        ("http://evil.example", "lab.example:8080", EVERYWHERE, False),
    ],
)
def test_a_page_is_the_server_s_own_where_its_origin_is_what_the_browser_asked_for(origin, asked, host, own):
    assert is_own(origin, asked, host) is own


@pytest.fixture(scope="module", params=[HERE, EVERYWHERE])
def page(request):
    with Page(Setting(policy="noop", overrides=SMALL), Address(host=request.param, port=0)) as made:
        yield made


def status(page, *headers, path="/"):
    """Shake hands as a browser does, and return the status of the answer."""
    lines = [
        f"GET {path} HTTP/1.1", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: viser-v1.1.1", *headers,
    ]  # fmt: skip
    with socket.create_connection((HERE, page.address.port), timeout=10) as link:
        link.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return int(link.recv(4096).split()[1])


def test_a_page_of_another_server_is_refused(page):
    host = f"Host: 127.0.0.1:{page.address.port}"
    for upgrade in ("websocket", "WebSocket"):
        assert status(page, host, f"Upgrade: {upgrade}", "Origin: http://evil.example") == 403
        assert status(page, host, f"Upgrade: {upgrade}", "Origin: null") == 403
    own = f"Origin: http://127.0.0.1:{page.address.port}"
    assert status(page, host, "Upgrade: websocket", own, "Origin: http://evil.example") == 403


def test_its_own_page_and_programs_are_let_in(page):
    host = f"127.0.0.1:{page.address.port}"
    assert status(page, f"Host: {host}", "Upgrade: websocket", f"Origin: http://{host}") == 101
    assert status(page, f"Host: {host}", "Upgrade: websocket") == 101


def test_a_server_that_is_started_in_another_way_is_refused():
    with pytest.raises(RuntimeError, match="origins are not checked"), only_own(HERE):
        pass
