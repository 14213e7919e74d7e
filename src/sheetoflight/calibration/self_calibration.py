"""What calibration without any target starts from, and what it gives.

Only the camera can be had so: pictures of unknown points have no scale, so there are no lengths in
mm and no sheet of light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from sheetoflight.calibration.rig_state import CAMERA
from sheetoflight.calibration.track_adjustment import TrackAdjustment, TrackState
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.estimation.block_least_squares import (
    SolverOptions,
    reduced_equations,
    scaled_inverse,
    solve,
)
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import proportions
from sheetoflight.model.camera import DISTORTION_MODELS, Camera

Pixels = Literal["skewed", "rectangular", "square", "centred"]
"""What of K is estimated: all of it; all but the skew; one focal length and the principal point;
one focal length, the principal point being in the picture's middle."""

STAGE = "camera"

_LOOSE = 0.1
"""Standard uncertainty of a focal length, and of the principal point as a part of the picture's
width, with which a camera no longer counts as determined."""

_OPTIONS = SolverOptions(iterations=150)
"""A camera that the views determine is found in some ten steps, or in some fifty along the bent
valley that a start without distortion may lead into."""


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """A camera from pictures of unknown points.

    Parameters
    ----------
    camera : Camera
    pixels : Pixels
        What of K was estimated.
    camera_from_first : (V, 3, 4) array
        ``[R t]`` of each view from the frame of the first; lengths in units of the distance from
        the first view to the farthest, or all 0 where the camera only turns.
    names : tuple of str
        The parameters that were estimated: ``camera.alpha`` …
    covariance : (P, P) array
        Of these; alpha and beta may be tied together.
    rms_px : float
        Root mean square of the residual image coordinates, corrected for degrees of freedom; of
        points with a typical std where these differ.
    degrees_of_freedom : int
    converged : bool
    """

    camera: Camera
    pixels: Pixels
    camera_from_first: Array
    names: tuple[str, ...]
    covariance: Array
    rms_px: float
    degrees_of_freedom: int
    converged: bool

    def std(self, name: str) -> float:
        """Standard uncertainty of a parameter; 0 of one that was held."""
        if name not in self.names:
            return 0.0
        place = self.names.index(name)
        return float(np.sqrt(self.covariance[place, place]))

    @property
    def trusted(self) -> bool:
        """Whether the pictures determine the camera."""
        width = max(self.camera.image_size)
        return (
            self.converged
            and self.std(CAMERA[0]) < _LOOSE * self.camera.alpha
            and self.std(CAMERA[1]) < _LOOSE * self.camera.beta
            and max(self.std(CAMERA[3]), self.std(CAMERA[4])) < _LOOSE * width
        )


def free_parameters(pixels: Pixels, distortion: str) -> Array:
    """How the ten parameters of a `Camera` move with the free ones, ``(10, p)``.

    Raises
    ------
    InputError
        If there is no such model.
    """
    for name, value, known in (
        ("pixels", pixels, get_args(Pixels)),
        ("distortion", distortion, DISTORTION_MODELS),
    ):
        if value not in known:
            raise InputError(f"{name} is '{value}'", f"choose {' | '.join(known)}")
    both = pixels in ("square", "centred")
    groups: list[tuple[str, ...]] = [("alpha", "beta")] if both else [("alpha",), ("beta",)]
    groups += [("gamma",)] if pixels == "skewed" else []
    groups += [] if pixels == "centred" else [("u0",), ("v0",)]
    groups += [(name,) for name in DISTORTION_MODELS[distortion]]
    tie = np.zeros((10, len(groups)))
    for column, group in enumerate(groups):
        tie[[Camera.PARAMETERS.index(name) for name in group], column] = 1.0
    return tie


def checked_tracks(uv: Array, views: int, tracks: int) -> Array:
    """Tracks seen in two views or more, ``(V, T, 2)`` px, NaN where not seen.

    Raises
    ------
    InputError
        If the shape is another.
    UntrustworthyError
        If there are too few views, or tracks of use.
    """
    uv = np.array(uv, dtype=float)
    if uv.ndim != 3 or uv.shape[2] != 2:
        raise InputError(
            f"the tracks have shape {uv.shape}", "give u and v of every track in every view"
        )
    uv[~np.isfinite(uv).all(axis=-1)] = np.nan
    useful = uv[:, np.isfinite(uv[..., 0]).sum(axis=0) >= 2]
    if useful.shape[0] < views or useful.shape[1] < tracks:
        raise UntrustworthyError(
            STAGE,
            f"{useful.shape[1]} points are seen more than once in {useful.shape[0]} views",
            f"follow at least {tracks} points through at least {views} views",
        )
    return useful


def track_weights(uv: Array, std: Array | None) -> Array:
    """Weights ``(V, T')`` of the tracks that `checked_tracks` keeps: the inverse of each std in
    proportion to the others, those that are unknown counting as typical.

    Raises
    ------
    InputError
        If the std has another shape, or is not above zero.
    """
    seen = np.isfinite(uv).all(axis=-1)
    given = np.full(seen.shape, np.nan) if std is None else np.asarray(std, dtype=float)
    if given.shape != seen.shape or (given <= 0).any():
        raise InputError(
            f"the tracks' std has shape {given.shape} or is not above zero, expected {seen.shape}",
            "give one value above zero, or NaN, for each image point",
        )
    size = proportions(np.where(seen, given, np.nan))[0]
    return 1.0 / size[:, seen.sum(axis=0) >= 2]


def pairs_of(uv: Array, tracks: int) -> list[tuple[int, int]]:
    """Pairs of views that share at least so many tracks."""
    seen = np.isfinite(uv[..., 0]).astype(int)
    shared = seen @ seen.T
    return [(i, j) for i in range(len(uv)) for j in range(i) if shared[i, j] >= tracks]


def picture_frame(image_size: tuple[int, int]) -> Array:
    """Similarity ``(3, 3)`` from pixels to a frame with the picture's middle at 0 and its half
    diagonal at 1."""
    width, height = image_size
    scale = 2.0 / float(np.hypot(width, height))
    middle = 0.5 * np.array([width - 1.0, height - 1.0])
    return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1.0]])


def turns(rotations: Array) -> Array:
    """Rotation vectors ``(V, 3)`` rad of rotations ``(V, 3, 3)`` by less than half a turn."""
    axes = 0.5 * np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(axes, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0))
    return axes * (angle / np.maximum(sine, np.finfo(float).tiny))[:, None]


def tied(camera: Camera, pixels: Pixels) -> Camera:
    """The camera of a reduced model nearest to a given one, without distortion."""
    alpha, beta, gamma, u0, v0 = camera.parameters[:5]
    if pixels in ("square", "centred"):
        alpha = beta = float(np.sqrt(alpha * beta))
    if pixels == "centred":
        u0, v0 = 0.5 * (np.array(camera.image_size) - 1.0)
    gamma = gamma if pixels == "skewed" else 0.0
    return Camera(camera.image_size, float(alpha), float(beta), float(u0), float(v0), float(gamma))


def adjusted(
    problem: TrackAdjustment,
    state: TrackState,
    pixels: Pixels,
    pixel_std: float | None,
) -> SelfCalibration | None:
    """The maximum-likelihood estimate from a start, or None where the tracks leave it open.

    The covariance is ``s² N⁻¹`` with the normal equations N of the shared parameters, all
    others eliminated, and s the pixel noise as stated, or as the residuals tell it.
    """
    freedom = problem.degrees_of_freedom
    if freedom < 1:
        return None
    try:
        solution = solve(problem, state, _OPTIONS)
        blocks = problem.blocks(solution.state)
        inverse, _ = scaled_inverse(reduced_equations(blocks, problem.shared_size)[0])
    except np.linalg.LinAlgError:
        return None
    rms = float(np.sqrt(2.0 * solution.cost / freedom))
    tie = problem.tie
    chosen = np.flatnonzero(tie.any(axis=1))
    own = tie[chosen] @ inverse[: tie.shape[1], : tie.shape[1]] @ tie[chosen].T
    return SelfCalibration(
        camera=solution.state.camera,
        pixels=pixels,
        camera_from_first=solution.state.camera_from_first,
        names=tuple(CAMERA[i] for i in chosen),
        covariance=own * (rms if pixel_std is None else pixel_std) ** 2,
        rms_px=rms,
        degrees_of_freedom=freedom,
        converged=solution.converged,
    )
