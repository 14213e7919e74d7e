"""Sheets of light that are not flat: whether the lines on boards say so, and the fit that follows.

A cheap line lens spreads the light to a flat cone. Its lines on flat boards bow all alike, and lie
beside those of any plane. Three further parameters a sheet describe that to second order
(`model.sheet_curvature`). They are estimated only where chance would hardly make the lines look so
(Wald's test), with the lines' windings and offsets counted as noise of which there may be some: a
board that is bent in one view, or a line that winds, is no reason to bend the sheet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.board_evidence import BoardEvidence
from sheetoflight.calibration.board_planes import ends_on_boards, faces_in_space, on_faces
from sheetoflight.calibration.components import COMPONENTS, LINE, SHAPE
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.printed_points import print_errors
from sheetoflight.calibration.rig_state import RigState, SheetBends, bend_names
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import reduced_equations, scaled_inverse
from sheetoflight.estimation.variance_components import reduced_model, variance_components
from sheetoflight.geometry.directions import Array
from sheetoflight.model.sheet_curvature import SheetCurvature

_ODDS = 1e-4
"""Odds of chance below which a sheet is taken to be curved."""

_PER_LINE = 2
"""What a line says for certain: where it is and which way it runs. Its windings are noise that
all of its points share."""

_PARTS = 3
_NOISE_PARTS = (LINE, SHAPE)


def curved(fit: Fit, noise: NoiseModel) -> tuple[Fit, tuple[str, ...]]:
    """The fit with curved sheets where the lines ask for them; else the fit as it is.

    Parameters
    ----------
    fit : Fit
        Of flat sheets, with everything in it.
    noise : NoiseModel
        As it was before anything was adjusted.

    Returns
    -------
    fit : Fit
    told : tuple of str
        What was found, in words.
    """
    boards = fit.adjustment.boards
    if boards is None or boards.lines is None or not len(boards.lines):
        return fit, ()
    state = replace(fit.state, bends=_unbent(boards, fit.state))
    odds = _odds_of_flat(fit, state)
    bent = np.flatnonzero(odds <= _ODDS)
    if not len(bent):
        return fit, ()
    for reason in (_bent_board(boards, fit.state), _rods(fit)):
        if reason:
            return fit, tuple(_kept_flat(fit.rig.lasers[k], odds[k], reason) for k in bent)
    names = bend_names(len(odds))
    own = (name for k in bent for name in names[_PARTS * k : _PARTS * (k + 1)])
    free = (*fit.adjustment.parameters, *own)
    try:
        found = fitted(fit.rig, fit.adjustment.stages, free, state, noise, "board")
    except UntrustworthyError:
        found = fit
    if found is fit or not found.solution.converged:
        reason = "its curvature does not come out of these lines – take more views"
        return fit, tuple(_kept_flat(fit.rig.lasers[k], odds[k], reason) for k in bent)
    return found, _in_words(found, odds)


def _bent_board(boards: BoardEvidence, state: RigState) -> str:
    """A bent board bows its lines as a curved sheet would; its points tell that it is bent."""
    bow = print_errors(boards, state).out_of_plane_mm
    if not bow:
        return ""
    return (
        f"the board itself is bent (points {bow:.2g} mm out of its plane), which looks the same – "
        "use a flat board"
    )


def _rods(fit: Fit) -> str:
    if not {"plane", "crossing"} & set(fit.adjustment.stages):
        return ""
    return "rods can tell planes only – calibrate with the boards alone"


def _kept_flat(laser: str, odds: float, reason: str) -> str:
    return (
        f"the lines of the sheet {laser} are bent as those of a curved one (odds of a flat one: "
        f"{odds:.0e}), yet it is taken to be flat: {reason}"
    )


def _unbent(boards: BoardEvidence, state: RigState) -> SheetBends:
    """Flat sheets, ready to bend about the middle of their lines."""
    lines = boards.lines
    assert lines is not None
    faces = faces_in_space(boards.board, state.poses["board"], lines.view, lines.face)
    ends = on_faces(lines.ends, *faces)
    centres = state.distances[:, None] * state.frames[:, :, 2]
    for number in range(len(centres)):
        points = ends[lines.laser == number].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            centres[number] = points.mean(axis=0)
    return SheetBends(centres, np.zeros((len(centres), _PARTS)))


def _odds_of_flat(fit: Fit, state: RigState) -> Array:
    """Odds ``(S,)`` that flat sheets look as curved as these: Wald's test of each one's bends at
    0, those of the others being free."""
    names = bend_names(len(state.distances))
    parameters, stages = (*fit.adjustment.parameters, *names), fit.adjustment.stages
    boards = fit.adjustment.boards
    assert boards is not None
    assert boards.lines is not None
    freedom = _PER_LINE * len(boards.lines) - _PARTS * (len(state.distances) + len(names) // _PARTS)
    if freedom < 1:
        return np.ones(len(state.distances))
    acting = np.isin(np.arange(len(COMPONENTS)), _NOISE_PARTS)
    points_alone = fit.noise.with_variances(np.where(acting, 0.0, fit.noise.variances))
    wide = points_alone.adjustment(fit.rig, stages, parameters, state)
    try:
        odds = _odds(*reduced_equations(wide.blocks(state), len(parameters)), len(names), freedom)
        if (odds > _ODDS).all():  # noise of whole lines would hardly make them smaller
            return odds
        noise = replace(fit.noise, free=fit.noise.free | acting)
        groups = noise.contrasts(wide, state, {})
        start = np.where(acting, np.maximum(noise.variances, 1e-12), noise.variances)
        sizes = variance_components(groups, len(parameters), start, noise.free).sizes
        model = reduced_model(groups, len(parameters), sizes)
        return _odds(model.information, model.gradient, len(names), freedom)
    except np.linalg.LinAlgError:  # the lines do not tell
        return np.ones(len(state.distances))


def _odds(information: Array, gradient: Array, bends: int, freedom: int) -> Array:
    """Odds of chance of each sheet's bends, the last of the parameters, as large as found."""
    covariance, own = scaled_inverse(information)[0], slice(len(gradient) - bends, None)
    found = -(covariance @ gradient)[own].reshape(-1, _PARTS)
    sheets = range(len(found))
    spread = covariance[own, own].reshape(len(found), _PARTS, len(found), _PARTS)
    parts = np.array([found[k] @ np.linalg.solve(spread[k, :, k], found[k]) for k in sheets])
    return np.asarray(fdtrc(_PARTS, freedom, np.maximum(parts, 0.0) / _PARTS))


def _in_words(fit: Fit, odds: Array) -> tuple[str, ...]:
    """How far each curved sheet bends where it was seen."""
    ends, laser = ends_on_boards(fit.rig, fit.state)
    told = []
    for number, plane in enumerate(fit.state.light_planes(fit.rig.lasers)):
        points = ends[laser == number].reshape(-1, 3)
        if plane.curvature is None or not len(points):
            continue
        bend = float(np.nanmax(np.abs(_from_best_plane(plane.curvature, points))))
        told.append(
            f"the sheet {plane.name} is curved: up to {bend:.2g} mm off a plane where its lines "
            f"are (odds of a flat one looking so: {odds[number]:.0e}); it is calibrated as curved "
            "– with --flat a plane is fitted all the same"
        )
    return tuple(told)


def _from_best_plane(bend: SheetCurvature, points: Array) -> Array:
    """How far the sheet at points ``(P, 3)`` lies from the plane that it is nearest to, mm."""
    points = points[np.isfinite(points).all(axis=1)]
    heights = bend.heights(points)
    design = np.column_stack([np.ones(len(points)), bend.places(points)])
    return heights - design @ np.linalg.lstsq(design, heights, rcond=None)[0]
