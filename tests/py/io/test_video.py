"""Videos are whole."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from videos import write

from gslts.io.video import Video

SIZE = (64, 48)


@pytest.mark.parametrize("count", [1, 2, 60])
def test_all_images_are_in_the_video(tmp_path: Path, count: int) -> None:
    write(tmp_path / "a.mp4", count)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    video = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert sum(video.read()[0] for _ in range(count + 1)) == count


def test_lost_images_are_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OSError, match=r"a\.mp4: .*0 of 0 images"):
        write(tmp_path / "a.mp4", 0)
    image = np.zeros((48, 64, 3), np.uint8)
    video = Video(tmp_path / "a.mp4", *SIZE)
    video.add(image)
    monkeypatch.setattr(video, "_writer", Deaf(video._writer))
    with pytest.raises(OSError, match=r"a\.mp4: .*1 of 2 images"), video:
        video.add(image)
    assert list(tmp_path.iterdir()) == []


class Deaf:
    """A writer that has no room for more images."""

    def __init__(self, writer: cv2.VideoWriter) -> None:
        self.release = writer.release

    def write(self, image: np.ndarray) -> None:
        assert image.shape == (48, 64, 3)


def test_an_error_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least 2 x 2 px, not 1 x 9"):
        Video(tmp_path / "a.mp4", 1, 9)
    with pytest.raises(KeyError), Video(tmp_path / "a.mp4", *SIZE):
        raise KeyError
    assert list(tmp_path.iterdir()) == []
