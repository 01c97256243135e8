"""Choice of the topics of a bag that hold the colour and depth images of one camera."""

from __future__ import annotations

from dataclasses import dataclass

from gslts.datasets.ros.bag import Bag
from gslts.datasets.ros.images import DEPTH_ENCODINGS, encoding_of
from gslts.datasets.ros.poses import frame_name

TF, TF_STATIC = "/tf", "/tf_static"
"""Topics of moving and of fixed transforms (tf2)."""
POSE_TYPES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "nav_msgs/msg/Odometry",
)
"""Message types of poses."""
REGISTERED = ("aligned_depth_to_color", "depth_to_rgb", "depth_registered", "registered")
"""Parts of topic names by which the drivers mark depth registered to the colour image: those of
RealSense, Azure Kinect and OpenNI."""
WARPED = "rgb_to_depth"
"""Part of a topic name by which the driver of Azure Kinect marks colours in the depth image's view:
they come from the image that is recorded as well, and are black where the depth is unknown."""


@dataclass(frozen=True)
class ImageTopic:
    """A topic with images.

    Attributes:
        topic: Its name.
        base: Its name without the ending of a compressed topic.
        kind: "depth", "colour", "grey", or "other" for images that are not used.
        info: Topic of its CameraInfo; None if there is none.
        frame: Optical frame of the first image.
        compressed: True if the messages are CompressedImage.
    """

    topic: str
    base: str
    kind: str
    info: str | None
    frame: str
    compressed: bool

    @property
    def rectified(self) -> bool:
        """True if the images are rectified, which ROS says by the name of the topic."""
        return self.base.rpartition("/")[2].startswith("image_rect")

    @property
    def registered(self) -> bool:
        """True if the name marks depth registered to the colour image."""
        return any(part in self.base for part in REGISTERED)


def choose_topics(bag: Bag) -> tuple[ImageTopic, ImageTopic | None]:
    """Choose the topics of the colour image and of the depth image.

    Colour is preferred to grey, registered depth to other depth, rectified images to others of the
    same camera, and raw images to compressed ones. Colour images need a CameraInfo in their
    namespace, and so does depth that is not registered.

    Args:
        bag: The bag.

    Returns:
        Topic of the colour image, and of the depth image; None without depth.

    Raises:
        ValueError: There is no colour image, or several cameras; the message lists the topics.
    """
    types = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
    images = [_image_topic(bag, topic) for topic, kind in bag.topics.items() if kind in types]
    with_info = [image for image in images if image.info is not None]
    colours = [image for image in with_info if image.kind == "colour"]
    greys = [image for image in with_info if image.kind == "grey"]
    colour = _best(bag, colours or greys, "colour images")
    if colour is None:
        raise _error(bag, "there are no colour images with a CameraInfo beside them")
    depths = [image for image in images if image.kind == "depth"]
    registered = [image for image in depths if image.registered]
    depth = _best(bag, registered or depths, "depth images")
    if depth is not None and depth.info is None and not depth.registered:
        raise _error(bag, f"there is no CameraInfo beside {depth.topic}")
    return colour, depth


def _image_topic(bag: Bag, topic: str) -> ImageTopic:
    message = bag.first(topic)
    base = topic.removesuffix("/compressed").removesuffix("/compressedDepth")
    encoding = encoding_of(message)
    compressed = not hasattr(message, "encoding")
    kind = "colour"
    if WARPED in base or (encoding == "mono16" and "depth" not in base):
        kind = "other"  # The latter is infrared.
    elif encoding in DEPTH_ENCODINGS or (compressed and "compressedDepth" in message.format):
        kind = "depth"
    elif encoding == "mono8":
        kind = "grey"
    info = f"{base.rpartition('/')[0]}/camera_info"
    return ImageTopic(
        topic=topic,
        base=base,
        kind=kind,
        info=info if bag.topics.get(info) == "sensor_msgs/msg/CameraInfo" else None,
        frame=frame_name(message.header.frame_id),
        compressed=compressed,
    )


def _best(bag: Bag, images: list[ImageTopic], what: str) -> ImageTopic | None:
    """Return the best of the topics of one camera; None for an empty list."""
    if len({image.base.rpartition("/")[0] for image in images}) > 1:
        names = ", ".join(image.topic for image in images)
        raise _error(bag, f"several cameras have {what}: {names}")
    return min(
        images, key=lambda each: (not each.rectified, each.compressed, each.topic), default=None
    )


def _error(bag: Bag, reason: str) -> ValueError:
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in bag.topics.items())
    return ValueError(f"{bag.path}: {reason}; topics: {topics or 'none'}")
