"""The camera stage by itself: camera and fixed point from the pivoting target (paper 3.1)."""

from __future__ import annotations

from dataclasses import replace

from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.estimation_task import EstimationTask
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.identifiability import determined
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import ANCHOR, RigState
from sheetoflight.calibration.search import best_fit
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig


def camera_alone(
    rig: Rig, noise: NoiseModel, start: RigState | None = None
) -> tuple[Fit, tuple[str, ...]]:
    """Camera and fixed point from the pivoting target and the boards' points alone, and warnings.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    start : RigState, optional
        Camera and poses of the boards, where there are boards.

    Raises
    ------
    UntrustworthyError
        If the views do not determine them.
    """
    views, boards = rig.observations.camera, rig.observations.board
    if not len(boards):
        _refuse_few_camera_views(views, 6 if rig.skew else 5)
    points = replace(boards, line=LinePixels())
    alone = replace(rig, observations=Observations(camera=views, board=points))
    stages = alone.observations.stages()
    blamed, others = ("camera", ANCHOR) if stages else ("board", ())
    task = EstimationTask(alone, noise, stages, others, blamed, start)
    fit = best_fit(task, lambda _, __, state: state)
    return determined(fit, blamed)


def with_known_pixel_noise(camera: Fit) -> NoiseModel:
    """The noise for a second step: the camera stage tells the pixel noise, because the in-plane
    residuals hold the camera's error too."""
    free = camera.noise.free.copy()
    free[PIXEL] = False
    return replace(camera.noise, free=free)


def _refuse_few_camera_views(views: TargetViews, needed: int) -> None:
    """Views count that show two markers beside the fixed one; marker 0 must be seen somewhere."""
    full = int((views.seen[:, 1:].sum(axis=1) >= 2).sum())
    if full < needed:
        raise UntrustworthyError(
            "camera",
            f"{full} {'view' if full == 1 else 'views'} of the pivoting target, "
            f"at least {needed} are needed",
            "take more pictures with the target swung about marker 0 into other directions, "
            "30 give a good result",
        )
    if not views.seen[:, 0].any():
        raise UntrustworthyError(
            "camera",
            "marker 0, about which the target pivots, is seen in no view",
            "take pictures in which nothing hides it",
        )
