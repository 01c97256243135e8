"""Words from topics, and answers to them as JSON text."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from gslts.navigation.trip import NavigationResult
from gslts.semantics.queries import Instance

MAX_WORDS = 200
"""Maximum number of characters of a query; the longest name of an object has a few words, and CLIP
reads 77 tokens."""


def words_of(text: str) -> str:
    """Check the words of a message.

    Args:
        text: Its data, from anybody.

    Returns:
        The words without spaces around them.

    Raises:
        ValueError: They are empty, too long, or have control characters.
    """
    words = text.strip()
    if not words:
        raise ValueError('expected the name of an object, such as "alarm clock", got nothing')
    if len(words) > MAX_WORDS:
        raise ValueError(
            f"expected at most {MAX_WORDS} characters, got {len(words)}: {words[:40]!r}..."
        )
    if not words.isprintable():
        raise ValueError(f"expected one line of printable characters, got {words[:40]!r}")
    return words


def query_answer(words: str, frame_id: str, version: int, instances: Sequence[Instance]) -> str:
    """Return the answer to a query.

    Args:
        words: The query.
        frame_id: Frame of the boxes.
        version: Number of the version of the map that was searched.
        instances: Objects that match, the best one first; empty if there is none.

    Returns:
        JSON of one object on one line; `status` is "found" or "not found".
    """
    return _line(
        query=words,
        status="found" if instances else "not found",
        frame_id=frame_id,
        version=version,
        objects=[instance.to_json() for instance in instances],
    )


def errand_answer(words: str, frame_id: str, result: NavigationResult) -> str:
    """Return the result of an errand.

    Args:
        words: The object that the robot went to.
        frame_id: Frame of the position.
        result: Of the trip.

    Returns:
        JSON of one object on one line; `status` is that of the result.
    """
    return _line(
        go=words,
        status=result.status,
        reason=result.reason,
        frame_id=frame_id,
        position_m=None if len(result.path) == 0 else result.path[-1].tolist(),
        distance_m=result.distance_m,
        path_m=result.length_m,
    )


def failure_answer(kind: str, words: str, reason: str) -> str:
    """Return the answer to words that could not be followed.

    Args:
        kind: "query", "go" or "command".
        words: As they came; cut if they are too long.
        reason: Why, in one line.

    Returns:
        JSON of one object on one line; `status` is "failed".
    """
    return _line(**{kind: words[:MAX_WORDS]}, status="failed", reason=reason)


def _line(**values: Any) -> str:
    return json.dumps(values, allow_nan=False)
