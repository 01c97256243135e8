"""ROS 2 bags (sqlite3 or mcap) as data sets: images with CameraInfo, poses from tf2 or a topic."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.datasets.dataset import Dataset, name_of, pinhole
from gslts.datasets.ros.bag import Bag, MessageKey
from gslts.datasets.ros.images import camera_of, depth_of, rgb_of
from gslts.datasets.ros.poses import FrameTree, Track, frame_name, time_of
from gslts.datasets.ros.topics import POSE_TYPES, TF, TF_STATIC, ImageTopic, choose_topics
from gslts.datasets.undistort import Lens, undistort_depth, undistort_rgb

MAX_GAP_NS = 20_000_000
"""Maximum time between a colour and a depth image of one frame: less than a frame at 30 Hz."""
SAME_PX = 0.01
"""Tolerance of intrinsics of one camera, px; messages store them in double precision."""
ROS1 = ".bag"
"""Ending of bags of ROS 1, which are not read."""
WORLDS = ("earth", "map", "odom", "world")
"""Fixed frames by REP 105 and custom; the name of the robot may precede them."""


@dataclass(frozen=True, eq=False)
class RosCamera:
    """A camera of a bag.

    Args:
        camera: Intrinsics; the pose is the identity.
        lens: Distortion; None for a pinhole.
        frame: Name of its optical frame.
    """

    camera: Camera
    lens: Lens | None
    frame: str


@dataclass(frozen=True, eq=False)
class RosFrame:
    """A frame in a bag, not read yet.

    Args:
        bag: The bag.
        rgb: Message with the colour image.
        camera: Intrinsics and pose of the undistorted colour image.
        lens: Distortion of the colour image; None for a pinhole.
        depth: Message with the depth image; None without depth.
        depth_camera: Intrinsics and pose of the undistorted depth image; None if it is registered.
        depth_lens: Distortion of the depth image; None for a pinhole.
    """

    bag: Bag
    rgb: MessageKey
    camera: Camera
    lens: Lens | None
    depth: MessageKey | None = None
    depth_camera: Camera | None = None
    depth_lens: Lens | None = None

    @property
    def name(self) -> str:
        """Time stamp of the colour image, s."""
        seconds, nanoseconds = divmod(self.rgb.time_ns, 1_000_000_000)
        return f"{seconds}.{nanoseconds:09}"

    def read(self) -> RgbdFrame:
        """Read the images; see `gslts.datasets.dataset.Frame.read`."""
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

    def _pixels(self, key: MessageKey, camera: Camera, decode: Any) -> Any:
        where = f"{self.bag.path}: {key.topic} at {key.time_ns} ns"
        message = self.bag.read(key)
        try:
            pixels = decode(message)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        height, width = pixels.shape[:2]
        if (height, width) != (camera.height, camera.width):
            raise ValueError(
                f"{where}: {width} x {height} px, expected {camera.width} x {camera.height} px"
            )
        return pixels


def is_rosbag(path: Path) -> bool:
    """Return True if a path is a file of a bag, or a folder with the metadata of a bag.

    Args:
        path: Any path.
    """
    if path.is_file():
        return path.suffix in (".mcap", ".db3", ROS1)
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        return False
    with metadata.open("rb") as file:
        return b"rosbag2_bagfile_information" in file.read(4096)


def open_rosbag(path: Path) -> Dataset:
    """Open a bag; all colour images that have a pose become frames.

    Without a source of poses, all of them are frames without a pose.

    `choose_topics` chooses the topics. Poses come from /tf and /tf_static if the root above the
    camera's optical frame is fixed, such as map or odom, or if there is no other source; otherwise
    from the one topic of poses. Odometry names its child frame; other types do not, and are taken
    as poses of the root above the camera, usually base_link.

    Args:
        path: Folder of the bag, or a single file .mcap or .db3.

    Raises:
        ImportError: The package rosbags is missing.
        OSError: The bag cannot be read.
        ValueError: The bag is damaged, or topics of images are missing or ambiguous; the message
            lists them.
    """
    if path.suffix == ROS1:
        raise ValueError(
            f"{path}: a bag of ROS 1: convert it with rosbags-convert --src {path.name} "
            f"--dst {path.stem} --dst-typestore ros2_humble (pip install 'gslts[ros]')"
        )
    bag = Bag(path)
    colour, depth = choose_topics(bag)
    rgb_camera = _camera(bag, colour)
    depth_camera = None
    if depth is not None and depth.info is not None:
        depth_camera = _camera(bag, depth)
    tree, tracks = _poses(bag)
    if depth_camera is not None and not _same_view(rgb_camera, depth_camera):
        _require_connected(bag, tree, rgb_camera.frame, depth_camera.frame)
    poses, why_unposed = None, ""
    try:
        poses = _PoseSource(tree, tracks, rgb_camera.frame)
    except ValueError as error:
        why_unposed = str(error)
    wanted = [colour.topic] if depth is None else [colour.topic, depth.topic]
    keys = bag.keys(wanted)
    depth_keys = [] if depth is None else keys[depth.topic]
    depth_times = np.array([key.time_ns for key in depth_keys], np.int64)

    frames: list[RosFrame] = []
    skipped: list[str] = []
    for key in keys[colour.topic]:
        frame = RosFrame(bag, key, rgb_camera.camera, rgb_camera.lens)
        try:
            camera = rgb_camera.camera
            if poses is not None:
                camera = at_pose(camera, poses.world_from_camera(key.time_ns))
            posed_depth_camera = None
            if depth_camera is not None and not _same_view(rgb_camera, depth_camera):
                rgb_from_depth = tree.find(rgb_camera.frame, depth_camera.frame, key.time_ns)
                posed_depth_camera = at_pose(
                    depth_camera.camera, camera.world_from_camera @ rgb_from_depth
                )
            frames.append(
                RosFrame(
                    bag,
                    key,
                    camera,
                    rgb_camera.lens,
                    None if depth is None else _nearest(depth_keys, depth_times, key),
                    posed_depth_camera,
                    rgb_camera.lens if depth_camera is None else depth_camera.lens,
                )
            )
        except ValueError as error:
            skipped.append(f"{frame.name}: {error}")
    name = path.stem if path.is_file() else name_of(path)
    if poses is None:
        return Dataset(name, (), tuple(skipped), unposed=tuple(frames), why_unposed=why_unposed)
    return Dataset(name, tuple(frames), tuple(skipped))


def _camera(bag: Bag, topic: ImageTopic) -> RosCamera:
    try:
        intrinsics, size, lens = camera_of(bag.first(str(topic.info)), topic.rectified)
        return RosCamera(pinhole(intrinsics, size, np.eye(4)), lens, topic.frame)
    except ValueError as error:
        raise ValueError(f"{bag.path}: {topic.info}: {error}") from None


def _require_connected(bag: Bag, tree: FrameTree, rgb: str, depth: str) -> None:
    """Check that the transforms between both cameras are known."""
    try:
        tree.newest_ns(rgb, depth)
    except ValueError as error:
        raise ValueError(
            f"{bag.path}: the depth is not aligned to the colours, and the position of its camera "
            f"is not known: {error}; record {TF_STATIC} too, or aligned depth (RealSense: "
            "align_depth.enable:=true, Azure Kinect: depth_to_rgb)"
        ) from None


def _same_view(first: RosCamera, second: RosCamera) -> bool:
    """Return True if two undistorted cameras have the same pixels."""
    a, b = first.camera, second.camera
    difference = np.subtract((a.fx, a.fy, a.cx, a.cy), (b.fx, b.fy, b.cx, b.cy))
    same_size = (a.width, a.height) == (b.width, b.height)
    return first.frame == second.frame and same_size and bool(np.abs(difference).max() < SAME_PX)


def _nearest(keys: list[MessageKey], times: Any, wanted: MessageKey) -> MessageKey:
    """Return the message nearest in time; `times` are those of `keys`, in ns, ascending."""
    after = int(np.searchsorted(times, wanted.time_ns))
    near = keys[max(after - 1, 0) : after + 1]
    best = min(near, key=lambda key: abs(key.time_ns - wanted.time_ns), default=None)
    if best is None or abs(best.time_ns - wanted.time_ns) > MAX_GAP_NS:
        raise ValueError(f"there is no depth within {MAX_GAP_NS / 1e9:g} s")
    return best


@dataclass(frozen=True)
class _PoseTopic:
    """Poses of a frame; its name is "" where the type of the messages does not name it."""

    child: str
    track: Track


def _poses(bag: Bag) -> tuple[FrameTree, dict[str, _PoseTopic]]:
    """Read all transforms and all topics of poses."""
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
        child = frame_name(getattr(message, "child_frame_id", ""))
        poses = tracks.setdefault(topic, _PoseTopic(child, Track()))
        poses.track.add(time_of(message.header), pose.position, pose.orientation)
    return tree, tracks


class _PoseSource:
    """Finds poses of a camera in tf2 or in a topic of poses."""

    def __init__(self, tree: FrameTree, topics: dict[str, _PoseTopic], frame: str) -> None:
        self._tree, self._frame = tree, frame
        self._topic: _PoseTopic | None = None
        self._top = tree.ancestors(frame)[-1]
        moves = tree.moves(frame)
        if moves and (self._top.rpartition("/")[2] in WORLDS or not topics):
            return
        if len(topics) != 1:
            raise ValueError(
                f"no fixed frame ({', '.join(WORLDS)}) is above {frame} in {TF}; then one "
                f"topic with poses is needed, and there are {', '.join(topics) or 'none'}"
            )
        (self._topic,) = topics.values()

    def world_from_camera(self, time_ns: int) -> Any:
        """Return the pose of the camera at a time.

        Args:
            time_ns: Time in the header of its image, ns.

        Returns:
            [4,4] world_from_camera, m.

        Raises:
            ValueError: The pose is not known at that time.
        """
        if self._topic is None:
            return self._tree.find(self._top, self._frame, time_ns)
        camera = self._tree.find(self._topic.child or self._top, self._frame, time_ns)
        return self._topic.track.at(time_ns) @ camera
