"""Images as messages: the decoder of recorded images reads them back."""

import numpy as np
import pytest

from gslts.datasets.ros.images import rgb_of

images = pytest.importorskip(
    "gslts.ros.image_message", reason="needs the messages of ROS: scripts/setup ros"
)


@pytest.mark.parametrize("order", ["C", "F"])
def test_an_image_comes_back(order: str) -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    message = images.image_message(images.Header(frame_id="camera"), np.array(rgb, order=order))
    assert (message.encoding, message.step, message.header.frame_id) == ("rgb8", 21, "camera")
    np.testing.assert_array_equal(rgb_of(message), rgb)
