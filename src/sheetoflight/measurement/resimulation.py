"""The rig simulated again from the result of its calibration.

A trial's truth is the calibration: its camera, its sheets of light, its estimate of where the
target was in every view. From it new image points follow, with everything that is uncertain drawn
anew: the noise of the image points, how far targets laid into a sheet lie off it, where the
markers really are on the target, how warm it really was, what the known camera really is. This
shares with `simulation`, which draws rigs of its own for the tests, nothing but `Camera.project`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.components import COMPONENTS
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.rig_state import CAMERA
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.board_resimulation import TrueBoards, true_boards, winding_px
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig


@dataclass(frozen=True, eq=False)
class TrueViews:
    """One stage as it was, were the calibration exact.

    Parameters
    ----------
    points : (N, M, 3) array
        Markers, and in stage crossing the spots, mm, camera frame.
    along : (N, 3) array
        Direction of the target in each view.
    off : (N, 3) array
        Normal of the sheet in which the target lies; zero in other stages.
    std : (N, M) array
        Standard deviation of each image coordinate, px.
    """

    points: Array
    along: Array
    off: Array
    std: Array


@dataclass(frozen=True, eq=False)
class Resimulation:
    """What is needed to simulate a rig again.

    Parameters
    ----------
    rig : Rig
        With the views and points that the calibration used.
    camera : Camera
        The calibrated one.
    truth : mapping from stage to TrueViews
    sizes : mapping from noise component to float
        ``pixel``, ``corner``, ``stripe`` and ``shape`` in px, ``placement``, ``marker`` and
        ``line`` in mm.
    boards : TrueBoards, optional
        Stage board, where there is any.
    """

    rig: Rig
    camera: Camera
    truth: Mapping[str, TrueViews]
    sizes: Mapping[str, float]
    boards: TrueBoards | None = None

    def drawn(self, rng: np.random.Generator) -> Rig:
        """The rig as it might have been observed as well."""
        shift = self._marker_shifts(rng)
        stages = self.rig.observations.stages()
        views = {stage: self._observed(stage, stages[stage], shift, rng) for stage in stages}
        seen = replace(self.rig.observations, **views)
        if self.boards is not None:
            seen = replace(seen, board=self.boards.drawn(self.camera, self.sizes, rng))
        return replace(self.rig, camera=self._known_camera(rng), observations=seen)

    def _known_camera(self, rng: np.random.Generator) -> Camera | None:
        """The camera as its own calibration might have given it as well, where it was known."""
        known, covariance = self.rig.camera, self.rig.camera_covariance
        if known is None or covariance is None:
            return known
        names = tuple(name for name in covariance.parameters if name in CAMERA)
        error = np.zeros(len(CAMERA))
        error[[CAMERA.index(name) for name in names]] = rng.multivariate_normal(
            np.zeros(len(names)), covariance.block(names), check_valid="ignore"
        )
        return known.with_parameters(known.parameters + error)

    def _marker_shifts(self, rng: np.random.Generator) -> Array:
        """How far ``(M,)`` the markers lie from where they are said to lie, mm."""
        target = self.rig.target
        own = target.tolerance_mm * rng.standard_normal(len(target.positions))
        return own + target.thermal_std * rng.standard_normal() * target.positions

    def _observed(
        self, stage: str, views: TargetViews, shift: Array, rng: np.random.Generator
    ) -> TargetViews:
        truth, markers = self.truth[stage], len(shift)
        points = truth.points.copy()
        points[:, :markers] += shift[:, None] * truth.along[:, None, :]
        if stage == "plane":
            points += self._offsets(len(points), rng)[..., None] * truth.off[:, None, :]
        noise = truth.std[..., None] * rng.standard_normal((*points.shape[:2], 2))
        return replace(views, uv=self.camera.project(points) + noise).without(~views.seen)

    def _offsets(self, count: int, rng: np.random.Generator) -> Array:
        """How far ``(count, M)`` the markers lie off the sheet, mm: the ends of a straight rod
        independently, and each marker by itself."""
        positions = self.rig.target.positions
        share = (positions - positions[0]) / (positions[-1] - positions[0])
        ends = self.sizes["placement"] * rng.standard_normal((count, 2))
        own = self.sizes["marker"] * rng.standard_normal((count, len(positions)))
        return ends[:, :1] * (1.0 - share) + ends[:, 1:] * share + own


def resimulation(rig: Rig, calibration: Calibration) -> Resimulation:
    """What is needed to simulate a calibrated rig again.

    Parameters
    ----------
    rig : Rig
        From which it was calibrated.
    calibration : Calibration
        Its result.

    Raises
    ------
    InputError
        If the calibration knows none of the rig's views.
    """
    rig = _as_used(rig, calibration)
    proportions = noise_model(rig).proportions
    fitted = _fitted_points(calibration)
    truth = {}
    for stage, views in rig.observations.stages().items():
        points = np.array([fitted[stage, name] for name in views.names])
        normals = np.array([plane.normal for plane in calibration.light_planes])
        truth[stage] = TrueViews(
            points=points,
            along=normalised(points[:, len(rig.target.positions) - 1] - points[:, 0]),
            off=normals[views.lasers] if stage == "plane" else np.zeros((len(views), 3)),
            std=calibration.pixel_std * proportions[stage],
        )
    sizes, views = _sizes(rig, calibration), rig.observations.board
    boards = None
    if rig.board is not None and len(views):
        boards = true_boards(rig.board, views, calibration, sizes)
    return Resimulation(rig, calibration.camera, truth, sizes, boards)


def _as_used(rig: Rig, calibration: Calibration) -> Rig:
    """The rig without the views and points that the calibration left out."""
    used: dict[tuple[str, str], np.ndarray] = {
        (view.stage, view.view): np.asarray(np.isfinite(view.residuals).all(axis=-1))
        for view in calibration.residuals.views
    }
    views: dict[str, TargetViews] = {}
    for stage, every in rig.observations.stages().items():
        kept = every.take(np.array([(stage, name) in used for name in every.names]))
        if len(kept):
            seen = np.array([used[stage, name] for name in kept.names])
            views[stage] = kept.without(~(seen & kept.seen))
    board = _boards_as_used(rig, used)
    if not (views or len(board)):
        raise InputError(
            "the calibration holds no view of the rig, so that it cannot be simulated again",
            "give the rig from which it was calibrated",
        )
    return replace(rig, observations=replace(Observations(board=board), **views))


def _boards_as_used(rig: Rig, used: Mapping[tuple[str, str], np.ndarray]) -> BoardViews:
    """The views of boards that the calibration used, with those parts of the lines that are on
    them: a calibration names no points of lines, but every one begins with the same screening."""
    if not any(stage == "board" for stage, _ in used):
        return BoardViews()
    every = screened_boards(rig).rig.observations.board
    kept = every.take(np.array([("board", name) in used for name in every.names]))
    seen = np.array([used["board", name] for name in kept.names])
    return kept.without(~(seen & kept.seen)) if len(kept) else kept


def _fitted_points(calibration: Calibration) -> dict[tuple[str, str], Array]:
    return {(view.stage, view.view): view.xyz for view in calibration.residuals.views}


def _sizes(rig: Rig, calibration: Calibration) -> dict[str, float]:
    """Noise components, estimated where they were."""
    stated = dict.fromkeys(COMPONENTS, 0.0) | {
        "pixel": calibration.pixel_std,
        "corner": calibration.pixel_std,
        "placement": rig.placement_std or 0.0,
        "shape": winding_px(rig),
    }
    estimated = calibration.covariance.components
    return stated | dict(zip(estimated.names, estimated.std, strict=True))
