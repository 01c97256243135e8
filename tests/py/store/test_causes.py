"""Causes of versions: JSON and back, and one clear line for damaged or foreign ones."""

import json
import subprocess
import sys
from typing import Any

import pytest
from pydantic import ValidationError
from store_maps import BOX, ORACLE, REJECTED

from gslts.store.causes import (
    ChangeRecord,
    ImportCause,
    MappingCause,
    RejectedUpdateCause,
    RestoreCause,
    UpdateCause,
    UpdateFrame,
    UpdateRecord,
    VersionCause,
    rejected_cause_from_json,
    version_cause_from_json,
)

POSE = ((1.0, 0.0, 0.0, 0.1), (0.0, 1.0, 0.0, 1 / 3), (0.0, 0.0, 1.0, 0.7), (0.0, 0.0, 0.0, 1.0))
FRAME = UpdateFrame(
    fx=500.5,
    fy=500.25,
    cx=320,
    cy=240,
    width=640,
    height=480,
    world_from_camera=POSE,
    new_viewpoint=True,
)
CHANGE = ChangeRecord(kind="removal", confidence=0.9, boxes=(BOX, None))
SHIFT = ChangeRecord(kind="shift", confidence=0.9, boxes=(BOX, BOX), motion=POSE)
UPDATE = UpdateCause(
    round=3,
    changes=(CHANGE, SHIFT),
    record=UpdateRecord(kinds=("removal",), training_views=7, seconds={"editing": 0.25}),
    config={"threads": 1},
    frames=(FRAME,),
    landmarks="0123456789abcdef" * 4,
)


def _changes(**values: Any) -> dict[str, Any]:
    """Return a change of the JSON of a cause: the removal, with other values."""
    return {"changes": [{**CHANGE.model_dump(mode="json"), **values}]}


@pytest.mark.parametrize(
    "cause",
    [
        MappingCause(dataset="room"),
        ImportCause(file="a.ply"),
        UPDATE,
        RestoreCause(version=2),
        ORACLE,
    ],
)
def test_a_cause_comes_back_from_json_exactly(cause: VersionCause) -> None:
    assert version_cause_from_json(cause.model_dump_json()) == cause


def test_a_rejected_update_comes_back_from_json_exactly() -> None:
    assert rejected_cause_from_json(REJECTED.model_dump_json()) == REJECTED
    assert REJECTED.reason == "no view shows it"


def test_changes_of_older_maps_have_no_motion() -> None:
    content = json.loads(UPDATE.model_dump_json())
    content["changes"] = content["changes"][:1]
    del content["changes"][0]["motion"]
    assert version_cause_from_json(json.dumps(content)).changes == (CHANGE,)


def test_a_cause_is_immutable() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        UPDATE.round = 4  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "dream"}, "cause: Input tag 'dream' found using 'kind' does not match"),
        ({"kind": "restore"}, "cause: restore.version: Field required"),
        ({"schema_version": 2}, "cause: update.schema_version: Input should be 1"),
        ({"mood": "good"}, "cause: update.mood: Extra inputs are not permitted"),
        ({"round": -1}, "cause: update.round: "),
        ({"landmarks": "../../x"}, "cause: update.landmarks: "),
        ({"frames": [{}]}, "cause: update.frames.0.fx: Field required"),
        (_changes(motion=POSE), "cause: update.changes.0: Value error, motion: a shift needs one"),
        (_changes(kind="shift"), "cause: update.changes.0: Value error, motion: a shift needs one"),
        (_changes(motion=[[1, 2]]), "cause: update.changes.0.motion.0.2: Field required"),
    ],
)
def test_a_foreign_or_damaged_cause_is_named_in_one_line(
    change: dict[str, Any], message: str
) -> None:
    content = {**json.loads(UPDATE.model_dump_json()), **change}
    with pytest.raises(ValueError, match="cause") as error:
        version_cause_from_json(json.dumps(content))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "[]", "7", "{", "null", "[" * 100_000])
def test_text_that_is_no_cause_is_named_in_one_line(text: str) -> None:
    for parse in (version_cause_from_json, rejected_cause_from_json):
        with pytest.raises(ValueError, match=r"^cause: ") as error:
            parse(text)
        assert "\n" not in str(error.value)


def test_a_rejected_update_needs_a_reason() -> None:
    with pytest.raises(ValidationError, match="needs a reason"):
        RejectedUpdateCause(record=UpdateRecord())


def test_the_history_is_read_without_numpy() -> None:
    program = "import sys, gslts.store.history, gslts.store.describe; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "False\n", done.stderr
