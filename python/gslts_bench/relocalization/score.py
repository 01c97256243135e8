"""How right a relocalization is, and how long it took."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat

from gslts.core.se3 import pose_distance, rotation, twist_of
from gslts.localization.relocalizer import Localization, Status
from gslts.types import Floats
from gslts_sim.strict_model import STRICT

MOVED_M, MOVED_DEG = 0.05, 2.0
"""How far from the truth tracking starts."""
NEAR, FAR = (0.02, 1.0), (0.05, 5.0)
"""Distances, m, and angles, degrees, within which poses are counted."""


class Off(BaseModel):
    """How far a pose is from the true one."""

    model_config = STRICT

    m: FiniteFloat
    deg: FiniteFloat

    @classmethod
    def of(cls, pose: Floats, true: Floats) -> Off:
        """Both [4,4] world_from_camera."""
        metres, turn_rad = pose_distance(pose, true)
        return cls(m=metres, deg=float(np.rad2deg(turn_rad)))

    def within(self, m: float, deg: float) -> bool:
        """Whether it is at most so far off."""
        return self.m <= m and self.deg <= deg


class Answer(BaseModel):
    """What became of one question; see `gslts.localization.relocalizer.Localization`.

    Attributes:
        status, reason, inliers: As told.
        fit: Shares known, alike, measured and near; None if there was nothing to look at.
        coarse: How far off the pose is that was refined; None if there is none, or no true one.
        off: How far the one is that was told; None if lost, or if there is no true one.
        normalized: Squared error in units of the covariance that was told, over its 6 dimensions:
            1 on average if that is right.
        s: Wall time.
        cpu_s: Of all threads of the process meanwhile; less than `s` where others took the core.
    """

    model_config = STRICT

    status: Status
    reason: str = ""
    inliers: int = 0
    fit: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] | None = None
    coarse: Off | None = None
    off: Off | None = None
    normalized: FiniteFloat | None = None
    s: FiniteFloat = 0.0
    cpu_s: FiniteFloat = 0.0


@dataclass(frozen=True, eq=False)
class Told:
    """What was said, and the wall time and the time of all threads that it took."""

    found: Localization
    s: float
    cpu_s: float

    @classmethod
    def by(cls, ask: Callable[[], Localization]) -> Told:
        """Asks."""
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        found = ask()
        return cls(found, time.perf_counter() - start_s, time.process_time() - start_cpu_s)

    def answer(self, true: Floats | None) -> Answer:
        """As judged by the true pose [4,4]; None if that is not in this map."""
        found, fit, normalized = self.found, self.found.fit, None
        if true is not None and found.world_from_camera is not None:
            assert found.covariance is not None  # It comes with the pose.
            normalized = normalized_error(found.world_from_camera, found.covariance, true)
        return Answer(
            status=found.status,
            reason=found.reason,
            inliers=found.inliers,
            fit=None if fit is None else (fit.known, fit.alike, fit.measured, fit.near),
            coarse=_off(found.coarse, true),
            off=_off(found.world_from_camera, true),
            normalized=normalized,
            s=self.s,
            cpu_s=self.cpu_s,
        )


def normalized_error(pose: Floats, covariance: Floats, true: Floats) -> float:
    """`Answer.normalized` of a pose [4,4] with the covariance [6,6] of its twist.

    Source: Bar-Shalom et al. 2001, Estimation with Applications to Tracking and Navigation, 5.4.
    """
    twist = twist_of(np.linalg.inv(pose) @ true)
    return float(twist @ np.linalg.solve(covariance, twist)) / len(twist)


def start_near(true: Floats, rng: np.random.Generator) -> Floats:
    """[4,4] a pose `MOVED_M` and `MOVED_DEG` from the true one, in random directions."""
    along, about = rng.normal(size=(2, 3))
    motion = np.eye(4)
    motion[:3, :3] = rotation(np.deg2rad(MOVED_DEG) * about / np.linalg.norm(about))
    motion[:3, 3] = MOVED_M * along / np.linalg.norm(along)
    pose: Floats = true @ motion
    return pose


def scores(answers: Sequence[Answer]) -> dict[str, Any]:
    """What became of all frames, in values of JSON.

    Wrong is what is told to be `ok` and not within `FAR`; what is within tells whether covariances
    are right.
    """
    ok = [one for one in answers if one.status == "ok" and one.off is not None]
    right = [one.off is not None and one.off.within(*FAR) for one in ok]
    errors = [
        one.normalized
        for one, good in zip(ok, right, strict=True)
        if good and one.normalized is not None
    ]
    return {
        "frames": len(answers),
        "ok": sum(one.status == "ok" for one in answers),
        "ambiguous": sum(one.status == "ambiguous" for one in answers),
        "lost": sum(one.status == "lost" for one in answers),
        **_scores_of_offs([one.off for one in answers]),
        "coarse": _scores_of_offs([one.coarse for one in answers]),
        "wrong_ok": right.count(False),
        "normalized": _finite(np.mean, errors),
        "s": _finite(np.median, [one.s for one in answers]),
        "cpu_s": _finite(np.median, [one.cpu_s for one in answers]),
    }


def _scores_of_offs(offs: Sequence[Off | None]) -> dict[str, Any]:
    """How many poses are near, and the medians of all; where there is none, it is nowhere near."""
    return {
        "near": sum(one is not None and one.within(*NEAR) for one in offs),
        "far": sum(one is not None and one.within(*FAR) for one in offs),
        "mm": _finite(np.median, [np.inf if one is None else 1000 * one.m for one in offs]),
        "deg": _finite(np.median, [np.inf if one is None else one.deg for one in offs]),
    }


def _off(pose: Floats | None, true: Floats | None) -> Off | None:
    return None if pose is None or true is None else Off.of(pose, true)


def _finite(of: Callable[[Sequence[float]], Any], values: Sequence[float]) -> float | None:
    """What a function says of values; None if that is no finite number."""
    found = float(of(values)) if values else np.inf
    return found if np.isfinite(found) else None
