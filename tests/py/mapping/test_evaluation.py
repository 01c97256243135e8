"""Splits into training, validation and test frames, and test frames of a finished map."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
import scenes

from gslts.core.frame import RgbdFrame
from gslts.datasets import Dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import _adapt
from gslts.mapping.evaluation.held_out import TrainingRecord, read_test_frames
from gslts.mapping.frames import FrameSplit, observe, split_held_out
from gslts.mapping.observation import Observation

COUNT = 30


class MemoryFrame:
    """A frame in memory, with depth 1 m or none; or one that cannot be read."""

    def __init__(
        self, number: int, *, blind: bool = False, torn: bool = False, hidden: bool = False
    ) -> None:
        self.name, self._blind, self._torn = f"{number:02}", blind, torn
        self._hidden = hidden
        self.camera = scenes.orbit_camera(16, 12, angle_rad=0.1 * number)

    def read(self) -> RgbdFrame:
        if self._torn:
            raise ValueError(f"{self.name}.png: it is torn")
        depth = np.full((12, 16), 0 if self._blind else 1, np.float32)
        mask = None
        if self._hidden:  # But for lines of 1 px, which are nothing at half the resolution.
            mask = np.zeros((12, 16), np.bool_)
            mask[:, ::4] = True
        return RgbdFrame(np.zeros((12, 16, 3), np.uint8), depth, self.camera, mask=mask)


def dataset_of(
    *,
    torn: Sequence[int] = (),
    blind: Sequence[int] = (),
    hidden: Sequence[int] = (),
    count: int = COUNT,
) -> Dataset:
    frames = [
        MemoryFrame(k, torn=k in torn, blind=k in blind, hidden=k in hidden) for k in range(count)
    ]
    return Dataset("set", tuple(frames), ("early: no pose",))


def split_of(dataset: Dataset) -> FrameSplit:
    return FrameSplit.read(dataset, observe, split_held_out)


def record_of(dataset: Dataset) -> TrainingRecord:
    """Record of a map that was made from a data set."""
    split = split_of(dataset)
    return TrainingRecord(
        {name: frame.camera() for name, frame in split.training.items()},
        frozenset(split.validation.observations),
    )


def numbers(observations: Iterable[Observation]) -> list[int]:
    """Find the number of each frame by its given pose."""
    cameras = [MemoryFrame(k).camera.world_from_camera for k in range(COUNT)]
    return [
        next(
            k
            for k in range(COUNT)
            if np.array_equal(cameras[k], observation.given_world_from_depth)
        )
        for observation in observations
    ]


@pytest.mark.parametrize("count", [10, 17, 30, 125])
def test_each_frame_has_one_purpose(count: int) -> None:
    names = [f"{k:03}" for k in range(count)]
    validation, test = (set(part) for part in split_held_out(names))
    assert validation
    assert test
    assert not validation & test
    assert validation | test == set(range(0, count, 8))
    assert 0 <= len(test) - len(validation) <= 1


def test_neighbours_are_training_frames() -> None:
    split = split_of(dataset_of())
    assert list(split.names) == [f"{k:02}" for k in range(COUNT)]
    for held_out, frames in ((split.test, [0, 16]), (split.validation, [8, 24])):
        assert numbers(held_out.observations.values()) == frames
        wanted = [[k for k in (frame - 1, frame + 1) if k >= 0] for frame in frames]
        assert [numbers(near) for near in held_out.neighbours] == wanted
    assert not {"00", "08", "16", "24"} & set(split.training)


@pytest.mark.parametrize(
    ("torn", "blind"),
    [
        ((), ()),
        ((8,), ()),
        ((7, 16), ()),
        ((), (16,)),
        ((3,), (9, 15, 17)),
        ((3,), range(0, COUNT, 3)),  # With so many, the rest is worth more than nothing.
        ((), range(COUNT)),
    ],
)
def test_frames_are_those_of_the_mapping_run(torn: Sequence[int], blind: Sequence[int]) -> None:
    dataset = dataset_of(torn=torn, blind=blind)
    made = split_of(dataset)
    record = record_of(dataset)
    again = FrameSplit.read(dataset, record.observe, record.split)
    test, skipped = read_test_frames(dataset, record)
    for split in (made, again):
        assert list(test.observations) == list(split.test.observations)
        assert numbers(test.observations.values()) == numbers(split.test.observations.values())
        assert [numbers(near) for near in test.neighbours] == [
            numbers(near) for near in split.test.neighbours
        ]
        assert skipped == split.skipped
    assert list(again.validation.observations) == list(made.validation.observations)
    bad = len(torn) + (len(blind) if len(blind) < 10 else 0)
    assert len(skipped) == 1 + bad
    assert len(test.observations) == len(range(0, COUNT - bad, 16))


def test_a_plain_map_is_tested_past_bad_frames() -> None:
    for bad in ({"torn": [8]}, {"blind": [8]}):
        test, skipped = read_test_frames(dataset_of(**bad), TrainingRecord(), 2)
        frames = list(test.observations.values())
        assert numbers(frames) == [0, 2, 4, 6, *range(9, COUNT, 2)]
        assert test.neighbours == [[]] * len(frames)
        assert [reason.split(":")[0] for reason in skipped] == ["early", "08"]
        assert all(frame.rgb[0].shape == (12, 16, 3) for frame in frames)


def test_settings_without_effect_are_recorded_as_off() -> None:
    """Lenses are refined by the same equations as poses."""
    split = split_of(dataset_of())
    given = split.training["01"].lenses
    for refine in (True, False):
        config = _adapt(MappingConfig(refine_poses=refine), split, given)
        assert (config.refine_poses, config.refine_lenses) == (refine, refine)


@pytest.mark.parametrize("number", [0, 3, 8])
def test_frames_whose_mask_leaves_nothing_are_skipped(number: int) -> None:
    """They would end the run at its last step, or be no test at all."""
    dataset = dataset_of(hidden=[number])
    split = split_of(dataset)
    assert f"{number:02}" not in split.names
    reason = f"{number:02}: its mask leaves no pixel at half the resolution"
    assert split.skipped == ("early: no pose", reason)
    test, skipped = read_test_frames(dataset, record_of(dataset))
    assert list(test.observations) == list(split.test.observations)
    assert skipped == split.skipped


def test_a_neighbour_torn_since_is_left_out() -> None:
    record = record_of(dataset_of())
    test, skipped = read_test_frames(dataset_of(torn=[15]), record)
    assert [numbers(near) for near in test.neighbours] == [[1], [14, 17]]
    assert skipped[1:] == ("15: 15.png: it is torn",)


def test_of_equal_names_the_first_frame_counts() -> None:
    frames = dataset_of().frames
    twice = Dataset("set", (*frames, MemoryFrame(16), frames[3]))
    test, skipped = read_test_frames(twice, record_of(dataset_of()))
    assert numbers(test.observations.values()) == [0, 16]
    assert skipped == tuple(f"{name}: there is another frame of that name" for name in ("16", "03"))


def test_too_many_bad_frames_are_an_error() -> None:
    record = record_of(dataset_of())
    with pytest.raises(ValueError, match="set: 7 of 31 frames cannot be used, such as early: no"):
        read_test_frames(dataset_of(torn=range(12, 18)), record)
    with pytest.raises(ValueError, match=r"all of its frames that can be used; 16: 16.png: it is"):
        read_test_frames(dataset_of(torn=[0, 16]), record)
    everything = TrainingRecord({frame.name: frame.camera for frame in dataset_of().frames})
    with pytest.raises(ValueError, match="set: there is no test frame: the map was made from all"):
        read_test_frames(replace(dataset_of(), skipped=()), everything)


def test_many_missing_images_are_no_error() -> None:
    missing = tuple(f"{number}.png: there is no such image" for number in range(17))
    dataset = replace(dataset_of(), missing=missing)
    _, skipped = read_test_frames(dataset, record_of(dataset_of()))
    assert skipped[-17:] == missing
    split = split_of(dataset)
    assert len(split.names) == COUNT
    assert split.skipped == ("early: no pose", *missing)


def test_more_frames_than_memory_are_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gslts.mapping.frames.free_memory_bytes", lambda: 10_000)
    with pytest.raises(ValueError, match=r"set: 30 frames take .* such as one in 9$"):
        read_test_frames(dataset_of(), TrainingRecord(), every=1)
    assert len(read_test_frames(dataset_of(), TrainingRecord(), every=10)[0].observations) == 3
