"""The sheet that fits image points of known places in it best, the camera held.

The sheet has a pose as a board has: ``X = R (x, y, 0) + t`` for a place (x, y). The closed form
follows two numbers of the homography that no pose has, and is several times as uncertain as what
the pictures hold; it is where least squares in the picture starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.board_closed_form import other_pose, pose_from_homography
from sheetoflight.calibration.self_generated import (
    OUT_OF_SQUARE,
    askew,
    out_of_square,
    sheet_homography,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import Block, solve
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.rotations import cross_matrix, rotation
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance

_CHANCE = 1e-4
"""Odds up to which noise is not what puts the places out of square."""

_SAME = 1e-3
"""Greatest difference of two rotations that are the same minimum."""

_ROUNDING_PX = 1e-6


@dataclass(frozen=True, eq=False)
class Placed:
    """Image points whose places in the sheet are known, and the camera that saw them.

    Parameters
    ----------
    uv : (P, 2) array
        px.
    place : (P, 2) array
        mm, in the sheet.
    std : (P,) array
        Standard uncertainties of the image coordinates, in proportion.
    view : (P,) int array
        Number of the view of each.
    camera : Camera
    covariance : Covariance or None
        Of the camera's parameters, among others; None where it is exact.
    """

    uv: Array
    place: Array
    std: Array
    view: np.ndarray
    camera: Camera
    covariance: Covariance | None = None

    @cached_property
    def xy(self) -> Array:
        """``(P, 2)`` ideal normalised image points."""
        return self.camera.unproject(self.uv)[:, :2]

    @property
    def flat(self) -> Array:
        """``(P, 3)`` places with z = 0, mm."""
        return np.pad(self.place, ((0, 0), (0, 1)))

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The camera's parameters that are uncertain."""
        known = self.covariance.parameters if self.covariance is not None else ()
        return tuple(f"camera.{p}" for p in Camera.PARAMETERS if f"camera.{p}" in known)

    @property
    def camera_matrix(self) -> Array:
        """Their covariance ``(Q, Q)``."""
        if self.covariance is None:
            return np.zeros((0, 0))
        return self.covariance.block(self.camera_names)

    def take(self, points: np.ndarray) -> Placed:
        """The points that an index array or mask selects."""
        return replace(
            self,
            uv=self.uv[points],
            place=self.place[points],
            std=self.std[points],
            view=self.view[points],
        )


@dataclass(frozen=True, eq=False)
class SheetPose:
    """Where the sheet is: ``X = R (x, y, 0) + t``, mm, camera frame."""

    R: Array
    t: Array


class _PoseProblem:
    """The least-squares problem of the sheet's pose, for `estimation.block_least_squares.solve`."""

    shared_size = 6

    def __init__(self, seen: Placed) -> None:
        self.seen = seen

    def blocks(self, state: SheetPose) -> list[Block]:
        """Residuals over their std, and derivatives by a turn about the places' origin (rad) and
        a shift (mm)."""
        seen, turned = self.seen, self.seen.flat @ state.R.T
        uv, by_point, _ = seen.camera.project_with_jacobians(turned + state.t, [])
        by_pose = np.concatenate([-by_point @ cross_matrix(turned), by_point], axis=2)
        scale = np.repeat(1.0 / seen.std, 2)
        residuals = (uv - seen.uv).ravel() * scale
        weighted = by_pose.reshape(-1, 6) * scale[:, None]
        nothing = np.zeros((1, len(scale), 0))
        return [Block(residuals[None], weighted[None], np.arange(6), nothing)]

    def moved(self, state: SheetPose, shared: Array, local: Sequence[Array]) -> SheetPose:
        """The pose after a step."""
        del local
        return SheetPose(rotation(shared[:3]) @ state.R, state.t + shared[3:])


@dataclass(frozen=True, eq=False)
class SheetFit:
    """The minimum, and how it moves with what it was found from.

    Parameters
    ----------
    seen : Placed
    pose : SheetPose
    rival : float
        By how much the sum of squares, px², is greater at the other minimum; infinite where there
        is none.
    """

    seen: Placed
    pose: SheetPose
    rival: float = np.inf

    @property
    def points(self) -> Array:
        """``(P, 3)`` the places in space, mm, camera frame."""
        return self.seen.flat @ self.pose.R.T + self.pose.t

    @cached_property
    def residuals(self) -> Array:
        """``(P, 2)`` observed image points less predicted ones, px."""
        return self.seen.uv - self.seen.camera.project(self.points)

    @cached_property
    def normal(self) -> Array:
        """``(3,)`` unit normal of the sheet, away from the camera."""
        normal = self.pose.R[:, 2]
        return -normal if normal @ self.pose.t < 0 else normal

    @property
    def distance(self) -> float:
        """Distance of the sheet, mm."""
        return float(self.normal @ self.pose.t)

    @cached_property
    def by_pose(self) -> Array:
        """``(2P, 6)`` derivatives of the predicted points over their std."""
        (block,) = _PoseProblem(self.seen).blocks(self.pose)
        return block.by_shared[0]

    @cached_property
    def pose_covariance(self) -> Array:
        """``(6, 6)`` covariance of the pose for image noise 1 px, the camera being exact."""
        half = np.linalg.pinv(self.by_pose)
        return half @ half.T

    @cached_property
    def by_camera(self) -> Array:
        """``(2P, Q)`` derivatives of the predicted points, over their std, by the camera."""
        seen = self.seen
        columns = [Camera.PARAMETERS.index(n.removeprefix("camera.")) for n in seen.camera_names]
        _, _, by_parameter = seen.camera.project_with_jacobians(self.points, columns)
        return by_parameter.reshape(2 * len(seen.uv), -1) / np.repeat(seen.std, 2)[:, None]

    @cached_property
    def pose_by_camera(self) -> Array:
        """``(6, Q)`` how the pose follows the camera that is held."""
        return -np.linalg.pinv(self.by_pose) @ self.by_camera

    @cached_property
    def camera_left(self) -> Array:
        """``(2P, Q)`` what the pose leaves of the derivatives by the camera."""
        return self.by_camera + self.by_pose @ self.pose_by_camera

    @cached_property
    def plane_by_pose(self) -> Array:
        """``(4, 6)`` derivatives of normal and distance."""
        by_turn = -cross_matrix(self.normal)
        by_pose = np.zeros((4, 6))
        by_pose[:3, :3] = by_turn
        by_pose[3] = [*(self.pose.t @ by_turn), *self.normal]
        return by_pose


def fitted_sheet(seen: Placed) -> SheetFit:
    """The pose of the sheet that fits best: from the closed form, or from its mirror image, where
    the error may have a second minimum (`board_closed_form.other_pose`).

    Raises
    ------
    UntrustworthyError
        If the points do not span the sheet, no sheet before the camera fits, or a map that is no
        pose fits far better, and is out of square.
    """
    H = sheet_homography(seen.place, seen.xy)
    first = pose_from_homography(np.eye(3), H[None])
    starts = [first, other_pose(seen.xy[None], seen.flat, *first)]
    problem = _PoseProblem(seen)
    found = [solve(problem, SheetPose(R[0], t[0])) for R, t in starts]
    found = [solution for solution in found if solution.converged and np.isfinite(solution.cost)]
    if not found:
        raise UntrustworthyError(
            "plane",
            "no sheet before the camera fits the points",
            "check the points, their places, and that this is the right camera",
        )
    best = min(found, key=lambda solution: solution.cost)
    others = [s for s in found if np.abs(s.state.R - best.state.R).max() > _SAME]
    rival = min((2.0 * (s.cost - best.cost) for s in others), default=np.inf)
    if out_of_square(H) > OUT_OF_SQUARE and _odds_of_pose(seen, H, 2.0 * best.cost) < _CHANCE:
        raise askew(H)
    return SheetFit(seen, best.state, rival)


def _odds_of_pose(seen: Placed, H: Array, square: float) -> float:
    """Odds of so much better a fit by a homography's eight numbers than by a pose's six:
    ``F = [(q − q_H) / 2] / [q_H / (2P − 8)]``."""
    freedom = 2 * len(seen.uv) - 8
    if freedom < 1:
        return 1.0
    image = np.column_stack([seen.place, np.ones(len(seen.place))]) @ H.T
    off = (seen.camera.pixels_of(image[:, :2] / image[:, 2:]) - seen.uv) / seen.std[:, None]
    own = max(float(np.sum(off**2)), _ROUNDING_PX**2)
    return float(fdtrc(2.0, freedom, max(square - own, 0.0) / 2.0 / (own / freedom)))
