"""Images of updates as pages show them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from store_maps import random_map

from gslts.store.manifest import update_image_path
from gslts.store.map_folder import write_map_folder
from gslts.viewer.viewed_map import MAX_IMAGE_BYTES, MAX_IMAGE_PX, ViewedMap


def test_images_of_updates(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", random_map(5), {}, {})
    viewed, path = ViewedMap(tmp_path / "map"), update_image_path(tmp_path / "map", 1)
    assert viewed.update_image(1) is None
    path.parent.mkdir(exist_ok=True)
    Image.new("RGB", (1200, 900), (200, 100, 50)).save(path)
    image = viewed.update_image(1)
    assert image is not None
    assert image.shape == (MAX_IMAGE_PX * 3 // 4, MAX_IMAGE_PX, 3)
    assert np.abs(image.astype(int) - (200, 100, 50)).max() < 6
    Image.new("RGB", (9000, 10)).save(path)
    assert viewed.update_image(1) is None
    path.write_bytes(bytes(MAX_IMAGE_BYTES + 1))
    assert viewed.update_image(1) is None
    path.write_bytes(b"nonsense")
    with pytest.raises(OSError, match="cannot identify"):
        viewed.update_image(1)
