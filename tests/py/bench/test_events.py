"""Precision and recall of the events of a history."""

from gslts.store.records import ObjectEvent
from gslts_bench.days.events import EventScore, is_untrue, score_events, true_events, was_found
from gslts_sim.task import Change

BOX_A = ((0.0, 0.0, 0.0), (0.2, 0.2, 0.2))
BOX_B = ((2.0, 0.0, 0.0), (2.2, 0.2, 0.2))


def change(kind, before, after, object_id="Mug|1"):
    return Change(
        kind=kind,
        object_id=object_id,
        object_type="Mug",
        box_before=before,
        box_after=after,
    )


def test_an_object_that_goes_and_comes_elsewhere_has_moved():
    removal = change("removal", BOX_A, None)
    other = change("addition", None, BOX_A, "Mug|2")
    (first, second) = true_events([removal, other, change("addition", None, BOX_B)])
    assert first == other
    assert second == change("relocation", BOX_A, BOX_B)
    back = change("addition", None, BOX_A)
    assert true_events([removal, back]) == [removal, back]


def test_each_true_event_counts_once():
    true = [change("relocation", BOX_A, BOX_B), change("removal", BOX_A, None, "Mug|2")]
    move = ObjectEvent(kind="relocation", type="Mug", boxes=(BOX_A, BOX_B))
    score = score_events([move, move], true)
    assert score == EventScore(right=1, reported=2, true=2)
    assert (score.precision, score.recall) == (0.5, 0.5)


def test_an_end_at_another_position_is_wrong():
    move = ObjectEvent(kind="relocation", type="Mug", boxes=(BOX_A, BOX_A))
    assert score_events([move], [change("relocation", BOX_A, BOX_B)]).right == 0
    half = ObjectEvent(kind="removal", type="Mug", boxes=(BOX_A, None))
    assert score_events([half], [change("relocation", BOX_A, BOX_B)]).right == 0
    assert score_events([], []).precision == score_events([], []).recall == 1


def test_an_end_where_nothing_happened_is_untrue():
    moved = [change("relocation", BOX_A, BOX_B)]
    for boxes in ((BOX_A, BOX_B), (BOX_A, None), (None, BOX_B)):
        assert not is_untrue(ObjectEvent(kind="relocation", type="Mug", boxes=boxes), moved)
    for boxes in ((BOX_B, None), (BOX_A, BOX_A), (None, BOX_A)):
        assert is_untrue(ObjectEvent(kind="relocation", type="Mug", boxes=boxes), moved)


def reported_shift(before, after):
    # A plain copy: which kinds a history stores is not the subject.
    return ObjectEvent.model_construct(kind="shift", type="Mug", boxes=(before, after))


def test_a_shift_is_true_only_where_an_object_moved():
    near = ((0.05, 0.0, 0.0), (0.25, 0.2, 0.2))
    shift = reported_shift(BOX_A, near)
    true = change("shift", BOX_A, near)
    assert not is_untrue(shift, [true])
    assert was_found(true, [shift])
    assert score_events([shift], [true]).right == 1
    exchanged = [change("removal", BOX_A, None), change("addition", None, near, "Mug|2")]
    for changes in ([], exchanged, [change("relocation", BOX_A, BOX_B)]):
        assert is_untrue(shift, changes)
    assert not any(was_found(each, [shift]) for each in exchanged)
    assert score_events([shift], exchanged).right == 0
