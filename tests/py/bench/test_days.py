"""The tables of `gslts bench days`."""

from gslts.store.records import Event, TrackEvent
from gslts_bench.days.run import Record, Round
from gslts_bench.days.tables import summarize, tabulate
from gslts_bench.tables import tables_markdown
from gslts_sim.task import Change

BOX_A = ((0.0, 0.0, 0.0), (0.2, 0.2, 0.2))
BOX_B = ((2.0, 0.0, 0.0), (2.2, 0.2, 0.2))
BOX_C = ((4.0, 0.0, 0.0), (4.2, 0.2, 0.2))
MOVE = Change(
    kind="relocation", object_id="Mug|1", object_type="Mug", box_before=BOX_A, box_after=BOX_B
)
GONE = Change(
    kind="removal", object_id="Book|1", object_type="Book", box_before=BOX_C, box_after=None
)


def event(version, kind, before, after):
    return Event(kind=kind, type="object", boxes=(before, after), version=version)


def found(*rounds, tracks=()):
    return summarize([Record(id="home/day", rounds=rounds, tracks=tracks)])


def test_what_happens_later_does_not_make_an_event_true():
    gone = event(2, "removal", BOX_C, None)
    early = found(Round(changes=(MOVE,), events=(gone,)), Round(changes=(GONE,), events=()))
    assert (early["home"]["untrue"], early["home"]["shown"]) == (1, 0)
    assert early["home"]["untrue_events"] == [
        "version 2: removal of object, (4.10, 0.10, 0.10) to nowhere"
    ]
    later = found(Round(changes=(GONE,), events=()), Round(changes=(MOVE,), events=(gone,)))
    assert (later["home"]["untrue"], later["home"]["shown"]) == (0, 1)


def test_a_version_counts_once():
    nothing = event(2, "addition", None, BOX_C)
    true = event(2, "relocation", BOX_A, BOX_B)
    day = found(Round(changes=(MOVE,), events=(nothing, nothing, true)))["home"]
    assert (day["versions"], day["untrue"], day["shown"], day["changes"]) == (1, 1, 1, 1)


def test_the_tables_hold_the_sums():
    halves = (event(2, "removal", BOX_A, None), event(3, "addition", None, BOX_B))
    move = event(3, "relocation", BOX_A, BOX_B)
    track = TrackEvent(**move.model_dump(), parts=(2, 3))
    text = tables_markdown(
        tabulate(found(Round(changes=(MOVE, GONE), events=halves), tracks=(track,)))
    ).splitlines()
    assert "| home | 1 | 2 | 0.0 % (0 of 2) | 50.0 % (1 of 2) |" in text
    assert "| all | 1 | 2 | 0.0 % (0 of 2) | 50.0 % (1 of 2) |" in text
    updates = "0.0 % (0 of 2) | 0.0 % (0 of 2) | - | 0.0 % (0 of 1) |"
    assert f"| as updates found them | {updates}" in text
    tracks = "100.0 % (1 of 1) | 50.0 % (1 of 2) | 100.0 % (1 of 1) | 100.0 % (1 of 1) |"
    assert f"| as tracks tell them | {tracks}" in text
