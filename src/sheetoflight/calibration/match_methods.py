"""The methods that need no target: the camera alone, from points matched between pictures.

A scene of unknown points has no scale. What comes out is the camera with its uncertainty; a sheet
of light, and lengths, need a target or a board, for which this camera can then be held.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from sheetoflight.calibration.components import COMPONENTS, PIXEL
from sheetoflight.calibration.match_screening import ScreenedMatches, screened_matches
from sheetoflight.calibration.moving_camera import moving_camera
from sheetoflight.calibration.noise import chi2_limit
from sheetoflight.calibration.rotating_camera import rotating_camera
from sheetoflight.calibration.self_calibration import Pixels, SelfCalibration
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import proportions
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.covariance import Covariance, NoiseComponents, Source
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.rig import Rig

STAGE = "match"
ROTATING, MOVING = "rotating-camera", "moving-camera"

_SHARED = {ROTATING: 5, MOVING: 10}
"""Points that a view must share with some other, to be placed beside it at all."""

_NAMED = 4
_MANY_WRONG = 0.1
_COARSE_PX = 1.0
_SHOWN = 4.0
"""Standard uncertainties of a k1 that is not 0: by chance once in 16 000 sets."""

_OFF = 2.0
"""Standard uncertainties of alpha that a neglected distortion may bring about."""

_MODELS: Mapping[Pixels, str] = {
    "skewed": "alpha, beta, the skew and the principal point",
    "rectangular": "alpha, beta and the principal point, the skew being taken as 0",
    "square": "one focal length (square pixels) and the principal point; alpha = beta was taken "
    "for granted, as the motion leaves more open, and the uncertainties hold only if it is so",
    "centred": "one focal length (square pixels); the principal point was put into the picture's "
    "middle, as the motion leaves it open, and the uncertainties hold only if it is there",
}


class _SelfCalibrating(Protocol):
    def __call__(
        self,
        uv: Array,
        image_size: tuple[int, int],
        distortion: str = ...,
        pixels: Pixels | None = ...,
        pixel_std: float | None = ...,
        std: Array | None = ...,
    ) -> SelfCalibration: ...


MATCH_METHODS: Mapping[str, _SelfCalibrating] = {ROTATING: rotating_camera, MOVING: moving_camera}
"""The methods by name."""


def camera_from_matches(rig: Rig, method: str) -> Calibration:
    """The camera from the matches of a rig, wrong ones left out.

    Parameters
    ----------
    rig : Rig
        Its target and boards play no part.
    method : {"rotating-camera", "moving-camera"}

    Returns
    -------
    Calibration
        Without a sheet of light; the residuals' ``xyz`` are NaN, because nothing says how far away
        the points are in mm.

    Raises
    ------
    InputError
        If there are no matches, or the camera is known already.
    UntrustworthyError
        If a view shares too few points, the pictures leave the camera open, most matches
        contradict each other, or they show a distortion that is not in the model and spoils the
        focal length.
    """
    matches = rig.observations.matches
    _refuse_unfit(rig, method)
    _refuse_lonely(matches, _SHARED[method])
    stated = rig.pixel_std
    found = _screened(rig, method, stated)
    ratio = 1.0 if stated is None else (found.fit.rms_px / stated) ** 2
    freedom = found.fit.degrees_of_freedom
    warnings: tuple[str, ...] = ()
    if stated is not None and ratio * freedom > chi2_limit(freedom):
        found, stated = _screened(rig, method, None), None
        warnings = _excess_noise(ratio)
    return Calibration(
        method=method,
        camera=found.fit.camera,
        light_planes=(),
        covariance=_covariance(found.fit, stated),
        residuals=Residuals(
            rms_px=float(np.sqrt(np.nanmean(found.residuals**2))),
            chi2_per_dof=ratio,
            views=_views(matches, found),
        ),
        target=None,
        pixel_std=found.fit.rms_px if stated is None else stated,
        warnings=(*warnings, *_warnings(rig, found), *_lens(rig, method, found)),
    )


def refuse_matches_alone(rig: Rig, method: str) -> None:
    """Refuse a rig with nothing but matches for a method that cannot use them.

    Raises
    ------
    InputError
        Naming the methods that can.
    """
    counts = rig.observations.counts()
    if set(counts) == {STAGE}:
        raise InputError(
            f"method {method} needs views of a target or a board, and there are matched points "
            "alone",
            f"use --method {ROTATING} where the camera only turned about its centre of "
            f"projection, --method {MOVING} where it was carried about",
        )


def _refuse_unfit(rig: Rig, method: str) -> None:
    if not len(rig.observations.matches):
        raise InputError(
            f"method {method} needs matched points, and there are none",
            f"give rows of stage {STAGE} in points.csv: view,{STAGE},number of the point,u,v",
        )
    if rig.camera is not None:
        raise InputError(
            f"method {method} finds the camera, and it is known already",
            "leave out --camera, or use --method joint with a target or a board",
        )


def _refuse_lonely(matches: PointMatches, fewest: int) -> None:
    """Refuse a view that shares too few points with any other, by its name."""
    seen = matches.seen.astype(int)
    shared = seen @ seen.T
    np.fill_diagonal(shared, 0)
    most = shared.max(axis=1, initial=0)
    if (most < fewest).any():
        view = int(np.argmax(most < fewest))
        raise UntrustworthyError(
            "camera",
            f"view {matches.names[view]} shares {most[view]} points with the view it shares most "
            f"with, at least {fewest} are needed",
            "remove it, or match more of its points",
        )


def _screened(rig: Rig, method: str, pixel_std: float | None) -> ScreenedMatches:
    matches, run = rig.observations.matches, MATCH_METHODS[method]
    pixels: Pixels | None = "skewed" if rig.skew else None

    def estimate(uv: Array) -> SelfCalibration:
        return run(uv, rig.image_size, rig.distortion, pixels, pixel_std, matches.stds)

    weights = 1.0 / proportions(np.where(matches.seen, matches.stds, np.nan))[0]
    return screened_matches(matches.uv, rig.image_size, method == ROTATING, estimate, weights)


def _covariance(fit: SelfCalibration, stated: float | None) -> Covariance:
    """The covariance, from noise that was stated or that the residuals told."""
    matrix = 0.5 * (fit.covariance + fit.covariance.T)
    if stated is not None:
        return Covariance(fit.names, matrix, (Source("matches", matrix),))
    name = COMPONENTS[PIXEL]
    relative = np.array([[2.0 / fit.degrees_of_freedom]])
    components = NoiseComponents((name,), (fit.rms_px,), relative)
    return Covariance(fit.names, matrix, (Source("matches", matrix, name),), components)


def _views(matches: PointMatches, found: ScreenedMatches) -> tuple[ViewResiduals, ...]:
    used = np.isfinite(found.residuals)
    uv = np.where(used, matches.uv, np.nan)
    nowhere = np.full((uv.shape[1], 3), np.nan)
    return tuple(
        ViewResiduals(STAGE, name, uv[view], found.residuals[view], nowhere)
        for view, name in enumerate(matches.names)
    )


def _excess_noise(ratio: float) -> tuple[str, ...]:
    return (
        f"the residuals are {np.sqrt(ratio):.1f} times as large as the stated noise (chi-squared "
        f"per degree of freedom {ratio:.2f}); the uncertainties follow the residuals instead – "
        "look for lens distortion, or things that moved",
    )


def _warnings(rig: Rig, found: ScreenedMatches) -> tuple[str, ...]:
    """What such a camera cannot do, which model it is, and what was left out."""
    told = [
        "the camera alone was calibrated: unknown points have no scale, so there is no sheet of "
        "light and no length – give this file as --camera to a rig with a target or a board",
        f"estimated of K: {_MODELS[found.fit.pixels]}",
    ]
    others = [stage for stage in rig.observations.counts() if stage != STAGE]
    if others:
        told.append(f"the views of stage {', '.join(others)} play no part in this method")
    return (*told, *_left_out(rig.observations.matches, found), *_coarse(found.fit))


def _lens(rig: Rig, method: str, found: ScreenedMatches) -> tuple[str, ...]:
    """Distortion that the same matches show, where rig.toml says that there is none.

    Turns and distortion bend the same lines: what is left out of the model goes into the focal
    length, by more than half of it where a lens is wide.

    Raises
    ------
    UntrustworthyError
        If it takes the focal length out of its stated uncertainty.
    """
    if rig.distortion != "none":
        return ()
    matches = rig.observations.matches
    uv = np.where(np.isfinite(found.residuals), matches.uv, np.nan)
    try:
        bent = MATCH_METHODS[method](
            uv, rig.image_size, "radial1", found.fit.pixels, rig.pixel_std, matches.stds
        )
    except UntrustworthyError:
        return (
            'the lens was taken to be free of distortion (distortion = "none" under [camera] in '
            "rig.toml); these matches cannot tell whether it is",
        )
    k1, std = bent.camera.distortion[0], bent.std("camera.k1")
    if abs(k1) <= _SHOWN * std:
        return ()
    shown = (
        f"the matches show lens distortion, k1 = {k1:.3g} with a std of {std:.1g}, and rig.toml "
        'says distortion = "none"'
    )
    remedy = 'set distortion = "radial1", or a further model, under [camera]'
    off = abs(bent.camera.alpha - found.fit.camera.alpha)
    if off > _OFF * found.fit.std("camera.alpha"):
        raise UntrustworthyError("camera", f"{shown}: alpha would be off by {off:.3g} px", remedy)
    return (f"{shown} – {remedy}",)


def _coarse(fit: SelfCalibration) -> tuple[str, ...]:
    if fit.rms_px <= _COARSE_PX:
        return ()
    return (
        f"the residuals are {fit.rms_px:.2g} px, much for matched points – look for lens "
        "distortion, things that moved, and, where the camera only turned, for a turn about "
        "another point than its centre of projection",
    )


def _left_out(matches: PointMatches, found: ScreenedMatches) -> tuple[str, ...]:
    seen, wrong, unused = (int(mask.sum()) for mask in (matches.seen, found.wrong, found.unused))
    told = []
    if wrong:
        first = [
            f"point {matches.labels[point]} in view {matches.names[view]}"
            for view, point in np.argwhere(found.wrong)[:_NAMED]
        ]
        more = " …" if wrong > _NAMED else ""
        told.append(f"left out as wrong: {wrong} of {seen} matches: {', '.join(first)}{more}")
    if wrong > _MANY_WRONG * seen:
        told.append(
            f"{wrong / seen:.0%} of the matches do not fit – match with stricter settings, and "
            "see that the lens's distortion is estimated"
        )
    if unused:
        told.append(
            f"not used: {unused} of {seen} matches that nothing checks, being the only ones of "
            "their points"
        )
    return tuple(told)
