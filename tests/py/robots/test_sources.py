"""Robots by name, which installed packages register."""

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

from gslts.robots import sources
from gslts.robots.sources import open_robot

OPENERS = {
    "good": lambda name: SimpleNamespace(digest=name, rounds=None, robot=None),
    "other": lambda name: (_ for _ in ()).throw(ValueError(f"{name}: not mine")),
    "robot": lambda _: SimpleNamespace(observe=None),
}


def register(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let packages register openers by the names of OPENERS."""
    points = [EntryPoint(name, f"package:{name}", sources.GROUP) for name in names]
    monkeypatch.setattr(EntryPoint, "load", lambda point: OPENERS[point.name])
    monkeypatch.setattr(sources, "entry_points", lambda **_: points)


def test_the_first_opener_that_knows_a_name_opens_it(monkeypatch: pytest.MonkeyPatch) -> None:
    register(monkeypatch, "other", "good")
    assert open_robot("mine").digest == "mine"


def test_openers_that_know_no_name_give_their_reasons(monkeypatch: pytest.MonkeyPatch) -> None:
    register(monkeypatch, "other")
    with pytest.raises(ValueError, match=r"^mine: not mine$"):
        open_robot("mine")


def test_an_opener_that_returns_a_robot_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    register(monkeypatch, "robot")
    with pytest.raises(
        ValueError, match=r"^mine: package:robot returns no RobotSource: no digest$"
    ):
        open_robot("mine")
