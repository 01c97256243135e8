"""Diagnostics: states of the parts of the node, and the message of them."""

import pytest

from gslts.ros.intake import Counts
from gslts.ros.statuses import Status, memory_status, statuses

IDLE = Status("operation", "ok", "watching")


def test_frames_are_stale_until_the_first_is_judged() -> None:
    frames, *_ = statuses(Counts(), [], {}, IDLE)
    assert (frames.name, frames.level) == ("frames", "stale")
    assert frames.values["median latency (ms)"] is None
    counts = Counts(received=300, taken=40, dropped=260)
    frames, *_ = statuses(counts, [0.1, 0.3, 0.2], {}, IDLE)
    assert (frames.level, frames.message) == ("ok", "40 judged, 260 of 300 dropped")
    assert frames.values["median latency (ms)"] == pytest.approx(200)


def test_problems_are_warnings() -> None:
    parts = statuses(Counts(), [], {"/rgb": "two publishers"}, IDLE)
    assert Status("/rgb", "warn", "two publishers") in parts
    assert IDLE in parts


def test_memory_is_that_of_this_process() -> None:
    status = memory_status()
    assert status.level == "ok"
    assert 10 < status.values["resident (MiB)"] < 100_000


def test_the_message_has_all_parts_and_values_as_text() -> None:
    diagnostics = pytest.importorskip(
        "gslts.ros.diagnostics", reason="needs diagnostic_msgs: scripts/setup ros"
    )
    values = {"reason": "dark", "attempts": 3, "rate (Hz)": 1 / 3, "age (s)": None}
    parts = [IDLE, Status("localization", "error", "lost", values), Status("/rgb", "stale", "none")]
    message = diagnostics.diagnostic_array(diagnostics.Header(), "gslts", "kitchen", parts)
    assert [status.level for status in message.status] == [b"\x00", b"\x02", b"\x03"]
    localization = message.status[1]
    assert (localization.name, localization.message) == ("gslts: localization", "lost")
    assert localization.hardware_id == "kitchen"
    assert {value.key: value.value for value in localization.values} == {
        "reason": "dark",
        "attempts": "3",
        "rate (Hz)": "0.333",
        "age (s)": "unknown",
    }
