"""Requests of the service and the action get the answers to their words; ROS is a stand-in."""

import json
import sys
from importlib.util import find_spec, module_from_spec
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

import pytest

PACKAGES = {
    "geometry_msgs": ("msg",),
    "gslts_msgs": ("action", "msg", "srv"),
    "rclpy": ("action", "callback_groups", "executors", "node"),
}


class Operation:
    """Answers a query as soon as it is asked, or rejects it."""

    def __init__(self) -> None:
        self.requests = MagicMock()
        self.answer: Any = None

    def ask(self, words: str) -> None:
        if words == "busy":
            raise ValueError("the robot is busy")
        self.answer(json.dumps({"query": words, "status": "found", "version": len(words)}))


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Load the module beside those that other tests import, which have the real messages."""
    for package, parts in PACKAGES.items():
        for name in (package, *(f"{package}.{part}" for part in parts)):
            monkeypatch.setitem(sys.modules, name, MagicMock())
    monkeypatch.setitem(sys.modules, "gslts.ros.operation", MagicMock())
    spec = find_spec("gslts.ros.typed_requests")
    assert spec is not None
    assert spec.loader is not None
    loaded = module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def asked(requests: Any, words: str) -> Any:
    return requests._on_query(MagicMock(words=words), MagicMock())


def test_a_query_gets_its_answer_and_leaves_nothing_behind(module: ModuleType) -> None:
    operation = Operation()
    requests = module.TypedRequests(operation)
    operation.answer = requests.on_answer
    for number in range(5):
        assert asked(requests, f"mug {number}").version == 5
    assert asked(requests, "busy").reason == "the robot is busy"
    requests.on_answer(json.dumps({"go": "nobody waits for it", "status": "reached"}))
    assert len(requests._waiting) == 0


def test_equal_requests_are_answered_in_their_order(module: ModuleType) -> None:
    requests = module.TypedRequests(Operation())
    first, second = (requests._submit("go", "mug") for _ in range(2))
    requests.on_answer(json.dumps({"query": "mug", "status": "found"}))
    assert first.empty()
    requests.on_answer(json.dumps({"go": "mug", "status": "reached"}))
    assert first.get_nowait()["status"] == "reached"
    assert second.empty()
    with requests:
        pass
    assert second.get_nowait() == {"status": "failed", "reason": "the node ends"}
