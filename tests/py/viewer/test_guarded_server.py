"""Who gets the page of the viewer, and what a page may send."""

import http.client
import socket
from collections.abc import Iterator
from contextlib import closing, suppress

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from gslts.viewer import guarded_server
from gslts.viewer.guarded_server import MAX_MESSAGE_BYTES, MAX_PAGES, open_server

TOKEN = "0123456789abcdef"
PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    """A server of this machine, without a token."""
    opened = open_server("127.0.0.1", 0, "map")
    yield opened
    opened.stop()


def ask(server: viser.ViserServer, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    """Ask for a file, as a browser or anybody else does."""
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=60)
    connection.request("GET", path, headers=headers)
    with closing(connection), connection.getresponse() as answer:
        answer.read()
        return answer


def page(server: viser.ViserServer, **options: object) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{server.get_port()}", subprotocols=[PROTOCOL], max_size=None, **options
    )


def assert_closed(connection: ClientConnection, code: int) -> None:
    with suppress(ConnectionClosed):
        while True:
            connection.recv(timeout=60)
    assert connection.close_code == code


def test_only_this_machine_without_a_token(server: viser.ViserServer) -> None:
    assert ask(server).status == 200
    assert ask(server, Host="localhost:9000").status == 200  # Of a tunnel of ssh.
    assert ask(server, Host="name-of-a-trap.example").status == 403
    assert ask(server, Origin="http://elsewhere.example").status == 403
    with pytest.raises(Exception, match="HTTP 403"):
        page(server, origin="http://elsewhere.example")
    for path in ("/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd"):
        assert ask(server, path).status == 404


def test_token() -> None:
    server = open_server("127.0.0.1", 0, "map", TOKEN)
    try:
        assert ask(server).status == 401
        assert ask(server, "/?token=0123456789abcdeX").status == 401
        assert ask(server, "/still").status == 401
        wrong = f"gslts-token-{server.get_port()}=0123456789abcdeX"
        assert ask(server, Cookie=wrong).status == 401
        assert ask(server, Cookie="; =; gslts-token").status == 401
        with pytest.raises(Exception, match="HTTP 401"):
            page(server)
        let_in = ask(server, f"/?token={TOKEN}", Host="robot:8080")
        assert (let_in.status, let_in.headers["Location"]) == (303, "/")
        cookie = let_in.headers["Set-Cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        own = {"Cookie": cookie.split(";")[0]}
        assert ask(server, **own, Host="robot:8080").status == 200
        # Cookies count for all ports of a host: those of two viewers have different names.
        port = server.get_port()
        cookie = ask(server, f"/?token={TOKEN}").headers["Set-Cookie"]
        assert cookie.split("=")[0] == f"gslts-token-{port}"
        both = {"Cookie": f"gslts-token-1=0123456789abcdeX; {cookie.split(';')[0]}"}
        assert ask(server, **both).status == 200
        page(server, additional_headers=both).close()
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("host", "token", "message"),
    [
        ("0.0.0.0", None, "give a --token"),
        ("127.0.0.1", "short", "--token: must match"),
        ("0.0.0.0", "has a space in it and is long", "--token: must match"),
    ],
)
def test_bad_token(host: str, token: str | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        open_server(host, 0, "map", token)


def test_port_in_use() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(OSError, match=r"127\.0\.0\.1, port \d+: .* in use; give another --port"),
    ):
        open_server("127.0.0.1", taken.getsockname()[1], "map")


def test_what_a_page_may_send(server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda _: asked.append(1))
    with page(server) as connection:
        for kind in ("ShareUrlRequest", "FileTransferStartUpload", "NoSuchMessage"):
            connection.send(msgspec.msgpack.encode({"type": kind}))
        connection.send(b"\xc1")  # No MessagePack.
        assert_closed(connection, 1007)
    with page(server) as connection:
        connection.send(MAX_MESSAGE_BYTES * b"\0" + b"\0")
        assert_closed(connection, 1009)
    assert not asked


def test_number_of_pages(server: viser.ViserServer) -> None:
    pages = [page(server) for _ in range(MAX_PAGES)]
    with page(server) as connection:
        assert_closed(connection, 1013)
    pages.pop().close()
    while True:  # Until the server has seen that it is closed.
        with page(server) as connection:
            try:
                connection.recv(timeout=60)
                break
            except ConnectionClosed:
                continue
    for connection in pages:
        connection.close()


def test_another_viser_is_not_served(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unguarded:
        def __init__(self, *_: object, **__: object) -> None:
            self.stopped = False

        def stop(self) -> None:
            self.stopped = True

    monkeypatch.setattr(guarded_server.viser, "ViserServer", Unguarded)
    with pytest.raises(RuntimeError, match="not known to be safe"):
        open_server("127.0.0.1", 0, "map")
