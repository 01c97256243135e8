"""Placement of a recording in a map that knows a part of what it shows."""

import numpy as np
from change_room import home, mapped, see

from gslts.core.frame import RgbdFrame
from gslts.extension.placement import place_frames
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.mapping.observation import Observation
from gslts.types import Floats
from gslts_sim.robot_body import Viewpoint

TO_KNOWN = (Viewpoint(2.4, 2.8, 180.0, 20.0), Viewpoint(2.2, 0.8, 180.0, 20.0))
TO_UNKNOWN = (Viewpoint(2.0, 2.8, 0.0, 20.0), Viewpoint(2.2, 1.0, 0.0, 20.0))


class Recorder(Relocalizer):
    """Notes the poses near which frames are localized."""

    def __init__(self) -> None:
        gaussian_map, _ = mapped()
        super().__init__(gaussian_map.select(gaussian_map.means[:, 0] < 2.4), None)
        self.tracked: list[Floats] = []

    def track(self, frame: RgbdFrame, world_from_camera: Floats) -> Localization:
        self.tracked.append(world_from_camera)
        return super().track(frame, world_from_camera)


def test_frames_are_tracked_only_where_the_map_may_show_them() -> None:
    frames = {
        str(k): Observation.of(see(home(), viewpoint))
        for k, viewpoint in enumerate((*TO_KNOWN, *TO_UNKNOWN))
    }
    relocalizer = Recorder()
    placement = place_frames(frames, relocalizer)
    assert placement.anchors == ("0", "1")
    assert list(placement.frames) == ["0", "1", "2", "3"], "others are placed by the given poses"
    poses = [frame.world_from_camera for frame in frames.values()]
    assert len(relocalizer.tracked) == 2
    assert np.allclose(relocalizer.tracked, poses[:2])
