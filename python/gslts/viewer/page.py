"""A page: its panel, and the scene that one browser sees."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gslts.core.se3 import rotation_of_quat
from gslts.types import Floats
from gslts.viewer.blocks import Block, Cell
from gslts.viewer.divider import STILL_M, Divider
from gslts.viewer.goals import Goal
from gslts.viewer.live import LiveFrame
from gslts.viewer.object_panel import ObjectPanel
from gslts.viewer.overlay import Overlay
from gslts.viewer.panel_text import EMPTY, paragraphs
from gslts.viewer.path_panel import PathPanel
from gslts.viewer.picking import is_in_view
from gslts.viewer.query_panel import QueryPanel
from gslts.viewer.robot_panel import RobotPanel
from gslts.viewer.splats import Splats
from gslts.viewer.viewed_map import ViewedMap

FIRST_GAUSSIANS = 50_000
"""Number of Gaussians that are sent first, so that the nearest in view show early. The page sorts
all it has after each message: with more messages, all of a large map show later."""
ANSWER_S = 2.0
"""Maximum time that a page takes to answer, s; one that is in no window draws and answers later."""
REST_S = 0.3
"""Time without a move after which colours are computed for the new direction, s."""
PLAY_S = 1.0
"""Time between the versions of *Play*, s."""
UNASKED = {"robot", "follow", "problem"}
"""Tasks that nobody on the page asks for; they interrupt nothing, as a robot posts them often."""
NO_EVENT = "..."
"""First entry of the list of object changes."""

_logger = logging.getLogger(__name__)


class Page:
    """An open page. Its work is done in a thread of its own: a page that asks much waits for it.

    Args:
        client: Of viser.
        viewed: The map.
        send_goal: Sends a robot to a goal; None if pages may not, or there is no robot.
    """

    def __init__(
        self, client: Any, viewed: ViewedMap, send_goal: Callable[[Goal], None] | None = None
    ) -> None:
        self._client, self._map, self._send_goal = client, viewed, send_goal
        self._overlay = Overlay(client.scene, viewed.origin)
        self._splats = Splats(client.scene)
        self._shown, self._replaced = 0, viewed.replaced
        self._robot: RobotPanel | None = None
        self._tasks: dict[str, Callable[[], None]] = {}
        self._changed = threading.Condition()
        self._is_open = True
        self._problem = client.gui.add_html("")
        self.post("begin", self._begin)
        threading.Thread(target=self._work, daemon=True).start()

    def close(self) -> None:
        """End the work for the page."""
        with self._changed:
            self._is_open = False
            self._changed.notify()

    def post(self, name: str, task: Callable[[], None]) -> None:
        """Let something be done soon.

        Args:
            name: Of the task; one of the same name that has not begun is dropped.
            task: To do.
        """
        with self._changed:
            self._tasks[name] = task
            self._changed.notify()

    def follow(self) -> None:
        """Tell the page that the map has new versions."""
        self.post("follow", self._follow)

    def report(self, problem: str) -> None:
        """Show a problem of the map.

        Args:
            problem: In words; "" for none.
        """
        lines = [problem] if problem else []
        self.post("problem", lambda: setattr(self._map_problem, "content", paragraphs(lines)))

    def show_robot(self, live: LiveFrame, path: Sequence[Floats]) -> None:
        """Show a frame of the robot.

        Args:
            live: The frame.
            path: (3,) positions of the robot so far, the newest last, m.
        """
        self.post("robot", lambda: self._show_robot(live, path))

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._tasks or not self._is_open)
                if not self._is_open:
                    return
                task = self._tasks.pop(next(iter(self._tasks)))
            problem: list[str] = []
            try:
                task()
            except (OSError, ValueError, RuntimeError, ImportError) as error:
                problem = [" ".join(str(error).split())]
            except Exception:  # Whatever a page sends, the next wish is heard.
                _logger.exception("%s: a page asked for what failed", self._map.name)
            if self._is_open:
                self._problem.content = paragraphs(problem)

    def _begin(self) -> None:
        self._build_panel()
        self._shown = self._number
        position, target, fov_rad = self._map.first_view()
        self._tasks.pop("camera", None)
        with self._client.atomic():
            self._client.camera.fov = fov_rad
            self._look(position, target)
            self._divider.show_still()
        self._wait_until_at(position)
        self._show_version()

    def _wait_until_at(self, position: Floats) -> None:
        """Wait until the page answers that it is there, and so has the image that came with it.

        Without a GPU, the first frame of many Gaussians takes 10 s and more: what comes with them,
        an image or a camera, is handled after it.
        """

        def is_there() -> bool:
            answered = "camera" in self._tasks
            return answered and np.allclose(self._client.camera.position, position, atol=STILL_M)

        with self._changed:
            self._changed.wait_for(lambda: is_there() or not self._is_open, ANSWER_S)

    def _build_panel(self) -> None:
        gui, newest = self._client.gui, self._map.newest
        self._map_problem = gui.add_html("")
        with gui.add_folder("Version"):
            self._slider = gui.add_slider(
                "Version", min=1, max=newest, step=1, initial_value=newest, disabled=newest == 1
            )
            self._described = gui.add_html("")
            self._following = gui.add_checkbox("Follow new versions", True)
            play = gui.add_button("Play")
        with gui.add_folder("Changes"):
            self._before = gui.add_slider(
                "Since", min=1, max=newest, step=1, initial_value=newest, disabled=newest == 1
            )
            self._event = gui.add_dropdown("Go to", self._events())
            self._images = gui.add_image(EMPTY, format="jpeg", visible=False)
            self._divider = Divider(
                self._client,
                self._map,
                lambda: (min(int(self._before.value), self._map.newest), self._shown),
                self._connect,
                self._splats.hide,
            )
            self._boxes = gui.add_checkbox("Boxes", True)
            self._cameras = gui.add_checkbox("Cameras", False)
        self._paths = PathPanel(
            gui,
            self._map,
            self._overlay,
            lambda: self._shown,
            lambda: self._eye + self._map.origin,
            self._send_goal,
            self._connect,
        )
        common = (gui, self._map, self._overlay, self._paths, lambda: self._shown, self._connect)
        self._object = ObjectPanel(*common)
        QueryPanel(*common)
        for control, name, task in (
            (self._slider.on_update, "show", self._show_version),
            (self._before.on_update, "changes", self._show_changes),
            (self._event.on_update, "event", self._show_event),
            (self._boxes.on_update, "changes", self._show_changes),
            (self._cameras.on_update, "cameras", self._show_cameras),
            (self._following.on_update, "following", self._follow),
            (play.on_click, "play", self._play),
            (self._client.camera.on_update, "camera", self._on_camera),
        ):
            self._connect(control, name, task)

        @self._client.scene.on_click()  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            ray = np.array(event.ray_origin) + self._map.origin, np.array(event.ray_direction)
            self.post("click", lambda: self._object.show(*ray))

    def _connect(self, control: Any, name: str, task: Callable[[], None]) -> None:
        async def post(event: Any) -> None:
            # Values that the program sets, such as the maximum of a slider, are no wish of anybody.
            if getattr(event, "client", self._client) is not None:
                self.post(name, task)

        control(post)

    @property
    def _number(self) -> int:
        return min(max(1, int(self._slider.value)), self._map.newest)

    @property
    def _eye(self) -> Floats:
        """(3,) position of the viewer, relative to the origin of the map, m."""
        eye = np.asarray(self._client.camera.position, np.float64)
        return eye if np.isfinite(eye).all() else np.zeros(3)

    def _show_version(self) -> None:
        number = self._number
        self._show_blocks(self._map.blocks(number))
        described = paragraphs(self._map.describe(number))
        is_new = number != self._shown or described != self._described.content
        self._shown, self._described.content = number, described
        if is_new:
            self._before.value = max(1, number - 1)
            self._object.clear()
            self._overlay.clear("path")
            self._show_changes()
        if self._cameras.value:
            self._show_cameras()

    def _show_blocks(self, blocks: dict[Cell, Block]) -> None:
        """Send the blocks that differ from those of the page; at first, the nearest in view."""
        eye = self._eye
        parts = [self._splats.changes(blocks, eye)]
        if self._splats.is_empty:
            forward = rotation_of_quat(np.asarray(self._client.camera.wxyz, np.float64))[:, 2]
            parts[0].sort(key=lambda change: _priority(change[1].middle - eye, forward))
            counts = np.cumsum([len(block.centers) for _, block, _ in parts[0]])
            first = int(np.searchsorted(counts, FIRST_GAUSSIANS)) + 1
            parts = [parts[0][:first], parts[0][first:]]
        for part in parts:
            with self._client.atomic():
                self._splats.send(part)
                self._splats.remove_others(blocks)
            self._client.flush()

    def _is_asked(self, timeout_s: float = 0) -> bool:
        """Wait until something is asked for; return whether it is, or the page is closed."""

        def is_asked() -> bool:
            return not self._is_open or not self._tasks.keys() <= UNASKED

        with self._changed:
            return self._changed.wait_for(is_asked, timeout_s)

    def _on_camera(self) -> None:
        if self._is_asked(REST_S):  # It does not rest, or something else comes first.
            with self._changed:
                self._tasks.setdefault("camera", self._on_camera)
            return
        self._divider.update()
        if self._shown and self._map.gaussians(self._shown).sh_degree > 0:
            self._show_blocks(self._map.blocks(self._shown))

    def _events(self) -> tuple[str, ...]:
        """Return the list of all object changes, the newest first."""
        changes = self._map.changes(1, self._map.newest)
        return (NO_EVENT, *sorted(changes, key=lambda text: -changes[text][1].version))

    def _follow(self) -> None:
        newest, replaced = self._map.newest, self._map.replaced
        is_new = newest > self._slider.max or replaced != self._replaced
        self._replaced = replaced
        if is_new:
            self._event.options = self._events()
        for slider in (self._slider, self._before):
            if slider.value > newest:
                slider.value = newest
            slider.max, slider.disabled = newest, newest == 1
        if is_new:
            if self._following.value:
                self._slider.value = newest
            self._show_version()

    def _play(self) -> None:
        self._following.value = False
        self._play_from(1 if self._number == self._map.newest else self._number + 1)

    def _play_from(self, number: int) -> None:
        """Show a version soon, and let the next one follow, unless something else is asked for."""
        if self._is_asked(PLAY_S):
            return
        self._slider.value = number
        self._show_version()
        if number < self._map.newest and not self._is_asked():
            self.post("play", lambda: self._play_from(number + 1))

    def _show_changes(self) -> None:
        self._overlay.clear("changes")
        before = min(int(self._before.value), self._map.newest)
        if self._boxes.value:
            for track, event in self._map.changes(before, self._shown).values():
                self._overlay.event("changes", event, track.name)
        self._divider.update()
        self._show_images(self._shown)

    def _show_images(self, number: int) -> None:
        """Show the frames of an update, and the map before and after it."""
        image = self._map.update_image(number)
        self._images.visible = image is not None
        if image is not None:
            self._images.image = image

    def _show_event(self) -> None:
        """Go to the version that shows the chosen change, and look at it."""
        found = self._map.changes(1, self._map.newest).get(self._event.value)
        if found is None:
            return
        _, event = found
        self._slider.value = event.version
        self._show_version()
        box = event.boxes[1] or event.boxes[0]
        if box is not None:
            self._look_at(np.mean(box, axis=0))

    def _look_at(self, point: Floats) -> None:
        """Move to the camera of the map that sees a point best."""
        views = [
            (float(np.linalg.norm(point - camera.world_from_camera[:3, 3])), camera)
            for camera in self._map.cameras(self._shown)
            if is_in_view(camera, point)
        ]
        if views:
            camera = min(views, key=lambda view: view[0])[1]
            position = camera.world_from_camera[:3, 3]
            self._look_in_world(position, point)

    def _look(self, position: Floats, target: Floats) -> None:
        camera = self._client.camera
        with self._client.atomic():
            camera.up_direction = (0.0, 0.0, 1.0)
            camera.position = position
            camera.look_at = target

    def _show_robot(self, live: LiveFrame, path: Sequence[Floats]) -> None:
        if self._robot is None:
            self._robot = RobotPanel(
                self._client.gui, self._map, self._overlay, self._look_in_world
            )
        self._robot.show(live, path)
        self._paths.robot_at = path[-1] if path else None

    def _look_in_world(self, position: Floats, target: Floats) -> None:
        self._look(position - self._map.origin, target - self._map.origin)

    def _show_cameras(self) -> None:
        self._overlay.clear("cameras")
        if self._cameras.value:
            self._overlay.cameras("cameras", self._map.cameras(self._shown))


def _priority(offset: Floats, forward: Floats) -> float:
    """Return a number that is less for a block that is near and before the viewer."""
    ahead = float(offset @ forward)
    return float(np.linalg.norm(offset)) + (0 if ahead > 0 else 1e6)
