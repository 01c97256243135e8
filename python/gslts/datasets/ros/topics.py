"""Which topics of a bag are the colours and the depth of a camera."""

from __future__ import annotations

from dataclasses import dataclass

from gslts.datasets.ros.bag import Bag
from gslts.datasets.ros.images import DEPTH_ENCODINGS, encoding_of
from gslts.datasets.ros.poses import plain

TF, TF_STATIC = "/tf", "/tf_static"
IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
POSE_TYPES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "nav_msgs/msg/Odometry",
)
REGISTERED = ("aligned_depth_to_color", "depth_registered", "registered")
"""Parts of the names of depth that is in the view of the colours already."""


@dataclass(frozen=True)
class ImageTopic:
    """A topic with pictures.

    Attributes:
        topic: Its name.
        base: Its name without the ending of a compressed one.
        kind: "depth", "colour" or "grey".
        info: The topic of its CameraInfo; None if there is none.
        frame: Optical frame of the first picture.
        compressed: Whether it has CompressedImage.
    """

    topic: str
    base: str
    kind: str
    info: str | None
    frame: str
    compressed: bool

    @property
    def rectified(self) -> bool:
        """Whether its lens has been corrected, which ROS tells by the name."""
        return self.base.rpartition("/")[2].startswith("image_rect")

    @property
    def registered(self) -> bool:
        """Whether it is depth in the view of the colours, by its name."""
        return any(part in self.base for part in REGISTERED)


def choose_topics(bag: Bag) -> tuple[ImageTopic, ImageTopic | None]:
    """The colours, and the depth if there is any.

    Colours are preferred to grey pictures, registered depth to any other, rectified pictures to
    others of the same camera, and pictures to compressed ones. Colours need a CameraInfo in their
    namespace, and so does depth that is not registered.

    Raises:
        ValueError: There are none, or those of several cameras; the message lists the topics.
    """
    images = [_image_topic(bag, topic) for topic, kind in bag.topics.items() if kind in IMAGE_TYPES]
    with_info = [one for one in images if one.info is not None]
    colours = [one for one in with_info if one.kind == "colour"]
    colour = _one(bag, colours or [one for one in with_info if one.kind == "grey"], "colours")
    if colour is None:
        raise _error(bag, "there are no colour pictures with a CameraInfo beside them")
    depths = [one for one in images if one.kind == "depth"]
    registered = [one for one in depths if one.registered]
    depth = _one(bag, registered or depths, "depth")
    if depth is not None and depth.info is None and not depth.registered:
        raise _error(bag, f"there is no CameraInfo beside {depth.topic}")
    return colour, depth


def _image_topic(bag: Bag, topic: str) -> ImageTopic:
    message = bag.first(topic)
    base = topic.removesuffix("/compressed").removesuffix("/compressedDepth")
    encoding = encoding_of(message)
    compressed = not hasattr(message, "encoding")
    kind = "colour"
    if encoding in DEPTH_ENCODINGS or (compressed and "compressedDepth" in message.format):
        kind = "depth"
    elif encoding == "mono8":
        kind = "grey"
    info = f"{base.rpartition('/')[0]}/camera_info"
    return ImageTopic(
        topic=topic,
        base=base,
        kind=kind,
        info=info if bag.topics.get(info) == "sensor_msgs/msg/CameraInfo" else None,
        frame=plain(message.header.frame_id),
        compressed=compressed,
    )


def _one(bag: Bag, topics: list[ImageTopic], what: str) -> ImageTopic | None:
    """The best of the topics of one camera; None of none."""
    if len({one.base.rpartition("/")[0] for one in topics}) > 1:
        names = ", ".join(one.topic for one in topics)
        raise _error(bag, f"several cameras have {what}: {names}")
    return min(topics, key=lambda one: (not one.rectified, one.compressed, one.topic), default=None)


def _error(bag: Bag, reason: str) -> ValueError:
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in bag.topics.items())
    return ValueError(f"{bag.path}: {reason}; topics: {topics or 'none'}")
