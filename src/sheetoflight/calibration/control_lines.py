"""What the noise of lines of light does to a sheet that a closed form laid through them.

Three kinds, as the adjustment has them (`lines_on_boards`): single points off their line, lines
that wind, and lines whose ends lie off the sheet. Each shifts a line's pixels across it in a
pattern of its own, and the sheet's response to a shift of each pixel adds these up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander

from sheetoflight.calibration.board_planes import faces_in_space, on_faces
from sheetoflight.calibration.components import LINE, SHAPE, STRIPE
from sheetoflight.calibration.control_forms import ControlForm, Sights
from sheetoflight.calibration.control_motions import moved_by
from sheetoflight.calibration.lines_on_boards import SHAPES
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.rig import Rig

_STEP_PX = 0.01


@dataclass(frozen=True, eq=False)
class _AlongLines:
    """Pixels of lines: across which way their line lies ``(P, 2)``, and where along it they are,
    from −1 to 1 ``(P,)``."""

    across: Array
    place: Array


def line_shares(
    rig: Rig, laser: int, form: ControlForm, slopes: Array, state: RigState, variances: Array
) -> dict[int, Array]:
    """Covariances ``(3, 3)`` of a sheet's tilts and distance by kind of the lines' noise.

    Parameters
    ----------
    rig : Rig
        Of boards.
    laser : int
        Whose sheet it is.
    form : ControlForm
    slopes : (3, K, 3) array
        By `control_motions.plane_slopes`.
    state : RigState
        With the sheets.
    variances : (7,) array
        Of the `COMPONENTS`.
    """
    line = rig.observations.board.line
    chosen = np.flatnonzero(line.laser == laser)
    own, weights = line.take(chosen), line.proportions[chosen]
    count = int(form.lines.max()) + 1
    along = _along(own.uv, form.lines, count)
    response = _responses(form, slopes, along, count)
    windings = legvander(along.place, max(SHAPES))[:, SHAPES] * np.sqrt(2 * np.array(SHAPES) + 1)
    ends = 0.5 * np.stack([1.0 - along.place, 1.0 + along.place], axis=1)
    lifted = ends * _lift(rig, own, state, laser, along.across)[:, None]
    single = response * weights
    return {
        STRIPE: variances[STRIPE] * single @ single.T,
        LINE: variances[LINE] * _squares(response, lifted, form.lines, count),
        SHAPE: variances[SHAPE] * _squares(response, windings, form.lines, count),
    }


def _along(uv: Array, lines: np.ndarray, count: int) -> _AlongLines:
    across, place = np.zeros_like(uv), np.zeros(len(uv))
    for number in range(count):
        own = np.flatnonzero(lines == number)
        offset = uv[own] - uv[own].mean(axis=0)
        way = np.linalg.svd(offset, full_matrices=False)[2][0]
        at = offset @ way
        low, high = at.min(), at.max()
        across[own] = -way[1], way[0]
        place[own] = (2.0 * at - low - high) / max(high - low, 1e-300)
    return _AlongLines(across, place)


def _responses(form: ControlForm, slopes: Array, along: _AlongLines, count: int) -> Array:
    """``(3, P)``: how the sheet moves with the shift of each pixel across its line, per px.

    Where only a line's total least-squares fit enters, that moves by the mean of the shifts and
    by their slope along the line.
    """

    def shifted(pattern: Array) -> Array:
        def sights(size: float) -> Sights:
            uv = form.sights.line_uv + size * pattern[:, None] * along.across
            return replace(form.sights, line_uv=uv)

        return moved_by(form, slopes, sights, _STEP_PX)

    if form.by_pixel:
        return shifted(np.ones(len(along.place)))
    points = np.bincount(form.lines, minlength=count)
    mean = np.bincount(form.lines, along.place, count) / points
    slant = along.place - mean[form.lines]
    spread = np.maximum(np.bincount(form.lines, slant**2, count), np.finfo(float).tiny)
    offset, tilt = (
        _by_line(shifted(pattern), form.line, count) for pattern in (np.ones_like(slant), slant)
    )
    return (offset / points)[:, form.lines] + (tilt / spread)[:, form.lines] * slant


def _by_line(values: Array, line: np.ndarray, count: int) -> Array:
    """Sums over the control points ``(q, K)`` of each line ``(q, count)``."""
    found = np.zeros((count, len(values)))
    np.add.at(found, line, values.T)
    return found.T


def _squares(response: Array, patterns: Array, lines: np.ndarray, count: int) -> Array:
    """``Σ (Σ response pattern)²`` over lines and patterns, of unit variance each."""
    moved = np.stack([_by_line(response * pattern, lines, count) for pattern in patterns.T])
    return np.einsum("jql,jrl->qr", moved, moved)


def _lift(rig: Rig, line: LinePixels, state: RigState, laser: int, across: Array) -> Array:
    """``(P,)``: how far the picture of the line moves across itself for a mm of the sheet along
    its normal, px; 0 for pixels whose ray misses the board."""
    assert rig.board is not None
    sheet = state.frames[laser][:, 2]
    face, offset = faces_in_space(rig.board, state.poses["board"], line.view, line.face)
    points = on_faces(state.camera.unproject(line.uv), face, offset)
    aside = np.cross(face, normalised(np.cross(sheet, face)))
    way = aside / (aside @ sheet)[:, None]
    there = np.isfinite(points).all(axis=1)
    by_point = state.camera.project_with_jacobians(points[there], ())[1]
    lift = np.zeros(len(points))
    lift[there] = np.einsum("pi,pij,pj->p", across[there], by_point, way[there])
    return lift
