"""Boxes around the objects that changed, drawn by eye in the images of real visits.

The images are from the Object Change Detection data of TU Wien (Langer et al.), as the repository
florianpfleiderer/CYWS3D-pipeline has them; the boxes were drawn for this benchmark.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from gslts_sim.strict_model import STRICT

Kind = Literal["new", "missing", "nudged", "ignore"]
"""Kind of a difference from the reference visit: an object that is new at its place, one that is
gone, one that moved by less than 15 cm, and one that no detector is judged by."""
BoxPx = tuple[float, float, float, float]
"""(x0, y0, x1, y1) in an image, px; x1 and y1 exclusive."""


JUDGED: tuple[Kind, ...] = ("new", "missing", "nudged")
"""Kinds that a detector is judged by: the first two must be found, the last may be reported as a
shift."""


class MarkedObject(BaseModel):
    """A difference between an image and the reference visit.

    Attributes:
        kind: Kind of the difference.
        name: Name of the object, the same in all images of a room.
        box_px: Box around its visible part, or, if missing, around where it would be seen.
        note: Remark on a doubtful case.
    """

    model_config = STRICT

    kind: Kind
    name: str
    box_px: Annotated[list[float], Field(min_length=4, max_length=4)]
    note: str = ""

    @property
    def box(self) -> BoxPx:
        """The box as a tuple."""
        x0, y0, x1, y1 = self.box_px
        return x0, y0, x1, y1


class MarkedRoom(BaseModel):
    """Differences in all later visits of a room.

    Attributes:
        room: Name of the room.
        reference: Name of the visit that the map is made from.
        visits: By name of the visit, and by file of the image in it.
    """

    model_config = STRICT

    room: str
    reference: str
    visits: dict[str, dict[str, list[MarkedObject]]]


def marked_rooms() -> dict[str, MarkedRoom]:
    """Return all rooms with boxes, by name."""
    folder = files(__package__) / "boxes"
    rooms = [MarkedRoom.model_validate_json(path.read_text()) for path in folder.iterdir()]
    return {room.room: room for room in sorted(rooms, key=lambda room: room.room)}
