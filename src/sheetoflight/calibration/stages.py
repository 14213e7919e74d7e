"""The steps that the methods share: the camera alone, a first sheet, the sheet alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.adjustment import (
    ANCHOR,
    PLANE,
    Adjustment,
    RigState,
    intrinsic_names,
    marker_points,
)
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.pivot_closed_form import PivotStart, pivot_starts
from sheetoflight.calibration.pose_reselection import reselected_directions
from sheetoflight.calibration.target_triangulation import triangulated_targets
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import (
    Solution,
    reduced_information,
    scaled_inverse,
    solve,
)
from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_RESELECTIONS = 5
_NO_CONVERGENCE = "look for wrong detections, or take more views in more varied directions"


@dataclass(frozen=True)
class Adjusted:
    """A minimum, and the adjustment it belongs to."""

    adjustment: Adjustment
    solution: Solution[RigState]

    @property
    def state(self) -> RigState:
        """The estimates."""
        return self.solution.state

    @property
    def chi2(self) -> float:
        """Sum of squared residuals in units of their stated variances."""
        return 2.0 * self.solution.cost

    def covariance(self, stage: str) -> Array:
        """Covariance of the shared parameters for the stated variances.

        Raises
        ------
        UntrustworthyError
            If the views leave a combination of parameters undetermined.
        """
        try:
            return scaled_inverse(self.solution.information)[0]
        except np.linalg.LinAlgError as reason:
            raise UntrustworthyError(
                stage,
                f"the views do not determine the parameters: {reason}",
                "take further views with the target turned into other directions",
            ) from reason


def camera_stage(rig: Rig, noise: NoiseModel) -> Adjusted:
    """Camera and fixed point from the pivoting target alone (paper 3.1), a result by itself.

    Raises
    ------
    UntrustworthyError
        As for `camera_start`, or if the refinement does not converge.
    """
    return _converged(camera_start(rig, noise), "camera")


def camera_start(rig: Rig, noise: NoiseModel) -> Adjusted:
    """What the camera stage alone finds; whether it converged is for the caller to judge.

    Raises
    ------
    UntrustworthyError
        If there are too few views, or no closed form starts.
    """
    views = rig.observations.camera
    _refuse_few_camera_views(views, 6 if rig.skew else 5)
    positions = rig.target.positions
    starts = pivot_starts(views.uv, positions, rig.image_size, rig.skew)
    states = [_best_poses(_state_of(start, rig), views, positions) for start in starts]
    if not states:
        raise UntrustworthyError(
            "camera",
            "no camera fits the views, as when all swings lie in one plane or on one cone",
            "swing the target about marker 0 to all sides: left, right, up, down, near and far",
        )
    stages = {"camera": views}
    pinhole = tuple(name for name in rig.free_intrinsics if name not in Camera.PARAMETERS[5:])
    first = Adjustment(positions, stages, noise.std, (*intrinsic_names(pinhole), *ANCHOR))
    state = min(states, key=lambda start: _cost(first, start))
    adjusted = _settled(first, state, views)
    if pinhole != rig.free_intrinsics:
        whole = Adjustment(
            positions, stages, noise.std, (*intrinsic_names(rig.free_intrinsics), *ANCHOR)
        )
        adjusted = _settled(whole, adjusted.state, views)
    return adjusted


def triangulated_views(rig: Rig, camera: Camera) -> tuple[Array, np.ndarray]:
    """A, P, B of the in-plane views that show three markers, by the paper's closed form.

    Of more than three markers the first and the last seen and the one nearest their middle.

    Returns
    -------
    points : (V, 3, 3) array
        mm, camera frame.
    used : (V,) int array
        Which views those are.
    """
    views = rig.observations.plane
    used = np.flatnonzero(views.seen.sum(axis=1) >= 3)
    chosen = np.array([_triple(views.seen[i], rig.target.positions) for i in used], dtype=int)
    if not len(used):
        return np.empty((0, 3, 3)), used
    uv = np.take_along_axis(views.uv[used], chosen[..., None], axis=1)
    places = rig.target.positions[chosen]
    l1, l2 = places[:, 1] - places[:, 0], places[:, 2] - places[:, 1]
    points = triangulated_targets(uv, l1, l2, camera)
    finite = np.isfinite(points).all(axis=(1, 2))
    return points[finite], used[finite]


def with_plane(state: RigState, rig: Rig, normal: Array, distance: float) -> RigState:
    """The state with a sheet of light, and the in-plane targets laid onto it.

    Raises
    ------
    UntrustworthyError
        If the sheet passes through the camera, or a target cannot lie in it.
    """
    if not distance > 0:
        raise UntrustworthyError(
            "plane", "the sheet of light passes through the camera's centre", "move the laser aside"
        )
    frame = np.stack([*tangent_basis(normal), normal], axis=1)
    views = rig.observations.plane
    return replace(
        state,
        frame=frame,
        distance=distance,
        poses={**state.poses, "plane": _lying_poses(state.camera, frame, distance, views, rig)},
    )


def plane_stage(state: RigState, rig: Rig, noise: NoiseModel) -> Adjusted:
    """Sheet of light by maximum likelihood, the camera held (two-step method)."""
    adjustment = Adjustment(
        rig.target.positions, {"plane": rig.observations.plane}, noise.std, PLANE
    )
    return _converged(Adjusted(adjustment, _solved(adjustment, state, "plane")), "plane")


def joint_stage(state: RigState, rig: Rig, noise: NoiseModel) -> Adjusted:
    """Everything in one adjustment."""
    stages = {"camera": rig.observations.camera, "plane": rig.observations.plane}
    free = (*intrinsic_names(rig.free_intrinsics), *ANCHOR, *PLANE)
    adjustment = Adjustment(rig.target.positions, stages, noise.std, free)
    return _converged(_settled(adjustment, state, rig.observations.camera), "joint")


def poses_only(state: RigState, rig: Rig, noise: NoiseModel) -> Adjusted:
    """The in-plane targets' poses, camera and sheet held: how well these fit the pictures."""
    adjustment = Adjustment(rig.target.positions, {"plane": rig.observations.plane}, noise.std, ())
    return Adjusted(adjustment, _solved(adjustment, state, "plane"))


def sheet_information(state: RigState, rig: Rig, noise: NoiseModel) -> Array:
    """What the in-plane views tell of camera and sheet: reduced normal equations of
    ``intrinsic_names`` and `PLANE`."""
    free = (*intrinsic_names(rig.free_intrinsics), *PLANE)
    stages: Mapping[str, TargetViews] = {"plane": rig.observations.plane}
    adjustment = Adjustment(rig.target.positions, stages, noise.std, free)
    return reduced_information(adjustment.blocks(state), adjustment.shared_size)


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


def _best_poses(state: RigState, views: TargetViews, positions: Array) -> RigState:
    directions, _ = reselected_directions(
        state.camera, state.anchor, state.poses["camera"], views, positions
    )
    return replace(state, poses={**state.poses, "camera": directions})


def _settled(adjustment: Adjustment, state: RigState, views: TargetViews) -> Adjusted:
    """Solve, test every pivoting view for its other pose, and solve again until none changes."""
    solution = _solved(adjustment, state, "camera")
    for _ in range(_RESELECTIONS):
        best = solution.state
        directions, changed = reselected_directions(
            best.camera, best.anchor, best.poses["camera"], views, adjustment.positions
        )
        if not changed.any():
            break
        poses = {**best.poses, "camera": directions}
        again = _solved(adjustment, replace(best, poses=poses), "camera")
        if again.cost >= solution.cost:
            break
        solution = again
    return Adjusted(adjustment, solution)


def _solved(adjustment: Adjustment, state: RigState, stage: str) -> Solution[RigState]:
    try:
        return solve(adjustment, state)
    except np.linalg.LinAlgError as reason:
        raise UntrustworthyError(
            stage,
            "a view does not determine its own pose",
            "remove views with fewer than two markers, or with markers that coincide",
        ) from reason


def _converged(adjusted: Adjusted, stage: str) -> Adjusted:
    if not adjusted.solution.converged or not np.isfinite(adjusted.solution.cost):
        raise UntrustworthyError(
            stage,
            f"no convergence after {adjusted.solution.iterations} iterations",
            _NO_CONVERGENCE,
        )
    return adjusted


def _cost(adjustment: Adjustment, state: RigState) -> float:
    cost = sum(block.cost for block in adjustment.blocks(state))
    return cost if np.isfinite(cost) else np.inf


def _state_of(start: PivotStart, rig: Rig) -> RigState:
    matrix = start.matrix.copy()
    if not rig.skew:
        matrix[0, 1] = 0.0
    return RigState(
        camera=Camera.from_matrix(rig.image_size, matrix),
        anchor=start.anchor,
        frame=np.eye(3),
        distance=0.0,
        poses={"camera": start.directions},
    )


def _triple(seen: np.ndarray, positions: Array) -> tuple[int, int, int]:
    markers = np.flatnonzero(seen)
    first, last = markers[0], markers[-1]
    middle = 0.5 * (positions[first] + positions[last])
    inner = markers[1:-1]
    return first, inner[np.abs(positions[inner] - middle).argmin()], last


def _lying_poses(
    camera: Camera, frame: Array, distance: float, views: TargetViews, rig: Rig
) -> Array:
    """x, y, ψ of the in-plane targets, from the rays of their first and last seen markers."""
    rays = camera.unproject(views.uv)
    depths = distance / (rays @ frame[:, 2])
    flat = (rays * depths[..., None]) @ frame[:, :2]
    poses = np.empty((len(views), 3))
    for index, name in enumerate(views.names):
        markers = np.flatnonzero(views.seen[index])
        if len(markers) < 2 or not (depths[index, markers] > 0).all():
            raise UntrustworthyError(
                "plane",
                f"view {name} cannot lie in the sheet of light that the other views give",
                "check this view's markers, or remove it",
            )
        first, last = flat[index, markers[0]], flat[index, markers[-1]]
        angle = np.arctan2(last[1] - first[1], last[0] - first[0])
        start = first - rig.target.positions[markers[0]] * np.array([np.cos(angle), np.sin(angle)])
        poses[index] = (*start, angle)
    return poses


def stage_points(state: RigState, adjustment: Adjustment) -> dict[str, Array]:
    """Estimated markers of every view, ``(N, M, 3)`` by stage, mm."""
    return {stage: marker_points(state, stage, adjustment.positions) for stage in adjustment.stages}
