"""What of the boards' views does not belong to the rest: points, views, and parts of lines.

A board shows far more points than its pose needs, so each view can be judged by itself once a
camera is there; the lines come last (`line_screening`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.board_closed_form import gives_homography
from sheetoflight.calibration.board_planes import point_errors
from sheetoflight.calibration.board_start import boards_alone
from sheetoflight.calibration.line_screening import screened_lines
from sheetoflight.calibration.mirrored_views import mirrored_views
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.wrong_points import FALSE_ALARM
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import Solution
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.rig import Rig

_PER_NORMAL = 1.1774
"""Median length of a plane normal vector, in standard deviations."""

_VIEW_FACTOR = 5.0
"""How many times the median view's residuals a view's may be: boards bend and pictures blur, but
not so much in one view alone."""

_PRINTED = 0.2
"""Share of the views in which a point must be off before it is thought to be misprinted."""

_ALIKE = 0.02
"""Relative difference of standard uncertainties that is none."""

_ROUNDING_PX = 1e-4
_ROUNDS = 6
_FEWEST = 6
"""Points that a view must keep."""


@dataclass(frozen=True)
class ScreenedBoards:
    """Boards that can be adjusted.

    Parameters
    ----------
    rig : Rig
        Without what was found wrong.
    state : RigState
        Camera and poses that fit the boards' points.
    wrong : tuple of str
        What was left out, in words.
    """

    rig: Rig
    state: RigState
    wrong: tuple[str, ...]


def screened_boards(rig: Rig) -> ScreenedBoards:
    """Leave out what is wrong in stage board.

    Raises
    ------
    UntrustworthyError
        If the views give no camera, or hardly a view is right.
    """
    given = rig
    rig, wrong = _with_poses(rig)
    solution = boards_alone(rig)
    for _ in range(_ROUNDS):
        mask, lost = _wrong_points(rig, solution.state)
        if not (mask.any() or lost.any()):
            break
        views = rig.observations.board
        wrong += _named(views, mask, lost, _sizes(rig, solution.state))
        if (~lost).sum() < 1 or lost.mean() > 0.5:
            raise UntrustworthyError(
                "board",
                f"{lost.sum()} of {len(views)} views disagree with the others, so that it cannot "
                "be told which are right",
                "check columns, rows and pitch_mm under [board] in rig.toml, and that all "
                "pictures come from one camera with one focus",
            )
        rig = with_board_views(rig, views.without(mask).take(~lost))
        solution = boards_alone(rig)
    rig, solution = _honestly_weighed(rig, solution)
    state = solution.state
    line, stray = screened_lines(rig, state)
    lined = with_board_views(rig, replace(rig.observations.board, line=line))
    mirrored = mirrored_views(rig, lined)
    if mirrored:  # they have pulled at camera and sheet
        views = given.observations.board
        right = np.array([name not in mirrored for name in views.names])
        again = screened_boards(with_board_views(given, views.take(right)))
        return replace(again, wrong=(*mirrored.values(), *again.wrong))
    return ScreenedBoards(lined, state, (*wrong, *stray))


def _honestly_weighed(rig: Rig, solution: Solution[RigState]) -> tuple[Rig, Solution[RigState]]:
    """The rig with standard uncertainties of the points that hold what no detector can know.

    A detector derives them from the grey values' noise. Where the residuals are larger, something
    else moves the points as well – print, light, lens – and moves all of them alike.
    """
    views, sizes = rig.observations.board, _sizes(rig, solution.state)
    std = views.stds[views.seen]
    if not np.isfinite(std).all() or np.ptp(std) <= _ALIKE * std.mean():
        return rig, solution
    freedom = max(2 * len(std) - 6 * len(views), 1)
    excess = max(float(np.nansum(sizes**2)) / freedom - float(np.mean(std**2)), 0.0)
    if excess <= _ALIKE * float(np.mean(std**2)):
        return rig, solution
    rig = with_board_views(rig, replace(views, std=np.sqrt(views.stds**2 + excess)))
    return rig, boards_alone(rig)


def with_board_views(rig: Rig, views: BoardViews) -> Rig:
    """The rig with other views of boards."""
    return replace(rig, observations=replace(rig.observations, board=views))


def _with_poses(rig: Rig) -> tuple[Rig, tuple[str, ...]]:
    """The rig without views that show too little of the board for a pose."""
    views = rig.observations.board
    enough = views.seen.sum(axis=1) >= _FEWEST
    if isinstance(rig.board, PlanarBoard) and rig.camera is None:
        enough &= gives_homography(rig.board.points, views.uv)
    if not enough.any():
        raise UntrustworthyError(
            "board",
            f"no view shows {_FEWEST} points of the board that are not on one line",
            "take pictures in which the whole board is seen",
        )
    if enough.all():
        return rig, ()
    names = [name for name, good in zip(views.names, enough, strict=True) if not good]
    words = tuple(f"view {name} of stage board (too few points)" for name in names)
    return with_board_views(rig, views.take(enough)), words


def _sizes(rig: Rig, state: RigState) -> Array:
    """Reprojection errors ``(N, M)``, px; NaN where not seen."""
    return np.asarray(np.linalg.norm(point_errors(rig, state), axis=-1))


def _wrong_points(rig: Rig, state: RigState) -> tuple[np.ndarray, np.ndarray]:
    """Masks ``(N, M)`` of wrong points in right views, and ``(N,)`` of wrong views."""
    sizes = _sizes(rig, state)
    seen = np.isfinite(sizes)
    own = np.sqrt(np.nanmedian(np.where(seen, sizes, np.nan) ** 2, axis=1)) / _PER_NORMAL
    typical = max(float(np.median(own)), _ROUNDING_PX)
    lost = own > _VIEW_FACTOR * typical
    scale = np.maximum(np.where(lost, typical, own), typical)
    limit = np.sqrt(float(chdtri(2, FALSE_ALARM / max(int(seen.sum()), 1)))) * scale
    mask = seen & (np.nan_to_num(sizes) > limit[:, None]) & ~lost[:, None]
    # what is off in many views is off on the board: no detection is wrong (`printed_points`)
    mask &= mask.sum(axis=0) < np.maximum(2, _PRINTED * seen.sum(axis=0))
    left = (seen & ~mask).sum(axis=1)
    lost |= left < np.maximum(_FEWEST, 0.5 * seen.sum(axis=1))
    return mask & ~lost[:, None], lost


def _named(views: BoardViews, mask: np.ndarray, lost: np.ndarray, sizes: Array) -> tuple[str, ...]:
    words = []
    for index, name in enumerate(views.names):
        where = f"view {name} of stage board"
        if lost[index]:
            size = float(np.sqrt(np.nanmean(sizes[index] ** 2) / 2.0))
            words.append(f"{where} (residuals {size:.2g} px)")
        elif mask[index].any():
            numbers = np.flatnonzero(mask[index])
            size = float(sizes[index][numbers].max())
            which = ", ".join(str(n) for n in numbers[:8]) + (" …" if len(numbers) > 8 else "")
            points = "points" if len(numbers) > 1 else "point"
            words.append(f"{points} {which} of {where} ({size:.2g} px off)")
    return tuple(words)
