"""A camera that is carried about, from points followed through its pictures; no target is needed.

Kruppa's equations give a focal length (`absolute_conic`), two views and then all others their
poses (`track_start`), and an adjustment of everything the camera (`track_adjustment`).

What such pictures cannot give: scale. Poses and points are in units of the distance between two
of the views; so there are no lengths in mm, and no sheet of light.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.absolute_conic import (
    epipolar_distances,
    fundamental_matrix,
    kruppa_focal_lengths,
)
from sheetoflight.calibration.board_closed_form import homographies
from sheetoflight.calibration.self_calibration import (
    STAGE,
    Pixels,
    SelfCalibration,
    adjusted,
    checked_tracks,
    free_parameters,
    pairs_of,
    picture_frame,
    tied,
    track_weights,
    turns,
)
from sheetoflight.calibration.track_adjustment import TrackAdjustment, TrackState
from sheetoflight.calibration.track_start import started
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera

_MODELS: tuple[Pixels, ...] = ("rectangular", "square", "centred")
_FEWEST_VIEWS = 3
_FEWEST_TRACKS = 15
_PAIR_TRACKS = 10
_FOCAL_LENGTHS = (0.8, 1.5, 3.0, 6.0)
"""In half diagonals of the picture, tried beside those of Kruppa's equations."""

_PARALLAX = 3.0
"""Points that a homography maps to within so many times their distances from epipolar lines show
no depth."""

_FIRST_PAIRS = 6
"""Pairs of views from which a start is tried."""

_ROUNDING_PX = 1e-6
_PLACED = 0.7
"""Part of the tracks that a start must place."""

_SLIGHT = np.radians(1.0)
_ONE_AXIS = 0.05


def moving_camera(
    uv: Array,
    image_size: tuple[int, int],
    distortion: str = "none",
    pixels: Pixels | None = None,
    pixel_std: float | None = None,
    std: Array | None = None,
) -> SelfCalibration:
    """Camera from pictures of an unknown, motionless scene, taken from several places.

    Parameters
    ----------
    uv : (V, T, 2) array
        Image points of T tracks in V >= 3 views, px; NaN where not seen. Matches must be right:
        `match_screening` looks for wrong ones.
    image_size : (int, int)
        Width and height, px.
    distortion : str
        A name of `DISTORTION_MODELS`.
    pixels : Pixels, optional
        What of K to estimate; the most that the motion determines where absent, without skew.
        The uncertainty of a reduced model holds only if the camera is such: with square pixels,
        and for "centred" with its principal point in the picture's middle.
    pixel_std : float, optional
        Standard uncertainty of an image coordinate; from the residuals where absent.
    std : (V, T) array, optional
        How uncertain each image point is in proportion to the others, px; NaN where unknown.

    Returns
    -------
    SelfCalibration

    Raises
    ------
    InputError
        If the tracks have another shape, or there is no such model.
    UntrustworthyError
        If there are too few views or tracks, or the motion leaves the camera open: turns without
        a change of place, a change of place without turns, turns about one axis; or the scene is
        flat.
    """
    models = _MODELS if pixels is None else (pixels,)
    ties = [free_parameters(model, distortion) for model in models]
    tracks = checked_tracks(uv, _FEWEST_VIEWS, _FEWEST_TRACKS)
    weights = track_weights(uv, std)
    fundamentals = _fundamentals(tracks)
    deep = _with_most_depth(tracks, fundamentals)
    start = _start(tracks, image_size, fundamentals, deep)
    placed = np.isfinite(start.places[:, 0])
    order = _farthest_second(start)
    first = replace(start, places=start.places[placed])
    turned = turns(start.rotations)
    for model, tie in zip(models, ties, strict=True):
        if _is_straight(turned):
            break
        state = _in_gauge(replace(first, camera=tied(start.camera, model)), order)
        problem = TrackAdjustment(tracks[order][:, placed], tie, False, weights[order][:, placed])
        fit = adjusted(problem, state, model, pixel_std)
        if fit is not None and fit.trusted:
            return replace(fit, camera_from_first=_in_order(fit.camera_from_first, order))
    raise UntrustworthyError(
        STAGE,
        f"{_found(turned)} leave the focal length or the principal point open",
        "between the pictures carry the camera about and turn it, about two axes, by tens of "
        "degrees",
    )


def _is_straight(turned: Array) -> bool:
    """Whether rotation vectors ``(V, 3)`` are those of moves without turns."""
    return bool(np.linalg.norm(turned, axis=1).max() < _SLIGHT)


def _found(turned: Array) -> str:
    """The motion in words."""
    if _is_straight(turned):
        return "moves without a turn"
    most = np.linalg.norm(turned, axis=1).max()
    strength = np.linalg.svd(turned, compute_uv=False)
    alone = " about one axis" if strength[1] < _ONE_AXIS * strength[0] else ""
    return f"moves with turns{alone} by up to some {np.degrees(most):.1f}°"


def _fundamentals(tracks: Array) -> dict[tuple[int, int], Array]:
    """Fundamental matrices of all pairs that share enough tracks.

    Raises
    ------
    UntrustworthyError
        Naming a view that is in no such pair.
    """
    found = {}
    for second, first in pairs_of(tracks, _PAIR_TRACKS):
        F = fundamental_matrix(tracks[first], tracks[second])
        if F is not None:
            found[second, first] = F
    for view in range(len(tracks)):
        if not any(view in pair for pair in found):
            raise UntrustworthyError(
                STAGE,
                f"view {view} shares fewer than {_PAIR_TRACKS} points with any other",
                "remove it, or follow more points into it",
            )
    return found


def _with_most_depth(
    tracks: Array, fundamentals: dict[tuple[int, int], Array]
) -> dict[tuple[int, int], Array]:
    """The pairs of views that a homography explains worst, where epipolar lines do better.

    Raises
    ------
    UntrustworthyError
        If there is no such pair.
    """
    marks = {pair: _depth(tracks, pair, F) for pair, F in fundamentals.items()}
    best = sorted((pair for pair in marks if marks[pair] > 0), key=lambda pair: -marks[pair])
    if best:
        return {pair: fundamentals[pair] for pair in best[:_FIRST_PAIRS]}
    raise UntrustworthyError(
        STAGE,
        "no pair of views shows depth: the camera only turned, or the scene is flat",
        "carry the camera about a scene with depth, or calibrate as a camera that only turns",
    )


def _depth(tracks: Array, pair: tuple[int, int], F: Array) -> float:
    """Root of the sum of squares of points' distances from where a homography has them, px; 0
    where that is no worse than the distances from epipolar lines."""
    second, first = pair
    both = np.isfinite(tracks[first, :, 0]) & np.isfinite(tracks[second, :, 0])
    x1, x2 = tracks[first, both], tracks[second, both]
    distance = _root_mean_square(epipolar_distances(F, x1, x2))
    H = homographies(np.column_stack([x1, np.zeros(len(x1))]), x2[None])[0]
    mapped = np.column_stack([x1, np.ones(len(x1))]) @ H.T
    apart = _root_mean_square(mapped[:, :2] / mapped[:, 2:] - x2)
    if apart <= _PARALLAX * distance + _ROUNDING_PX:
        return 0.0
    return float(apart * np.sqrt(len(x1)))


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _start(
    tracks: Array,
    image_size: tuple[int, int],
    fundamentals: dict[tuple[int, int], Array],
    deep: dict[tuple[int, int], Array],
) -> TrackState:
    """The start with least error, of several focal lengths; from the pairs with depth.

    Raises
    ------
    UntrustworthyError
        If there is none.
    """
    back = np.linalg.inv(picture_frame(image_size))
    central = [back.T @ F @ back for F in fundamentals.values()]
    middle = 0.5 * (np.array(image_size) - 1.0)
    states = []
    for focal in (*kruppa_focal_lengths(central), *_FOCAL_LENGTHS):
        camera = Camera(image_size, back[0, 0] * focal, back[0, 0] * focal, middle[0], middle[1])
        state = started(tracks, camera, deep)
        if state is not None and np.isfinite(state.places[:, 0]).mean() >= _PLACED:
            states.append(state)
    if not states:
        raise UntrustworthyError(
            STAGE,
            "the points cannot be placed in front of all views that see them",
            "follow more points through more of the views, and remove wrong matches",
        )
    return min(states, key=lambda state: _error(tracks, state))


def _error(tracks: Array, state: TrackState) -> float:
    """Median distance of the image points from where a state has them, px."""
    points = np.einsum("vij,tj->vti", state.rotations, state.places)
    uv = state.camera.project(points + state.translations[:, None])
    apart = np.linalg.norm(uv - tracks, axis=-1)
    return float(np.median(apart[np.isfinite(apart)]))


def _farthest_second(state: TrackState) -> np.ndarray:
    """Order of the views in which the second is the one farthest from the first."""
    order = np.arange(len(state.translations))
    far = int(np.linalg.norm(state.translations, axis=1).argmax())
    order[[1, far]] = order[[far, 1]]
    return order


def _in_gauge(state: TrackState, order: np.ndarray) -> TrackState:
    """The state with its views in another order, the first two at a distance of 1."""
    translations = state.translations[order]
    unit = np.linalg.norm(translations[1])
    rotations = state.rotations[order]
    return TrackState(state.camera, rotations, translations / unit, state.places / unit)


def _in_order(poses: Array, order: np.ndarray) -> Array:
    """Poses with the views as they were given, the farthest at a distance of 1."""
    given = poses[np.argsort(order)]
    far = np.linalg.norm(given[..., 3], axis=1).max()
    return given / np.array([1.0, 1.0, 1.0, far])
