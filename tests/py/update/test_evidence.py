"""Evidence of a view for a change in a region."""

from dataclasses import replace

import numpy as np
import pytest

from gslts._core import detect as core
from gslts.change.changes import Change
from gslts.change.detection import Detection
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.rendering.losses import Exposure
from gslts.update.evidence import (
    CLEAR_LOG_ODDS,
    FAR_M,
    MAX_LOG_ODDS,
    PRIOR_LOG_ODDS,
    confirm,
    evidence_of,
    is_visible,
)
from gslts.update.region import Region
from gslts.update.views import View

SIDE_PX = 40
DEPTH_ERROR_M = 0.01
"""Error of the depth of the map."""
REGION = Region("before", np.array([-0.1, -0.1, 1.0]), np.array([0.1, 0.1, 1.2]))


def camera_at(pose: np.ndarray, cx: float = SIDE_PX / 2) -> Camera:
    lens = {"fx": SIDE_PX, "fy": SIDE_PX, "cx": cx, "cy": SIDE_PX / 2}
    return Camera(**lens, width=SIDE_PX, height=SIDE_PX, world_from_camera=pose)


def detection(
    *surfaces: core.Surface, back_m: float = 0.0, depths_m: tuple[float, float] | None = None
) -> Detection:
    """Detection of a camera that sees the region in the middle, where the surfaces are labelled.

    Frame and map have one depth each, if these are given.
    """
    pose = np.eye(4)
    pose[2, 3] = -back_m
    labels = np.zeros((SIDE_PX, SIDE_PX), np.int32)
    for surface in surfaces:
        labels[15:25, 15:25] = surface.label
    camera = camera_at(pose)
    rgb = np.zeros((SIDE_PX, SIDE_PX, 3), np.float32)
    depths = None
    if depths_m is not None:
        observed, rendered, error = (
            np.full(labels.shape, value, np.float32) for value in (*depths_m, DEPTH_ERROR_M)
        )
        depths = observed, rendered, error
    return Detection((), None, camera, rgb, labels=labels, surfaces=surfaces, fine_depths=depths)


def surface(
    confidence: float, point=(0.0, 0.0, 1.1), side=core.Side.BEFORE, **more
) -> core.Surface:
    end = tuple(np.add(point, 0.1))
    return core.Surface(
        side=side, point=point, low=point, high=end, label=1, color_confidence=confidence, **more
    )


def test_a_confidence_says_what_it_adds_to_the_share_of_changed_objects() -> None:
    share = 1 / (1 + np.exp(-PRIOR_LOG_ODDS))
    assert evidence_of(REGION, detection(surface(share))) == pytest.approx(0)
    half = evidence_of(REGION, detection(surface(0.5)))
    assert half == pytest.approx(-PRIOR_LOG_ODDS)
    assert evidence_of(REGION, detection(surface(1.0))) == MAX_LOG_ODDS
    assert evidence_of(REGION, detection(surface(0.0))) == -MAX_LOG_ODDS


def test_no_surface_speaks_against_a_change_only_from_near() -> None:
    assert evidence_of(REGION, detection()) == -MAX_LOG_ODDS
    other_side = surface(0.9, side=core.Side.AFTER)
    assert evidence_of(REGION, detection(other_side)) == -MAX_LOG_ODDS
    far = evidence_of(REGION, detection(back_m=FAR_M))
    assert far == "a change may be overlooked from 3.6 m"


def test_what_is_covered_by_another_change_cannot_be_judged() -> None:
    beside = surface(0.9, point=(1.0, 0.0, 1.1))
    assert evidence_of(REGION, detection(beside)) == "another change covers it"


def test_a_view_that_misses_the_centre_cannot_judge() -> None:
    seen = detection()
    aside = replace(seen, camera=camera_at(np.eye(4), cx=-100.0))
    assert evidence_of(REGION, aside) == "it shows only a part of it"


def test_a_frame_whose_mask_hides_the_region_does_not_show_it() -> None:
    rgb, depth = np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8), np.zeros((SIDE_PX, SIDE_PX), np.float32)
    frame = RgbdFrame(rgb, depth, camera_at(np.eye(4)))
    assert is_visible(frame, REGION)
    mask = np.ones(depth.shape, np.bool_)
    assert is_visible(replace(frame, mask=mask), REGION)
    mask[18:22, 18:22] = False
    assert not is_visible(replace(frame, mask=mask), REGION)


def test_the_fault_of_a_surface_is_the_reason() -> None:
    seen_through = core.Visibility(on_surface=1, seen_through=99, known_share=1)
    found = evidence_of(REGION, detection(surface(0.9, visibility=seen_through)))
    assert found == "training cameras saw through this surface of the map"


def view_of(found: Detection) -> tuple[View, Detection]:
    """A view of the region, in which everything has changed."""
    shape = (SIDE_PX, SIDE_PX)
    rgb = np.full((*shape, 3), 128, np.uint8)
    frame = RgbdFrame(rgb, np.full(shape, 1.6, np.float32), camera_at(np.eye(4)))
    rendered, all_of_it = np.full(shape, 1.1, np.float32), np.ones(shape, np.bool_)
    view = View(frame, Exposure(), rendered, rgb.astype(np.float32) / 255, all_of_it, all_of_it)
    return view, found


def test_a_view_that_measures_a_step_does_not_speak_against_a_change() -> None:
    removal = Change("removal", 0.9, REGION.center, ((REGION.low, REGION.high), None))
    shown = view_of(detection(surface(0.9)))
    denied = view_of(detection(surface(0.05), depths_m=(1.1, 1.1)))
    gone = view_of(detection(surface(0.05), depths_m=(1.6, 1.1)))
    assert confirm(removal, [REGION], [shown, shown], []) is removal
    reason = "only 1 of 3 views show a removed object there"
    assert confirm(removal, [REGION], [shown, denied, denied], []) == reason
    assert confirm(removal, [REGION], [shown, gone, gone, shown], []) is removal
    assert confirm(removal, [REGION], [gone, gone], []) == (
        "0 view(s) can judge it, 2 are needed: depths differ there, but show no object by itself"
    )


def test_a_clear_step_shows_what_is_too_small_to_be_a_surface() -> None:
    added = Region("after", REGION.low, REGION.high)
    assert evidence_of(REGION, detection(depths_m=(1.6, 1.1))) == CLEAR_LOG_ODDS
    assert evidence_of(added, detection(depths_m=(1.1, 1.6))) == CLEAR_LOG_ODDS
    assert evidence_of(REGION, detection(depths_m=(1.1, 1.1))) == -MAX_LOG_ODDS
    # The map may err by as much as the step is.
    assert evidence_of(REGION, detection(depths_m=(1.125, 1.1))) != CLEAR_LOG_ODDS
    low = np.array([0.0, 0.0, 1.09])
    two_px = Region("before", low, low + np.array([0.05, 0.02, 0.02]))
    assert evidence_of(two_px, detection(depths_m=(1.6, 1.1))) == "it shows too little of it"


def test_a_view_that_shows_too_little_does_not_speak_against_a_change() -> None:
    too_little = "it shows too little of it"
    added = Region("after", REGION.low, REGION.high)
    # The map shows nothing in the region; the frame shows what is before it.
    assert evidence_of(REGION, detection(depths_m=(1.5, 1.5))) == too_little
    assert evidence_of(added, detection(depths_m=(0.95, 1.5))) == too_little
    # The frame shows what is behind the region: nothing came.
    assert evidence_of(added, detection(depths_m=(1.5, 1.5))) == -MAX_LOG_ODDS


def test_a_relocation_of_which_views_show_one_end_is_that_end() -> None:
    off = np.array([3.0, 0.0, 0.0])  # No view shows it.
    unseen = (REGION.low + off, REGION.high + off)
    came = Region("after", REGION.low, REGION.high)
    move = Change("relocation", 0.9, came.center, (unseen, (came.low, came.high)))
    new = view_of(detection(surface(0.9, side=core.Side.AFTER)))
    confirmed = confirm(move, [Region("before", *unseen), came], [new, new], [])
    assert isinstance(confirmed, Change)
    assert confirmed.kind == "addition"
    assert np.array_equal(confirmed.point, came.center)


def test_a_relocation_to_a_place_that_no_view_shows_is_rejected() -> None:
    off = np.array([3.0, 0.0, 0.0])
    unseen = Region("after", REGION.low + off, REGION.high + off)
    boxes = ((REGION.low, REGION.high), (unseen.low, unseen.high))
    move = Change("relocation", 0.9, unseen.center, boxes)
    gone = view_of(detection(surface(0.9)))
    assert confirm(move, [REGION, unseen], [gone, gone], ["no position is reachable"]) == (
        "0 view(s) show the change, 2 are needed: no position is reachable"
    )


def shift_at(x: float, confidence: float = 0.9) -> Change:
    """A shift of a part of an object by 6 cm."""
    motion = np.eye(4)
    motion[0, 3] = 0.06
    low = np.array([x - 0.1, -0.1, 1.0])
    before, after = ((corner, corner + 0.2) for corner in (low, low + motion[:3, 3]))
    return Change("shift", confidence, low + 0.1, boxes=(before, after), motion=motion)


def test_a_shift_needs_several_views_not_several_reports() -> None:
    seat, back = shift_at(0.0), shift_at(0.2)
    region = Region("before", seat.boxes[0][0], seat.boxes[0][1])
    without = view_of(detection())
    both = view_of(replace(detection(), changes=(seat, back)))
    part = view_of(replace(detection(), changes=(back,)))
    reason = "only 1 of 3 views show the same shift there"
    assert confirm(seat, [region], [both, without, without], []) == reason
    confirmed = confirm(seat, [region], [both, without, part], [])
    assert isinstance(confirmed, Change)
    assert confirmed.boxes[0] is not None
    np.testing.assert_allclose(confirmed.boxes[0][1], back.boxes[0][1], err_msg="boxes of all")
