"""What of the boards' views does not belong to the rest: points, views, and parts of lines.

A board shows far more points than its pose needs, so each view can be judged by itself once a
camera is there. Lines are judged in three steps: what lies off the board, what lies off the
straight line that the rest forms, and whole lines that do not lie in the sheet of the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.board_closed_form import gives_homography
from sheetoflight.calibration.board_planes import faces_in_space, on_faces, point_errors
from sheetoflight.calibration.board_start import boards_alone
from sheetoflight.calibration.line_consensus import (
    FacePlanes,
    agreed_pieces,
    cut_into_pieces,
    grown,
    whole_lines,
)
from sheetoflight.calibration.lines_on_boards import reduced_lines
from sheetoflight.calibration.mirrored_views import mirrored_views
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.wrong_points import FALSE_ALARM
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import Solution
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.rig import Rig

_PER_NORMAL = 1.1774
"""Median length of a plane normal vector, in standard deviations."""

_VIEW_FACTOR = 5.0
"""How many times the median view's residuals a view's may be: boards bend and pictures blur, but
not so much in one view alone."""

_PRINTED = 0.2
"""Share of the views in which a point must be off before it is thought to be misprinted."""

_PLENTY = 15
"""Points of a line on the pattern that tell which way it goes on beside it."""

_ON_EDGE = 0.1
"""Distance from a line of the pattern, in pitches, within which a line runs along it."""

_ENOUGH = 200
"""Points that tell where a line runs, as well as more do."""

_SHOWN = 5
"""Names that are listed one by one."""

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
    lined, stray = _in_the_sheets(rig, state)
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


def _in_the_sheets(rig: Rig, state: RigState) -> tuple[Rig, tuple[str, ...]]:
    """The rig with those parts of the lines that lie on the boards and in one sheet."""
    views = rig.observations.board
    line = views.line
    if not len(line) or rig.board is None:
        return rig, ()
    rays, groups = state.camera.unproject(line.uv), line.groups()
    points = _in_board_frames(rig.board, line, groups, state.poses["board"], rays)
    printed = on_printed_part(rig, line, points)
    focal = 0.5 * (state.camera.alpha + state.camera.beta)
    kept = np.zeros(len(line), dtype=bool)
    lost: list[str] = []
    edges: list[str] = []
    for laser in np.unique(line.laser):
        lines = [own for own in groups if line.laser[own[0]] == laser]
        images = [focal * rays[own, :2] for own in lines]
        whole = whole_lines(images, [printed[own] for own in lines])
        # on its pattern the board is sure to be, beside it only the others can tell
        lines = [
            own if straight is not None else _from_the_pattern(own, image, printed[own])
            for own, image, straight in zip(lines, images, whole, strict=True)
        ]
        cuts = cut_into_pieces(
            [rays[own, :2] for own in lines], focal, [printed[own] for own in lines], whole
        )
        pieces = [
            [piece for piece in cut if not _is_printed_edge(rig.board, points[own[piece.points]])]
            for own, cut in zip(lines, cuts, strict=True)
        ]
        faces = _faces_of(rig.board, line, lines, state.poses["board"])
        chosen = agreed_pieces(pieces, FacePlanes(*faces), focal, len(views))
        for own, cut, whole_cut, number in zip(lines, pieces, cuts, chosen, strict=True):
            if number is None:
                names = edges if whole_cut and not cut else lost
                names.append(views.names[line.view[own[0]]])
            else:
                kept[own[cut[number].points]] = True
    left = line.take(kept)
    if len(left):
        reduced_lines(left, state.camera, rays[kept])
    return with_board_views(rig, replace(views, line=left)), _lost_lines(lost, edges, kept.any())


def _is_printed_edge(board: Board, points: Array) -> bool:
    """Whether points ``(K, 3)`` of a line, in the board's frame, run along a line of its pattern:
    what a picture without laser light shows best. They agree on a sheet, for boards held alike."""
    if not isinstance(board, PlanarBoard):
        return False
    some = points[:: max(len(points) // _ENOUGH, 1), :2]
    places = np.sort(some / board.pitch_mm, axis=0)
    low, middle, high = places[(len(places) * np.array([0.05, 0.5, 0.95])).astype(int)]
    spread = high - low
    aligned = (np.abs(middle - np.rint(middle)) < _ON_EDGE) & (spread < 2.0 * _ON_EDGE)
    return bool((aligned & (spread[::-1] > 1.0)).any())


def _from_the_pattern(own: np.ndarray, points: Array, printed: np.ndarray) -> np.ndarray:
    """Those of a line's points that may lie on its board: all, or what goes on from its pattern."""
    return own[grown(points, printed)] if printed.sum() >= _PLENTY else own


def _lost_lines(lost: list[str], edges: list[str], others: bool | np.bool_) -> tuple[str, ...]:
    """In words, the lines of views that are left out, and those along lines of the pattern."""
    if not others:
        every = [*lost, *edges]
        reason = "in no common sheet: right if the laser was off"
        return (f"what looks like a line in {_views(every)} of stage board ({reason})",) * bool(every)
    beside = "not in the others' sheet"
    along = (
        "along the board's own rows or columns, whose edges pull at light and look like it – lay "
        "the line askew to the squares"
    )
    return tuple(
        f"the line{'s' * (len(names) > 1)} of {_views(names)} of stage board ({reason})"
        for names, reason in ((lost, beside), (edges, along))
        if names
    )


def _views(names: list[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"view{'s' * (len(names) > 1)} {', '.join(names[:_SHOWN])}{more}"


def _faces_of(
    board: Board, line: LinePixels, groups: list[np.ndarray], poses: Array
) -> tuple[Array, Array]:
    """The planes of the faces on which lines lie; see `faces_in_space`."""
    firsts = np.array([own[0] for own in groups], dtype=int)
    return faces_in_space(board, poses, line.view[firsts], line.face[firsts])


def _in_board_frames(
    board: Board, line: LinePixels, groups: list[np.ndarray], poses: Array, rays: Array
) -> Array:
    """Where the rays ``(P, 3)`` of lines meet their faces, in the frames of the boards, mm."""
    points = np.empty_like(rays)
    for own, normal, offset in zip(groups, *_faces_of(board, line, groups, poses), strict=True):
        pose = poses[line.view[own[0]]]
        there = on_faces(rays[None, own], normal[None], np.array([offset]))[0]
        points[own] = (there - pose[:, 3]) @ pose[:, :3]
    return points


def on_printed_part(rig: Rig, line: LinePixels, points: Array) -> np.ndarray:
    """Mask ``(P,)`` of a line's points, given in their boards' frames, that lie within one pitch
    of the pattern; of a solid body's faces, within the box about the face's points."""
    assert rig.board is not None
    if isinstance(rig.board, PlanarBoard):
        low, high = rig.board.points.min(axis=0), rig.board.points.max(axis=0)
        margin = np.array([*rig.board.pitch_mm, np.inf])
        with np.errstate(invalid="ignore"):
            return np.asarray(((points > low - margin) & (points < high + margin)).all(axis=1))
    boxes = np.array(
        [
            (corners.min(axis=0), corners.max(axis=0))
            for corners in (rig.board.points[list(face)] for face in rig.board.face_points)
        ]
    )
    size = 1e-3 * float(np.ptp(rig.board.points, axis=0).max())
    low, high = boxes[line.face, 0] - size, boxes[line.face, 1] + size
    with np.errstate(invalid="ignore"):
        return np.asarray(((points >= low) & (points <= high)).all(axis=1))
