"""Start, refine, check: the methods by which a rig is calibrated, and the table that names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sheetoflight.calibration.adjustment import CAMERA, PLANE, RigState, intrinsic_names
from sheetoflight.calibration.noise import NoiseModel, chi2_limit, noise_model
from sheetoflight.calibration.paper_plane import PaperOptions, PaperPlane, paper_plane
from sheetoflight.calibration.stages import (
    Adjusted,
    camera_stage,
    joint_stage,
    plane_stage,
    poses_only,
    sheet_information,
    stage_points,
    triangulated_views,
    with_plane,
)
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import fitted_plane
from sheetoflight.model.calibration import Calibration, Covariance, Residuals, ViewResiduals
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_LINEAR_LIMIT = 0.1
"""Greatest relative standard uncertainty (radians for the normal) at which a covariance, which
is a linear notion, still describes the result: its square, the neglected second order, is 1 %."""


@dataclass(frozen=True)
class CalibrationOptions:
    """Settings of the methods that have any."""

    paper: PaperOptions = field(default_factory=PaperOptions)


@dataclass(frozen=True)
class _Outcome:
    """What a method found: estimates, their covariance for the stated variances in the names of
    `CAMERA` and `PLANE`, the fits behind it, those whose residuals are noise alone, warnings."""

    state: RigState
    parameters: tuple[str, ...]
    covariance: Array
    fits: tuple[Adjusted, ...]
    noise_fits: tuple[Adjusted, ...]
    warnings: tuple[str, ...] = ()


def calibrate(
    rig: Rig, method: str = "joint", options: CalibrationOptions | None = None
) -> Calibration:
    """Calibrate camera and sheet of light.

    Parameters
    ----------
    rig : Rig
        Target, picture size, lens model and observations.
    method : {"joint", "two-step", "paper"}
        ``joint``: everything in one maximum-likelihood adjustment. ``two-step``: the camera
        first, then maximum likelihood on the sheet. ``paper``: the camera first, then each
        target position triangulated, RANSAC, and a genetic search for the plane.
    options : CalibrationOptions, optional

    Raises
    ------
    InputError
        If the method is unknown, or the observations do not fit the target.
    UntrustworthyError
        If no trustworthy number can be had from these views.
    """
    if method not in METHODS:
        raise InputError(f"method '{method}' is unknown", f"choose {' | '.join(METHODS)}")
    _refuse_unusable_views(rig)
    noise = noise_model(rig.observations.stages(), rig.pixel_std)
    outcome = METHODS[method](rig, noise, options or CalibrationOptions())
    return _calibration(method, rig, noise, outcome)


def _joint(rig: Rig, noise: NoiseModel, _: CalibrationOptions) -> _Outcome:
    camera = camera_stage(rig, noise)
    start = plane_stage(_first_sheet(camera.state, rig), rig, noise)
    fit = joint_stage(start.state, rig, noise)
    names = (*intrinsic_names(rig.free_intrinsics), *PLANE)
    chosen = fit.adjustment.columns_of(names)
    covariance = fit.covariance("joint")[np.ix_(chosen, chosen)]
    return _Outcome(fit.state, names, covariance, (fit,), (fit,))


def _two_step(rig: Rig, noise: NoiseModel, _: CalibrationOptions) -> _Outcome:
    camera = camera_stage(rig, noise)
    fit = plane_stage(_first_sheet(camera.state, rig), rig, noise)
    names = intrinsic_names(rig.free_intrinsics)
    own = fit.covariance("plane")
    mixed = sheet_information(fit.state, rig, noise)[len(names) :, : len(names)]
    camera_covariance = _camera_covariance(camera, names)
    covariance = _chained(camera_covariance, own, -own @ mixed)
    fits = (camera, fit)
    return _Outcome(fit.state, (*names, *PLANE), covariance, fits, fits)


def _paper(rig: Rig, noise: NoiseModel, options: CalibrationOptions) -> _Outcome:
    camera = camera_stage(rig, noise)
    points, used = triangulated_views(rig, camera.state.camera)
    plane = paper_plane(points, options.paper)
    state = with_plane(camera.state, rig, plane.normal, plane.distance)
    fit = poses_only(state, rig, noise)
    names = intrinsic_names(rig.free_intrinsics)
    own, by_camera = _paper_sensitivities(fit.state, rig, noise, plane, used)
    covariance = _chained(_camera_covariance(camera, names), own, by_camera)
    warnings = _few_inliers(plane, options.paper)
    # the in-plane residuals hold this plane's own error, which is not noise
    return _Outcome(fit.state, (*names, *PLANE), covariance, (camera, fit), (camera,), warnings)


METHODS: Mapping[str, Callable[[Rig, NoiseModel, CalibrationOptions], _Outcome]] = {
    "joint": _joint,
    "two-step": _two_step,
    "paper": _paper,
}


def _first_sheet(state: RigState, rig: Rig) -> RigState:
    """The least-squares plane through the triangulated markers."""
    points, used = triangulated_views(rig, state.camera)
    if len(used) < 2:
        raise UntrustworthyError(
            "plane",
            f"{len(used)} usable position of the target in the sheet of light, "
            "at least 2 are needed",
            "lay the target into the sheet in further, differently turned positions, "
            "10 give a good result",
        )
    return with_plane(state, rig, *fitted_plane(points.reshape(-1, 3)))


def _chained(first: Array, own: Array, slope: Array) -> Array:
    """Covariance of (x, y) where y depends on x with ``slope`` and on noise of its own."""
    crossing = slope @ first
    return np.block([[first, crossing.T], [crossing, own + crossing @ slope.T]])


def _camera_covariance(camera: Adjusted, names: tuple[str, ...]) -> Array:
    chosen = camera.adjustment.columns_of(names)
    return camera.covariance("camera")[np.ix_(chosen, chosen)]


def _paper_sensitivities(
    state: RigState, rig: Rig, noise: NoiseModel, plane: PaperPlane, used: np.ndarray
) -> tuple[Array, Array]:
    """Covariance of the paper's plane from the in-plane pixels, and its slope by the camera.

    The genetic search ends at the least-squares plane through the inliers, so that plane's
    central differences tell how it moves: the points of one position share their depth error,
    which a covariance from the scatter of single points would miss.
    """
    views = rig.observations.plane
    free = np.array([CAMERA.index(name) for name in intrinsic_names(rig.free_intrinsics)])
    kept = plane.used

    def plane_at(uv: Array, parameters: Array) -> Array:
        moved = Rig(
            rig.target,
            rig.image_size,
            observations=type(rig.observations)(plane=TargetViews(views.names, uv)),
        )
        points, _ = triangulated_views(moved, state.camera.with_parameters(parameters))
        normal, distance = fitted_plane(points[kept])
        return np.array([*(normal @ state.frame[:, :2]), distance])

    base = state.camera.parameters
    by_camera = np.empty((3, len(free)))
    for column, index in enumerate(free):
        step = np.zeros(len(base))
        step[index] = 1e-4 * max(abs(base[index]), 1e-2)
        change = plane_at(views.uv, base + step) - plane_at(views.uv, base - step)
        by_camera[:, column] = change / (2.0 * step[index])

    own = np.zeros((3, 3))
    for view in used:
        for marker in np.flatnonzero(views.seen[view]):
            for axis in range(2):
                step = np.zeros(views.uv.shape)
                step[view, marker, axis] = 0.01
                change = plane_at(views.uv + step, base) - plane_at(views.uv - step, base)
                slope = change / 0.02
                own += np.outer(slope, slope) * noise.std["plane"][view, marker] ** 2
    return own, by_camera


def _few_inliers(plane: PaperPlane, options: PaperOptions) -> tuple[str, ...]:
    total = plane.used.size
    if plane.agreeing >= options.inlier_share * total:
        return ()
    return (
        f"only {plane.agreeing} of {total} triangulated points lie within "
        f"{options.threshold_mm} mm of the plane, the paper asks for {options.inlier_share:.0%} – the depth of a tilted "
        "target is too noisy for this method; use --method joint",
    )


def _refuse_unusable_views(rig: Rig) -> None:
    markers = len(rig.target.markers_mm)
    for stage, views in rig.observations.stages().items():
        if views.uv.shape[1] != markers:
            raise InputError(
                f"the views of stage {stage} have {views.uv.shape[1]} markers, "
                f"the target has {markers}",
                "give markers_mm of the target that was seen",
            )
        for name, seen in zip(views.names, views.seen, strict=True):
            if seen.sum() < 2:
                raise InputError(
                    f"view {name} of stage {stage} shows {int(seen.sum())} marker, "
                    "at least 2 are needed",
                    "remove the view, or detect its markers again",
                )


def _calibration(method: str, rig: Rig, noise: NoiseModel, outcome: _Outcome) -> Calibration:
    factor = noise.variance_factor(*_chi2(outcome.noise_fits))
    parameters, covariance = _named_covariance(outcome, factor)
    _refuse_beyond_linear(outcome, covariance, method)
    views = tuple(view for fit in outcome.fits for view in _view_residuals(fit))
    squares = np.concatenate([view.residuals.ravel() ** 2 for view in views])
    return Calibration(
        method=method,
        camera=outcome.state.camera,
        light_planes=(outcome.state.light_plane,),
        covariance=Covariance(parameters, covariance),
        residuals=Residuals(
            rms_px=float(np.sqrt(np.nanmean(squares))),
            chi2_per_dof=_chi2_per_dof(outcome.fits) / (1.0 if noise.stated else factor),
            views=views,
        ),
        target=rig.target,
        pixel_std=noise.typical_std(factor),
        warnings=(*outcome.warnings, *_noise_warnings(noise, *_chi2(outcome.noise_fits))),
    )


def _chi2(fits: tuple[Adjusted, ...]) -> tuple[float, int]:
    return (
        sum(fit.chi2 for fit in fits),
        sum(fit.adjustment.degrees_of_freedom for fit in fits),
    )


def _chi2_per_dof(fits: tuple[Adjusted, ...]) -> float:
    chi2, freedom = _chi2(fits)
    return chi2 / freedom if freedom > 0 else 1.0


def _named_covariance(outcome: _Outcome, factor: float) -> tuple[tuple[str, ...], Array]:
    """Covariance in public names: the sheet's tilts become changes of its normal."""
    intrinsics = [name for name in outcome.parameters if name in CAMERA]
    plane = outcome.state.light_plane
    sign = float(np.sign(outcome.state.distance))
    change = np.zeros((len(intrinsics) + 4, len(outcome.parameters)))
    change[: len(intrinsics), : len(intrinsics)] = np.eye(len(intrinsics))
    change[len(intrinsics) : -1, len(intrinsics) : -1] = sign * outcome.state.frame[:, :2]
    change[-1, -1] = sign
    names = (*intrinsics, *(f"{plane.name}.{part}" for part in ("nx", "ny", "nz", "d")))
    return names, factor * change @ outcome.covariance @ change.T


def _refuse_beyond_linear(outcome: _Outcome, covariance: Array, method: str) -> None:
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    camera = outcome.state.camera
    checks = (
        ("camera", "the focal length alpha", std[0] / camera.alpha),
        ("camera", "the focal length beta", std[1] / camera.beta),
        ("plane", "the sheet's normal, in radians,", float(np.linalg.norm(std[-4:-1]))),
        ("plane", "the sheet's distance", std[-1] / abs(outcome.state.distance)),
    )
    for stage, what, relative in checks:
        if not relative <= _LINEAR_LIMIT:
            raise UntrustworthyError(
                stage,
                f"{what} would have a relative standard uncertainty of {relative:.0%} "
                f"(limit {_LINEAR_LIMIT:.0%}, method {method})",
                "take more views, with the target turned into other directions"
                if stage == "camera"
                else "lay the target into the sheet in further, differently turned positions",
            )


def _view_residuals(fit: Adjusted) -> list[ViewResiduals]:
    residuals = fit.adjustment.residuals_px(fit.state)
    points = stage_points(fit.state, fit.adjustment)
    return [
        ViewResiduals(stage, name, views.uv[i], residuals[stage][i], points[stage][i])
        for stage, views in fit.adjustment.stages.items()
        for i, name in enumerate(views.names)
    ]


def _noise_warnings(noise: NoiseModel, chi2: float, freedom: int) -> tuple[str, ...]:
    if not noise.stated or freedom <= 0 or chi2 <= chi2_limit(freedom):
        return ()
    return (
        f"the residuals are {np.sqrt(chi2 / freedom):.1f} times as large as the stated noise "
        f"(chi-squared per degree of freedom {chi2 / freedom:.2f}); the uncertainties were "
        "enlarged accordingly – look for a bent target, lens distortion or a wrong view",
    )
