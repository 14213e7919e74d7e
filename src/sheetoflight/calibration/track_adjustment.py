"""The adjustment of one camera that sees unknown points from several places.

Bundle adjustment (Triggs et al., "Bundle adjustment – a modern synthesis", 2000): the camera's
intrinsics and the poses of the views are shared, every track – a point followed through the views
– has its own place. Where the camera only turns, nothing tells how far away a point is, and its
place is a direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sheetoflight.estimation.block_least_squares import Block
from sheetoflight.geometry.directions import Array, moved, tangent_basis
from sheetoflight.geometry.rotations import cross_matrix, rotation
from sheetoflight.model.camera import Camera


@dataclass(frozen=True, eq=False)
class TrackState:
    """Camera, poses and places.

    Parameters
    ----------
    camera : Camera
    rotations : (V, 3, 3) array, and translations : (V, 3) array
        ``X_view = R X + t``; the first view's are 1 and 0, and the second view's translation has
        length 1, or all translations are 0.
    places : (T, 3) array
        Points in the first view's frame, or unit directions where the camera only turns.
    """

    camera: Camera
    rotations: Array
    translations: Array
    places: Array

    @property
    def turns_only(self) -> bool:
        """Whether all views are taken from one point."""
        return not self.translations.any()

    @property
    def camera_from_first(self) -> Array:
        """Poses ``(V, 3, 4)``."""
        return np.concatenate([self.rotations, self.translations[..., None]], axis=2)


class TrackAdjustment:
    """The least-squares problem of tracks, for `estimation.block_least_squares.solve`.

    The gauge is fixed: the first view's frame is the world's, and the distance of the second view
    from the first is the unit of length. A picture has no scale, so no length in mm can be had.

    Parameters
    ----------
    uv : (V, T, 2) array
        Image points, px; NaN where not seen. Every track is seen in two views or more.
    tie : (10, p) array
        How the camera's parameters move with the p free ones.
    turns_only : bool
        Whether the camera stays in its place.
    weights : (V, T) array, optional
        What each image point's residuals are multiplied by; 1 where absent.
    """

    def __init__(
        self, uv: Array, tie: Array, turns_only: bool, weights: Array | None = None
    ) -> None:
        self.seen = np.asarray(np.isfinite(uv).all(axis=-1)).T
        self.uv = np.where(self.seen[..., None], np.swapaxes(uv, 0, 1), 0.0)
        given = np.ones(uv.shape[:2]) if weights is None else weights
        self.weights = np.where(self.seen, given.T, 0.0)
        self.tie = tie
        self.turns_only = turns_only

    @property
    def views(self) -> int:
        """Number of views."""
        return self.seen.shape[1]

    @property
    def shared_size(self) -> int:
        """Number of shared parameters: the camera's, rotations, translations."""
        poses = 3 * (self.views - 1) if self.turns_only else 6 * (self.views - 1) - 1
        return self.tie.shape[1] + poses

    @cached_property
    def degrees_of_freedom(self) -> int:
        """Observed coordinates less estimated parameters."""
        own = 2 if self.turns_only else 3
        return 2 * int(self.seen.sum()) - own * len(self.seen) - self.shared_size

    def blocks(self, state: TrackState) -> list[Block]:
        """Residuals (predicted minus observed) in px and their derivatives, one group a track."""
        turned = np.einsum("vij,tj->tvi", state.rotations, state.places)
        uv, by_point, by_camera = state.camera.project_with_jacobians(turned + state.translations)
        by_pose = [by_point[:, v] @ m for v, m in self._pose_moves(state, turned)]
        own = state.rotations @ _own_moves(state.places, self.turns_only)[:, None]
        count, size = len(uv), self.shared_size
        by_shared = np.zeros((*uv.shape, size))
        by_shared[..., : self.tie.shape[1]] = by_camera @ self.tie
        column = self.tie.shape[1]
        for (view, _), slope in zip(self._pose_moves(state, turned), by_pose, strict=True):
            by_shared[:, view, :, column : column + slope.shape[-1]] = slope
            column += slope.shape[-1]
        hidden = ~self.seen
        residuals, by_local = uv - self.uv, by_point @ own
        residuals *= self.weights[..., None]
        by_shared *= self.weights[..., None, None]
        by_local *= self.weights[..., None, None]
        for array in (residuals, by_shared, by_local):
            array[hidden] = 0.0
        return [
            Block(
                residuals.reshape(count, -1),
                by_shared.reshape(count, -1, size),
                np.arange(size),
                by_local.reshape(count, -1, by_local.shape[-1]),
            )
        ]

    def _pose_moves(self, state: TrackState, turned: Array) -> list[tuple[int, Array]]:
        """Of each parameter group of the poses: its view, and how the view's points move."""
        rest = range(1, self.views)
        turns: list[tuple[int, Array]] = [(v, -cross_matrix(turned[:, v])) for v in rest]
        if self.turns_only:
            return turns
        shifts = [(1, np.stack(tangent_basis(state.translations[1]), axis=-1))]
        return [*turns, *shifts, *((v, np.eye(3)) for v in rest[1:])]

    def moved(self, state: TrackState, shared: Array, local: Sequence[Array]) -> TrackState:
        """The state after a step; unchanged where no such camera exists."""
        count, rest = self.tie.shape[1], 3 * (self.views - 1)
        parameters = state.camera.parameters + self.tie @ shared[:count]
        if not (np.isfinite(shared).all() and (parameters[:2] > 0).all()):
            return state
        turns, shifts = shared[count : count + rest].reshape(-1, 3), shared[count + rest :]
        rotations = state.rotations.copy()
        rotations[1:] = rotation(turns) @ rotations[1:]
        translations = state.translations.copy()
        if self.turns_only:
            places = moved(state.places, local[0])
        else:
            places = state.places + local[0]
            translations[1] = moved(translations[1], shifts[:2])
            translations[2:] += shifts[2:].reshape(-1, 3)
        camera = state.camera.with_parameters(parameters)
        return TrackState(camera, rotations, translations, places)


def _own_moves(places: Array, turns_only: bool) -> Array:
    """How tracks move with their own parameters, ``(T, 3, 2)`` or ``(T, 3, 3)``."""
    if turns_only:
        return np.stack(tangent_basis(places), axis=-1)
    return np.broadcast_to(np.eye(3), (len(places), 3, 3))
