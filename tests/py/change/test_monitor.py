"""The change monitor: confirmation over several frames, counts of frames, and its end."""

import threading
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from change_images import BLUE, RED, blank, changes_in, gs_lts_change_at, put
from watching import LONG_S, Clock, Gated, close

from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.confirmation import MonitorConfig
from gslts.change.detection import Detection
from gslts.change.monitor import ChangeMonitor
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame

CAMERA = Camera(fx=100, fy=100, cx=80, cy=60, width=160, height=120, world_from_camera=np.eye(4))
FAST = MonitorConfig(rate_hz=1e6)
Found = Callable[[float], list[Change]]


def change(x: float, kind: str = "addition", confidence: float = 0.9) -> Change:
    return Change(kind, confidence, np.array([x, 0.0, 1.0]))


def frame(time_s: float) -> RgbdFrame:
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    return RgbdFrame(rgb, np.ones(rgb.shape[:2], np.float32), CAMERA, time_s)


class Stub:
    """A detector that returns scripted changes by the time of the frame."""

    def __init__(self, found: Found) -> None:
        self.found = found
        self.config = DetectionConfig()
        self.times: list[float] = []

    def detect(self, frame: RgbdFrame) -> Detection:
        self.times.append(frame.time_s)
        photo = np.zeros((1, 1, 3), np.float32)
        return Detection(tuple(self.found(frame.time_s)), None, frame.camera, photo)


def watched(found: Found, frames: int, config: MonitorConfig = FAST) -> tuple[list, ChangeMonitor]:
    """Process a number of frames and return all reports."""
    reports = []
    with ChangeMonitor(Stub(found), config) as monitor:
        for k in range(frames):
            monitor.offer(frame(float(k)))
            assert monitor.wait(LONG_S)
            reports += monitor.poll()
    return reports, monitor


def test_a_change_is_reported_when_enough_frames_show_it() -> None:
    reports, monitor = watched(lambda _: [change(1.0)], 20)
    (report,) = reports
    assert report.number == 1
    assert report.change.kind == "addition"
    assert report.times_s == (0.0, 1.0, 2.0)
    assert monitor.counts.offered == monitor.counts.processed == 20
    assert monitor.counts.dropped == monitor.counts.unreliable == 0


def test_it_is_reported_as_last_observed() -> None:
    reports, _ = watched(lambda t: [change(1.0 + 0.1 * t, confidence=0.1 * t)], 3)
    assert reports[0].change.point[0] == pytest.approx(1.2)
    assert reports[0].change.confidence == pytest.approx(0.2)


def test_a_glitch_is_never_reported() -> None:
    """Test a change in one frame, in two of six, and at ever new positions."""
    assert watched(lambda t: [change(1.0)] if t == 7 else [], 30)[0] == []
    assert watched(lambda t: [change(1.0)] if t % 3 == 0 else [], 30)[0] == []
    assert watched(lambda t: [change(t)], 30)[0] == []
    kinds = ("addition", "removal", "relocation")
    assert watched(lambda t: [change(1.0, kinds[int(t) % 3])], 6)[0] == []


def test_objects_side_by_side_are_several_changes_and_a_frame_counts_once() -> None:
    side_by_side = [change(1.0), change(1.1), change(1.2)]
    assert watched(lambda t: side_by_side if t == 3 else [], 10)[0] == []
    reports, _ = watched(
        lambda t: side_by_side[:: 1 - 2 * (int(t) % 2)] if t in (3, 4, 5) else [], 10
    )
    assert sorted(report.change.point[0] for report in reports) == [1.0, 1.1, 1.2]
    assert all(report.times_s == (3.0, 4.0, 5.0) for report in reports)


def test_frames_confirm_a_change_together() -> None:
    config = MonitorConfig(rate_hz=1e6, needed=1, confidence=0.8)
    assert watched(lambda t: [change(1.0, confidence=0.7)] if t == 3 else [], 10, config)[0] == []
    (both,), _ = watched(lambda t: [change(1.0, confidence=0.7)] if t in (3, 5) else [], 10, config)
    assert both.times_s == (3.0, 5.0)  # (0.7 / 0.3)^2 > 0.8 / 0.2
    (report,), _ = watched(lambda t: [change(1.0, confidence=0.85)] if t == 3 else [], 10, config)
    assert report.times_s == (3.0,)
    never = watched(lambda _: [change(1.0, confidence=0.45)], 10, config)
    assert never[0] == []


def boxed(x: float, half_m: float, confidence: float = 0.9) -> Change:
    """Return an addition with a cube around it."""
    point = np.array([x, 0.0, 1.0])
    return Change("addition", confidence, point, (None, (point - half_m, point + half_m)))


def test_boxes_tell_which_of_two_near_changes_is_seen_again() -> None:
    """Test a bowl whose point errs, and a peach in it that the first frame does not tell apart."""
    frames = [
        [boxed(1.0, 0.1)],
        [boxed(1.05, 0.1), boxed(1.02, 0.02)],
        [boxed(1.0, 0.1), boxed(1.02, 0.02)],
        [boxed(1.02, 0.02)],
    ]
    bowl, peach = watched(lambda t: frames[int(t)], len(frames))[0]
    assert (bowl.change, bowl.times_s) == (frames[2][0], (0.0, 1.0, 2.0))
    assert (peach.change, peach.times_s) == (frames[3][0], (1.0, 2.0, 3.0))


def test_distant_changes_are_several() -> None:
    both = [change(1.0), change(2.0), change(1.0, "removal")]
    reports, _ = watched(lambda _: both, 10)
    assert [report.number for report in reports] == [1, 2, 3]
    assert [(report.change.kind, report.change.point[0]) for report in reports] == [
        ("addition", 1.0),
        ("addition", 2.0),
        ("removal", 1.0),
    ]


def boxes(
    before: tuple[int, int] | None = None,
    after: tuple[int, int] | None = None,
    color: tuple[float, float, float] = RED,
) -> list[Change]:
    """Return the changes if a red box is removed and one of some colour is added."""
    images = blank()
    if before is not None:
        put(images, "before", before, color=RED)
    if after is not None:
        put(images, "after", after, color=color)
    return list(changes_in(images))


HERE, THERE, BEYOND = (40, 20), (40, 100), (80, 60)
"""First rows and columns of boxes farther apart than observations of one change."""


@pytest.mark.parametrize("removal_first", [True, False])
def test_ends_of_different_frames_are_one_relocation(removal_first: bool) -> None:
    (removal,), (addition,) = boxes(before=HERE), boxes(after=THERE)
    assert (removal.kind, addition.kind) == ("removal", "addition")
    ends = (removal, addition) if removal_first else (addition, removal)
    reports, _ = watched(lambda t: [ends[t >= 5]], 20)
    first, second = reports
    assert first.change is ends[0]
    assert (first.number, first.replaces, first.times_s) == (1, None, (0.0, 1.0, 2.0))
    assert (second.number, second.replaces, second.times_s) == (2, 1, (5.0, 6.0, 7.0))
    assert second.change.kind == "relocation"
    np.testing.assert_array_equal(second.change.boxes[0], removal.boxes[0])
    np.testing.assert_array_equal(second.change.boxes[1], addition.boxes[1])
    np.testing.assert_array_equal(second.change.point, addition.point)


def test_an_end_of_a_plain_relocation_is_not_reported_beside_it() -> None:
    """Changes of another detector have boxes and no surfaces."""
    before, after = (tuple(np.array([x, -0.1, h]) for h in (0.9, 1.1)) for x in (1.0, 3.0))
    whole = Change("relocation", 0.9, np.array([3.0, 0.0, 1.0]), (before, after))
    reports, _ = watched(lambda t: [whole] if t < 3 else [change(1.0, "removal")], 10)
    assert [report.change.kind for report in reports] == ["relocation"]


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_an_object_that_came_beside_a_moved_one_is_reported_too(confidence: float) -> None:
    """A frame shows both, so that the addition is no end of the relocation."""
    before, after = (tuple(np.array([x, -0.1, h]) for h in (0.9, 1.1)) for x in (1.0, 3.0))
    moved = Change("relocation", 0.9, np.array([3.0, 0.0, 1.0]), (before, after))
    both = sorted((moved, change(3.2, confidence=confidence)), key=lambda c: -c.confidence)
    reports, _ = watched(lambda _: both, 10)
    assert [(report.change, report.replaces) for report in reports] == [(c, None) for c in both]


def test_unlike_ends_of_different_frames_are_two_changes() -> None:
    (removal,) = boxes(before=HERE)
    for addition in (*boxes(after=THERE, color=BLUE), change(5.0), gs_lts_change_at("after")):
        reports, _ = watched(lambda t, end=addition: [end if t >= 5 else removal], 20)
        assert [report.change for report in reports] == [removal, addition]
        assert [report.replaces for report in reports] == [None, None]


def test_an_unconfirmed_end_joins_no_relocation() -> None:
    (removal,), (addition,) = boxes(before=HERE), boxes(after=THERE)
    reports, _ = watched(lambda t: [removal if t in (0, 1) else addition], 20)
    assert [(report.change.kind, report.replaces) for report in reports] == [("addition", None)]


def test_a_resolved_end_joins_no_relocation() -> None:
    (removal,), (addition,) = boxes(before=HERE), boxes(after=THERE)
    with ChangeMonitor(Stub(lambda t: [removal if t < 5 else addition]), FAST) as monitor:
        reports = []
        for k in range(10):
            if k == 5:
                monitor.resolve(reports[0])
            monitor.offer(frame(float(k)))
            assert monitor.wait(LONG_S)
            reports += monitor.poll()
    assert [(report.change.kind, report.replaces) for report in reports] == [
        ("removal", None),
        ("addition", None),
    ]


def test_one_end_belongs_to_one_relocation() -> None:
    """If two boxes like the removed one appear, the second one is an addition."""
    (removal,), (second,), (other,) = boxes(before=HERE), boxes(after=THERE), boxes(after=BEYOND)
    assert np.linalg.norm(second.point - other.point) > FAST.near_m
    seen = (removal, second, other)
    reports, _ = watched(lambda t: [seen[int(t) // 5]], 15)
    assert [(report.change.kind, report.replaces) for report in reports] == [
        ("removal", None),
        ("relocation", 1),
        ("addition", None),
    ]


def test_a_relocation_whose_ends_were_joined_is_not_reported_again() -> None:
    """Later frames show both ends at once."""
    seen = (*boxes(before=HERE), *boxes(after=THERE), *boxes(before=HERE, after=THERE))
    assert [change.kind for change in seen] == ["removal", "addition", "relocation"]
    reports, _ = watched(lambda t: [seen[int(t) // 5]], 15)
    assert [(report.change.kind, report.replaces) for report in reports] == [
        ("removal", None),
        ("relocation", 1),
    ]


def test_frames_without_the_change_may_lie_between() -> None:
    reports, _ = watched(lambda t: [change(1.0)] if t % 2 == 0 else [], 10)
    (report,) = reports
    assert report.times_s == (0.0, 2.0, 4.0)


def test_a_resolved_change_may_be_reported_again() -> None:
    with ChangeMonitor(Stub(lambda _: [change(1.0), change(5.0)]), FAST) as monitor:

        def seen(times: range) -> list:
            for k in times:
                monitor.offer(frame(float(k)))
                assert monitor.wait(LONG_S)
            return monitor.poll()

        first, second = seen(range(5))
        assert seen(range(5, 10)) == []
        monitor.resolve(first)
        (again,) = seen(range(10, 15))
        assert again.number == 3
        assert again.change.point[0] == first.change.point[0]
        assert again.times_s == (10.0, 11.0, 12.0)
        assert second.number == 2


def test_a_new_map_forgets_old_observations() -> None:
    old, new = Stub(lambda _: [change(1.0)]), Stub(lambda _: [change(2.0)])
    with ChangeMonitor(old, FAST) as monitor:
        for k in range(2):
            monitor.offer(frame(float(k)))
            assert monitor.wait(LONG_S)
        monitor.publish(new)
        for k in range(2, 5):
            monitor.offer(frame(float(k)))
            assert monitor.wait(LONG_S)
        (report,) = monitor.poll()
    assert report.change.point[0] == 2.0
    assert report.times_s == (2.0, 3.0, 4.0)
    assert old.times == [0.0, 1.0]


def test_a_frame_in_process_when_the_map_changes_does_not_count() -> None:
    started, go_on = threading.Event(), threading.Event()

    class Slow(Stub):
        def detect(self, frame: RgbdFrame) -> Detection:
            started.set()
            assert go_on.wait(LONG_S)
            return super().detect(frame)

    once = MonitorConfig(rate_hz=1e6, needed=1)
    with ChangeMonitor(Slow(lambda _: [change(1.0)]), once) as monitor:
        monitor.offer(frame(0.0))
        assert started.wait(LONG_S)
        monitor.publish(Stub(lambda _: []))
        go_on.set()
        assert monitor.wait(LONG_S)
        assert monitor.poll() == []
        assert monitor.counts.processed == 1


def test_a_failure_of_the_detector_is_raised() -> None:
    def fail(_: float) -> list[Change]:
        raise ValueError("the camera melted")

    monitor = ChangeMonitor(Stub(fail), FAST)
    monitor.offer(frame(0.0))
    with pytest.raises(RuntimeError, match="it has stopped: the camera melted") as raised:
        monitor.wait(LONG_S)
    assert isinstance(raised.value.__cause__, ValueError)
    for method in (monitor.poll, lambda: monitor.offer(frame(1.0))):
        with pytest.raises(RuntimeError, match="the camera melted"):
            method()
    close(monitor)
    with pytest.raises(RuntimeError, match="the camera melted"):
        monitor.poll()  # It is not forgotten.


def test_close_ends_a_pause() -> None:
    """The pause would never end, as the clock stands still."""
    before = threading.active_count()
    detector = Gated(Stub(lambda _: []))
    monitor = ChangeMonitor(detector, MonitorConfig(rate_hz=0.01, queue=3), clock=Clock())
    monitor.offer(frame(0.0))
    detector.let_through()
    for k in range(1, 6):
        monitor.offer(frame(float(k)))
    close(monitor)
    assert threading.active_count() == before
    counts = monitor.counts
    assert (counts.offered, counts.processed, counts.dropped) == (6, 1, 5)
    assert monitor.wait(LONG_S)
    with pytest.raises(RuntimeError, match="it is closed"):
        monitor.offer(frame(9.0))
    monitor.close()  # Again.


def test_it_keeps_to_its_rate_and_to_the_newest_frames() -> None:
    """The rate allows one of four frames: the older one of the two that wait."""
    stub, clock = Stub(lambda _: []), Clock()
    detector = Gated(stub)
    config = MonitorConfig(rate_hz=1024, queue=2)
    with ChangeMonitor(detector, config, clock=clock) as monitor:
        for k in range(65):
            monitor.offer(frame(float(k)))
            clock.time_s = k / 4096
            if k % 4 == 0:
                detector.let_through()
    assert monitor.counts.processed == 17
    assert stub.times == [0.0, *range(3, 64, 4)]


def test_under_load_memory_stays_and_nothing_confirmed_is_lost() -> None:
    """1,000 frames come twice as fast as they can be processed; a change comes every 100."""
    count, lasting = 1000, 100
    stub = Stub(lambda t: [change(float(int(t) // lasting))])
    detector = Gated(stub)
    kept: list[int] = []
    reports = []
    tracemalloc.start()
    try:
        with ChangeMonitor(detector, FAST) as monitor:
            for k in range(count):
                monitor.offer(frame(float(k)))
                if k % 2:
                    detector.let_through()
                reports += monitor.poll()
                if k % 100 == 99:
                    kept.append(tracemalloc.get_traced_memory()[0])
            detector.open(FAST.queue + 1)
            assert monitor.wait(LONG_S)
            reports += monitor.poll()
    finally:
        tracemalloc.stop()
    counts = monitor.counts
    assert counts.offered == count == counts.dropped + counts.processed
    assert 0.4 * count < counts.dropped < 0.5 * count
    assert len(stub.times) == counts.processed
    assert [report.change.point[0] for report in reports] == [float(k) for k in range(10)]
    frame_bytes = CAMERA.width * CAMERA.height * (3 + 4)
    assert max(kept) - min(kept) < (FAST.queue + 4) * frame_bytes


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"rate_hz": 0}, "must be positive"),
        ({"rate_hz": float("nan")}, "must be positive"),
        ({"queue": 0}, "must be positive"),
        ({"near_m": -1.0}, "must be positive"),
        ({"needed": 0}, r"needed must be in 1\.\.6, got 0"),
        ({"needed": 7}, r"needed must be in 1\.\.6, got 7"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict, message: str) -> None:
    with pytest.raises(ValueError, match=f"^MonitorConfig: .*{message}"):
        MonitorConfig(**settings)
