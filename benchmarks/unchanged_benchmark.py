"""How often changes are reported in a real visit in which nothing changed.

    python benchmarks/unchanged_benchmark.py DATASET --preset fast

maps the visit eight times, each time without other frames (every eighth is kept aside), and shows
these to the detectors: most frames of the visit are judged once, by a map that does not know them.
What people or screens do in it counts as false too.
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

KEPT_ASIDE = 8
"""Each of so many frames; see `gslts.mapping.frames.split_held_out`."""


@dataclass(frozen=True, eq=False)
class Visit:
    """A map, the cameras that it was made from, and frames that it does not know, by name."""

    gaussian_map: GaussianMap
    cameras: list[Camera]
    unknown: dict[str, RgbdFrame]

    def detector(self, config: DetectionConfig) -> ChangeDetector:
        """Looks for changes against the map."""
        return ChangeDetector(self.gaussian_map, config, cameras=self.cameras)


def visits_of(dataset: Dataset, preset: str) -> Iterator[Visit]:
    """The visit in all the ways in which frames can be kept aside."""
    frames = {frame.name: frame for frame in dataset.frames}
    for first in tqdm(range(KEPT_ASIDE), desc="maps"):
        part = replace(dataset, frames=dataset.frames[first:])
        result = make_map(part, PRESETS[preset].model_copy(update={"variant_steps": 0}))
        cameras = [one.camera() for one in result.training.values()]
        yield Visit(
            result.gaussian_map, cameras, {name: frames[name].read() for name in result.held_out}
        )


def main() -> None:
    """Prints how many frames have reports."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--preset", default="fast", choices=sorted(PRESETS))
    arguments = parser.parse_args()
    compared = {name: one for name, one in STRATEGIES.items() if not one.locate}
    frames, reports, unreliable = 0, Counter[str](), Counter[str]()
    for visit in visits_of(open_dataset(arguments.dataset), arguments.preset):
        frames += len(visit.unknown)
        for name, variant in compared.items():
            detector = visit.detector(variant.config)
            for frame in visit.unknown.values():
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
