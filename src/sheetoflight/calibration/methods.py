"""Start, refine, check: the methods by which a rig is calibrated, and the table that names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sheetoflight.calibration.adjustment import CAMERA, PLANE, RigState, intrinsic_names
from sheetoflight.calibration.noise import NoiseModel, chi2_limit, noise_model
from sheetoflight.calibration.paper_plane import PaperOptions, PaperPlane, paper_plane
from sheetoflight.calibration.stages import (
    Adjusted,
    camera_stage,
    camera_start,
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


_DIFFERENCE_PX = 0.01
_STANDS_OUT = 4.0
"""How many times the median residual a view's may be. With noise alone a view of four degrees of
freedom exceeds that with odds below 1e-9."""

_SAME_POINT_PX = 1e-6
_FIXED_END_SHARE = 0.03
"""How far, as a part of the picture's diagonal, marker 0 may lie from where the other views see
it: farther than a slipped pivot, nearer than the other end of the target."""


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
    if not isinstance(rig, Rig):
        raise InputError(
            f"a rig was expected, found {rig!r}", 'load it first: sol.load_rig("rig/")'
        )
    _refuse_unusable_views(rig)
    noise = noise_model(rig.observations.stages(), rig.pixel_std)
    outcome = METHODS[method](rig, noise, options or CalibrationOptions())
    return _calibration(method, rig, noise, outcome)


def _joint(rig: Rig, noise: NoiseModel, _: CalibrationOptions) -> _Outcome:
    camera = camera_start(rig, noise)
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
    # the in-plane residuals hold the camera's error, which is not noise
    return _Outcome(fit.state, (*names, *PLANE), covariance, (camera, fit), (camera,))


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
    views = rig.observations.plane.take(used)
    free = np.array([CAMERA.index(name) for name in intrinsic_names(rig.free_intrinsics)])
    base = state.camera.parameters

    def points_at(uv: Array, parameters: Array) -> Array:
        seen = replace(rig.observations, plane=TargetViews(views.names, uv))
        camera = state.camera.with_parameters(parameters)
        return triangulated_views(replace(rig, observations=seen), camera)[0]

    def plane_of(points: Array) -> Array:
        normal, distance = fitted_plane(points[plane.used])
        return np.array([*(normal @ state.frame[:, :2]), distance])

    by_camera = np.empty((3, len(free)))
    for column, index in enumerate(free):
        step = np.zeros(len(base))
        step[index] = 1e-4 * max(abs(base[index]), 1e-2)
        above, below = (plane_of(points_at(views.uv, base + s)) for s in (step, -step))
        by_camera[:, column] = (above - below) / (2.0 * step[index])

    own = np.zeros((3, 3))
    now = points_at(views.uv, base)
    variances = noise.std["plane"][used] ** 2
    for marker in range(views.uv.shape[1]):
        for axis in range(2):
            step = np.zeros(views.uv.shape)
            step[:, marker, axis] = _DIFFERENCE_PX
            above, below = (points_at(views.uv + s, base) for s in (step, -step))
            for view in np.flatnonzero(views.seen[:, marker]):
                ends = []
                for moved in (above, below):
                    points = now.copy()
                    points[view] = moved[view]
                    ends.append(plane_of(points))
                slope = (ends[0] - ends[1]) / (2.0 * _DIFFERENCE_PX)
                own += np.outer(slope, slope) * variances[view, marker]
    return own, by_camera


def _few_inliers(plane: PaperPlane, options: PaperOptions) -> tuple[str, ...]:
    total = plane.used.size
    if plane.agreeing >= options.inlier_share * total:
        return ()
    return (
        f"only {plane.agreeing} of {total} triangulated points lie within "
        f"{options.threshold_mm} mm of the plane, the paper asks for "
        f"{options.inlier_share:.0%} – the depth of a tilted target is too noisy for this method; "
        "use --method joint",
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
        for name, uv, seen in zip(views.names, views.uv, views.seen, strict=True):
            if seen.sum() < 2:
                raise InputError(
                    f"view {name} of stage {stage} shows {int(seen.sum())} of {markers} markers, "
                    "at least 2 are needed",
                    "remove the view, or detect its markers again",
                )
            gaps = np.linalg.norm(np.diff(uv[seen], axis=0), axis=1)
            if gaps.min() < _SAME_POINT_PX:
                raise InputError(
                    f"view {name} of stage {stage}: two markers have the same image point",
                    "detect its markers again, or remove the view",
                )
    _refuse_other_fixed_points(rig)


def _refuse_other_fixed_points(rig: Rig) -> None:
    """Marker 0 is fixed in the camera stage: a view that shows it elsewhere is of another stage,
    or counts its markers from the other end."""
    views = rig.observations.camera
    seen = views.seen[:, 0] if len(views) else np.zeros(0, dtype=bool)
    if seen.sum() < 3:
        return
    offsets = np.linalg.norm(views.uv[:, 0] - np.median(views.uv[seen, 0], axis=0), axis=1)
    worst = int(np.argmax(np.where(seen, offsets, 0.0)))
    if offsets[worst] > _FIXED_END_SHARE * float(np.hypot(*rig.image_size)):
        raise InputError(
            f"view {views.names[worst]} of stage camera shows marker 0 {offsets[worst]:.0f} px "
            "away from its place in the other views",
            "marker 0 stays fixed in this stage: check the order of the markers, whether the view "
            "belongs to stage plane, and whether the fixed end is marker 0",
        )


def _calibration(method: str, rig: Rig, noise: NoiseModel, outcome: _Outcome) -> Calibration:
    chi2, freedom = _chi2(outcome.noise_fits)
    if freedom < 1 and not noise.stated:
        raise UntrustworthyError(
            "camera" if method != "joint" else method,
            "there are no more observations than unknowns, so the noise cannot be estimated",
            "take more views, or state pixel_std under [noise] in rig.toml",
        )
    factor = noise.variance_factor(chi2, freedom)
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
        warnings=(
            *outcome.warnings,
            *_noise_warnings(noise, chi2, freedom),
            *_views_that_stand_out(views),
        ),
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


def _views_that_stand_out(views: tuple[ViewResiduals, ...]) -> tuple[str, ...]:
    """One warning for the worst view of each stage that fits far worse than the stage's others."""
    warnings = []
    for stage in dict.fromkeys(view.stage for view in views):
        own = [view for view in views if view.stage == stage]
        typical = float(np.median([view.rms_px for view in own]))
        worst = max(own, key=lambda view: view.rms_px)
        if worst.rms_px > max(_STANDS_OUT * typical, _SAME_POINT_PX):
            warnings.append(
                f"view {worst.view} of stage {stage} has residuals of {worst.rms_px:.2g} px, the "
                f"stage's median is {typical:.2g} px – check its markers, or remove it"
            )
    return tuple(warnings)


def _noise_warnings(noise: NoiseModel, chi2: float, freedom: int) -> tuple[str, ...]:
    if not noise.stated or freedom <= 0 or chi2 <= chi2_limit(freedom):
        return ()
    return (
        f"the residuals are {np.sqrt(chi2 / freedom):.1f} times as large as the stated noise "
        f"(chi-squared per degree of freedom {chi2 / freedom:.2f}); the uncertainties were "
        "enlarged accordingly – look for a bent target, lens distortion or a wrong view",
    )
