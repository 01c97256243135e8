"""The table and the plot of `gslts bench series`."""

from pathlib import Path

from drawn import assert_drawn

from gslts_bench.series.run import BEFORE, REBUILT, UPDATED, End, Record, Step
from gslts_bench.series.tables import GAIN, GROWTH, summarize, tabulate, write_plot
from gslts_bench.tables import tables_markdown


def record(number: int, changes: int, rejected: str | None) -> Record:
    step = Step(
        kind="removal",
        object_type="Mug",
        detected=changes > 0,
        changes=changes,
        rejected=rejected,
        gaussians=1000,
        seconds=float(number),
        psnr_db=None,
    )
    return Record(id=f"home/{number:03}", step=step)


STEPS = [record(1, 1, None), record(2, 0, None), record(3, 2, "why")]


def test_the_table_holds_the_figures() -> None:
    end = End(
        psnr_db={UPDATED: 30.0, BEFORE: 25.0, REBUILT: 30.25},
        gaussians={UPDATED: 1100, BEFORE: 1000, REBUILT: 990},
    )
    found = summarize([*STEPS, Record(id="home/end", end=end)])
    rows = tables_markdown(tabulate(found)).splitlines()
    assert "|  | home, 3 changes | target |" in rows
    assert f"| {GAIN} | -0.25 dB | -0.5 dB |" in rows
    assert f"| {GROWTH} | +10.0 % | +5 % |" in rows
    assert "| detected in the first frame | 66.7 % (2 of 3) |  |" in rows
    assert "| left without an update | 66.7 % (2 of 3) |  |" in rows
    assert tables_markdown(tabulate(summarize(STEPS))) == "No home came to its end."


def test_a_home_that_stopped_early_is_drawn_without_its_end(tmp_path: Path) -> None:
    write_plot(summarize(STEPS[:1]), tmp_path / "plot.png")
    assert_drawn(tmp_path / "plot.png")
