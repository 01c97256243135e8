"""Counts false reports of changes in a real visit in which nothing changed.

    python benchmarks/unchanged_benchmark.py DATASET --preset fast

maps the visit eight times, each time without other frames (every eighth is held out), and runs the
detectors on these: most frames of the visit are used once, with a map made without them. Changes by
people or screens in the visit count as false too.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from tqdm import tqdm

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset, open_dataset
from gslts.mapping.config import PRESETS
from gslts.mapping.engine import make_map
from gslts_bench.detection.variants import STRATEGIES

FOLDS = 8
"""Number of maps; see `gslts.mapping.frames.split_held_out`."""


@dataclass(frozen=True, eq=False)
class Visit:
    """A map, its training cameras, and frames that were held out of it, by name."""

    gaussian_map: GaussianMap
    cameras: list[Camera]
    held_out: dict[str, RgbdFrame]

    def detector(self, config: DetectionConfig) -> ChangeDetector:
        """Return a detector for the map."""
        return ChangeDetector(self.gaussian_map, config, cameras=self.cameras)


def visits_of(dataset: Dataset, preset: str) -> Iterator[Visit]:
    """Yield the visit in all folds."""
    frames = {frame.name: frame for frame in dataset.frames}
    for first in tqdm(range(FOLDS), desc="maps"):
        part = replace(dataset, frames=dataset.frames[first:])
        result = make_map(part, PRESETS[preset].model_copy(update={"variant_steps": 0}))
        cameras = [frame.camera() for frame in result.training.values()]
        yield Visit(
            result.gaussian_map, cameras, {name: frames[name].read() for name in result.held_out}
        )


def main() -> None:
    """Print how many frames have reports."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--preset", default="fast", choices=sorted(PRESETS))
    arguments = parser.parse_args()
    compared = {name: variant for name, variant in STRATEGIES.items() if not variant.locate}
    frames, reports, unreliable = 0, Counter[str](), Counter[str]()
    for visit in visits_of(open_dataset(arguments.dataset), arguments.preset):
        frames += len(visit.held_out)
        for name, variant in compared.items():
            detector = visit.detector(variant.config)
            for frame in visit.held_out.values():
                detection = detector.detect(frame)
                reports[name] += bool(detection.changes)
                unreliable[name] += detection.unreliable is not None
    for name in compared:
        print(
            f"{name}: reports in {reports[name]} of {frames} frames, "
            f"{unreliable[name]} of them unreliable"
        )


if __name__ == "__main__":
    main()
