"""Sheets that were computed with a camera held: what the camera's own error does to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.components import CORNER
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.uncertainty import Influence, chained
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.rig import Rig


def refuse_nothing_left(rig: Rig) -> None:
    """Refuse boards without a line of light whose camera is held.

    Raises
    ------
    UntrustworthyError
        If neither camera nor sheet is to be calibrated.
    """
    if rig.camera is not None and not rig.lasers:
        raise UntrustworthyError(
            "board",
            "no line of light was found on the boards that lies in one sheet with others, so that "
            "with a camera that is known already nothing is left to calibrate",
            "take pictures with the laser line across the board, held at 5 or more different "
            "places and tilts, or calibrate the camera from these views: leave out --camera",
        )


def by_held_camera(fit: Fit, names: tuple[str, ...]) -> tuple[Array, Fit]:
    """How estimates move with the camera that was held, ``(Q, P)``, and the fit in which it would
    not be."""
    own = fit.adjustment.parameters
    every = (*names, *own)
    adjustment = fit.noise.adjustment(fit.rig, fit.adjustment.stages, every, fit.state)
    wide = replace(fit, adjustment=adjustment)
    information = wide.model().information
    first = len(names)
    return -np.linalg.solve(information[first:, first:], information[first:, :first]), wide


def by_camera(
    camera: Fit, sheet: Fit, names: tuple[str, ...], sheets: tuple[str, ...]
) -> tuple[Array, Array | None]:
    """How the sheets move with the camera that they were computed with, ``(Q, P)``, and the
    covariance ``(P, Q)`` that the boards' points bring, which both steps saw."""
    slope, wide = by_held_camera(sheet, names)
    boards = wide.adjustment.boards
    if boards is None:
        return slope, None
    points = replace(boards, lines=None).contrasts(sheet.state, names)
    both = wide.contrasts[-1]
    rows = points.across.shape[2]
    variance = sheet.noise.variances[CORNER]
    pulls = [
        np.linalg.solve(group.covariance(sheet.noise.variances), group.by_shared)
        for group in (points, both)
    ]
    first = np.swapaxes(pulls[0], 1, 2) @ points.across
    second = np.swapaxes(pulls[1], 1, 2) @ both.across[:, :, :rows]
    common = variance * np.einsum("npr,nqr->pq", first, second)
    joined = np.zeros((len(names), len(names) + len(sheets)))
    joined[np.ix_(points.columns, both.columns)] = common
    gain = camera.covariance[camera.adjustment.columns_of(names)]
    gain = gain[:, camera.adjustment.columns_of(names)]
    return slope, gain @ joined[:, len(names) :] @ sheet.covariance


def with_known_camera(fit: Fit, second: Influence, covariance: Covariance) -> Influence:
    """The influence on the estimates of a fit, and on the camera that was known before it.

    Parameters
    ----------
    fit : Fit
    second : Influence
        On its estimates.
    covariance : Covariance
        Of the known camera's parameters, among others.
    """
    names = tuple(name for name in covariance.parameters if name.startswith("camera."))
    slope, _ = by_held_camera(fit, names)
    chosen = fit.adjustment.columns_of(second.names)
    markers = second.by_marker.shape[1]
    known = Influence(
        names,
        (("known camera", None, covariance.block(names)),),
        np.zeros((len(names), markers)),
        np.zeros(len(names)),
        np.zeros((len(names), 0, 3)),
    )
    return chained(known, second, slope[chosen])
