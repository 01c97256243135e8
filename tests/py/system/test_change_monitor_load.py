"""Standing watch with the real detector under load."""

import time

import change_room
import numpy as np
from change_room import LOOKS, see

from gslts.change.detect import ChangeDetector
from gslts.change.monitor import ChangeMonitor, MonitorConfig


def test_under_load_with_the_real_detector() -> None:
    """A box goes while frames come faster than they can be looked at; it comes back later."""
    full, empty = change_room.home(), change_room.home().without(["Box|1"])
    views = [
        [see(home, look, "kinect", seed) for seed in range(2) for look in LOOKS]
        for home in (full, empty)
    ]
    detector = ChangeDetector(change_room.mapped()[0], change_room.CONFIG)
    began_s = time.monotonic()
    for one in views[0][:3]:
        detector.detect(one)
    cost_s = (time.monotonic() - began_s) / 3
    with ChangeMonitor(detector, MonitorConfig(rate_hz=1000)) as monitor:
        for k in range(30):
            monitor.offer(views[0][k % 6])
            time.sleep(cost_s / 2)
        assert monitor.wait(LONG_S)
        assert monitor.poll() == []
        for k in range(60):
            monitor.offer(views[1][k % 6])
            time.sleep(cost_s / 2)
        assert monitor.wait(LONG_S)
        (report,) = monitor.poll()
        assert report.change.kind == "removal"
        np.testing.assert_allclose(report.change.point, [2.2, 1.85, 0.9], atol=0.3)
        counts = monitor.counts
    assert counts.unreliable == 0
    assert counts.dropped > 0
