"""Goals from pages on their way to the robot."""

import io
import os

import pytest
from pydantic import ValidationError

from gslts.viewer.goals import MAX_GOAL_BYTES, MAX_TEXT, Goal, GoalSender, PendingGoal

BOX = ((0.0, 1.0, 2.0), (1.0, 1.5, 2.0))


def pending(*lines: bytes) -> PendingGoal:
    """Return what a robot should do after some messages."""
    goals = PendingGoal(lambda: None)
    goals.listen(io.BytesIO(b"".join(lines)))
    return goals


def followed(goals: PendingGoal) -> list[Goal]:
    """Return the goals that a robot drives to."""
    found: list[Goal] = []
    for _ in range(3):
        goals.follow(lambda goal: found.append(goal) or "reached")
    return found


def test_goals_arrive_and_the_newest_counts() -> None:
    reading, writing = os.pipe()
    sender = GoalSender(writing)
    sender.send(Goal(words="mug"))
    sender.send(Goal(words="\u20ac" * MAX_TEXT, box=BOX))
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        goals = PendingGoal(lambda: None)
        goals.listen(stream)
    assert goals.lines()[0].endswith(": sent; the robot ends first what it is doing")
    assert followed(goals) == [Goal(words="\u20ac" * MAX_TEXT, box=BOX)]
    assert goals.lines() == ["\u20ac" * MAX_TEXT + ": reached"]


@pytest.mark.parametrize(
    "message",
    [
        b"nonsense\n",
        b"\xff\n",
        b"{}\n",
        b'{"words": ""}\n',
        b'{"words": "a", "speed": 9}\n',
        b'{"words": "a", "box": [[0, 0, 1e999], [1, 1, 1]]}\n',
        b'{"words": "a", "box": [[0, 0, 2], [1, 1, 1]]}\n',
        b'{"words": "' + b"a" * (MAX_TEXT + 1) + b'"}\n',
        b'{"words": "' + b"a" * (3 * MAX_GOAL_BYTES) + b'"}\n',
        b"[" * 100_000,
    ],
)
def test_other_messages_are_dropped(message: bytes) -> None:
    good = Goal(words="mug").model_dump_json().encode() + b"\n"
    assert followed(pending(message)) == []
    assert followed(pending(message.removesuffix(b"\n") + b"\n", good)) == [Goal(words="mug")]


def test_states_of_a_goal() -> None:
    good = Goal(words="mug").model_dump_json().encode() + b"\n"
    goals, seen = pending(good), list[list[str]]()

    def drive(_: Goal) -> str:
        seen.append(goals.lines())
        goals.listen(io.BytesIO(good))  # Somebody clicks while the robot drives.
        seen.append(goals.lines())
        raise ValueError("the map has no floor")

    goals.follow(drive)
    sent = "mug: sent; the robot ends first what it is doing"
    assert seen == [["mug: driving there"], ["mug: driving there", sent]]
    assert goals.lines() == ["mug: the map has no floor", sent]
    with pytest.raises(KeyboardInterrupt):
        goals.follow(lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
    assert goals.lines() == ["mug: given up"]


def test_a_robot_that_reads_nothing() -> None:
    reading, writing = os.pipe()
    sender, goal = GoalSender(writing), Goal(words="a" * MAX_TEXT)
    with pytest.raises(OSError, match="the robot takes no goals"):
        list(map(sender.send, [goal] * 10_000))  # More than any pipe holds.
    os.close(reading)
    with pytest.raises(OSError, match="the robot takes no goals"):
        sender.send(goal)
    os.close(writing)


def test_a_goal_that_is_too_long() -> None:
    with pytest.raises(ValidationError, match="at most 200 characters"):
        Goal(words="a" * (MAX_TEXT + 1))
