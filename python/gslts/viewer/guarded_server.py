"""A server of viser that is closed to all but those who may look at it.

viser itself binds all addresses, asks nobody who they are, takes 50 MB from anybody, offers a
tunnel to the internet, and goes on to the next port if one is in use. Here a page is served to this
machine only, or to whoever knows a token; it may send its camera, its inputs and its clicks, and
nothing else is read.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import re
import socket
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

try:
    import msgspec
    import rich
    import viser
    import websockets.asyncio.server
    from websockets import Headers, Request, Response
except ImportError as error:
    raise ImportError("the viewer needs viser: pip install 'gslts[viewer]'") from error

LOOPBACK = ("127.0.0.1", "::1", "localhost")
"""Hosts that only programs and browsers of this machine reach."""
MAX_PAGES = 20
"""Maximum number of open pages."""
MAX_MESSAGE_BYTES = 1 << 16
"""Maximum size of a message of a page: a camera takes some 200 bytes, a text what was typed."""
MESSAGES = ("ViewerCameraMessage", "GuiUpdateMessage", "ScenePointerMessage")
"""Messages of a page that are read: where it looks from, its inputs, its clicks."""
TOKEN = re.compile("[A-Za-z0-9_-]{16,128}")
"""A token: characters that need no quotes in a URL, and too many to be guessed."""
COOKIE = "gslts-token"
"""Cookie of the token, so that it leaves the address of the page at once. The port follows: a
browser sends the cookies of all ports of a host, and there may be several viewers."""
STILL = "/still"
"""Path of a page for browsers without WebGL 2."""
TO_STILL = f"""<script>
if (!document.createElement("canvas").getContext("webgl2")) location.replace("{STILL}");
</script>"""
"""Opens that page: without WebGL 2, viser shows nothing, not even its panel."""


def open_server(
    host: str,
    port: int,
    label: str,
    token: str | None = None,
    make_still: Callable[[], bytes] = bytes,
) -> viser.ViserServer:
    """Start a server.

    Args:
        host: Address to bind.
        port: Port; 0 for a free one.
        label: Title of the panel of the page.
        token: Without which nobody sees anything; required unless the host is of `LOOPBACK`.
        make_still: Makes the page for browsers without WebGL 2, HTML in UTF-8.

    Returns:
        The server; `stop` ends it.

    Raises:
        OSError: The port is in use, or the host is not of this machine.
        ValueError: The token is missing or too weak.
    """
    if token is None and host not in LOOPBACK:
        raise ValueError(f"--host {host}: others could look at the map; give a --token as well")
    if token is not None and not TOKEN.fullmatch(token):
        raise ValueError(
            f"--token: must match {TOKEN.pattern}, such as that of: openssl rand -hex 16"
        )
    rich.get_console().quiet = True  # viser greets on the terminal.
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # Pages may be closed.
    try:
        bound = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET
        )
    except OSError as error:
        reason = str(error.strerror).partition(" (")[0]  # Python adds the address.
        raise OSError(f"{host}, port {port}: {reason}; give another --port or --host") from None
    with _guarding(bound, token, make_still) as guarded:
        server = viser.ViserServer(host, port, label, verbose=False)
    if not guarded:  # A viser that serves in another manner must not serve unguarded.
        server.stop()
        bound.close()
        raise RuntimeError(f"viser {viser.__version__} is not known to be safe: install 1.1")
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    server.gui.main_panel.dock_right()
    return server


@contextmanager
def _guarding(
    bound: socket.socket, token: str | None, make_still: Callable[[], bytes]
) -> Iterator[list[bool]]:
    """Let the next server of websockets, which viser starts, serve a socket with our checks."""
    serve, guarded = websockets.asyncio.server.serve, []

    def serve_guarded(handler: Any, _host: str, _port: int, **options: Any) -> Any:
        guarded.append(True)
        inner: Callable[[Any, Request], Response | None] = options.pop("process_request")

        async def process_request(connection: Any, request: Request) -> Response | None:
            answer = check_request(request, token)
            if answer is not None:
                return answer
            path = urlsplit(request.path).path
            if path == STILL:
                return await asyncio.to_thread(_still_answer, make_still)
            if path != "/" or "Upgrade" in request.headers:
                return inner(connection, request)
            if "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # The code in the page is compressed.
            page = inner(connection, request)
            return None if page is None else _with_still(page)

        options |= {
            "sock": bound,
            "max_size": MAX_MESSAGE_BYTES,
            "process_request": process_request,
        }
        return serve(_limited(handler), **options)

    websockets.asyncio.server.serve = serve_guarded  # type: ignore[assignment,misc]
    try:
        yield guarded
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def check_request(request: Request, token: str | None) -> Response | None:
    """Decide on a request before anything is done for it.

    Args:
        request: Of a page, or for its connection.
        token: That it must show; None without any.

    Returns:
        An answer instead of the page; None if the request may pass.
    """
    host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
    if origin is not None and urlsplit(origin).netloc != host:
        return _answer(http.HTTPStatus.FORBIDDEN, "This is the page of another site.")
    if token is None:
        # A name that some site lets point to this machine is not of this machine.
        name = urlsplit(f"//{host}").hostname
        return None if name in LOOPBACK else _answer(http.HTTPStatus.FORBIDDEN, "Wrong host.")
    port = host.rpartition(":")[2]
    cookie_name = f"{COOKIE}-{port}" if port.isdecimal() else COOKIE
    query = parse_qs(urlsplit(request.path).query)
    if _is(token, query.get("token", [""])[0]):
        cookie = f"{cookie_name}={token}; HttpOnly; SameSite=Strict; Path=/"
        return _answer(http.HTTPStatus.SEE_OTHER, "", Location="/", **{"Set-Cookie": cookie})
    try:
        cookies = SimpleCookie(request.headers.get("Cookie", ""))
    except CookieError:
        cookies = SimpleCookie()
    if cookie_name in cookies and _is(token, cookies[cookie_name].value):
        return None
    return _answer(http.HTTPStatus.UNAUTHORIZED, "Open the address with ?token=TOKEN at its end.")


def _is(token: str, text: str) -> bool:
    return hmac.compare_digest(token.encode(), text.encode())


def _still_answer(make_still: Callable[[], bytes]) -> Response:
    try:
        page = make_still()
    except (OSError, ValueError) as error:
        return _answer(http.HTTPStatus.INTERNAL_SERVER_ERROR, f"The map cannot be read: {error}")
    return _response(http.HTTPStatus.OK, page, "text/html; charset=utf-8")


def _with_still(answer: Response) -> Response:
    """Return the page of viser, or an error of it, with the script for browsers without WebGL 2."""
    body = bytes(answer.body).replace(b"<head>", b"<head>" + TO_STILL.encode(), 1)
    return _response(http.HTTPStatus(answer.status_code), body, "text/html; charset=utf-8")


def _answer(status: http.HTTPStatus, text: str, **headers: str) -> Response:
    return _response(status, f"{text}\n".encode(), "text/plain; charset=utf-8", **headers)


def _response(status: http.HTTPStatus, body: bytes, kind: str, **headers: str) -> Response:
    fields = {"Content-Type": kind, "Content-Length": str(len(body)), **headers}
    return Response(status.value, status.phrase, Headers(fields), body)


def _limited(handler: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a handler that serves so many pages only, and ends one that sends nonsense."""
    pages: set[Any] = set()

    async def serve_page(connection: Any) -> None:
        if len(pages) >= MAX_PAGES:
            await connection.close(1013, "too many pages are open")
            return
        pages.add(connection)
        try:
            await handler(_Filtered(connection))
        except (msgspec.DecodeError, AssertionError, KeyError, TypeError, ValueError):
            await connection.close(1007, "not a message of the page")
        finally:
            pages.discard(connection)

    return serve_page


class _Filtered:
    """A connection from which only `MESSAGES` are received.

    Args:
        connection: Of websockets.
    """

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        while True:
            raw = await self._connection.recv()
            message = msgspec.msgpack.decode(raw)
            if isinstance(message, dict) and message.get("type") in MESSAGES:
                assert isinstance(raw, bytes)
                return raw
