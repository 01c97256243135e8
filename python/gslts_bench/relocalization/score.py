"""Errors of relocalization against the true pose, and times."""

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
"""Distance of the start of tracking from the true pose."""
NEAR, FAR = (0.02, 1.0), (0.05, 5.0)
"""Maximum errors, m and degrees, of poses that count as near, and as right."""


class PoseError(BaseModel):
    """Distance of a pose from the true one in translation and rotation."""

    model_config = STRICT

    m: FiniteFloat
    deg: FiniteFloat

    @classmethod
    def of(cls, pose: Floats, true: Floats) -> PoseError:
        """Compare two poses world_from_camera [4,4].

        Args:
            pose: Answered world_from_camera [4,4].
            true: True world_from_camera [4,4].
        """
        metres, turn_rad = pose_distance(pose, true)
        return cls(m=metres, deg=float(np.rad2deg(turn_rad)))

    def within(self, m: float, deg: float) -> bool:
        """Return whether the error is at most so large.

        Args:
            m: Maximum translation, m.
            deg: Maximum rotation, degrees.
        """
        return self.m <= m and self.deg <= deg


class Answer(BaseModel):
    """Answer about one frame; see `gslts.localization.relocalizer.Localization`.

    Attributes:
        status, reason, inliers: As answered.
        fit: Shares known, alike, measured and near; None without a pose to compare.
        coarse: Error of the pose before refinement; None without one, or without a true pose.
        off: Error of the answer; None if lost, or without a true pose.
        normalized: Squared error in units of the returned covariance, over its 6 dimensions: 1 on
            average if that is right.
        s: Wall time.
        cpu_s: Time of all threads of the process; less than `s` where others took the core.
    """

    model_config = STRICT

    status: Status
    reason: str = ""
    inliers: int = 0
    fit: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] | None = None
    coarse: PoseError | None = None
    off: PoseError | None = None
    normalized: FiniteFloat | None = None
    s: FiniteFloat = 0.0
    cpu_s: FiniteFloat = 0.0


@dataclass(frozen=True, eq=False)
class TimedAnswer:
    """A localization with its wall time and the time of all threads."""

    found: Localization
    s: float
    cpu_s: float

    @classmethod
    def of(cls, ask: Callable[[], Localization]) -> TimedAnswer:
        """Ask and measure the time.

        Args:
            ask: Localizes a frame.
        """
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        found = ask()
        return cls(found, time.perf_counter() - start_s, time.process_time() - start_cpu_s)

    def judge(self, true: Floats | None) -> Answer:
        """Judge by the true pose [4,4]; None if the frame is not in this map.

        Args:
            true: True world_from_camera [4,4]; None if unknown.
        """
        found, fit, normalized = self.found, self.found.fit, None
        if true is not None and found.world_from_camera is not None:
            assert found.covariance is not None  # It comes with the pose.
            normalized = normalized_error(found.world_from_camera, found.covariance, true)
        return Answer(
            status=found.status,
            reason=found.reason,
            inliers=found.inliers,
            fit=None if fit is None else (fit.known, fit.alike, fit.measured, fit.near),
            coarse=_error_of(found.coarse, true),
            off=_error_of(found.world_from_camera, true),
            normalized=normalized,
            s=self.s,
            cpu_s=self.cpu_s,
        )


def normalized_error(pose: Floats, covariance: Floats, true: Floats) -> float:
    """Compute the squared error of a pose in units of its covariance; see `Answer.normalized`.

    Args:
        pose: Answered world_from_camera [4,4].
        covariance: [6,6] covariance of the twist.
        true: True world_from_camera [4,4].

    Source: Bar-Shalom et al. 2001, Estimation with Applications to Tracking and Navigation, 5.4.
    """
    twist = twist_of(np.linalg.inv(pose) @ true)
    return float(twist @ np.linalg.solve(covariance, twist)) / len(twist)


def start_near(true: Floats, rng: np.random.Generator) -> Floats:
    """Draw a pose [4,4] at `MOVED_M` and `MOVED_DEG` from the true one.

    Args:
        true: True world_from_camera [4,4].
        rng: Source of all randomness.
    """
    along, about = rng.normal(size=(2, 3))
    motion = np.eye(4)
    motion[:3, :3] = rotation(np.deg2rad(MOVED_DEG) * about / np.linalg.norm(about))
    motion[:3, 3] = MOVED_M * along / np.linalg.norm(along)
    pose: Floats = true @ motion
    return pose


def scores(answers: Sequence[Answer]) -> dict[str, Any]:
    """Compute the numbers of some answers.

    An answer is wrong if it is `ok` and not within `FAR`. Covariances are judged by right answers.

    Args:
        answers: Answers about frames.

    Returns:
        JSON values.
    """
    ok = [answer for answer in answers if answer.status == "ok" and answer.off is not None]
    right = [answer.off is not None and answer.off.within(*FAR) for answer in ok]
    errors = [
        answer.normalized
        for answer, good in zip(ok, right, strict=True)
        if good and answer.normalized is not None
    ]
    return {
        "frames": len(answers),
        "ok": sum(answer.status == "ok" for answer in answers),
        "ambiguous": sum(answer.status == "ambiguous" for answer in answers),
        "lost": sum(answer.status == "lost" for answer in answers),
        **_error_scores([answer.off for answer in answers]),
        "coarse": _error_scores([answer.coarse for answer in answers]),
        "wrong_ok": right.count(False),
        "normalized": _finite(np.mean, errors),
        "s": _finite(np.median, [answer.s for answer in answers]),
        "cpu_s": _finite(np.median, [answer.cpu_s for answer in answers]),
    }


def _error_scores(offs: Sequence[PoseError | None]) -> dict[str, Any]:
    """Count near poses and take medians of all; a missing pose counts as infinitely far."""
    return {
        "near": sum(error is not None and error.within(*NEAR) for error in offs),
        "far": sum(error is not None and error.within(*FAR) for error in offs),
        "mm": _finite(np.median, [np.inf if error is None else 1000 * error.m for error in offs]),
        "deg": _finite(np.median, [np.inf if error is None else error.deg for error in offs]),
    }


def _error_of(pose: Floats | None, true: Floats | None) -> PoseError | None:
    return None if pose is None or true is None else PoseError.of(pose, true)


def _finite(of: Callable[[Sequence[float]], Any], values: Sequence[float]) -> float | None:
    """Apply a function to values; None if the result is not finite."""
    found = float(of(values)) if values else np.inf
    return found if np.isfinite(found) else None
