"""The viewer: a server with a page for each browser, which follows the map."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from gslts.types import Floats
from gslts.viewer.goals import Goal
from gslts.viewer.guarded_server import open_server
from gslts.viewer.live import LiveFrame
from gslts.viewer.page import Page
from gslts.viewer.still_page import make_still_page
from gslts.viewer.viewed_map import ViewedMap

MAX_PATH = 1_000
"""Maximum number of positions of the robot's path that are shown: the newest ones."""
POLL_S = 0.25
"""Time between two questions for a new version, s; one takes a millisecond."""


class Viewer:
    """Serves the pages of a map until it is closed. A context manager.

    Args:
        folder: Folder of the map; it is only read.
        host: Address to bind.
        port: Port; 0 for a free one.
        token: Without which nobody sees anything; required if the host is not of this machine.
        clip: Folder of the CLIP of the semantics of the map, if it was moved.
        send_goal: Sends a robot to a goal; None if pages may not, or there is no robot.

    Attributes:
        url: Address of the page, without the token.

    Raises:
        ImportError: viser is missing.
        OSError: The map cannot be read, or the port is in use.
        ValueError: The folder holds no map, or the token is missing or too weak.
    """

    def __init__(
        self,
        folder: Path,
        host: str = "127.0.0.1",
        port: int = 8080,
        token: str | None = None,
        clip: Path | None = None,
        send_goal: Callable[[Goal], None] | None = None,
    ) -> None:
        self._map = ViewedMap(folder, clip)
        self._map.blocks(self._map.newest)  # Damage is found here, and the first page is fast.
        self._pages: dict[int, Page] = {}
        self._path: deque[Floats] = deque(maxlen=MAX_PATH)
        self._still_lock = threading.Lock()
        self._still = lru_cache(1)(lambda _number, _replaced: make_still_page(folder))
        self._server: Any = open_server(host, port, self._map.name, token, self._make_still)
        name = f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self._server.get_port()}"

        @self._server.on_client_connect
        async def _(client: Any) -> None:
            self._pages[client.client_id] = Page(client, self._map, send_goal)

        @self._server.on_client_disconnect
        async def _(client: Any) -> None:
            page = self._pages.pop(client.client_id, None)
            if page is not None:
                page.close()

        self._closing = threading.Event()
        self._poll = threading.Thread(target=self._follow, daemon=True)
        self._poll.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close all pages and the port."""
        self._closing.set()
        self._poll.join()
        for page in list(self._pages.values()):
            page.close()
        self._server.stop()

    def wait(self, seconds: float) -> None:
        """Serve for a time, or until the viewer is closed.

        Args:
            seconds: The time, s.
        """
        self._closing.wait(seconds)

    def show_robot(self, live: LiveFrame) -> None:
        """Show a frame of a robot on all pages.

        Args:
            live: The frame.
        """
        if live.camera is not None:
            self._path.append(live.camera.world_from_camera[:3, 3])
        for page in list(self._pages.values()):
            page.show_robot(live, list(self._path))

    def _make_still(self) -> bytes:
        with self._still_lock:  # It takes a second, and is made once for each version.
            return self._still(self._map.newest, self._map.replaced)

    def _follow(self) -> None:
        problem = ""
        while not self._closing.wait(POLL_S):
            pages = list(self._pages.values())
            try:
                is_new, now = self._map.refresh(), ""
            except (OSError, ValueError) as error:
                is_new, now = False, f"The map cannot be read any more: {error}"
            for page in pages:
                if is_new:
                    page.follow()
                if now != problem:
                    page.report(now)
            problem = now
