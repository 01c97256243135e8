"""Methods of updating a map that are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.store.causes import UpdateRecord
from gslts.update.config import GS_LTS, EditConfig, RefineConfig, UpdateConfig
from gslts.update.edit import Edit, pre_edit
from gslts.update.integrate import integrate_views
from gslts.update.refine import OnStep, Refinement, refine
from gslts.update.targets import view_targets
from gslts.update.verify import split_views
from gslts.update.view_collection import Collection

PLAIN = RefineConfig(
    scope="map",
    new_visits=1,
    patience=1_000_000,
    depth_weight=0.0,
    means_rate=5e-4,
    quats_rate=1e-3,
    log_scales_rate=5e-3,
    logit_opacities_rate=5e-2,
    sh_rate=2.5e-3,
    final_rate_share=1.0,
)
"""Fine-tuning of the whole map with the loss and the rates of 3DGS (Kerbl et al. 2023), whose rate
of the means, 1.6e-4 times the extent of the cameras, is taken for an extent of 3 m."""


@dataclass(frozen=True)
class Method:
    """Method of updating a map.

    Attributes:
        edit: Settings of the edit; None leaves the Gaussians as they are.
        refine: Settings of the refinement; None leaves the map as it is.
        whole: Whether it is all of `gslts.update.integrate`, with old views and verification.
    """

    edit: EditConfig | None
    refine: RefineConfig | None
    whole: bool = False


OURS = UpdateConfig()
"""Settings of our method."""


def _without(**settings: object) -> Method:
    return Method(OURS.edit.model_copy(update=settings), OURS.refine, whole=True)


METHODS: dict[str, Method] = {
    "no update": Method(None, None),
    "plain fine-tuning": Method(None, PLAIN),
    "gs_lts editing": Method(GS_LTS, PLAIN),
    "ours": Method(OURS.edit, OURS.refine, whole=True),
}
"""Methods of the table: the second is the baseline of GS-LTS, the third its editing as printed."""
ABLATION: dict[str, Method] = {
    "plain, our rates": Method(
        None, OURS.refine.model_copy(update={"scope": "map", "patience": 1_000_000})
    ),
    "all hidden vote": _without(visible_votes=False),
    "nothing carved": _without(carve=False),
    "nothing swept": _without(sweep=False),
    "all measured is added": _without(only_missing=False),
    "shapes inherited": _without(flat=False),
    "colours inherited": _without(observed_colors=False),
    "no old views": Method(
        OURS.edit, OURS.refine.model_copy(update={"replay_views": 0}), whole=True
    ),
    "no refinement": Method(
        OURS.edit, OURS.refine.model_copy(update={"iterations": 0}), whole=True
    ),
    "gs_lts editing, then ours": Method(GS_LTS, OURS.refine, whole=True),
}
"""Methods that differ from `ours` in one setting."""


def update_with(
    method: Method,
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    found: Collection,
    *,
    iterations: int | None = None,
    threads: int = 1,
    on_step: OnStep = lambda *_: None,
) -> tuple[GaussianMap, UpdateRecord | None]:
    """Update a map with a method.

    Args:
        method: The method.
        gaussian_map: Map before the change.
        cameras: Cameras of the frames that it was made from.
        found: Frames of the change; all methods use the same.
        iterations: Number of iterations instead of the method's.
        threads: 0 means one per hardware thread.
        on_step: Called after each step of the refinement.

    Returns:
        The updated map, and the record of a method that writes one.
    """
    steps = {} if iterations is None else {"iterations": iterations}
    if method.whole:
        assert method.edit is not None
        assert method.refine is not None
        config = UpdateConfig(
            edit=method.edit, refine=method.refine.model_copy(update=steps), threads=threads
        )
        detector = None
        if iterations is None:  # Verification would hide what a number of iterations does.
            detector = ChangeDetector(
                gaussian_map, DetectionConfig(threads=threads), cameras=cameras
            )
        updated, _, record = integrate_views(
            gaussian_map, cameras, found, config, detector=detector, on_step=on_step
        )
        return updated, record
    every = OURS.collect.validation_every
    used, _ = split_views(found.views, found.regions_by_change, every)
    edit = Edit(gaussian_map, np.zeros(gaussian_map.size, np.bool_), 0)
    if method.edit is not None:
        edit = pre_edit(gaussian_map, used, found.regions_by_change, method.edit, threads=threads)
    refined = Refinement(edit.gaussian_map, 0, ())
    if method.refine is not None:
        config_of = method.refine.model_copy(update=steps)
        refined = refine(
            edit.gaussian_map,
            view_targets(used, found.regions, config_of),
            np.ones(edit.gaussian_map.size, np.bool_),
            config_of,
            threads=threads,
            on_step=on_step,
        )
    return refined.gaussian_map, None
