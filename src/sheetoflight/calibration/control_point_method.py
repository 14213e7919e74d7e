"""The older methods for boards: the camera first, then a plane through control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.camera_alone import camera_alone
from sheetoflight.calibration.components import CORNER
from sheetoflight.calibration.control_forms import FORMS, ControlForm
from sheetoflight.calibration.control_influence import sheet_errors
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.identifiability import edge_on, roughly_determined
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import CAMERA, RigState, intrinsic_names
from sheetoflight.calibration.screening import Screened
from sheetoflight.calibration.starts import with_planes
from sheetoflight.calibration.uncertainty import Influence, chained, influence
from sheetoflight.calibration.weaknesses import LINEAR_LIMIT
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig


def by_control_points(found: Screened, noise: NoiseModel, method: str) -> Outcome:
    """Camera and poses from the boards' points, each sheet by a closed form, the camera held.

    Parameters
    ----------
    found : Screened
        A rig whose boards show the line of light; of rods it needs none, and looks at none.
    noise : NoiseModel
        Where there is no joint fit to tell its size.
    method : str
        Of `control_forms.FORMS`.

    Raises
    ------
    UntrustworthyError
        If there is no board or no line on it, the method cannot work with such a board, or the
        views do not determine camera or sheet.
    """
    rig = _boards_of(found.rig, method)
    told = found.fit
    if told is not None and not (told.solution.converged and roughly_determined(told)):
        told = None  # what does not fit together tells no noise
    sizes = noise if told is None else replace(told.noise, free=np.zeros_like(told.noise.free))
    camera, weak = _camera(rig, sizes, found.start)
    if told is not None:
        camera = replace(camera, size_covariance=told.size_covariance)
    forms = _forms(rig, camera.state, method)
    sheets = [form.place(form.sights) for form in forms]
    state = with_planes(rig, camera.state, [(sheet.normal, sheet.distance) for sheet in sheets])
    for laser, sheet in zip(rig.lasers, sheets, strict=True):
        _require_open_sheet(camera, laser, sheet.normal, sheet.points)
    return Outcome(state, _influence(rig, camera, forms, state), (camera,), camera, weak)


def _boards_of(rig: Rig, method: str) -> Rig:
    """The rig without its rods, of which these methods know nothing."""
    views = rig.observations.board
    if rig.board is None or not len(views):
        raise UntrustworthyError(
            "board",
            f"method {method} works on the line of light across boards, and the rig shows none",
            "take pictures of a board with the line across it (stage board), or use --method joint",
        )
    rig = replace(rig, observations=Observations(board=views))
    for number in range(len(rig.lasers)):
        if not (views.line.laser == number).any():
            raise _no_line(method, rig.lasers[number])
    if not rig.lasers:
        raise _no_line(method, "the laser")
    return rig


def _no_line(method: str, laser: str) -> UntrustworthyError:
    return UntrustworthyError(
        "board",
        f"no board shows the line of {laser}, which is all that method {method} has of its sheet",
        "take pictures with the line across the board; for the camera alone use --method joint",
    )


def _camera(rig: Rig, noise: NoiseModel, start: RigState | None) -> tuple[Fit, tuple[str, ...]]:
    """Camera and poses by the boards' points, or the poses alone where the camera is known."""
    if rig.camera is None or start is None:
        return camera_alone(rig, noise, start)
    points = replace(rig.observations.board, line=LinePixels())
    alone = replace(rig, observations=Observations(board=points))
    return fitted(alone, {}, (), start, noise, "board"), ()


def _forms(rig: Rig, state: RigState, method: str) -> list[ControlForm]:
    assert rig.board is not None
    views, poses = rig.observations.board, state.poses["board"]
    lit = [_of_laser(views, number) for number in range(len(rig.lasers))]
    return [FORMS[method](rig.board, own, state.camera, poses) for own in lit]


def _of_laser(views: BoardViews, laser: int) -> BoardViews:
    return replace(views, line=views.line.take(views.line.laser == laser))


def _influence(rig: Rig, camera: Fit, forms: list[ControlForm], state: RigState) -> Influence:
    """The camera's errors, or those of the known camera, and what the sheets make of them."""
    known = rig.camera_covariance
    if rig.camera is None:
        names = intrinsic_names(rig.free_intrinsics)
        first = influence(camera, names, "camera")
        errors = sheet_errors(rig, forms, camera, state, names)
        chosen = camera.adjustment.columns_of(names)
        covariance = camera.covariance[np.ix_(chosen, chosen)]
        return chained(first, errors.influence, errors.slope, covariance @ errors.in_common)
    names = tuple(n for n in known.parameters if n in CAMERA) if known is not None else ()
    errors = sheet_errors(rig, forms, camera, state, names)
    if known is None:
        return errors.influence
    markers = len(rig.target.positions)
    first = Influence(
        names,
        (("known camera", None, known.block(names)),),
        np.zeros((len(names), markers)),
        np.zeros(len(names)),
        np.zeros((len(names), 0, 3)),
    )
    return chained(first, errors.influence, errors.slope)


def _require_open_sheet(camera: Fit, laser: str, normal: Array, points: Array) -> None:
    """Refuse a sheet that the camera sees all but edge on, as
    `identifiability.require_open_sheets` does."""
    points = points[np.isfinite(points).all(axis=1)]
    slopes = np.abs(points @ normal) / points[:, 2]
    pixel_std = float(np.sqrt(camera.noise.variances[CORNER]))
    across = float(np.linalg.norm((np.linalg.inv(camera.state.camera.matrix).T @ normal)[:2]))
    if not pixel_std * across <= LINEAR_LIMIT * float(np.median(slopes)):
        distance = float(np.median(points @ normal))
        reach = float(np.median(np.linalg.norm(points, axis=1)))
        raise edge_on(laser, distance, reach, "board")
