"""Sheets of light that are not flat: whether the lines on boards say so, and the fit that follows.

A cheap line lens spreads the light to a flat cone. Its lines on flat boards bow all alike, and lie
beside those of any plane. Three further parameters a sheet describe that to second order
(`model.sheet_curvature`). They are estimated only where chance would hardly make the lines look so
(Wald's test), with the lines' windings and offsets counted as noise of which there may be some: a
board that is bent in one view, or a line that winds, is no reason to bend the sheet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.board_planes import ends_on_boards
from sheetoflight.calibration.components import COMPONENTS, LINE, SHAPE
from sheetoflight.calibration.fitting import Fit, fitted
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import RigState, SheetBends, bend_names
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import scaled_inverse
from sheetoflight.estimation.variance_components import (
    Contrasts,
    reduced_model,
    variance_components,
)
from sheetoflight.geometry.directions import Array

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
    state = replace(fit.state, bends=_unbent(fit))
    odds = _odds_of_flat(fit, state)
    if odds > _ODDS:
        return fit, ()
    if fit.adjustment.stages:
        return fit, (_rods_are_flat(odds),)
    names = (*fit.adjustment.parameters, *bend_names(len(state.distances)))
    try:
        bent = fitted(fit.rig, {}, names, state, noise, "board")
    except UntrustworthyError:
        return fit, ()
    if not bent.solution.converged:
        return fit, ()
    return bent, _in_words(bent, odds)


def _unbent(fit: Fit) -> SheetBends:
    """Flat sheets, ready to bend about the middle of their lines."""
    state = fit.state
    ends, laser = ends_on_boards(fit.rig, state)
    centres = state.distances[:, None] * state.frames[:, :, 2]
    for number in range(len(centres)):
        points = ends[laser == number].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            centres[number] = points.mean(axis=0)
    return SheetBends(centres, np.zeros((len(centres), _PARTS)))


def _odds_of_flat(fit: Fit, state: RigState) -> float:
    """Odds that flat sheets look as curved as these: Wald's test of the bends at 0."""
    adjustment, names = fit.adjustment, bend_names(len(state.distances))
    boards = adjustment.boards
    assert boards is not None
    assert boards.lines is not None
    parameters = (*adjustment.parameters, *names)
    wide = Adjustment(
        adjustment.positions,
        adjustment.stages,
        adjustment.std,
        parameters,
        adjustment.whiteners,
        boards,
    )
    freedom = _PER_LINE * len(boards.lines) - _PARTS * (len(state.distances) + len(names) // _PARTS)
    if freedom < 1:
        return 1.0
    acting = np.isin(np.arange(len(COMPONENTS)), _NOISE_PARTS)
    noise = replace(fit.noise, free=fit.noise.free | acting)
    groups = noise.contrasts(wide, state, {})
    sizes, count = fit.noise.variances, len(names)
    try:
        without = np.where(acting, 0.0, sizes)
        odds = _odds(groups, len(parameters), without, count, freedom)
        if odds > _ODDS:  # any noise of whole lines would only make them larger
            return odds
        start = np.where(acting, np.maximum(sizes, 1e-12), sizes)
        sizes = variance_components(groups, len(parameters), start, noise.free).sizes
        return _odds(groups, len(parameters), sizes, count, freedom)
    except np.linalg.LinAlgError:  # the lines do not tell
        return 1.0


def _odds(groups: Sequence[Contrasts], size: int, sizes: Array, bends: int, freedom: int) -> float:
    """Odds of chance of bends, the last of the parameters, as large as they come out."""
    model = reduced_model(groups, size, sizes)
    covariance = scaled_inverse(model.information)[0]
    own = slice(size - bends, size)
    found = -(covariance @ model.gradient)[own]
    squares = float(found @ np.linalg.solve(covariance[own, own], found))
    return float(fdtrc(bends, freedom, max(squares, 0.0) / bends))


def _in_words(fit: Fit, odds: float) -> tuple[str, ...]:
    """How far each sheet bends where it was seen."""
    ends, laser = ends_on_boards(fit.rig, fit.state)
    told = []
    for number, plane in enumerate(fit.state.light_planes(fit.rig.lasers)):
        points = ends[laser == number].reshape(-1, 3)
        if plane.curvature is None or not len(points):
            continue
        bend = float(np.nanmax(np.abs(_from_best_plane(plane.curvature.heights(points), points))))
        told.append(
            f"the sheet {plane.name} is curved: up to {bend:.2g} mm off a plane where its lines "
            f"are (odds of a flat one looking so: {odds:.0e}); it is calibrated as curved – if the "
            "board may be bent instead, use a flat one; with --flat a plane is fitted all the same"
        )
    return tuple(told)


def _from_best_plane(heights: Array, points: Array) -> Array:
    """What of heights at points ``(P, 3)`` no plane takes up."""
    there = np.isfinite(heights)
    design = np.column_stack([np.ones(there.sum()), points[there]])
    return heights[there] - design @ np.linalg.lstsq(design, heights[there], rcond=None)[0]


def _rods_are_flat(odds: float) -> str:
    return (
        f"the lines on the boards are bent as those of a curved sheet (odds of a flat one looking "
        f"so: {odds:.0e}), but rods lying in the sheet can tell planes only – calibrate with the "
        "boards alone to have it curved"
    )
