"""Diagnostics: levels of streams, and what a tool shows of them."""

import pytest

diagnostics = pytest.importorskip(
    "gslts.ros.diagnostics", reason="needs the messages of ROS: scripts/setup ros"
)


@pytest.mark.parametrize(
    ("counts", "level", "message"),
    [
        ({}, "stale", "no message yet"),
        ({"age_s": 0.1, "rate_hz": 29.97, "received": 300}, "ok", "30.0 Hz"),
        ({"age_s": 0.1, "rate_hz": 30, "problem": "two publishers"}, "warn", "two publishers"),
        ({"age_s": 61.0, "problem": "two publishers"}, "stale", "no message for 61 s"),
    ],
)
def test_level_of_a_stream(counts: dict[str, float], level: str, message: str) -> None:
    status = diagnostics.stream_status("/rgb", diagnostics.StreamCounts(**counts))
    assert (status.name, status.level, status.message) == ("/rgb", level, message)


def test_memory_is_that_of_this_process() -> None:
    status = diagnostics.memory_status()
    assert status.level == "ok"
    assert 10 < status.values["resident (MiB)"] < 100_000


def test_the_message_has_all_parts_and_values_as_text() -> None:
    counts = diagnostics.StreamCounts(received=7, dropped=2, age_s=0.1, latency_s=0.015)
    lost = diagnostics.Status("localization", "error", "lost", {"reason": "dark"})
    message = diagnostics.diagnostic_array(
        diagnostics.Header(),
        "gslts",
        "kitchen",
        [diagnostics.stream_status("/rgb", counts), lost],
    )
    stream, localization = message.status
    assert (stream.level, localization.level) == (b"\x00", b"\x02")
    assert (stream.name, localization.name) == ("gslts: /rgb", "gslts: localization")
    assert {status.hardware_id for status in message.status} == {"kitchen"}
    values = {value.key: value.value for value in stream.values}
    assert values["dropped"] == "2"
    assert values["latency (ms)"] == "15.000"
    assert [(value.key, value.value) for value in localization.values] == [("reason", "dark")]
