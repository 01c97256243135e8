"""Images of updates as pages show them, and versions that are replaced by those of others."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from store_maps import grown, random_map

from gslts.fleet.replica import Replica
from gslts.store.causes import UpdateCause
from gslts.store.manifest import update_image_path
from gslts.store.map_folder import write_map_folder
from gslts.store.map_store import MapStore
from gslts.viewer.viewed_map import MAX_IMAGE_BYTES, MAX_IMAGE_PX, ViewedMap
from gslts.viewer.viewer import Viewer


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
    with pytest.raises(ValueError, match=r"00001\.jpg: not an image"):
        viewed.update_image(1)


def replace_newest(folder: Path) -> int:
    """Replace the newest version by one of fewer Gaussians, as a pull may; return their number."""
    with Replica(folder) as replica:
        number = replica.version().number
        with replica.replacing(number - 1, []):
            pass
        before = replica.read()
        replica.commit(before.select(np.arange(before.size - 1)), UpdateCause())
        return before.size - 1


def test_a_version_that_another_replaces_is_read_again(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", random_map(50), {}, {})
    grown(tmp_path / "map", 2)
    viewed = ViewedMap(tmp_path / "map")
    sizes = {number: viewed.gaussians(number).size for number in (1, 2, 3)}
    blocks = viewed.blocks(3)
    size = replace_newest(tmp_path / "map")
    assert size != sizes[3]
    assert viewed.refresh()
    assert (viewed.newest, viewed.replaced) == (3, 1)
    assert viewed.gaussians(3).size == size
    assert viewed.blocks(3) is not blocks
    assert f"{size} Gaussians" in viewed.describe(3)[1]
    assert not viewed.refresh()


def test_versions_that_follow_or_lose_their_files_replace_nothing(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", random_map(50), {}, {})
    grown(tmp_path / "map", 2)
    viewed = ViewedMap(tmp_path / "map")
    with MapStore(tmp_path / "map", writable=True) as store:
        store.compact(keep=1)
    grown(tmp_path / "map", 1)
    assert viewed.refresh()
    assert (viewed.newest, viewed.replaced) == (4, 0)


def test_the_page_of_images_shows_a_replaced_version(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", random_map(50), {}, {})
    grown(tmp_path / "map", 1)
    with Viewer(tmp_path / "map", port=0) as viewer:
        before = viewer._make_still()
        assert viewer._make_still() is before
        size = replace_newest(tmp_path / "map")
        viewer._map.refresh()
        assert f"{size} Gaussians".encode() in viewer._make_still()
