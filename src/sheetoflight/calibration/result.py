"""From what a method found to the calibration that a user gets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sheetoflight.calibration.components import COMPONENTS, CORNER, PIXEL
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.remedies import remedy, stage_of
from sheetoflight.calibration.uncertainty import covariance_of
from sheetoflight.calibration.weaknesses import LINEAR_LIMIT
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.covariance import PLANE_PARTS, Covariance, NoiseComponents
from sheetoflight.model.diagnosis import Finding
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.rig import Rig

_STANDS_OUT = 4.0
"""How many times the median residual a view's may be. With noise alone a view of four degrees of
freedom exceeds that with odds below 1e-9."""

_NO_RESIDUAL_PX = 1e-6


def calibration_of(
    method: str, rig: Rig, outcome: Outcome, chi2_per_dof: float, findings: tuple[Finding, ...]
) -> Calibration:
    """The calibration with its covariance, residuals and warnings.

    Raises
    ------
    UntrustworthyError
        If the noise cannot be estimated, or a sheet is known too badly.
    """
    told = outcome.noise
    if told.degrees_of_freedom < 1 and rig.pixel_std is None:
        raise UntrustworthyError(
            stage_of(rig, "camera" if method != "joint" else method),
            "there are no more observations than unknowns, so the noise cannot be estimated",
            "take more views, or state pixel_std under [noise] in rig.toml",
        )
    covariance = covariance_of(
        outcome.influence, outcome.state, rig.lasers, rig.target, _components(told), rig.board
    )
    planes = outcome.state.light_planes(rig.lasers)
    _refuse_beyond_linear(method, rig, planes, covariance)
    views = tuple(view for fit in outcome.fits for view in _view_residuals(fit))
    squares = np.concatenate([view.residuals.ravel() ** 2 for view in views])
    return Calibration(
        method=method,
        camera=outcome.state.camera,
        light_planes=planes,
        covariance=covariance,
        residuals=Residuals(
            rms_px=float(np.sqrt(np.nanmean(squares))),
            chi2_per_dof=chi2_per_dof,
            views=views,
        ),
        target=rig.target if rig.observations.stages() else None,
        pixel_std=float(
            np.sqrt(told.noise.variances[PIXEL if rig.observations.stages() else CORNER])
        ),
        warnings=(
            *outcome.warnings,
            *_views_that_stand_out(views),
        ),
        findings=findings,
    )


def _components(fit: Fit) -> NoiseComponents:
    """The estimated noise components, and how well they are known."""
    known = [k for k in range(len(COMPONENTS)) if fit.size_covariance[k, k] > 0]
    sizes = fit.noise.variances[known]
    relative = fit.size_covariance[np.ix_(known, known)] / np.outer(sizes, sizes)
    return NoiseComponents(
        tuple(COMPONENTS[k] for k in known), tuple(np.sqrt(sizes).tolist()), relative
    )


def _refuse_beyond_linear(
    method: str, rig: Rig, planes: Sequence[LightPlane], covariance: Covariance
) -> None:
    """What the camera's uncertainty adds to the sheet's is known only in the end."""
    for plane in planes:
        tilt = np.sqrt(sum(covariance.std(f"{plane.name}.{part}") ** 2 for part in PLANE_PARTS[:3]))
        distance = covariance.std(f"{plane.name}.d") / plane.distance_mm
        for what, relative in (("direction", tilt), ("distance", distance)):
            if not relative <= LINEAR_LIMIT:
                other = "" if method == "joint" else ", or use --method joint"
                raise UntrustworthyError(
                    stage_of(rig, "plane"),
                    f"the views leave the {what} of the sheet {plane.name} uncertain by "
                    f"{relative:.0%} (limit {LINEAR_LIMIT:.0%})",
                    remedy(rig, "plane") + other,
                )


def _view_residuals(fit: Fit) -> list[ViewResiduals]:
    residuals = fit.adjustment.residuals_px(fit.state)
    return [
        ViewResiduals(stage, name, views.uv[i], residuals[stage][i], points[i])
        for stage in fit.adjustment.block_names
        for views, points in [(fit.adjustment.views_of(stage), _known_points(fit, stage))]
        for i, name in enumerate(views.names)
    ]


def _known_points(fit: Fit, stage: str) -> Array:
    """Points of a stage in space; NaN for spots that were not seen, which have no place."""
    if stage == "board" and fit.adjustment.boards is not None:
        return fit.adjustment.boards.points(fit.state)
    points = fit.adjustment.placed(fit.state, stage).points.copy()
    markers = len(fit.adjustment.positions)
    points[:, markers:][~fit.adjustment.stages[stage].seen[:, markers:]] = np.nan
    return points


def _views_that_stand_out(views: tuple[ViewResiduals, ...]) -> tuple[str, ...]:
    """One warning for the worst view of each stage that fits far worse than the stage's others."""
    warnings = []
    for stage in dict.fromkeys(view.stage for view in views):
        own = [view for view in views if view.stage == stage]
        sizes = np.sqrt(np.nanmean([view.residuals**2 for view in own], axis=(1, 2)))
        typical, worst = float(np.median(sizes)), int(np.argmax(sizes))
        if sizes[worst] > max(_STANDS_OUT * typical, _NO_RESIDUAL_PX):
            warnings.append(
                f"view {own[worst].view} of stage {stage} has residuals of {sizes[worst]:.2g} px, "
                f"the stage's median is {typical:.2g} px – check its markers, or remove it"
            )
    return tuple(warnings)
