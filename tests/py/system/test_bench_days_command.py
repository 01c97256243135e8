"""The command `gslts bench days` on one small home."""

import json
from pathlib import Path

import pytest
from bench_settings import SETTINGS
from command import gslts

from gslts.store.history import open_history

pytestmark = pytest.mark.long


def test_a_day_is_lived_and_judged(tmp_path: Path) -> None:
    small = ("--room", "kitchen", "--seeds", "4:5", "--size", "240x180", "--frames", "32")
    run = ("bench", "days", *small, *SETTINGS, "--changes", "2", "--json", "days.json")
    process = gslts(*run, "--work", "work", cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    (record,) = json.loads((tmp_path / "days.json").read_text())["records"]
    assert sum(len(past["changes"]) for past in record["rounds"]) == 2
    assert "| kitchen_4 |" in process.stdout
    (kept,) = (tmp_path / "work/days").glob("kitchen_4_*/manifest.json")
    with open_history(kept.parent) as history:
        events = [event.model_dump(mode="json") for event in history.events()]
    assert [event for past in record["rounds"] for event in past["events"]] == events
