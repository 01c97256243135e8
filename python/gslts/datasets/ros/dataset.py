"""ROS 2 bags (sqlite3 or mcap): pictures with CameraInfo, and poses from tf2 or a topic."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.datasets.dataset import Dataset, name_of, pinhole
from gslts.datasets.ros.bag import Bag, Place
from gslts.datasets.ros.images import camera_of, depth_of, rgb_of
from gslts.datasets.ros.poses import FrameTree, Track, plain, time_of
from gslts.datasets.ros.topics import POSE_TYPES, TF, TF_STATIC, ImageTopic, choose_topics
from gslts.datasets.undistort import Lens, undistort_depth, undistort_rgb

MOST_APART_NS = 20_000_000
"""Colours and depth that are farther apart in time do not belong together."""
SAME_PX = 0.01
"""Intrinsics that differ by less are the same."""
WORLDS = ("earth", "map", "odom", "world")
"""Frames that do not move, by REP 105 and custom; before them may stand a name of the robot."""
FILES = (".mcap", ".db3")


@dataclass(frozen=True, eq=False)
class RosCamera:
    """A camera of a bag: its intrinsics, its lens and its optical frame."""

    camera: Camera
    lens: Lens | None
    frame: str


@dataclass(frozen=True, eq=False)
class RosFrame:
    """A frame that is still in its bag.

    Args:
        bag: The bag.
        rgb: The message with the colours.
        camera: Intrinsics and pose of the colours, without the lens.
        lens: That distorts them; None if none does.
        depth: The message with the depth; None if there is none.
        depth_camera: Intrinsics and pose of the depth, without the lens; None if it is registered.
        depth_lens: That distorts the depth; None if none does.
    """

    bag: Bag
    rgb: Place
    camera: Camera
    lens: Lens | None
    depth: Place | None = None
    depth_camera: Camera | None = None
    depth_lens: Lens | None = None

    @property
    def name(self) -> str:
        """The time of the picture, s."""
        seconds, nanoseconds = divmod(self.rgb.time_ns, 1_000_000_000)
        return f"{seconds}.{nanoseconds:09}"

    def read(self) -> RgbdFrame:
        """Reads the messages."""
        rgb = self._pixels(self.rgb, self.camera, rgb_of)
        mask = None
        if self.lens is not None:
            rgb, mask = undistort_rgb(rgb, self.camera, self.lens)
        depth = np.zeros(rgb.shape[:2], np.float32)
        if self.depth is not None:
            depth_camera = self.depth_camera or self.camera
            depth = self._pixels(self.depth, depth_camera, depth_of)
            if self.depth_lens is not None:
                depth = undistort_depth(depth, depth_camera, self.depth_lens)
        return RgbdFrame(rgb, depth, self.camera, self.rgb.time_ns * 1e-9, self.depth_camera, mask)

    def _pixels(self, place: Place, camera: Camera, decode: Any) -> Any:
        where = f"{self.bag.path}: {place.topic} at {place.time_ns} ns"
        message = self.bag.read(place)
        try:
            pixels = decode(message)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        height, width = pixels.shape[:2]
        if (height, width) != (camera.height, camera.width):
            raise ValueError(
                f"{where}: it has {width} x {height} px, expected {camera.width} x {camera.height}"
            )
        return pixels


def is_rosbag(path: Path) -> bool:
    """Whether a path is a file of a bag, or a folder with the metadata of one."""
    if path.is_file():
        return path.suffix in FILES
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        return False
    with metadata.open("rb") as file:
        return b"rosbag2_bagfile_information" in file.read(4096)


def open_rosbag(path: Path) -> Dataset:
    """Opens a bag; all colour pictures that have a pose become frames.

    Topics are chosen by `choose_topics`. Poses come from /tf and /tf_static where the topmost frame
    above the camera's optical frame is a world, such as map or odom, or where there is no other
    source; otherwise from the one topic of poses. Odometry names the frame whose pose it is, other
    types do not: they are taken as poses of the topmost frame above the camera, usually base_link.

    Raises:
        ImportError: The package rosbags is missing.
        OSError: The bag cannot be read.
        ValueError: It is damaged, or topics are missing or ambiguous; the message lists them.
    """
    bag = Bag(path)
    colour, depth = choose_topics(bag)
    rgb_camera = _camera(bag, colour)
    depth_camera = None
    if depth is not None and depth.info is not None:
        depth_camera = _camera(bag, depth)
    tree, tracks = _poses(bag)
    poses = _PoseSource(path, tree, tracks, rgb_camera.frame)
    wanted = [colour.topic] if depth is None else [colour.topic, depth.topic]
    places = bag.places(wanted)
    depth_places = [] if depth is None else places[depth.topic]
    depth_times = np.array([place.time_ns for place in depth_places], np.int64)

    frames: list[RosFrame] = []
    skipped: list[str] = []
    for place in places[colour.topic]:
        frame = RosFrame(bag, place, rgb_camera.camera, rgb_camera.lens)
        try:
            camera = at_pose(rgb_camera.camera, poses.world_from_camera(place.time_ns))
            beside = None
            if depth_camera is not None and not _same_view(rgb_camera, depth_camera):
                moved = tree.find(rgb_camera.frame, depth_camera.frame, place.time_ns)
                beside = at_pose(depth_camera.camera, camera.world_from_camera @ moved)
            frames.append(
                RosFrame(
                    bag,
                    place,
                    camera,
                    rgb_camera.lens,
                    None if depth is None else _nearest(depth_places, depth_times, place),
                    beside,
                    rgb_camera.lens if depth_camera is None else depth_camera.lens,
                )
            )
        except ValueError as error:
            skipped.append(f"{frame.name}: {error}")
    name = path.stem if path.is_file() else name_of(path)
    return Dataset(name, tuple(frames), tuple(skipped))


def _camera(bag: Bag, topic: ImageTopic) -> RosCamera:
    try:
        intrinsics, size, lens = camera_of(bag.first(str(topic.info)), topic.rectified)
        return RosCamera(pinhole(intrinsics, size, np.eye(4)), lens, topic.frame)
    except ValueError as error:
        raise ValueError(f"{bag.path}: {topic.info}: {error}") from None


def _same_view(first: RosCamera, second: RosCamera) -> bool:
    """Whether two cameras without their lenses are one, so that their pixels belong together."""
    a, b = first.camera, second.camera
    apart = np.subtract((a.fx, a.fy, a.cx, a.cy), (b.fx, b.fy, b.cx, b.cy))
    same_size = (a.width, a.height) == (b.width, b.height)
    return first.frame == second.frame and same_size and bool(np.abs(apart).max() < SAME_PX)


def _nearest(places: list[Place], times: Any, wanted: Place) -> Place:
    """The depth next in time; `times` are those of `places`, in ns and in order."""
    after = int(np.searchsorted(times, wanted.time_ns))
    near = places[max(after - 1, 0) : after + 1]
    best = min(near, key=lambda place: abs(place.time_ns - wanted.time_ns), default=None)
    if best is None or abs(best.time_ns - wanted.time_ns) > MOST_APART_NS:
        raise ValueError(f"there is no depth within {MOST_APART_NS / 1e9:g} s")
    return best


@dataclass(frozen=True)
class _PoseTopic:
    """Poses of a frame, "" if it is not named."""

    child: str
    track: Track


def _poses(bag: Bag) -> tuple[FrameTree, dict[str, _PoseTopic]]:
    """Everything that the bag says about where something is."""
    tree = FrameTree()
    tracks: dict[str, _PoseTopic] = {}
    kinds = bag.topics
    topics = [topic for topic, kind in kinds.items() if kind in POSE_TYPES]
    for topic, _, message in bag.messages([*topics, TF, TF_STATIC]):
        if topic in (TF, TF_STATIC):
            for transform in message.transforms:
                tree.add(transform, fixed=topic == TF_STATIC)
            continue
        pose = message.pose if kinds[topic].endswith("/PoseStamped") else message.pose.pose
        child = plain(getattr(message, "child_frame_id", ""))
        one = tracks.setdefault(topic, _PoseTopic(child, Track()))
        one.track.add(time_of(message.header), pose.position, pose.orientation)
    return tree, tracks


class _PoseSource:
    """Where a camera is, from tf2 or from a topic of poses."""

    def __init__(
        self, path: Path, tree: FrameTree, topics: dict[str, _PoseTopic], frame: str
    ) -> None:
        self._tree, self._frame = tree, frame
        self._topic: _PoseTopic | None = None
        try:
            self._top = tree.ancestors(frame)[-1]
            moves = tree.moves(frame)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        if moves and (self._top.rpartition("/")[2] in WORLDS or not topics):
            return
        if len(topics) != 1:
            raise ValueError(
                f"{path}: no world is above {frame} in {TF}, and there are "
                f"{', '.join(topics) or 'no topics'} with poses, where one is expected"
            )
        (self._topic,) = topics.values()

    def world_from_camera(self, time_ns: int) -> Any:
        """[4,4] at a time.

        Raises:
            ValueError: It is not known.
        """
        if self._topic is None:
            return self._tree.find(self._top, self._frame, time_ns)
        camera = self._tree.find(self._topic.child or self._top, self._frame, time_ns)
        return self._topic.track.at(time_ns) @ camera
