"""Fits the weights of `gslts::detect::confidence` and `match_score` to simulated changes.

    python benchmarks/fit_confidence.py --seeds 5:12 --unchanged DATASET

records, maps and changes homes as `gslts bench detect` does, and prints what belongs into
cpp/detect/constants.hpp, with the loss (nats per answer) in homes that
were left out of the fit. Everything found in a real visit without changes, if one is given, counts
as an error. Seeds of test homes are rejected.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from logistic_regression import fit as fit_logistic
from logistic_regression import logistic
from tqdm import tqdm

from gslts._core.detect import Side, Surface, confidence_features, match_features
from gslts.change.config import DetectionConfig, ObjectRule
from gslts.change.detector import ChangeDetector, Detection
from gslts.mapping.config import PRESETS
from gslts.types import Floats
from gslts_bench.detection.cases import Case, counts_of, make_cases, take_frame
from gslts_bench.detection.truth import Truth
from gslts_bench.homes import BenchHome, HomeSetup, homes_of, split_of
from gslts_bench.relocalization.room import FOLDS, RecordedRoom, RoomFold

RULE = ObjectRule(min_confidence=0, min_match_score=1)
"""Rule that reports each surface by itself, whatever its confidence."""
HALVINGS = (0, 1, 2)
"""Resolutions of the frames of homes, so that weights do not depend on it."""
NEAR_M = 0.05
"""Maximum distance of a surface from the box of the changed object that it belongs to."""
NEGATIVES = 40
"""Maximum number of pairs of different objects per pair of the same object."""
RIDGE = 1e-3
"""Weight of the squared weights of features with unit variance."""


@dataclass(frozen=True, eq=False)
class Found:
    """A surface in an image of some width, and its object; None if it is an error."""

    home: str
    case: str
    width_px: int
    surface: Surface
    object_id: str | None

    @property
    def before(self) -> bool:
        """True if it is a surface of the map."""
        return self.surface.side == Side.BEFORE


@dataclass(frozen=True, eq=False)
class Questions:
    """Features [N,F], answers [N] of 0 and 1, homes [N] and weights [N]."""

    features: Floats
    answers: Floats
    homes: np.ndarray[tuple[int], np.dtype[np.str_]]
    weights: Floats


def found_in(home: str, case: Case, detection: Detection) -> Iterator[Found]:
    """Yield the surfaces that a detector found in a case, with their objects."""
    for surface in _surfaces_of(detection):
        owner = _owner(surface, case.truths)
        yield Found(home, case.name, detection.camera.width, surface, owner)


def _surfaces_of(detection: Detection) -> list[Surface]:
    ends = [end for change in detection.changes for end in (change.before, change.after)]
    return [end for end in ends if end is not None]


def _owner(surface: Surface, truths: Iterable[Truth]) -> str | None:
    for truth in truths:
        change = truth.change
        box = change.box_before if surface.side == Side.BEFORE else change.box_after
        if box is None:
            continue
        low, high = np.array(box)
        if (surface.point >= low - NEAR_M).all() and (surface.point <= high + NEAR_M).all():
            return change.object_id
    return None


def confidence_questions(found: Sequence[Found]) -> Questions:
    """Ask for each surface whether it belongs to a changed object."""
    return Questions(
        features=np.array([confidence_features(entry.surface) for entry in found]),
        answers=np.array([entry.object_id is not None for entry in found], np.float64),
        homes=np.array([entry.home for entry in found]),
        weights=np.ones(len(found)),
    )


def match_questions(found: Sequence[Found], rng: np.random.Generator) -> Questions:
    """Ask for pairs of surfaces of a home whether they are one object, with balanced weights."""
    ends: dict[tuple[str, str, int, str, bool], Found] = {}
    for entry in found:
        if entry.object_id is not None:
            key = (entry.home, entry.case, entry.width_px, entry.object_id, entry.before)
            if key not in ends or ends[key].surface.area_px < entry.surface.area_px:
                ends[key] = entry
    of_homes: dict[str, list[Found]] = defaultdict(list)
    for entry in ends.values():
        of_homes[entry.home].append(entry)
    same, others = [], []
    for home in of_homes.values():
        for before in (entry for entry in home if entry.before):
            for after in (entry for entry in home if not entry.before):
                if before.object_id != after.object_id:
                    others.append((before, after))
                elif (before.case, before.width_px) == (after.case, after.width_px):
                    same.append((before, after))
    chosen = rng.permutation(len(others))[: NEGATIVES * len(same)]
    pairs = [*same, *(others[k] for k in chosen)]
    answers = np.arange(len(pairs)) < len(same)
    return Questions(
        features=np.array([match_features(a.surface, b.surface) for a, b in pairs]),
        answers=answers.astype(np.float64),
        homes=np.array([a.home for a, _ in pairs]),
        weights=np.where(answers, 1.0, len(same) / len(chosen)),
    )


def fit(questions: Questions) -> Floats:
    """Fit weights and an offset [F+1]."""
    ridge = RIDGE * questions.weights.sum()
    return fit_logistic(questions.features, questions.answers, questions.weights, ridge)


def answers_of_others(questions: Questions) -> Floats:
    """Answer [N] the questions of each home with the weights of all other homes."""
    answers = np.zeros(len(questions.answers))
    for home in np.unique(questions.homes):
        own = questions.homes == home
        others = Questions(
            questions.features[~own],
            questions.answers[~own],
            questions.homes[~own],
            questions.weights[~own],
        )
        answers[own] = logistic(_with_one(questions.features[own]) @ fit(others))
    return answers


def loss(questions: Questions, answers: Floats) -> float:
    """Return the mean negative log-likelihood of the true answers, nats."""
    given = np.where(questions.answers > 0, answers, 1 - answers)
    return float(np.average(-np.log(given + 1e-9), weights=questions.weights))


def report(title: str, questions: Questions) -> None:
    """Print weights and their loss in homes that were left out."""
    answers = answers_of_others(questions)
    right = np.average((answers > 0.5) == (questions.answers > 0), weights=questions.weights)
    known = questions.answers > 0
    print(f"{title}: {known.sum()} yes, {(~known).sum()} no")
    print(f"  in homes left out: loss {loss(questions, answers):.4f}, right {100 * right:.1f} %")
    *weights, offset = fit(questions)
    print(f"  offset {offset:.3f}, weights {', '.join(f'{weight:.3f}' for weight in weights)}")


def _with_one(features: Floats) -> Floats:
    return np.hstack([features, np.ones((len(features), 1))])


def _found_in_homes(homes: Iterable[BenchHome], tasks: int, count: int) -> Iterator[Found]:
    for bench, counts in zip(homes, counts_of(tasks, count), strict=True):
        folder = bench.map()
        detectors = [
            ChangeDetector.of_map(folder, DetectionConfig(halvings=halvings, objects=RULE))
            for halvings in HALVINGS
        ]
        cases = make_cases(bench, counts)
        before = bench.default_state(cases.initial_actions)
        for case in tqdm(cases.cases, desc=bench.name):
            frame = take_frame(case, before, bench)
            for detector in detectors:
                yield from found_in(bench.name, case, detector.detect(frame))


def _found_unchanged(dataset: Path, work: Path) -> Iterator[Found]:
    room = RecordedRoom.of(dataset, PRESETS["fast"], work)
    for fold in tqdm(range(FOLDS), desc=room.name):
        bench = RoomFold(room, fold)
        detector = ChangeDetector.of_map(bench.map(), DetectionConfig(objects=RULE))
        for frame in bench.frames:
            detection = detector.detect(frame.read())
            for surface in _surfaces_of(detection):
                yield Found(room.name, frame.name, detection.camera.width, surface, None)


def main() -> None:
    """Fit and print both models."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="5:12", help="A:B, without B, of one split")
    parser.add_argument("--tasks", type=int, default=525, help="number of single changes")
    parser.add_argument("--work", type=Path, default=Path("out/bench"))
    parser.add_argument("--unchanged", type=Path, help="data set of a visit without changes")
    arguments = parser.parse_args()
    first, end = map(int, arguments.seeds.split(":"))
    if split_of(range(first, end)) == "test":
        parser.error("--seeds: homes of the test split must not be fitted to")
    homes = homes_of(range(first, end), (), HomeSetup(), arguments.work)
    found = list(_found_in_homes(homes, arguments.tasks, len(homes)))
    report("match score", match_questions(found, np.random.default_rng(0)))
    if arguments.unchanged is not None:
        found += _found_unchanged(arguments.unchanged, arguments.work)
    report("confidence", confidence_questions(found))


if __name__ == "__main__":
    main()
