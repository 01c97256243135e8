"""Page of images for browsers that cannot draw Gaussians."""

import base64
import re
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image
from store_maps import random_map

from gslts.store.map_folder import write_map_folder
from gslts.viewer.still_page import make_still_page


def test_a_map_without_cameras_is_shown_from_outside(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", random_map(50), {}, {})
    (encoded,) = re.findall(rb"data:image/jpeg;base64,([^\"]+)", make_still_page(tmp_path / "map"))
    image = np.asarray(Image.open(BytesIO(base64.b64decode(encoded))))
    assert image.shape == (480, 640, 3)
    shown = np.argwhere(image.astype(int).max(axis=2) > 20)
    assert len(shown) > 1000
    assert np.abs(shown.mean(axis=0) - (240, 320)).max() < 100
