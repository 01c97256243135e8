"""Words from topics and JSON answers."""

import json

import numpy as np
import pytest

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.navigation.trip import NavigationResult
from gslts.ros.answers import MAX_WORDS, errand_answer, failure_answer, query_answer, words_of
from gslts.semantics.queries import Instance


def test_words_are_stripped() -> None:
    assert words_of("  alarm clock \n") == "alarm clock"
    assert words_of("caf\u00e9 cup") == "caf\u00e9 cup"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "got nothing"),
        (" \t\n", "got nothing"),
        ("x" * (MAX_WORDS + 1), f"at most {MAX_WORDS} characters, got {MAX_WORDS + 1}"),
        ("mug\nsofa", "printable"),
        ("mug\x1b[2J", "printable"),
        ("mug\u2028sofa", "printable"),
    ],
)
def test_other_words_are_rejected(text: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem) as error:
        words_of(text)
    assert len(str(error.value)) < 200
    assert str(error.value).isprintable()


def test_a_query_is_answered_by_boxes() -> None:
    low, high = np.array([0.0, 1.0, 2.0]), np.array([0.5, 1.5, 2.5])
    found = Instance(low, high, np.zeros((4, 2)), 0.7, np.arange(12))
    text = query_answer("mug", "map", 3, [found])
    assert "\n" not in text
    answer = json.loads(text)
    assert (answer["query"], answer["status"], answer["version"]) == ("mug", "found", 3)
    (item,) = answer["objects"]
    assert (item["low_m"], item["high_m"], item["score"]) == (low.tolist(), high.tolist(), 0.7)
    empty = json.loads(query_answer("mug", "map", 3, []))
    assert (empty["status"], empty["objects"]) == ("not found", [])


@pytest.mark.parametrize("distance_m", [0.8, None])
def test_an_errand_is_answered_by_its_result(distance_m: float | None) -> None:
    camera = Camera(
        fx=10.0, fy=10.0, cx=8.0, cy=6.0, width=16, height=12, world_from_camera=np.eye(4)
    )
    frame = RgbdFrame(np.zeros((12, 16, 3), np.uint8), np.zeros((12, 16), np.float32), camera)
    path = np.array([[0.0, 0.0], [3.0, 4.0]])
    status = "not found" if distance_m is None else "reached"
    result = NavigationResult(status, "", path, frame, 1, distance_m)
    answer = json.loads(errand_answer("mug", "map", result))
    assert (answer["go"], answer["status"], answer["distance_m"]) == ("mug", status, distance_m)
    assert (answer["position_m"], answer["path_m"]) == ([3.0, 4.0], 5.0)


def test_a_failure_names_the_words_and_the_reason() -> None:
    answer = json.loads(failure_answer("go", "y" * 10_000, "the robot is busy"))
    assert (answer["status"], answer["reason"]) == ("failed", "the robot is busy")
    assert len(answer["go"]) == MAX_WORDS
