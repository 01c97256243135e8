"""The change monitor with the real detector under load."""

import change_room
import numpy as np
from change_room import VIEWPOINTS, see
from watching import LONG_S, Gated

from gslts.change.confirmation import MonitorConfig, Report
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import ChangeMonitor
from gslts.core.frame import RgbdFrame


def test_under_load_with_the_real_detector() -> None:
    """A box is removed, and comes back, while frames come faster than they are processed."""
    full, empty = change_room.home(), change_room.home().without(["Box|1"])
    views = [
        [see(home, viewpoint, "kinect", seed) for seed in range(2) for viewpoint in VIEWPOINTS]
        for home in (full, empty)
    ]
    detector = Gated(ChangeDetector(change_room.mapped()[0], change_room.CONFIG))
    with ChangeMonitor(detector, MonitorConfig(rate_hz=1e6)) as monitor:

        def watch(frames: list[RgbdFrame], count: int) -> list[Report]:
            """Offer two frames for each one that is processed; return the reports."""
            for k in range(count):
                monitor.offer(frames[k % len(frames)])
                if k % 2:
                    detector.let_through()
            detector.open(monitor.config.queue + 1)
            assert monitor.wait(LONG_S)
            return monitor.poll()

        assert watch(views[0], 30) == []
        (report,) = watch(views[1], 60)
        assert report.change.kind == "removal"
        np.testing.assert_allclose(report.change.point, [2.2, 1.85, 0.9], atol=0.3)
        counts = monitor.counts
    assert counts.unreliable == 0
    assert counts.dropped > 0
