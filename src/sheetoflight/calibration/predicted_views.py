"""What views would tell that have not been taken: their share of the information.

A view's share on the shared parameters follows from its predicted image and the noise alone; its
pose is unknown and eliminated like any other's. Shares of independent views add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.placements import placed
from sheetoflight.calibration.rig_state import CAMERA, SHEET_PARTS, RigState
from sheetoflight.geometry.directions import Array
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig


@dataclass(frozen=True)
class PredictedViews:
    """N views of one stage that could be taken, all their points in the picture.

    Parameters
    ----------
    stage : {"camera", "plane", "crossing"}
    laser : int
        In whose sheet the targets lie, or whose sheet crosses them.
    poses : (N, k) array
        As in `RigState.poses`.
    points : (N, M, 3) array
        The markers, in stage crossing the spot behind them; mm, camera frame.
    uv : (N, M, 2) array
        Where they are seen, px.
    information : (N, P, P) array
        What each view adds on the shared parameters, ``Xᵀ V⁻¹ X``.
    placement : (N, P, P) array
        What the targets' placement off the sheet does to the gradient, ``Xᵀ V⁻¹ V_k V⁻¹ X``;
        the rest of `information` is the image points' noise.
    by_marker : (N, P, markers) array
        What 1 mm of each marker along the target does to the gradient, ``Xᵀ V⁻¹ Z``.
    """

    stage: str
    laser: int
    poses: Array
    points: Array
    uv: Array
    information: Array
    placement: Array
    by_marker: Array

    def __len__(self) -> int:
        return len(self.poses)

    def take(self, views: np.ndarray) -> PredictedViews:
        """The views that an index array or mask selects."""
        return PredictedViews(
            self.stage,
            self.laser,
            self.poses[views],
            self.points[views],
            self.uv[views],
            self.information[views],
            self.placement[views],
            self.by_marker[views],
        )


def predicted_views(
    rig: Rig,
    state: RigState,
    noise: NoiseModel,
    parameters: tuple[str, ...],
    stage: str,
    poses: Array,
    laser: int = 0,
) -> PredictedViews:
    """Those of the poses whose points are all in the picture, and what each would tell.

    Parameters
    ----------
    rig : Rig
    state : RigState
    noise : NoiseModel
    parameters : tuple of str
        The P shared parameters.
    stage : {"camera", "plane", "crossing"}
    poses : (N, k) array
        As in `RigState.poses`.
    laser : int
    """
    every = _everywhere(rig, stage, len(poses), laser)
    points = placed(state.with_poses(stage, poses), stage, rig.target.positions, every).points
    columns = _columns(rig, stage, laser)
    uv = state.camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = (uv >= 0) & (uv <= np.array(rig.image_size) - 1.0)
    good = np.asarray(inside[:, columns].all(axis=(1, 2)))
    shares = view_shares(rig, state, noise, parameters, stage, every.take(good), poses[good])
    return PredictedViews(
        stage, laser, poses[good], points[good][:, columns], uv[good][:, columns], *shares
    )


def view_shares(
    rig: Rig,
    state: RigState,
    noise: NoiseModel,
    parameters: tuple[str, ...],
    stage: str,
    views: TargetViews,
    poses: Array,
) -> tuple[Array, Array, Array]:
    """`information`, `placement` and `by_marker` of views, as in `PredictedViews`.

    Parameters
    ----------
    rig : Rig
    state : RigState
    noise : NoiseModel
    parameters : tuple of str
    stage : str
    views : TargetViews
        Which points are seen; where they are seen says nothing here.
    poses : (N, k) array
    """
    size, markers = len(parameters), len(rig.target.markers_mm)
    if not len(views):
        nothing = np.zeros((0, size, size))
        return nothing, nothing, np.zeros((0, size, markers))
    even = replace(noise, proportions={stage: np.ones(views.uv.shape[:2])})
    std = {stage: even.std(stage)}
    adjustment = Adjustment(rig.target.positions, {stage: views}, std, parameters)
    information, placement = _shares(adjustment, even, state.with_poses(stage, poses), stage)
    return (
        information[:, :size, :size],
        placement[:, :size, :size],
        information[:, :size, size:],
    )


def _everywhere(rig: Rig, stage: str, count: int, laser: int) -> TargetViews:
    """Views in which the markers, and the spot of a laser, count as seen."""
    markers, lasers = len(rig.target.markers_mm), len(rig.lasers)
    spots = lasers if stage == "crossing" else 0
    uv = np.full((count, markers + spots, 2), np.nan)
    uv[:, _columns(rig, stage, laser)] = 0.0
    names = tuple(str(index) for index in range(count))
    return TargetViews(names, uv, laser=np.full(count, laser))


def _columns(rig: Rig, stage: str, laser: int) -> list[int]:
    """Places of the points that a view shows."""
    markers = len(rig.target.markers_mm)
    return [*range(markers), *([markers + laser] if stage == "crossing" else [])]


def _shares(
    adjustment: Adjustment, noise: NoiseModel, state: RigState, stage: str
) -> tuple[Array, Array]:
    """Information ``(N, P + M, P + M)`` of each view on the parameters and the markers'
    positions, and the share in it of the noise other than the image points'."""
    moves = marker_shifts(adjustment, state, stage)
    (group,) = noise.contrasts(adjustment, state, {stage: moves})
    size = adjustment.shared_size + len(moves)
    slopes = np.zeros((*group.values.shape, size))
    slopes[..., group.columns] = group.by_shared
    weighted = np.linalg.solve(group.covariance(noise.variances), slopes)
    turned = np.swapaxes(weighted, 1, 2)
    placement = np.zeros((len(slopes), size, size))
    for component, part in group.variances:
        if component != PIXEL:
            placement += noise.variances[component] * turned @ part @ weighted
    return turned @ slopes, placement


def marker_shifts(adjustment: Adjustment, state: RigState, stage: str) -> list[Array]:
    """Moves of the points ``(N, M, 3)`` when one marker after the other shifts along the target."""
    place = adjustment.placed(state, stage)
    moves = []
    for marker in range(len(adjustment.positions)):
        move = np.zeros_like(place.points)
        move[:, marker] = place.along
        moves.append(move)
    return moves


def public_slopes(
    by_parameter: Array, state: RigState, laser: int, parameters: Sequence[str]
) -> Array:
    """Derivatives by the shared parameters from those by a calibration's parameters.

    Parameters
    ----------
    by_parameter : (F, 14) array
        By the camera's ten parameters and nx, ny, nz, d of one sheet.
    state : RigState
    laser : int
        Whose sheet it is.
    parameters : sequence of str
        The P shared parameters.

    Returns
    -------
    (F, P) array
    """
    sign = state.signs[laser]
    tilts = sign * by_parameter[:, 10:13] @ state.frames[laser][:, :2]
    own = np.column_stack([by_parameter[:, :10], tilts, sign * by_parameter[:, 13]])
    names = [*CAMERA, *(f"sheet{laser}.{part}" for part in SHEET_PARTS)]
    slopes = np.zeros((len(own), len(parameters)))
    for column, name in enumerate(parameters):
        if name in names:
            slopes[:, column] = own[:, names.index(name)]
    return slopes


def joined(views: Sequence[PredictedViews]) -> PredictedViews:
    """Views of one stage and laser as one."""
    parts = ("poses", "points", "uv", "information", "placement", "by_marker")
    return PredictedViews(
        views[0].stage,
        views[0].laser,
        *(np.concatenate([getattr(one, part) for one in views]) for part in parts),
    )
