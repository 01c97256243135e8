"""Fits the weights of `gslts::detect::certainty` and `likeness` to simulated changes.

    python benchmarks/fit_certainty.py --seeds 5:12 --unchanged DATASET

records, maps and changes homes as `gslts bench detect` does, and prints what belongs into
cpp/detect/certainty.cpp and cpp/detect/likeness.cpp, with the loss (nats an answer) in homes that
were left out of the fit. What is found in a real visit in which nothing changed, if one is given,
is all wrong. Seeds from 10,000 up are kept for evaluation.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm
from unchanged_benchmark import visits_of

from gslts._core.detect import Side, Surface, differences_of, features_of
from gslts.change.config import DetectionConfig, ObjectRule
from gslts.change.detector import ChangeDetector, Detection
from gslts.datasets import open_dataset
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts_bench.detection.cases import Case, counts_of, make_cases, take_frame
from gslts_bench.detection.truth import Truth
from gslts_bench.homes import BenchHome, HomeSetup, default_state, homes_of

Floats = NDArray[np.float64]

RULE = ObjectRule(certain=0, alike=1)
"""Reports each surface by itself, however unlikely."""
HALVINGS = (0, 1, 2)
"""Frames of homes are looked at in all resolutions, so that weights do not depend on it."""
NEAR_M = 0.05
"""So near to the box of an object that changed, a surface is its."""
NEGATIVES = 40
"""Pairs of surfaces of different objects for each of the same object, at most."""
RIDGE = 1e-3
"""Of the squares of the weights of features that vary by one."""
ROUNDS = 50


@dataclass(frozen=True, eq=False)
class Found:
    """A surface in an image of some width, and the object whose it is; None if it is an error."""

    home: str
    case: str
    width_px: int
    surface: Surface
    object_id: str | None

    @property
    def before(self) -> bool:
        """Whether it is seen in the map."""
        return self.surface.side == Side.BEFORE


@dataclass(frozen=True, eq=False)
class Questions:
    """Features [N,F], answers [N] of 0 and 1, homes [N] and weights [N]."""

    features: Floats
    answers: Floats
    homes: NDArray[np.str_]
    weights: Floats


def found_in(home: str, case: Case, detection: Detection) -> Iterator[Found]:
    """What a detector that reports everything found in a case."""
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


def certainty_questions(found: Sequence[Found]) -> Questions:
    """Whether each surface is that of an object that changed."""
    return Questions(
        features=np.array([features_of(one.surface) for one in found]),
        answers=np.array([one.object_id is not None for one in found], np.float64),
        homes=np.array([one.home for one in found]),
        weights=np.ones(len(found)),
    )


def likeness_questions(found: Sequence[Found], rng: np.random.Generator) -> Questions:
    """Whether two surfaces of one home are one object, both answers weighing as much."""
    ends: dict[tuple[str, str, int, str, bool], Found] = {}
    for one in found:
        if one.object_id is not None:
            key = (one.home, one.case, one.width_px, one.object_id, one.before)
            if key not in ends or ends[key].surface.area_px < one.surface.area_px:
                ends[key] = one
    of_homes: dict[str, list[Found]] = defaultdict(list)
    for one in ends.values():
        of_homes[one.home].append(one)
    same, others = [], []
    for home in of_homes.values():
        for before in (one for one in home if one.before):
            for after in (one for one in home if not one.before):
                if before.object_id != after.object_id:
                    others.append((before, after))
                elif (before.case, before.width_px) == (after.case, after.width_px):
                    same.append((before, after))
    chosen = rng.permutation(len(others))[: NEGATIVES * len(same)]
    pairs = [*same, *(others[k] for k in chosen)]
    answers = np.arange(len(pairs)) < len(same)
    return Questions(
        features=np.array([differences_of(a.surface, b.surface) for a, b in pairs]),
        answers=answers.astype(np.float64),
        homes=np.array([a.home for a, _ in pairs]),
        weights=np.where(answers, 1.0, len(same) / len(chosen)),
    )


def fitted(questions: Questions) -> Floats:
    """[F+1] weights of the features, and an offset: logistic regression by Newton's method."""
    mean, spread = questions.features.mean(axis=0), questions.features.std(axis=0) + 1e-9
    features = _with_one((questions.features - mean) / spread)
    ridge = np.full(features.shape[1], RIDGE * questions.weights.sum())
    ridge[-1] = 0
    weights = np.zeros(features.shape[1])
    for _ in range(ROUNDS):
        answers = _logistic(features @ weights)
        gradient = features.T @ (questions.weights * (answers - questions.answers))
        curvature = questions.weights * answers * (1 - answers)
        hessian = (features * curvature[:, None]).T @ features + np.diag(ridge + 1e-9)
        weights -= np.linalg.solve(hessian, gradient + ridge * weights)
    plain = weights[:-1] / spread
    return np.append(plain, weights[-1] - plain @ mean)


def answers_of_others(questions: Questions) -> Floats:
    """[N] what the weights of all other homes answer in each."""
    answers = np.zeros(len(questions.answers))
    for home in np.unique(questions.homes):
        own = questions.homes == home
        others = Questions(
            questions.features[~own],
            questions.answers[~own],
            questions.homes[~own],
            questions.weights[~own],
        )
        answers[own] = _logistic(_with_one(questions.features[own]) @ fitted(others))
    return answers


def loss(questions: Questions, answers: Floats) -> float:
    """Mean of -log of what was given to what is true."""
    given = np.where(questions.answers > 0, answers, 1 - answers)
    return float(np.average(-np.log(given + 1e-9), weights=questions.weights))


def tell(title: str, questions: Questions) -> None:
    """Prints weights, and how well they do in homes they have not seen."""
    answers = answers_of_others(questions)
    right = np.average((answers > 0.5) == (questions.answers > 0), weights=questions.weights)
    known = questions.answers > 0
    print(f"{title}: {known.sum()} yes, {(~known).sum()} no")
    print(f"  in homes left out: loss {loss(questions, answers):.4f}, right {100 * right:.1f} %")
    *weights, offset = fitted(questions)
    print(f"  offset {offset:.3f}, weights {', '.join(f'{weight:.3f}' for weight in weights)}")


def _logistic(values: Floats) -> Floats:
    return np.asarray(1 / (1 + np.exp(-values)))


def _with_one(features: Floats) -> Floats:
    return np.hstack([features, np.ones((len(features), 1))])


def _found_in_homes(homes: Iterable[BenchHome], tasks: int, count: int) -> Iterator[Found]:
    for bench, counts in zip(homes, counts_of(tasks, count), strict=True):
        folder = bench.map()
        gaussian_map = read_map(folder)
        cameras = cameras_of_map(folder).values()
        detectors = [
            ChangeDetector(
                gaussian_map, DetectionConfig(halvings=one, objects=RULE), cameras=cameras
            )
            for one in HALVINGS
        ]
        cases = make_cases(bench, counts)
        before = default_state(cases.home, cases.initial_actions)
        for case in tqdm(cases.cases, desc=bench.name):
            frame = take_frame(case, before, bench)
            for detector in detectors:
                yield from found_in(bench.name, case, detector.detect(frame))


def _found_unchanged(dataset: Path) -> Iterator[Found]:
    for visit in visits_of(open_dataset(dataset), "fast"):
        detector = visit.detector(DetectionConfig(objects=RULE))
        for name, frame in visit.unknown.items():
            detection = detector.detect(frame)
            for surface in _surfaces_of(detection):
                yield Found(str(dataset), name, detection.camera.width, surface, None)


def main() -> None:
    """Prints both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="5:12", help="A:B, without B")
    parser.add_argument("--tasks", type=int, default=525, help="single changes in all")
    parser.add_argument("--work", type=Path, default=Path("out/bench"))
    parser.add_argument("--unchanged", type=Path, help="data set of one visit")
    arguments = parser.parse_args()
    first, end = map(int, arguments.seeds.split(":"))
    if end > 10_000:
        parser.error("seeds from 10,000 up are kept for evaluation")
    homes = homes_of(range(first, end), (), HomeSetup(), arguments.work)
    found = list(_found_in_homes(homes, arguments.tasks, len(homes)))
    tell("likeness", likeness_questions(found, np.random.default_rng(0)))
    if arguments.unchanged is not None:
        found += _found_unchanged(arguments.unchanged)
    tell("certainty", certainty_questions(found))


if __name__ == "__main__":
    main()
