"""Units of work that measure one map each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import open_dataset
from gslts.fleet.jobs import Add, Result
from gslts.mapping.config import MappingConfig
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.frames import FrameSplit
from gslts.store.manifest import read_manifest, split_version
from gslts.store.map_folder import read_map
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.tradeoff import mapping
from gslts_bench.tradeoff.mapping import COUNTS, MappingPoint

THE_MAP = "the map"
"""Name of the unit that measures the map as it is."""


@dataclass(frozen=True)
class PointUnit:
    """Measurement of one map.

    Attributes:
        name: `THE_MAP`, a share of its Gaussians (of `COUNTS`), or a budget ("10 s").
        map_path: The map.
        dataset: Data set that it was made from.
        config: Settings of the mapping.
        budget_s: Time for a map from scratch; None measures `map_path`.
        results: File of the result.
    """

    name: str
    map_path: Path
    dataset: Path
    config: MappingConfig
    budget_s: float | None
    results: Path | None
    count: int = 1

    def run(self, done: frozenset[str], add: Add) -> None:
        """Read what is needed, and measure; see `Unit`.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives the result.
        """
        if self.name in done:
            return
        gaussian_map, split = read_map(self.map_path), None
        if self.budget_s is None:
            split = mapping.split_of(open_dataset(self.dataset), TrainingRecord.read(self.map_path))
        add({"id": self.name, **asdict(self.measure(gaussian_map, split))})

    def measure(self, gaussian_map: GaussianMap, split: FrameSplit | None) -> MappingPoint:
        """Measure the map of this unit.

        Args:
            gaussian_map: The map at `map_path`, float32.
            split: Frames of the data set; None for a map from scratch, which reads them itself.
        """
        if self.budget_s is not None:
            opened = open_dataset(self.dataset)
            return mapping.measure_budget(opened, self.config, self.budget_s)
        assert split is not None
        if self.name in COUNTS:
            return mapping.measure_count(gaussian_map, split, self.config, self.name)
        folder, _ = split_version(self.map_path)
        made_in_s = mapping.seconds_of(read_manifest(folder)) if folder.is_dir() else None
        return mapping.measure_map(gaussian_map, split, made_in_s, self.config.threads)


def units_of(
    map_path: Path,
    dataset: Path,
    config: MappingConfig,
    budgets_s: Iterable[float],
    results: Path | None = None,
) -> list[PointUnit]:
    """List the measurements of a map and its data set.

    Args:
        map_path: The map.
        dataset: Data set that it was made from.
        config: Settings of the mapping.
        budgets_s: Budgets of maps from scratch.
        results: Folder of the results of interrupted runs; None keeps none.
    """
    kinds: dict[str, float | None] = {THE_MAP: None, **dict.fromkeys(COUNTS)}
    kinds |= {f"{budget_s:g} s": budget_s for budget_s in budgets_s}
    if results is not None:
        made_of = {
            "map": _stamps(map_path),
            "dataset": _stamps(dataset),
            "config": config.model_dump(mode="json"),
            "code": [code_digest("gslts_bench.tradeoff.mapping"), native_digest()],
        }
        results /= digest(made_of)
    return [
        PointUnit(name, map_path, dataset, config, budget_s, results and results / f"{name}.jsonl")
        for name, budget_s in kinds.items()
    ]


def point_of(result: Result) -> MappingPoint:
    """Return the measurement in a result of a unit.

    Args:
        result: Without an error.
    """
    return MappingPoint(**{name: value for name, value in result.items() if name != "id"})


def _stamps(path: Path) -> list[tuple[str, int, int]]:
    """Return names, sizes and times of change of a file, or of all files in a folder."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    stats = [(str(file.resolve()), file.stat()) for file in files if file.is_file()]
    return [(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]
