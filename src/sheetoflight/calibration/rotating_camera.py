"""A camera that only turns, from points followed through its pictures; no target is needed.

R. Hartley, "Self-calibration of stationary cameras", Int. J. Computer Vision 22(1), 1997 (first:
ECCV 1994). Two pictures taken from one point differ by a homography, whatever the scene:
``x_j ~ H x_i`` with ``H = K R K⁻¹``, scaled to ``det H = 1``. The image of the absolute conic,
``ω = K⁻ᵀ K⁻¹``, is then unmoved, ``Hᵀ ω H = ω``; it is the inverse of Hartley's ``K Kᵀ``, and
zero skew or square pixels are linear in it (de Agapito, Hayman and Reid, "Self-calibration of
rotating and zooming cameras", Int. J. Computer Vision 45(2), 2001, section 4).

Turning about one axis leaves one more conic unmoved, ``a aᵀ`` with ``a = K⁻ᵀ r``: then only a
camera with fewer parameters can be had, and none where the axis is the optical one.

What such pictures cannot give: lengths, and so a sheet of light.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera

_MODELS: tuple[Pixels, ...] = ("rectangular", "square", "centred")
_FEWEST_TRACKS = 8
_PAIR_TRACKS = 5
_ROUNDING = 1e-9
_SLIGHT = 0.05
"""Turns about further axes, as a part of those about the main one, that count as none."""

_FOCAL_LENGTHS = np.geomspace(0.4, 8.0, 14)
"""In half diagonals of the picture: tried where the linear equations give no camera."""


def rotating_camera(
    uv: Array,
    image_size: tuple[int, int],
    distortion: str = "none",
    pixels: Pixels | None = None,
    pixel_std: float | None = None,
    std: Array | None = None,
) -> SelfCalibration:
    """Camera from pictures taken from one point in several directions.

    Parameters
    ----------
    uv : (V, T, 2) array
        Image points of T tracks in V views, px; NaN where not seen. Matches must be right:
        `match_screening` looks for wrong ones.
    image_size : (int, int)
        Width and height, px.
    distortion : str
        A name of `DISTORTION_MODELS`.
    pixels : Pixels, optional
        What of K to estimate; the most that the rotations determine where absent, without skew.
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
        If views share too few tracks, or the rotations leave the camera open.
    """
    tracks, turned = checked_tracks(uv, 2, _FEWEST_TRACKS), np.zeros((1, 3))
    weights = track_weights(uv, std)
    for model in _MODELS if pixels is None else (pixels,):
        tie = free_parameters(model, distortion)
        state = _start(tracks, image_size, model)
        turned = turns(state.rotations)
        if _rolls(turned):
            break
        fit = adjusted(TrackAdjustment(tracks, tie, True, weights), state, model, pixel_std)
        if fit is not None and fit.trusted:
            return fit
    raise UntrustworthyError(
        STAGE,
        f"{_found(turned)} leave the focal length or the principal point open",
        "turn the camera by tens of degrees, about two axes across its line of sight",
    )


def _rolls(turned: Array) -> bool:
    """Whether rotation vectors ``(V, 3)`` lie along the line of sight, but for what noise may
    do."""
    across = np.linalg.norm(turned[:, :2], axis=1).max()
    return bool(across < _SLIGHT * np.abs(turned[:, 2]).max())


def _found(turned: Array) -> str:
    """Rotation vectors in words."""
    if _rolls(turned):
        along = np.degrees(np.abs(turned[:, 2]).max())
        return f"turns about the line of sight alone, by up to {along:.1f}°,"
    strength = np.linalg.svd(turned, compute_uv=False)
    alone = " about one axis" if strength[1] < _SLIGHT * strength[0] else ""
    most = np.degrees(np.linalg.norm(turned, axis=1).max())
    return f"turns{alone} by up to some {most:.1f}°"


def conic_cameras(maps: Array) -> dict[Pixels, Array]:
    """K by model, from homographies between views that differ by rotations.

    Parameters
    ----------
    maps : (P, 3, 3) array
        Homographies of image points, in a frame whose origin is the middle of the picture.

    Returns
    -------
    dict
        ``(3, 3)`` in the same frame; without the models for which the rotations leave the linear
        equations open, or which no K fits.
    """
    unit = maps / np.cbrt(np.linalg.det(maps))[:, None, None]
    found: dict[Pixels, Array] = {}
    for model, basis in _CONICS.items():
        K = _conic_camera(unit, basis)
        if K is not None:
            found[model] = K
    return found


def _symmetric(row: int, column: int) -> Array:
    matrix = np.zeros((3, 3))
    matrix[row, column] = matrix[column, row] = 1.0
    return matrix


_SQUARE = np.diag([1.0, 1.0, 0.0])
_OFFSETS = [_symmetric(0, 2), _symmetric(1, 2), _symmetric(2, 2)]
_AXES = [_symmetric(0, 0), _symmetric(1, 1)]
_CONICS: dict[Pixels, list[Array]] = {
    "skewed": [*_AXES, _symmetric(0, 1), *_OFFSETS],
    "rectangular": [*_AXES, *_OFFSETS],
    "square": [_SQUARE, *_OFFSETS],
    "centred": [_SQUARE, _OFFSETS[2]],
}
"""The matrices of which ω is composed."""


def _conic_camera(unit: Array, basis: Sequence[Array]) -> Array | None:
    """K for one model: the null vector of ``Hᵀ ω H − ω = 0``."""
    rows = np.stack([(np.swapaxes(unit, 1, 2) @ b @ unit - b).ravel() for b in basis], axis=1)
    _, size, vectors = np.linalg.svd(rows, full_matrices=False)
    if size[-2] <= _ROUNDING * max(size[0], 1.0):
        return None
    conic = np.tensordot(vectors[-1], np.stack(basis), axes=1)
    try:
        upper = np.linalg.cholesky(conic if np.trace(conic) > 0 else -conic).T
    except np.linalg.LinAlgError:
        return None
    K = np.linalg.inv(upper)
    return K / K[2, 2]


def _start(tracks: Array, image_size: tuple[int, int], model: Pixels) -> TrackState:
    """The state with least error among all that closed forms and a row of focal lengths give."""
    frame = picture_frame(image_size)
    maps = {pair: _map_between(tracks, *pair) for pair in pairs_of(tracks, _PAIR_TRACKS)}
    there = {pair: H for pair, H in maps.items() if np.isfinite(H).all()}
    chain = _chain(there, len(tracks))
    central = [frame @ H @ np.linalg.inv(frame) for H in there.values()]
    matrices = [*conic_cameras(np.stack(central)).values()]
    matrices += [np.diag([f, f, 1.0]) for f in _FOCAL_LENGTHS]
    states = []
    for K in matrices:
        whole = np.triu(np.linalg.solve(frame, K))
        camera = tied(Camera.from_matrix(image_size, whole / whole[2, 2]), model)
        states.append(_turned_views(tracks, camera, chain))
    return min(states, key=lambda state: _error(tracks, state))


def _map_between(tracks: Array, first: int, second: int) -> Array:
    """Homography ``(3, 3)`` from one view's points to another's, of determinant 1."""
    both = np.isfinite(tracks[first]).all(axis=1) & np.isfinite(tracks[second]).all(axis=1)
    points = np.column_stack([tracks[first][both], np.zeros(int(both.sum()))])
    H = homographies(points, tracks[second][both][None])[0]
    return H / np.cbrt(np.linalg.det(H))


def _chain(maps: dict[tuple[int, int], Array], views: int) -> Array:
    """Homographies ``(V, 3, 3)`` from the first view to each, over the fewest others.

    Raises
    ------
    UntrustworthyError
        Naming a view that shares too few tracks with any other.
    """
    either = {**maps, **{(j, i): np.linalg.inv(H) for (i, j), H in maps.items()}}
    chain = {0: np.eye(3)}
    ends = [0]
    while ends:
        here = ends.pop(0)
        for (start, end), H in either.items():
            if start == here and end not in chain:
                chain[end] = H @ chain[here]
                ends.append(end)
    for view in range(views):
        if view not in chain:
            raise UntrustworthyError(
                STAGE,
                f"view {view} shares fewer than {_PAIR_TRACKS} points with the others",
                "remove it, or follow more points into it",
            )
    return np.stack([chain[view] for view in range(views)])


def _turned_views(tracks: Array, camera: Camera, chain: Array) -> TrackState:
    """Rotations nearest to ``K⁻¹ H K``, and the tracks' mean directions."""
    K = camera.matrix
    u, _, vt = np.linalg.svd(np.linalg.solve(K, chain @ K))
    rotations = u @ vt
    rotations[0] = np.eye(3)
    rays = normalised(camera.unproject(tracks)) @ rotations  # each by its view's Rᵀ
    directions = normalised(np.nansum(rays, axis=0))
    return TrackState(camera, rotations, np.zeros((len(tracks), 3)), directions)


def _error(tracks: Array, state: TrackState) -> float:
    """Median distance of the image points from where a state has them, px."""
    points = np.einsum("vij,tj->vti", state.rotations, state.places)
    seen = np.isfinite(tracks).all(axis=-1)
    apart = np.linalg.norm(state.camera.project(points) - tracks, axis=-1)[seen]
    return float(np.median(np.where(np.isfinite(apart), apart, np.inf)))
