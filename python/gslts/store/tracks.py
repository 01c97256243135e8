"""Tracks: the history of single objects, derived from the object changes of a line of versions.

A version tells what one update found, so a moved object may be gone in one version and there in
another, and a large one may be found twice. Tracks put these parts together. They are a function of
the history and not stored: a restored version has the tracks of the versions it was made from. This
module does not import NumPy, because `gslts log` must start fast.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from gslts.store.causes import Appearance, Box, Motion, Point, UpdateCause
from gslts.store.match_score import is_at, report_score
from gslts.store.records import UNKNOWN, Event, Track, TrackEvent, Version

MAX_ROUNDS_APART = 1
"""Maximum number of rounds between two reports that are parts of one change, except that an object
that is gone may be found at any later time. A robot sees the whole home in a round; what an update
rejects, it tries again in the next one. With 2, two changes on two days are taken for one."""

MAX_ABSENT = 100
"""Maximum number of objects that are gone and may be found again: those that left last. Bounds the
time of a long history without names."""

INSIDE_M = 0.02
"""Maximum distance of the centre of an object from the box of furniture that carries it, m: as much
as boxes of one object differ from frame to frame. The box of what lies on the edge reaches over."""


@dataclass(eq=False)
class _Report:
    """An end of an object change: the object at its position before or after the change."""

    version: int
    round: int | None
    type: str
    box: Box | None
    appearance: Appearance | None

    def is_near(self, other: _Report) -> bool:
        """Return whether both may report parts of one change; without rounds, the next version."""
        if self.round is None or other.round is None:
            return abs(self.version - other.version) <= 1
        return abs(self.round - other.round) <= MAX_ROUNDS_APART

    def score(self, other: _Report) -> float:
        """Return how alike the objects are, 0 to 1; 0 if they cannot be one object."""
        named = UNKNOWN not in (self.type, other.type)
        if named and self.type != other.type:
            return 0.0
        return report_score(
            (self.box, other.box), (self.appearance, other.appearance), same_type=named
        )

    def is_at(self, other: _Report) -> bool:
        """Return whether both may be one object at one position, or parts of it."""
        known = {self.type, other.type} - {UNKNOWN}
        if len(known) == 2:
            return False
        parts = UNKNOWN not in (self.type, other.type) and self.is_near(other)
        return is_at(self.box, other.box, parts=parts)


@dataclass(eq=False)
class _Shift:
    """A small motion of an object during its stay.

    Attributes:
        before: The object before the motion.
        after: The object after it.
        motion: The motion.
        carried: The object stands on another one, of which the motion was reported.
    """

    before: _Report
    after: _Report
    motion: Motion
    carried: bool = False


@dataclass(eq=False)
class _Stay:
    """An object at one position, but for shifts.

    Attributes:
        came: Reports of its arrival, oldest first; none if the first map shows it.
        left: Reports of its departure, oldest first; none while it is there.
        shifts: Its shifts, oldest first.
    """

    came: list[_Report] = field(default_factory=list)
    left: list[_Report] = field(default_factory=list)
    shifts: list[_Shift] = field(default_factory=list)

    @property
    def reports(self) -> list[_Report]:
        """Return the reports of its arrival, its shifts and its departure."""
        shifts = [report for shift in self.shifts for report in (shift.before, shift.after)]
        return [*self.came, *shifts, *self.left]

    @property
    def place(self) -> _Report:
        """Return the last report of where it is."""
        return self.reports[-1]

    def is_at(self, report: _Report) -> bool:
        return any(own.is_at(report) for own in self.reports)

    def score(self, report: _Report) -> float:
        # A shift shows only edges of the object, which say little of its appearance.
        whole = [*self.came, *self.left] or self.reports
        return max(own.score(report) for own in whole)


_Stays = list[_Stay]
"""Stays of one object, oldest first; only the last may be without departure."""


def object_tracks(lineage: Sequence[Version], events: Sequence[Event]) -> list[Track]:
    """Return the tracks of all objects that changed.

    Args:
        lineage: A version and those it was made from, oldest first.
        events: History of the map, oldest first; those of other versions do not count.

    Returns:
        By the first change of each object. The first object of a type is called by the type, such
        as "Pillow", the next ones "Pillow 2", "Pillow 3".
    """
    found: list[_Stays] = []
    own: dict[int, list[Event]] = {}
    for event in events:
        own.setdefault(event.version, []).append(event)
    for version in lineage:
        of_version = own.get(version.number, [])
        for event in of_version:
            if event.motion is not None:
                _shift(found, _shift_of(version, event, event.motion))
        pairs = _reports(version, of_version)
        for before, after in sorted(pairs, key=lambda pair: pair[0] is None):  # Departures first.
            gone = None if before is None else _leave(found, before)
            if after is not None:
                _arrive(found, after, gone)
            elif gone is not None:
                _join_earlier_arrival(found, gone)
    names: Counter[str] = Counter()
    tracks = []
    for stays in sorted(found, key=_first_version):
        types = Counter(report.type for stay in stays for report in stay.reports)
        del types[UNKNOWN]
        name = types.most_common(1)[0][0] if types else UNKNOWN
        names[name] += 1
        label = name if names[name] == 1 else f"{name} {names[name]}"
        tracks.append(Track(name=label, events=tuple(_events(stays, name))))
    return tracks


def _reports(
    version: Version, events: Sequence[Event]
) -> list[tuple[_Report | None, _Report | None]]:
    """Return both ends of each change but shifts; None where there is no object."""
    cause, number_of_round = version.cause, _round_of(version)
    changes = cause.changes if isinstance(cause, UpdateCause) else ()
    pairs = []
    for row, event in enumerate(events):
        if event.kind == "shift":
            continue
        appearances = changes[row].appearances if len(changes) == len(events) else (None, None)
        sides = {"addition": (False, True), "removal": (True, False)}.get(event.kind, (True, True))
        before, after = (
            _Report(version.number, number_of_round, event.type, box, appearance) if there else None
            for there, box, appearance in zip(sides, event.boxes, appearances, strict=True)
        )
        pairs.append((before, after))
    return pairs


def _round_of(version: Version) -> int | None:
    return version.cause.round if isinstance(version.cause, UpdateCause) else None


def _shift_of(version: Version, event: Event, motion: Motion) -> _Shift:
    before, after = (
        _Report(version.number, _round_of(version), event.type, box, None) for box in event.boxes
    )
    return _Shift(before, after, motion)


def _shift(found: list[_Stays], shift: _Shift) -> None:
    """Add a shift to the object at its position, or to a new one, and to all that stands on it."""
    present = [stays[-1] for stays in found if not stays[-1].left]
    same = [
        stay for stay in present if stay.is_at(shift.before) and stay.place.score(shift.before) > 0
    ]
    own = max(same, key=lambda stay: stay.place.score(shift.before), default=None)
    for stay in present:
        if stay is own:
            stay.shifts.append(shift)
        elif _carries(shift.before.box, stay.place.box):
            place = stay.place
            after = replace(place, box=_moved_box(place.box, shift.motion))
            stay.shifts.append(_Shift(place, after, shift.motion, carried=True))
    if own is None:
        found.append([_Stay(shifts=[shift])])


def _carries(box: Box | None, other: Box | None) -> bool:
    """Return whether an object stands on furniture with a box, or in it."""
    if box is None or other is None:
        return False
    centre, (low, high) = _centre(other), box
    over = all(low[axis] - INSIDE_M <= centre[axis] <= high[axis] + INSIDE_M for axis in (0, 1))
    return over and centre[2] >= low[2] and other[0][2] <= high[2] + INSIDE_M


def _moved_box(box: Box | None, motion: Motion) -> Box | None:
    """Return a box at the position to which a motion carries its centre."""
    if box is None:
        return None
    centre, sizes = _centre(box), [high - low for low, high in zip(*box, strict=True)]
    x, y, z = (
        sum(turn * at for turn, at in zip(row, centre, strict=False)) + row[3] for row in motion[:3]
    )
    dx, dy, dz = (size / 2 for size in sizes)
    return (x - dx, y - dy, z - dz), (x + dx, y + dy, z + dz)


def _centre(box: Box) -> Point:
    (x0, y0, z0), (x1, y1, z1) = box
    return (x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2


def _leave(found: list[_Stays], report: _Report) -> _Stays | None:
    """Add a departure to the object that is at its position, or that has just left it.

    Returns:
        The object; None if it is known to be elsewhere already.
    """
    present = [stays for stays in found if not stays[-1].left and stays[-1].is_at(report)]
    if present:
        stays = max(present, key=lambda stays: stays[-1].score(report))
        stays[-1].left.append(report)
        return stays
    for stays in reversed(found):
        for stay in stays:
            if stay.left and stay.left[-1].is_near(report) and stay.is_at(report):
                stay.left.append(report)
                return stays if stays[-1].left else None
    found.append([_Stay(left=[report])])
    return found[-1]


def _arrive(found: list[_Stays], report: _Report, gone: _Stays | None) -> None:
    """Add an arrival to the object that is there already, or that is gone, or to a new one.

    Args:
        found: All objects.
        report: The arrival.
        gone: Object that has just left another position, if the change is a relocation.
    """
    there = [stays for stays in found if not stays[-1].left and stays[-1].is_at(report)]
    if there:
        stays = max(there, key=lambda stays: stays[-1].score(report))
        stays[-1].came.append(report)
        if gone is not None and stays[0].came:
            _join(found, gone, stays)
        return
    if gone is None:
        absent = [stays for stays in found if stays[-1].left]
        absent.sort(key=lambda stays: stays[-1].left[-1].version)
        gone = _best(absent[-MAX_ABSENT:], report)
    if gone is not None:
        gone.append(_Stay(came=[report]))
    else:
        found.append([_Stay(came=[report])])


def _join_earlier_arrival(found: list[_Stays], gone: _Stays) -> None:
    """Join an object that has left with one that was found elsewhere shortly before."""
    report = gone[-1].left[-1]
    new = [
        stays
        for stays in found
        if stays is not gone
        and stays[0].came
        and stays[0].came[0].is_near(report)
        and not stays[0].is_at(report)
    ]
    best = _best(new, report, stay=0)
    if best is not None:
        _join(found, gone, best)


def _best(
    candidates: Sequence[_Stays], report: _Report, stay: Literal[0, -1] = -1
) -> _Stays | None:
    """Return the object that is most like a reported one, the last one of equals; None if none."""
    best = max(reversed(candidates), key=lambda stays: stays[stay].score(report), default=None)
    return best if best is not None and best[stay].score(report) > 0 else None


def _join(found: list[_Stays], first: _Stays, second: _Stays) -> None:
    first.extend(second)
    found.remove(second)


def _first_version(stays: _Stays) -> int:
    return min(report.version for stay in stays for report in stay.reports)


def _events(stays: _Stays, name: str) -> list[TrackEvent]:
    """Return what happened to one object."""
    events = []
    for before, after in zip([None, *stays], [*stays, None], strict=True):
        left = before.left if before is not None else []
        came = after.came if after is not None else []
        if left and came and not left[0].is_at(came[0]):
            events.append(_event("relocation", name, left, came))
        else:
            events += [_event("removal", name, left, [])] if left else []
            events += [_event("addition", name, [], came)] if came else []
        if after is not None:
            events += [_shift_event(name, shift) for shift in after.shifts if not shift.carried]
    return events


def _shift_event(name: str, shift: _Shift) -> TrackEvent:
    version = shift.before.version
    return TrackEvent(
        kind="shift",
        type=name,
        boxes=(shift.before.box, shift.after.box),
        motion=shift.motion,
        version=version,
        parts=(version,),
    )


def _event(
    kind: Literal["addition", "removal", "relocation"],
    name: str,
    left: Sequence[_Report],
    came: Sequence[_Report],
) -> TrackEvent:
    parts = [reports for reports in (left, came) if reports]
    return TrackEvent(
        kind=kind,
        type=name,
        boxes=(left[0].box if left else None, came[0].box if came else None),
        version=max(reports[0].version for reports in parts),
        parts=tuple(sorted({report.version for reports in parts for report in reports})),
    )
