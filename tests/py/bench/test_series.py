"""The table and the plot of `gslts bench series`."""

from pathlib import Path

from PIL import Image

from gslts_bench.series.benchmark import ANEW, BEFORE, UPDATED, End, Step
from gslts_bench.series.report import GAIN, GROWTH, printed, write_plot


def test_the_table_holds_the_figures() -> None:
    def step(number: int, changes: int, rejected: str | None) -> Step:
        return Step(
            id=f"home/{number}",
            kind="removal",
            object_type="Mug",
            detected=changes > 0,
            changes=changes,
            rejected=rejected,
            gaussians=1000,
            seconds=float(number),
            psnr_db=None,
        )

    steps = {"home": [step(1, 1, None), step(2, 0, None), step(3, 2, "why")]}
    end = End(
        id="home/end",
        psnr_db={UPDATED: 30.0, BEFORE: 25.0, ANEW: 30.25},
        gaussians={UPDATED: 1100, BEFORE: 1000, ANEW: 990},
    )
    rows = printed(steps, {"home": end}).splitlines()
    assert f"| {GAIN} | -0.25 dB | -0.5 dB |" in rows
    assert f"| {GROWTH} | +10.0 % | +10 % |" in rows
    assert "| detected in the first frame | 66.7 % (2 of 3) |  |" in rows
    assert "| left without an update | 66.7 % (2 of 3) |  |" in rows
    assert printed(steps, {}) == "no home came to its end"


def test_a_home_that_stopped_early_is_drawn_without_its_end(tmp_path: Path) -> None:
    step = Step(
        id="home/001",
        kind="removal",
        object_type="Mug",
        detected=True,
        changes=1,
        rejected=None,
        gaussians=10,
        seconds=1.0,
        psnr_db=None,
    )
    write_plot({"home": [step]}, {}, tmp_path / "plot.png")
    with Image.open(tmp_path / "plot.png") as picture:
        assert picture.size == (880, 660)
