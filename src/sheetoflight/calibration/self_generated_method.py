"""Method self-generated: the sheet from points whose places in it a stage tells, the camera held.

`self_generated_fit` finds the sheet that fits best. Its uncertainty is that of the image points and
that of the camera that is held. The stage's places are taken as exact.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.components import COMPONENTS, CORNER
from sheetoflight.calibration.self_generated_fit import Placed, SheetFit, fitted_sheet
from sheetoflight.calibration.self_generated_noise import (
    Noise,
    estimated_noise,
    noise_of,
    odds_of_drop,
    worst_point,
)
from sheetoflight.calibration.weaknesses import LINEAR_LIMIT
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.covariance import PLANE_PARTS, Covariance, NoiseComponents, Source
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.rig import Rig

SELF_GENERATED = "self-generated"
STAGE = "board"

_APART = 16.0
"""Least difference of chi-squared between two sheets of which one is the right one."""

_MORE = "let the plate travel farther, use a wider one, or find its edges more sharply"

_DOUBT = 1e-3
"""Odds of good points, up to which the worst is called doubtful."""


def self_generated(rig: Rig) -> Calibration:
    """The sheet of light from a bare plate that a stage moves.

    Parameters
    ----------
    rig : Rig
        With a known camera, one laser, no board, and points of the line in stage board of which
        `LinePixels.places` tells the place in the sheet; points without one are left out.

    Returns
    -------
    Calibration
        With the camera as it was held, and its covariance carried on.

    Raises
    ------
    InputError
        If no camera is known, the rig has a board or several lasers, or no place is known.
    UntrustworthyError
        If the points do not determine the sheet, or leave two, their places are not square, or
        there are too few to tell the noise, which is not stated.
    """
    seen = placed_points(rig)
    fit = fitted_sheet(seen)
    plane = LightPlane(fit.normal, fit.distance, rig.lasers[0])
    noise = noise_of(fit, rig.pixel_std)
    if fit.rival < _APART * noise.pixel_std**2:
        raise UntrustworthyError(
            STAGE,
            "the points fit two sheets, one the other's mirror image",
            _MORE,
        )
    covariance = _covariance(fit, noise, plane.name)
    _refuse_vague(plane, covariance)
    return Calibration(
        method=SELF_GENERATED,
        camera=seen.camera,
        light_planes=(plane,),
        covariance=covariance,
        residuals=Residuals(
            rms_px=float(np.sqrt(np.mean(fit.residuals**2))),
            chi2_per_dof=noise.chi2_per_dof,
            views=_views(rig, fit),
        ),
        target=None,
        pixel_std=noise.pixel_std,
        warnings=(*noise.warnings, *_warnings(rig), *_doubtful(rig, fit)),
    )


def refuse_places(rig: Rig, method: str) -> None:
    """Refuse points of which a stage tells the place for a method that makes nothing of them.

    Raises
    ------
    InputError
        Naming the method that does.
    """
    if rig.board is None and len(rig.observations.board):
        raise InputError(
            f"method {method} makes nothing of points of the line whose places in the sheet are "
            "given (stage board, and rig.toml has no [board])",
            f"use --method {SELF_GENERATED} with --camera FILE, or describe the board in rig.toml",
        )


def placed_points(rig: Rig) -> Placed:
    """The points of known places, once all else that is needed is there.

    Raises
    ------
    InputError, UntrustworthyError
        As for `self_generated`.
    """
    if rig.board is not None:
        raise InputError(
            f"method {SELF_GENERATED} works on a bare plate, and rig.toml has a [board]",
            "leave [board] out, or use --method joint with the board",
        )
    line = rig.observations.board.line
    known = np.flatnonzero(np.isfinite(line.places).all(axis=1))
    if not known.size:
        raise InputError(
            f"method {SELF_GENERATED} needs points of the line whose places in the sheet are "
            "known, and there are none",
            "give rows of stage board, marker laser, in points.csv, with columns x and y in mm: x "
            "along the line, y by the stage",
        )
    if rig.camera is None:
        raise InputError(
            f"method {SELF_GENERATED} needs a camera that is known, and there is none",
            "calibrate the camera first, and give it: --camera camera.json",
        )
    if len(rig.lasers) != 1:
        raise InputError(
            f"method {SELF_GENERATED} finds one sheet, and the rig has {len(rig.lasers)} lasers",
            "give each laser a rig folder of its own",
        )
    line = line.take(known)
    _refuse_unseeable(rig, line.uv, line.view)
    return Placed(
        line.uv, line.places, line.proportions, line.view, rig.camera, rig.camera_covariance
    )


def _refuse_unseeable(rig: Rig, uv: Array, view: np.ndarray) -> None:
    """Refuse points that no picture of the camera can show."""
    assert rig.camera is not None
    names = rig.observations.board.names
    within = ((uv >= -0.5) & (uv <= np.array(rig.image_size) - 0.5)).all(axis=1)
    if not within.all():
        point = int(np.argmin(within))
        raise InputError(
            f"stage {STAGE}, view {names[view[point]]}: a point of the line at "
            f"({uv[point, 0]:.6g}, {uv[point, 1]:.6g}) lies outside the picture of "
            f"{rig.image_size[0]} × {rig.image_size[1]} px",
            "check the point, and image_size in rig.toml",
        )
    there = np.isfinite(rig.camera.unproject(uv)).all(axis=1)
    if not there.all():
        raise UntrustworthyError(
            STAGE,
            f"view {names[view[int(np.argmin(there))]]} has a point where the known camera's lens "
            "model sees nothing",
            "give a camera that was calibrated up to the picture's corners",
        )


def _covariance(fit: SheetFit, noise: Noise, laser: str) -> Covariance:
    """Of the camera that was held, and of the sheet, by both their causes."""
    known = fit.seen.camera_names
    names = (*known, *(f"{laser}.{part}" for part in PLANE_PARTS))
    pixels = np.zeros((len(names), len(names)))
    of_plane = fit.plane_by_pose @ fit.pose_covariance @ fit.plane_by_pose.T
    pixels[len(known) :, len(known) :] = noise.pixel_std**2 * of_plane
    sources = [Source(STAGE, pixels, None if noise.freedom is None else COMPONENTS[CORNER])]
    if known:
        by_camera = np.vstack([np.eye(len(known)), fit.plane_by_pose @ fit.pose_by_camera])
        held = by_camera @ fit.seen.camera_matrix @ by_camera.T
        sources.append(Source("known camera", held))
    components = NoiseComponents()
    if noise.freedom is not None:
        relative = np.array([[2.0 / noise.freedom]])
        components = NoiseComponents((COMPONENTS[CORNER],), (noise.pixel_std,), relative)
    return Covariance(
        names, np.sum([s.matrix for s in sources], axis=0), tuple(sources), components
    )


def _refuse_vague(plane: LightPlane, covariance: Covariance) -> None:
    """Refuse a sheet that is known too badly for a covariance to describe it."""
    std = [covariance.std(f"{plane.name}.{part}") for part in PLANE_PARTS]
    parts = {"direction": np.linalg.norm(std[:3]), "distance": std[3] / plane.distance_mm}
    for what, relative in parts.items():
        if not relative <= LINEAR_LIMIT:
            raise UntrustworthyError(
                STAGE,
                f"the points leave the {what} of the sheet uncertain by {relative:.0%} (limit "
                f"{LINEAR_LIMIT:.0%})",
                _MORE,
            )


def _views(rig: Rig, fit: SheetFit) -> tuple[ViewResiduals, ...]:
    """The points of every view, the views filled up with NaN to equal lengths."""
    names, numbers = rig.observations.board.names, fit.seen.view
    most = int(np.bincount(numbers).max())

    def of(view: int, values: Array) -> Array:
        own = values[numbers == view]
        return np.pad(own, ((0, most - len(own)), (0, 0)), constant_values=np.nan)

    parts = (fit.seen.uv, fit.residuals, fit.points)
    return tuple(
        ViewResiduals(STAGE, names[view], *(of(view, values) for values in parts))
        for view in np.unique(numbers).tolist()
    )


def _warnings(rig: Rig) -> tuple[str, ...]:
    """What plays no part."""
    told = []
    line = rig.observations.board.line
    left = int((~np.isfinite(line.places).all(axis=1)).sum())
    if left:
        told.append(f"not used: {left} of {len(line)} points of the line, whose place is not known")
    others = [stage for stage in rig.observations.counts() if stage != STAGE]
    if others:
        told.append(f"the views of stage {', '.join(others)} play no part in this method")
    return tuple(told)


def _doubtful(rig: Rig, fit: SheetFit) -> tuple[str, ...]:
    """The point without which all others fit far better, if there is one."""
    seen, point = fit.seen, worst_point(fit)
    others = seen.take(np.arange(len(seen.uv)) != point)
    try:
        rest = estimated_noise(fitted_sheet(others))
    except UntrustworthyError:
        return ()
    every = estimated_noise(fit)
    if every is None or rest is None or odds_of_drop(every, rest, len(seen.uv)) > _DOUBT:
        return ()
    u, v = seen.uv[point]
    return (
        f"the point at ({u:.6g}, {v:.6g}) of view {rig.observations.board.names[seen.view[point]]} "
        f"does not fit: the residuals tell {every.pixel_std:.2g} px of noise, and without it "
        f"{rest.pixel_std:.2g} px – check it and its place, or remove it",
    )
