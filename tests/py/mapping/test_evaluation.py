"""Frames that judge a map: those that cannot be used are skipped as when a map is made."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scenes

from gslts.core.frame import RgbdFrame
from gslts.datasets import Dataset
from gslts.mapping.evaluation.held_out import Known, held_out_of, judging
from gslts.mapping.frames import Visit, every_eighth
from gslts.mapping.observation import Observation

COUNT = 30


class Seen:
    """A frame in memory, with depth 1 m or none; or one that cannot be read."""

    def __init__(self, number: int, *, blind: bool = False, torn: bool = False) -> None:
        self.name, self._blind, self._torn = f"{number:02}", blind, torn
        self.camera = scenes.orbit_camera(16, 12, angle_rad=0.1 * number)

    def read(self) -> RgbdFrame:
        if self._torn:
            raise ValueError(f"{self.name}.png: it is torn")
        depth = np.full((12, 16), 0 if self._blind else 1, np.float32)
        return RgbdFrame(np.zeros((12, 16, 3), np.uint8), depth, self.camera)


def seen(*, torn: Sequence[int] = (), blind: Sequence[int] = (), count: int = COUNT) -> Dataset:
    frames = [Seen(k, torn=k in torn, blind=k in blind) for k in range(count)]
    return Dataset("set", tuple(frames), ("early: no pose",))


def known_of(dataset: Dataset) -> Known:
    """Of a map that was made from it."""
    visit = Visit.of(dataset, lambda frame: Observation.of(frame.read()), every_eighth)
    return Known({name: one.camera() for name, one in visit.training.items()})


def places(observations: Sequence[Observation]) -> list[int]:
    """The number of each frame, by where it was taken."""
    cameras = [Seen(k).camera.world_from_camera for k in range(COUNT)]
    return [
        next(k for k in range(COUNT) if np.array_equal(cameras[k], one.given))
        for one in observations
    ]


@pytest.mark.parametrize(
    ("torn", "blind"),
    [
        ((), ()),
        ((8,), ()),
        ((7, 16), ()),
        ((), (16,)),
        ((3,), (9, 15, 17)),
        ((3,), range(0, COUNT, 3)),  # So many are worth more than nothing.
        ((), range(COUNT)),
    ],
)
def test_the_frames_are_those_that_judged_when_the_map_was_made(
    torn: Sequence[int], blind: Sequence[int]
) -> None:
    dataset = seen(torn=torn, blind=blind)
    known = known_of(dataset)
    visit = Visit.of(dataset, known.observe, lambda names: judging(names, known))
    observations, neighbours, skipped = held_out_of(dataset, known)
    assert places(observations) == places(list(visit.held_out.values()))
    assert [places(near) for near in neighbours] == [places(near) for near in visit.neighbours]
    assert skipped == visit.skipped
    bad = len(torn) + (len(blind) if len(blind) < 10 else 0)
    assert len(skipped) == 1 + bad
    assert len(observations) == len(range(0, COUNT - bad, 8))


def test_a_plain_map_is_judged_past_bad_frames() -> None:
    for bad in ({"torn": [8]}, {"blind": [8]}):
        observations, neighbours, skipped = held_out_of(seen(**bad), Known({}), 2)
        assert places(observations) == [0, 2, 4, 6, *range(9, COUNT, 2)]
        assert neighbours == [[]] * len(observations)
        assert [reason.split(":")[0] for reason in skipped] == ["early", "08"]
    assert all(one.rgb[0].shape == (12, 16, 3) for one in observations)


def test_a_neighbour_torn_since_is_none() -> None:
    known = known_of(seen())
    _, neighbours, skipped = held_out_of(seen(torn=[7]), known)
    assert [places(near) for near in neighbours] == [[1], [6, 9], [15, 17], [23, 25]]
    assert skipped[1:] == ("07: 07.png: it is torn",)


def test_of_one_name_the_first_frame_counts() -> None:
    frames = seen().frames
    twice = Dataset("set", (*frames, Seen(8), frames[3]))
    observations, _, skipped = held_out_of(twice, known_of(seen()))
    assert places(observations) == [0, 8, 16, 24]
    assert skipped == tuple(f"{name}: there is another frame of that name" for name in ("08", "03"))


def test_too_many_bad_frames_are_an_error() -> None:
    known = known_of(seen())
    with pytest.raises(ValueError, match="set: 7 of 31 frames cannot be used, such as early: no"):
        held_out_of(seen(torn=range(8, 14)), known)
    with pytest.raises(ValueError, match=r"all of its frames that can be used; 24: 24.png: it is"):
        held_out_of(seen(torn=[0, 8, 16, 24]), known)
    everything = Known({one.name: one.camera for one in seen().frames})
    with pytest.raises(ValueError, match="set: the map was made from all of its frames"):
        held_out_of(replace(seen(), skipped=()), everything)


def test_more_frames_than_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gslts.mapping.frames.free_memory_bytes", lambda: 10_000)
    with pytest.raises(ValueError, match=r"set: 30 frames take .* such as one in 9$"):
        held_out_of(seen(), Known({}), every=1)
    assert len(held_out_of(seen(), Known({}), every=10)[0]) == 3
