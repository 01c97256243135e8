"""Images of a camera as frames: the newest ones with a pose, decoded only when they are needed."""

from __future__ import annotations

import json
import threading
from collections import deque
from dataclasses import dataclass, replace

from gslts.core.frame import RgbdFrame
from gslts.datasets.ros.bag import header_time_ns
from gslts.datasets.ros.poses import frame_name
from gslts.ros.config import Topics
from gslts.ros.constants import CLOCK_JUMP_NS, MAX_PAIR_GAP_NS, MAX_WAITING
from gslts.ros.decoding import Decode, FrameMessages, decode_frame
from gslts.ros.live_poses import LivePoses
from gslts.ros.problems import Problems
from gslts.types import Floats

MAX_LABEL_NAMES_BYTES = 1 << 20
"""Maximum size of the list of label names: 10,000 objects take 200 kB."""


@dataclass(frozen=True)
class Counts:
    """Numbers of images so far.

    Attributes:
        received: Colour images.
        dropped: Colour images that were replaced by newer ones, or had no partner or no pose.
        taken: Frames that were decoded.
    """

    received: int = 0
    dropped: int = 0
    taken: int = 0


class Intake:
    """Keeps the last images of the topics, serialized; `take` makes a frame of the newest ones.

    Args:
        topics: Names of the topics.
        poses: Poses of the camera.
        decode: Decodes a serialized message of a topic.
        problems: Gets what is wrong with messages.
    """

    def __init__(
        self, topics: Topics, poses: LivePoses, decode: Decode, problems: Problems
    ) -> None:
        self._topics, self._poses, self._decode, self._problems = topics, poses, decode, problems
        names = [topics.rgb, topics.depth, *filter(None, [topics.labels])]
        self._images = {name: deque[tuple[int, bytes]](maxlen=MAX_WAITING) for name in names}
        self._infos: dict[str, bytes] = {}
        self._label_names: tuple[str, ...] = ()
        self._last_ns = 0
        self._counts = Counts()
        self._new = threading.Condition()

    @property
    def counts(self) -> Counts:
        """Numbers of images so far."""
        with self._new:
            return self._counts

    def add_image(self, topic: str, message: bytes) -> None:
        """Add an image; returns at once.

        Args:
            topic: Of the image.
            message: Serialized, with a header first.
        """
        try:
            time_ns = header_time_ns(message)
            if time_ns <= 0:
                raise ValueError("an image has the stamp zero")
        except ValueError as error:
            self._problems.report(topic, str(error))
            return
        with self._new:
            images = self._images[topic]
            if images and time_ns < images[-1][0]:
                if time_ns > images[-1][0] - CLOCK_JUMP_NS:
                    self._problems.report(topic, "an image is older than the last one: dropped")
                    return
                self._problems.report(topic, "the clock was set back: waiting images are dropped")
                for waiting in self._images.values():
                    waiting.clear()
                self._last_ns = 0
            images.append((time_ns, message))
            if topic == self._topics.rgb:
                counts = self._counts
                self._counts = replace(counts, received=counts.received + 1)
            self._new.notify_all()

    def add_info(self, topic: str, message: bytes) -> None:
        """Add a CameraInfo; the last one holds.

        Args:
            topic: Of the message.
            message: Serialized.
        """
        with self._new:
            self._infos[topic] = message

    def add_label_names(self, text: str) -> None:
        """Set the types of the labelled objects.

        Args:
            text: JSON list of strings.
        """
        try:
            if len(text) > MAX_LABEL_NAMES_BYTES:
                raise ValueError(f"more than {MAX_LABEL_NAMES_BYTES} characters")
            names = json.loads(text)
            if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
                raise ValueError("expected a JSON list of strings")
        except (ValueError, RecursionError) as error:
            self._problems.report(self._topics.label_names, str(error))
            return
        with self._new:
            self._label_names = tuple(names)

    def take(self, timeout_s: float) -> RgbdFrame | None:
        """Decode the newest images that are not older than the last frame and have a pose.

        Args:
            timeout_s: Maximum time to wait for them, s.

        Returns:
            The frame at the pose that the robot believes, stamped in seconds; None if none came.
        """
        with self._new:
            found = self._choose()
            if found is None:
                self._new.wait(timeout_s)
                found = self._choose()
            if found is None:
                return None
            self._last_ns = found.time_ns
        try:
            frame = decode_frame(found, self._topics, self._decode)
        except ValueError as error:
            self._problems.report(self._topics.rgb, str(error))
            return None
        with self._new:
            taken = self._counts.taken + 1
            waiting = sum(time_ns > self._last_ns for time_ns, _ in self._images[self._topics.rgb])
            dropped = self._counts.received - taken - waiting
            self._counts = replace(self._counts, taken=taken, dropped=dropped)
        return frame

    @property
    def newest_s(self) -> float:
        """Stamp of the newest colour image, s; 0 before the first one."""
        with self._new:
            images = self._images[self._topics.rgb]
            return images[-1][0] * 1e-9 if images else 0.0

    def latest_pose(self) -> Floats:
        """Return the newest pose of the camera by its source, [4,4] world_from_camera, m.

        Raises:
            ValueError: It is not known, or there is no source.
        """
        with self._new:
            info = self._infos.get(self._topics.rgb_info)
        if info is None:
            raise ValueError(f"no CameraInfo has come on {self._topics.rgb_info}")
        return self._poses.latest(self._frame_of(info))

    def base_from_camera(self) -> Floats | None:
        """Return the pose of the camera on the robot, [4,4], m; None if it is not known."""
        with self._new:
            info = self._infos.get(self._topics.rgb_info)
        return None if info is None else self._poses.base_from_camera(self._frame_of(info))

    def _choose(self) -> FrameMessages | None:
        """Return the messages of the newest complete frame; None if there is none."""
        topics = self._topics
        info = self._infos.get(topics.rgb_info)
        if info is None:
            if self._images[topics.rgb]:
                self._problems.report(topics.rgb_info, "no CameraInfo has come yet")
            return None
        reason = ""
        for time_ns, rgb in reversed(self._images[topics.rgb]):
            if time_ns <= self._last_ns:
                break
            try:
                partners = {name: self._partner(name, time_ns) for name in self._images}
                partners[topics.rgb] = rgb
                pose, depth_pose = self._poses.at(time_ns, self._frame_of(info)), None
                if topics.depth_info in self._infos:
                    frame = self._frame_of(self._infos[topics.depth_info])
                    depth_pose = self._poses.at(time_ns, frame)
                return FrameMessages(
                    time_ns, partners, dict(self._infos), self._label_names, pose, depth_pose
                )
            except ValueError as error:
                reason = str(error)
        if reason and len(self._images[topics.rgb]) == MAX_WAITING:
            self._problems.report(topics.rgb, reason)
        return None

    def _partner(self, topic: str, time_ns: int) -> bytes:
        """Return the image of a topic that is nearest to a time."""
        images = self._images[topic]
        best = min(images, key=lambda image: abs(image[0] - time_ns), default=None)
        if best is None or abs(best[0] - time_ns) > MAX_PAIR_GAP_NS:
            gap_s = MAX_PAIR_GAP_NS / 1e9
            raise ValueError(f"there is no image of {topic} within {gap_s:g} s of it")
        return best[1]

    def _frame_of(self, info: bytes) -> str:
        return frame_name(self._decode(self._topics.rgb_info, info).header.frame_id)
