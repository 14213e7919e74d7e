"""Start, refine, check: the methods by which a rig is calibrated, and the table that names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.components import CORNER, PIXEL
from sheetoflight.calibration.control_forms import FORMS
from sheetoflight.calibration.control_point_method import by_control_points
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.joint_method import joint
from sheetoflight.calibration.match_methods import (
    MATCH_METHODS,
    camera_from_matches,
    refuse_matches_alone,
)
from sheetoflight.calibration.noise import NoiseModel, chi2_limit, noise_model
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.paper_method import paper
from sheetoflight.calibration.paper_plane import PaperOptions
from sheetoflight.calibration.result import calibration_of
from sheetoflight.calibration.screening import Screened, screened
from sheetoflight.calibration.self_generated_method import (
    SELF_GENERATED,
    refuse_places,
    self_generated,
)
from sheetoflight.calibration.two_step_method import two_step
from sheetoflight.calibration.usable_views import refuse_unusable_views
from sheetoflight.errors import InputError
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.rig import Rig


@dataclass(frozen=True)
class CalibrationOptions:
    """Settings of the methods that have any.

    Parameters
    ----------
    paper : PaperOptions
    flat : bool
        Method joint: sheets are planes, even where lines on boards show that they are curved.
    """

    paper: PaperOptions = field(default_factory=PaperOptions)
    flat: bool = False


Method = Callable[[Screened, NoiseModel, CalibrationOptions], Outcome]
"""From a screened rig, with the joint fit of it where there is one, its noise, and options."""

CAMERA_FREE = "camera-free"
"""The method that knows no camera, and so gives another kind of result."""


def _by_form(name: str, found: Screened, noise: NoiseModel, _: CalibrationOptions) -> Outcome:
    """By a closed form of this name."""
    return by_control_points(found, noise, name)


METHODS: Mapping[str, Method] = {
    "joint": lambda found, noise, options: joint(
        found.rig, noise, found.fit, found.start, options.flat
    ),
    "two-step": lambda found, noise, _: two_step(found.rig, noise, found.fit, found.start),
    "paper": lambda found, noise, options: paper(_rod_alone(found.rig), noise, options.paper),
    **{name: partial(_by_form, name) for name in FORMS},
}


def calibrate(
    rig: Rig, method: str = "joint", options: CalibrationOptions | None = None
) -> Calibration:
    """Calibrate camera and sheet of light.

    Parameters
    ----------
    rig : Rig
        Target, picture size, lens model and observations.
    method : str
        ``joint``: everything in one maximum-likelihood adjustment. ``two-step``: the camera
        first, then maximum likelihood on the sheet. ``paper``: the camera first, then each
        target position triangulated, RANSAC, and a genetic search for the plane.
        ``planar-lines``, ``cross-ratio``, ``zigzag``: the camera from the boards first, then the
        plane through the line's points on them, through its crossings with rows of known points,
        or through its spots on the ridges of a solid body.
        ``self-generated``: with a known camera, from points of the line on a bare plate whose
        places in the sheet a stage tells. ``rotating-camera`` and ``moving-camera``: the camera
        alone, from matched points.
        `calibration.camera_free_method.camera_free` needs no camera.
    options : CalibrationOptions, optional

    Raises
    ------
    InputError
        If the method is unknown, or the observations do not fit the target.
    UntrustworthyError
        If no trustworthy number can be had from these views.
    """
    if method not in METHODS and method not in MATCH_METHODS and method != SELF_GENERATED:
        known = " | ".join((*METHODS, SELF_GENERATED, CAMERA_FREE, *MATCH_METHODS))
        raise InputError(f"method '{method}' is unknown", f"choose {known}")
    if not isinstance(rig, Rig):
        raise InputError(
            f"a rig was expected, found {rig!r}", 'load it first: sol.load_rig("rig/")'
        )
    if method in MATCH_METHODS:
        return camera_from_matches(rig, method)
    if method == SELF_GENERATED:
        return self_generated(rig)
    refuse_matches_alone(rig, method)
    refuse_places(rig, method)
    refuse_unusable_views(rig)
    options = options or CalibrationOptions()
    found = _screened(rig)
    rig, noise = found.rig, found.noise or noise_model(found.rig, found.start)
    outcome = METHODS[method](found, noise, options)
    outcome = replace(outcome, warnings=(*outcome.warnings, *_warnings(found)))
    told = outcome.noise
    chi2, freedom = told.chi2, told.degrees_of_freedom
    if rig.pixel_std is None or freedom < 1 or chi2 <= chi2_limit(freedom):
        return calibration_of(method, rig, outcome, _chi2_per_dof(told), found.findings)
    # the stated noise cannot be right: take what the residuals say
    open_size = np.isin(np.arange(len(noise.free)), (PIXEL, CORNER))
    estimated = replace(noise, free=noise.free | open_size)
    outcome = METHODS[method](replace(found, fit=None), estimated, options)
    warnings = (*outcome.warnings, *_warnings(found))
    warning = (
        f"the residuals are {np.sqrt(chi2 / freedom):.1f} times as large as the stated noise "
        f"(chi-squared per degree of freedom {chi2 / freedom:.2f}); the uncertainties follow the "
        "residuals instead – look for a bent target, lens distortion or a wrong view"
    )
    outcome = replace(outcome, warnings=(warning, *warnings))
    return calibration_of(method, rig, outcome, chi2 / freedom, found.findings)


def _screened(rig: Rig) -> Screened:
    """The rig without what is wrong, its boards first: they leave no doubt of the camera."""
    if rig.board is None or not len(rig.observations.board):
        return screened(rig)
    boards = screened_boards(rig)
    rig = boards.rig
    if not (rig.observations.plane or rig.observations.crossing or rig.observations.board.line):
        rig = replace(rig, lasers=())  # nothing tells of a sheet: the camera alone is calibrated
    found = screened(rig, boards.state)
    return replace(found, wrong=(*boards.wrong, *found.wrong), start=boards.state)


def _rod_alone(rig: Rig) -> Rig:
    """The rig without its boards, of which the paper knows nothing."""
    seen = replace(rig.observations, board=BoardViews())
    return replace(rig, board=None, observations=seen)


def _warnings(found: Screened) -> tuple[str, ...]:
    left_out = tuple(f"left out as wrong: {words}" for words in found.wrong)
    return (*left_out, *(finding.in_words for finding in found.findings))


def _chi2_per_dof(fit: Fit) -> float:
    """1 where the noise was estimated from these residuals."""
    if fit.rig.pixel_std is None or fit.degrees_of_freedom < 1:
        return 1.0
    return fit.chi2 / fit.degrees_of_freedom
