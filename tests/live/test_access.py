"""Who is let in to the page's server: by token, by origin, and at an address that is told."""

import contextlib
import socket
from http.client import HTTPConnection

import pytest

pytest.importorskip("viser", reason="needs the extra live")

from websockets.datastructures import Headers

from tests.live.browser import CAMERA, Browser
from tests.live.conftest import SMALL
from warp_torchrl.live.access import Access, is_own
from warp_torchrl.live.address import Address
from warp_torchrl.live.door import MOST_CONNECTIONS, Door
from warp_torchrl.live.match import Setting
from warp_torchrl.live.page import Page
from warp_torchrl.live.scene import local_server, quiet
from warp_torchrl.runs.config.construction import ConfigError

HERE, EVERYWHERE = "127.0.0.1", "0.0.0.0"
TOKEN = "a-token-of-tests"


@pytest.mark.parametrize(
    ("origin", "asked", "host", "own"),
    [
        (None, "127.0.0.1:8080", HERE, True),
        ("http://127.0.0.1:8080", "127.0.0.1:8080", HERE, True),
        ("HTTP://LOCALHOST:8080", "localhost:8080", HERE, True),
        ("http://localhost:9000", "localhost:9000", HERE, True),  # through a tunnel of ssh
        ("http://[::1]:8080", "[::1]:8080", "::1", True),
        ("http://lab.example:8080", "lab.example:8080", EVERYWHERE, True),
        ("http://evil.example", "127.0.0.1:8080", HERE, False),
        ("http://localhost:3000", "127.0.0.1:8080", HERE, False),
        ("http://127.0.0.1:3000", "127.0.0.1:8080", HERE, False),
        ("https://127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("null", "127.0.0.1:8080", HERE, False),
        ("", "127.0.0.1:8080", HERE, False),
        # What begins or ends with its own address, or holds it, is another's.
        ("http://evil.127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("http://evil127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("http://evil@127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("http://evil.example/http://127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("http://127.0.0.1:8080.evil.example", "127.0.0.1:8080", HERE, False),
        ("http://127.0.0.1:80801", "127.0.0.1:8080", HERE, False),
        ("127.0.0.1:8080", "127.0.0.1:8080", HERE, False),
        ("http://evil-lab.example:8080", "lab.example:8080", EVERYWHERE, False),
        ("http://evil.example", "lab.example:8080", EVERYWHERE, False),
        ("http://127.0.0.1:8080, http://evil.example", "127.0.0.1:8080", HERE, False),
        # A name that is pointed at this machine, and what is no host.
        ("http://evil.example:8080", "evil.example:8080", HERE, False),
        (None, "evil.example:8080", HERE, False),
        (None, "127.0.0.1@evil.example", HERE, False),
        (None, "evil.example@127.0.0.1:8080", HERE, False),
        ("http://", "", EVERYWHERE, False),
        (None, "[::1", HERE, False),
        (None, None, EVERYWHERE, False),
        ("http://127.0.0.1:8080", None, HERE, False),
    ],
)
def test_a_page_is_the_server_s_own_where_its_origin_is_what_the_browser_asked_for(origin, asked, host, own):
    assert is_own(origin, asked, host) is own


@pytest.fixture
def access():
    return Access(host=HERE, port=8080, token=TOKEN)


@pytest.mark.parametrize(
    ("path", "let_in"),
    [
        (f"/?token={TOKEN}", True),
        (f"/any/path?other=1&token={TOKEN}", True),
        ("/", False),
        (f"/{TOKEN}", False),
        ("/?token=", False),
        (f"/?token={TOKEN}x", False),
        (f"/?token={TOKEN[:-1]}", False),
        (f"/?Token={TOKEN}", False),
        ("/?token=\udcff", False),
        ("/?" + "&".join(["token=x"] * 1000), False),
    ],
)
def test_a_page_or_a_websocket_needs_the_token(access, path, let_in):
    for upgrade in ({}, {"Upgrade": "websocket"}):
        refusal = access.refusal(path, Headers(Host="127.0.0.1:8080", **upgrade))
        assert (refusal is None) is let_in and TOKEN not in str(refusal)


def test_the_cookie_of_a_page_stands_for_the_token_and_is_of_this_server_alone(access):
    cookie, *rules = access.cookie.split("; ")
    assert {"HttpOnly", "SameSite=Strict"} <= set(rules) and TOKEN not in cookie and "8080" in cookie
    name, _, value = cookie.partition("=")
    other = Access(host=HERE, port=8080, token=TOKEN).cookie.partition(";")[0]
    for given, let_in in (
        (cookie, True),
        (f"a=b; {cookie} ;c", True),
        (other, False),
        (f"{name}={TOKEN}", False),
        (f"x{cookie}", False),
        (f"{name}={value[:-1]}", False),
        (name, False),
        ("=;;=", False),
    ):
        assert (access.refusal("/", Headers(Host="127.0.0.1:8080", Cookie=given)) is None) is let_in


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


def test_only_pages_of_its_own_and_programs_with_the_token_open_a_websocket(page):
    host = f"127.0.0.1:{page.address.port}"
    own, path = f"Origin: http://{host}", f"/?token={page.address.token}"
    for upgrade in ("Upgrade: websocket", "Upgrade: WebSocket"):
        for wrong in (["Origin: http://evil.example"], ["Origin: null"], [own, "Origin: http://evil.example"]):
            assert status(page, f"Host: {host}", upgrade, *wrong, path=path) == 403
        assert status(page, f"Host: {host}", upgrade, own) == 403, "without the token"
    for fitting in ([own], []):
        assert status(page, f"Host: {host}", "Upgrade: websocket", *fitting, path=path) == 101


def test_a_browser_loads_the_page_once_with_the_token_and_then_by_its_cookie(page):
    def get(path, **headers):
        link = HTTPConnection(HERE, page.address.port, timeout=10)
        link.request("GET", path, headers=headers)
        answer = link.getresponse()
        body = answer.read()
        link.close()
        return answer, body

    for path in ("/", "/index.html", "/?token=wrong-token", "/assets/x.js", "/hdri/potsdamer_platz_1k.hdr"):
        answer, body = get(path)
        assert answer.status == 403 and b"<html" not in body.lower() and answer.getheader("Set-Cookie") is None
    first, body = get(f"/?token={page.address.token}")
    assert first.status == 200 and b"<html" in body.lower()
    assert first.getheader("Referrer-Policy") == "no-referrer" and first.getheader("Cache-Control") == "no-store"
    assert "frame-ancestors 'none'" in first.getheader("Content-Security-Policy")
    cookie = first.getheader("Set-Cookie").partition(";")[0]
    again, _ = get("/", Cookie=cookie)
    assert again.status == 200 and again.getheader("Set-Cookie") is None
    host = f"127.0.0.1:{page.address.port}"
    given = (f"Host: {host}", "Upgrade: websocket", f"Origin: http://{host}", f"Cookie: {cookie}")
    assert status(page, *given) == 101


def test_many_connections_of_strangers_hold_up_nobody(page):
    browser = Browser(page.address.port, page.address.token, reads=False)
    links = [socket.create_connection((HERE, page.address.port), timeout=10) for _ in range(MOST_CONNECTIONS + 20)]
    try:
        links[0].settimeout(5)  # a handshake may take ten seconds
        with contextlib.suppress(ConnectionError):
            assert links[0].recv(100) == b"", "the oldest is closed"
        links[-1].sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert b"403" in links[-1].recv(100), "the newest is answered"
        browser.send(CAMERA)
        assert browser.link.recv(timeout=10), "and who has the token stays"
    finally:
        for each in (*links, browser):
            each.close()


def test_a_server_that_is_started_in_another_way_is_refused():
    listener, _, access = Address(port=0).listen()
    door = Door(listener, access, lambda *_: True)
    with listener, pytest.raises(RuntimeError, match="nobody would be kept out"), door.hung():
        pass


def test_the_server_that_writes_an_episode_lets_in_nobody():
    server = local_server()
    try:
        link = HTTPConnection(HERE, server.get_port(), timeout=10)
        link.request("GET", "/")
        assert link.getresponse().status == 403
        link.close()
    finally:
        with quiet():
            server.stop()


# Addresses


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"host": ""}, "host must be an address or a name"),
        ({"host": " "}, "host must be an address or a name"),
        ({"port": -1}, "port must be in"),
        ({"token": ""}, "token must be 8 to 200 letters"),
        ({"token": "short"}, "token must be 8 to 200 letters"),
        ({"token": "with space and = and #"}, "token must be 8 to 200 letters"),
    ],
)
def test_an_address_that_is_none_is_refused_without_its_token(values, says):
    with pytest.raises(ValueError, match=says) as caught:
        Address(**values)
    assert not values.get("token") or values["token"] not in str(caught.value)


@pytest.mark.parametrize(
    ("host", "is_local", "printed"),
    [
        ("127.0.0.1", True, "127.0.0.1"),
        ("localhost", True, "localhost"),
        ("127.1", True, "127.0.0.1"),
        ("0.0.0.0", False, "127.0.0.1"),
        ("0", False, "127.0.0.1"),
    ],
)
def test_an_address_is_local_where_the_network_cannot_reach_it(host, is_local, printed):
    listener, address, access = Address(host=host, port=0).listen()
    with listener:
        assert address.is_local is is_local
        assert address.url == f"http://{printed}:{listener.getsockname()[1]}/?token={access.token}"
        assert (access.refusal(f"/?token={access.token}", Headers(Host="evil.example")) is None) is not is_local


def test_an_address_of_six_groups_stands_in_brackets():
    assert Address(host="::1", token=TOKEN).url == f"http://[::1]:8080/?token={TOKEN}"
    assert not Address(host="::").is_local and Address(host="::1").is_local


def test_each_page_has_a_token_of_its_own_which_is_not_shown():
    one, other = Address(), Address()
    assert one.token != other.token and len(one.token) >= 32 and one.token not in repr(one)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "192.0.2.1", "\u2024"])
def test_a_host_that_is_none_of_this_machine_s_is_one_line(host):
    with pytest.raises(ConfigError, match="cannot be used on"):
        Address(host=host, port=0).listen()
