"""Where the adjustment begins: cameras from all the evidence, and what follows from each.

Closed forms come first. Where they fail – degenerate swings, few views, strong noise – cameras
with square pixels and their principal point in the middle of the picture are tried over the
range of focal lengths that exist. Given a camera, everything else follows in closed form.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.board_planes import planes_on_boards
from sheetoflight.calibration.camera_closed_form import (
    PivotImages,
    closed_form_cameras,
    normalisation,
    pivot_images,
)
from sheetoflight.calibration.crossing_start import crossings_in_front, spots, with_crossings
from sheetoflight.calibration.pose_reselection import reselected_directions
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.sheet_map_closed_form import sheet_map
from sheetoflight.calibration.triangulated_views import outer_markers, triangulated_views
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.geometry.planes import fitted_plane
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_FIELDS_OF_VIEW_DEG = (120.0, 85.0, 60.0, 42.0, 30.0, 21.0, 15.0, 10.0, 7.0, 5.0)
"""Diagonal fields of view to be tried, each focal length some 1.4 times the one before: from
fish-eye-like to telephoto lenses."""


@dataclass(frozen=True)
class Evidence:
    """What the views say before a camera is known, in normalised pixels and lengths.

    Parameters
    ----------
    pixels : (3, 3) array
        From pixels to normalised ones.
    length : float
        Of the target, mm: the unit of length.
    pivot : PivotImages or None
    sheets : tuple of (3, 3) array or None
        For each laser the homography from its sheet to the image, where its views give one.
    """

    pixels: Array
    length: float
    pivot: PivotImages | None
    sheets: tuple[Array | None, ...]


def evidence(rig: Rig) -> Evidence:
    """What the views say before a camera is known."""
    seen = rig.observations
    markers = len(rig.target.markers_mm)
    length = float(rig.target.positions[-1])
    positions = rig.target.positions / length
    every = [views.uv[:, :markers].reshape(-1, 2) for views in seen.stages().values()]
    pixels = normalisation(np.concatenate(every))
    pivot = pivot_images(_in(pixels, seen.camera.uv), positions) if len(seen.camera) else None
    sheets = []
    for laser in range(len(rig.lasers)):
        views = seen.plane.uv[seen.plane.lasers == laser]
        found = sheet_map(_in(pixels, views), positions) if len(views) else None
        sheets.append(None if found is None else np.linalg.inv(found))
    return Evidence(pixels, length, pivot, tuple(sheets))


def cameras(rig: Rig, found: Evidence) -> Iterator[Camera]:
    """Cameras worth trying, the best founded first."""
    if rig.camera is not None:
        yield rig.camera
        return
    middle = 0.5 * (np.array(rig.image_size) - 1.0)
    slopes = np.zeros((0, 3)) if found.pivot is None else found.pivot.slopes[found.pivot.full]
    back = np.linalg.inv(found.pixels)
    maps = [sheet for sheet in found.sheets if sheet is not None]
    sets: list[Sequence[Array]] = [maps, ()] if maps else [()]
    for sheets in sets:
        for matrix in closed_form_cameras(slopes, sheets, _in(found.pixels, middle), rig.skew):
            in_pixels = back @ matrix
            if not rig.skew:
                in_pixels[0, 1] = 0.0
            yield Camera.from_matrix(rig.image_size, in_pixels)


def plain_cameras(rig: Rig) -> Iterator[Camera]:
    """Square pixels, principal point in the middle, all focal lengths that exist; none where the
    camera is known."""
    if rig.camera is not None:
        return
    middle = 0.5 * (np.array(rig.image_size) - 1.0)
    diagonal = float(np.hypot(*rig.image_size))
    for angle in _FIELDS_OF_VIEW_DEG:
        focal = 0.5 * diagonal / np.tan(np.radians(angle / 2))
        yield Camera(rig.image_size, focal, focal, middle[0], middle[1])


def pivoting_state(rig: Rig, found: Evidence, camera: Camera) -> RigState:
    """Fixed point and directions for a camera.

    Raises
    ------
    UntrustworthyError
        If no view shows the fixed point, or none two markers beside it.
    """
    views = rig.observations.camera
    empty = RigState(camera, np.array([0.0, 0.0, 1.0]), np.zeros((0, 3, 3)), np.zeros(0), {})
    if not len(views):
        return empty
    if found.pivot is None or not found.pivot.full.any():
        raise UntrustworthyError(
            "camera",
            "no view shows marker 0, about which the target pivots, and two more markers",
            "take pictures in which nothing hides them",
        )
    # the anchor from the target's length unit, its ray from the pixels
    matrix = found.pixels @ camera.matrix
    depth = found.pivot.depth(matrix)
    directions = found.pivot.directions(matrix)
    anchor = found.length * depth * np.linalg.solve(matrix, found.pivot.anchor)
    best, _ = reselected_directions(camera, anchor, directions, views, rig.target.positions)
    return replace(empty, anchor=anchor, poses={"camera": best})


def with_sheets(rig: Rig, found: Evidence | None, state: RigState) -> RigState:
    """The state with all sheets of light and the views that belong to them.

    A sheet follows from its line on boards; where there is none, from its homography to the
    image, or else from the points that are triangulated on it.

    Raises
    ------
    UntrustworthyError
        If a sheet's points do not give a plane, it passes through the camera, or a target
        cannot lie in it.
    """
    state = with_crossings(rig, state)
    boards = planes_on_boards(rig, state) if rig.observations.board else ()
    known = {laser: plane for laser, plane in enumerate(boards) if plane is not None}
    lasers = range(len(rig.lasers))
    try:
        planes = [known.get(n) or _plane(rig, found, state, n) for n in lasers]
        state = with_planes(rig, state, planes)
    except UntrustworthyError:  # parallel targets give a poor homography, but points in space
        planes = [known.get(n) or _triangulated_plane(rig, state, n) for n in lasers]
        state = with_planes(rig, state, planes)
    return crossings_in_front(rig, state)


def _plane(rig: Rig, found: Evidence | None, state: RigState, laser: int) -> tuple[Array, float]:
    homography = None if found is None else found.sheets[laser]
    if homography is None or found is None:
        return _triangulated_plane(rig, state, laser)
    return seen_plane(found, homography, state.camera)


def seen_plane(found: Evidence, homography: Array, camera: Camera) -> tuple[Array, float]:
    """The sheet from ``K⁻¹ H ~ [r1 r2 t]``: two directions in it and a point of it."""
    first, second, point = np.linalg.solve(found.pixels @ camera.matrix, homography).T
    size = 0.5 * (np.linalg.norm(first) + np.linalg.norm(second)) * np.sign(point[2])
    normal = normalised(np.cross(first, second))
    distance = float(found.length * normal @ point / size)
    return (normal, distance) if distance >= 0 else (-normal, -distance)


def _triangulated_plane(rig: Rig, state: RigState, laser: int) -> tuple[Array, float]:
    """The plane through all triangulated markers that lie in a sheet and its spots on targets."""
    lying, used = triangulated_views(rig, state.camera, "plane")
    lying = lying[rig.observations.plane.lasers[used] == laser] if len(used) else lying
    crossed = spots(rig, state, laser)
    if len(rig.observations.board) and not len(lying) and not len(crossed):
        raise UntrustworthyError(
            "board",
            f"the line of {rig.lasers[laser]} is seen on fewer than 2 boards",
            "take pictures with the laser line across the board, held at 5 or more different "
            "places and tilts",
        )
    if len(lying) < 2 and len(crossed) < 3 - len(lying):
        raise UntrustworthyError(
            "plane",
            f"{len(lying)} usable {'position' if len(lying) == 1 else 'positions'} of the target "
            f"in the sheet of {rig.lasers[laser]} and {len(crossed)} spots of it, "
            "at least 2 positions or 3 spots are needed",
            "lay the target into the sheet in further, differently turned positions (10 give a "
            "good result), or let the sheet cross it in further views",
        )
    return fitted_plane(np.concatenate([lying.reshape(-1, 3), crossed]))


def with_planes(rig: Rig, state: RigState, planes: Sequence[tuple[Array, float]]) -> RigState:
    """The state with given sheets ``(normal, distance)``, the in-plane targets laid onto them.

    Raises
    ------
    UntrustworthyError
        If a sheet passes through the camera, or a target cannot lie in it.
    """
    frames = np.array([np.stack([*tangent_basis(n), n], axis=1) for n, _ in planes])
    state = replace(
        state, frames=frames.reshape(-1, 3, 3), distances=np.array([d for _, d in planes])
    )
    views = rig.observations.plane
    return state.with_poses("plane", lying_poses(state, views, rig)) if len(views) else state


def lying_poses(state: RigState, views: TargetViews, rig: Rig) -> Array:
    """x, y, ψ of the in-plane targets, from the rays of their first and last seen markers."""
    rays = state.camera.unproject(views.uv)
    frames = state.frames[views.lasers]
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = state.distances[views.lasers][:, None] / np.einsum(
            "nmi,ni->nm", rays, frames[:, :, 2]
        )
    flat = np.einsum("nmi,nik->nmk", rays * depths[..., None], frames[:, :, :2])
    seen = views.seen
    lost = (seen.sum(axis=1) < 2) | (seen & ~(depths > 0)).any(axis=1)
    if lost.any():
        raise _cannot_lie(rig, state, views, int(np.flatnonzero(lost)[0]))
    rows = np.arange(len(views))
    first, last = outer_markers(seen)
    along = flat[rows, last] - flat[rows, first]
    angle = np.arctan2(along[:, 1], along[:, 0])
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    start = flat[rows, first] - rig.target.positions[first][:, None] * direction
    return np.column_stack([start, angle])


def _cannot_lie(rig: Rig, state: RigState, views: TargetViews, view: int) -> UntrustworthyError:
    laser = views.lasers[view]
    return UntrustworthyError(
        "plane",
        f"view {views.names[view]} cannot lie in the sheet of {rig.lasers[laser]} that the other "
        f"views give, which passes {state.distances[laser]:.2g} mm from the camera's centre",
        "check this view's markers; move the laser aside if the sheet passes through or near the "
        "camera",
    )


def _in(pixels: Array, uv: Array) -> Array:
    """Image points in normalised pixels."""
    return uv * pixels[0, 0] + pixels[:2, 2]
