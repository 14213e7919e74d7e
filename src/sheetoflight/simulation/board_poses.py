"""Random positions of boards and bodies before the camera, most of them across a sheet of light."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.simulation.board_lines import chords, face_outlines
from sheetoflight.simulation.poses import points_in_sheet
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.visible import in_picture

SHEET_OF_PAPER = PlanarBoard("chessboard", 11, 8, (20.0, 20.0))
"""A chessboard of 12 × 9 fields that fills a sheet of A4."""

_BATCH = 512
_BATCHES = 100
_ASIDE = 0.25
"""Greatest distance of the sheet's point from the board's middle, as a share of its size."""
_LEAST_COSINE = 0.2
"""A face turned further away from the camera, or from the projector, shows nothing."""
_NEARER, _FARTHER = 0.6, 1.2
"""How far boards for the camera alone leave the rig's range of depths."""


@dataclass(frozen=True)
class BoardHolding:
    """How boards are held before the camera.

    Parameters
    ----------
    max_tilt_deg : float
        Largest angle between the line of sight and the board's third axis.
    margin_px : float
        Least distance of the board's points from the picture's edge, px.
    least_line : float
        Least length of the line on the board, as a share of the board's longest side.
    whole : bool
        Whether the outlines of the board's faces must be in the picture, beside its points.
    max_roll_deg : float
        Largest turn of the board about its third axis, either way, from where its first axis
        points to the right and has no component along v.
    farthest_mm : float
        Greatest Z of the board's points.
    """

    max_tilt_deg: float = 50.0
    margin_px: float = 10.0
    least_line: float = 0.5
    whole: bool = False
    max_roll_deg: float = 180.0
    farthest_mm: float = math.inf


def board_rig(
    board: Board | None = None,
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
) -> SimulatedRig:
    """The paper's rig with a board, by default `SHEET_OF_PAPER`."""
    return replace(paper_rig(distortion), board=board or SHEET_OF_PAPER)


def board_poses(
    rig: SimulatedRig,
    board: Board,
    count: int,
    rng: np.random.Generator,
    holding: BoardHolding | None = None,
    laser: int | None = 0,
) -> tuple[Array, Array]:
    """Random poses in which all points are in the picture and the sheet crosses the board.

    A body is looked at along its own third axis, as a board is. Its faces are all seen from the
    side that this axis comes from, so that none of a body whose faces join in one surface hides
    another. Tilts are uniform over a disc, in all directions.

    Parameters
    ----------
    rig : SimulatedRig
    board : PlanarBoard or SolidTarget
    count : int
    rng : numpy.random.Generator
    holding : BoardHolding, optional
    laser : int, optional
        Whose sheet crosses the board, somewhere in `depth_mm`. None: no sheet need do so; the
        board is anywhere in the picture, from 0.6 of the nearest to 1.2 of the farthest depth.

    Returns
    -------
    rotations : (count, 3, 3), translations : (count, 3)
        Of the board in the camera frame: ``X_camera = R X_board + t``, mm.

    Raises
    ------
    InputError
        If too few of the poses drawn are such.
    """
    holding = holding or BoardHolding()
    rotations: list[Array] = [np.empty((0, 3, 3))]
    translations: list[Array] = [np.empty((0, 3))]
    found = 0
    for _ in range(_BATCHES if count else 0):
        turns, shifts = _drawn(rig, board, rng, holding, laser)
        good = _acceptable(rig, board, turns, shifts, holding, laser)
        rotations.append(turns[good])
        translations.append(shifts[good])
        found += int(good.sum())
        if found >= count:
            break
    if found < count:
        raise InputError(
            f"only {found} of {count} board views lie wholly in the picture with the line across",
            "use a smaller board, a larger distance, a wider lens or a larger max_tilt_deg",
        )
    return np.concatenate(rotations)[:count], np.concatenate(translations)[:count]


def placed_points(points: Array, rotations: Array, translations: Array) -> Array:
    """Points ``(N, M, 3)`` in the camera frame, of ``(M, 3)`` in the board's, mm."""
    return points @ np.swapaxes(rotations, -1, -2) + translations[:, None, :]


def _drawn(
    rig: SimulatedRig,
    board: Board,
    rng: np.random.Generator,
    holding: BoardHolding,
    laser: int | None,
) -> tuple[Array, Array]:
    """Poses drawn without a look at what is seen."""
    middle, half = _middle_and_half(board)
    if laser is None:
        at, aside = _points_in_picture(rig, rng), np.zeros((_BATCH, 3))
    else:
        at = points_in_sheet(rig, _BATCH, rng, laser)
        aside = 2.0 * _ASIDE * half * rng.uniform(-1.0, 1.0, (_BATCH, 3))
    rotations = _random_rotations(normalised(at), holding, rng)
    return rotations, at - (rotations @ (middle + aside)[..., None])[..., 0]


def _middle_and_half(board: Board) -> tuple[Array, Array]:
    """Middle of the board's points and half of its size along its axes ``(3,)``, mm; 0 across
    the faces of a flat board."""
    points = board.points
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, (high - low) / 2.0


def _points_in_picture(rig: SimulatedRig, rng: np.random.Generator) -> Array:
    """Points ``(n, 3)`` that are uniform in the picture and in depth, mm."""
    camera, (near, far) = rig.camera, rig.depth_mm
    z = rng.uniform(_NEARER * near, _FARTHER * far, _BATCH)
    uv = rng.uniform(0.0, 1.0, (_BATCH, 2)) * (np.array(camera.image_size) - 1.0)
    xy = (uv - (camera.u0, camera.v0)) / (camera.alpha, camera.beta)
    return np.column_stack([xy * z[:, None], z])


def _random_rotations(sight: Array, holding: BoardHolding, rng: np.random.Generator) -> Array:
    """Rotations ``(n, 3, 3)`` whose third axis is tilted away from directions ``(n, 3)``."""
    count = len(sight)
    tilt = math.radians(holding.max_tilt_deg) * np.sqrt(rng.uniform(0.0, 1.0, count))[:, None]
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)[:, None]
    right, down = tangent_basis(sight)
    aside = np.cos(azimuth) * right + np.sin(azimuth) * down
    third = np.cos(tilt) * sight + np.sin(tilt) * aside
    roll = math.radians(holding.max_roll_deg) * rng.uniform(-1.0, 1.0, count)[:, None]
    level = normalised(np.cross([0.0, 1.0, 0.0], third).astype(float))
    first = np.cos(roll) * level + np.sin(roll) * np.cross(third, level)
    return np.stack([first, np.cross(third, first), third], axis=-1)


def _acceptable(
    rig: SimulatedRig,
    board: Board,
    rotations: Array,
    translations: Array,
    holding: BoardHolding,
    laser: int | None,
) -> np.ndarray:
    """Mask ``(n,)`` of the poses that are as wanted."""
    outlines = [placed_points(o, rotations, translations) for o in face_outlines(board)]
    points = placed_points(board.points, rotations, translations)
    must = np.concatenate([points, *outlines], axis=1) if holding.whole else points
    good = in_picture(rig.camera, must, holding.margin_px).all(axis=1)
    good &= points[..., 2].max(axis=1) <= holding.farthest_mm
    good &= _seen_from(np.zeros(3), board, outlines, rotations)
    if laser is None:
        return good
    if laser == 0:  # where the projectors of the others stand is not said
        good &= _seen_from(rig.projector_mm, board, outlines, rotations)
    ends = np.stack([chords(o, rig.light_planes[laser]) for o in outlines], axis=1)
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
    good &= np.nansum(lengths, axis=1) >= holding.least_line * _longest_side(board)
    inside = in_picture(rig.camera, ends, holding.margin_px).all(axis=-1)
    return good & (inside | np.isnan(lengths)).all(axis=1)


def _seen_from(place: Array, board: Board, outlines: list[Array], rotations: Array) -> np.ndarray:
    """Mask ``(n,)`` of the poses that show every corner of every face to a place ``(3,)``."""
    good = np.ones(len(rotations), dtype=bool)
    for face, corners in zip(board.faces, outlines, strict=True):
        normal = rotations @ (face[:3] * np.copysign(1.0, face[2]))
        cosines = np.sum(normalised(corners - place) * normal[:, None, :], axis=-1)
        good &= cosines.min(axis=1) >= _LEAST_COSINE
    return good


def _longest_side(board: Board) -> float:
    corners = np.concatenate(face_outlines(board))
    return float(np.ptp(corners, axis=0).max())
