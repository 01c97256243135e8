"""Units of work for tests, where other processes can find them."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from gslts.fleet.jobs import Add


@dataclass(frozen=True)
class CountingUnit:
    """Gives the numbers below `count`; at some of them something happens."""

    name: str
    folder: Path
    count: int = 5
    raises_at: int | None = None
    dies_at: int | None = None
    deaths: int = 100
    waits_at: int | None = None

    @property
    def results(self) -> Path:
        return self.folder / f"{self.name}.jsonl"

    def run(self, done: frozenset[str], add: Add) -> None:
        for number in range(self.count):
            name = f"{self.name}/{number}"
            if name in done:
                continue
            if number == self.raises_at:
                raise ValueError("no such\nluck")
            if number == self.dies_at and self._count_death() <= self.deaths:
                os.kill(os.getpid(), signal.SIGKILL)
            if number == self.waits_at:
                (self.folder / f"{os.getpid()}.pid").touch()
                time.sleep(3600)
            add({"id": name, "square": number**2, "process": os.getpid()})

    def _count_death(self) -> int:
        with (self.folder / f"{self.name}.deaths").open("ab") as file:
            file.write(b"+")
            return file.tell()


class UnkeptUnit(CountingUnit):
    """Keeps no results."""

    @property
    def results(self) -> None:  # type: ignore[override]
        return


class Bar:
    """Stand-in for tqdm's bar."""

    def __init__(self) -> None:
        self.total, self.n = 0.0, 0.0

    def reset(self, total: float) -> None:
        self.total, self.n = total, 0.0

    def update(self, n: float) -> None:
        self.n += n
