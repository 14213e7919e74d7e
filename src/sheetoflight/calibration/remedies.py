"""What to do where the views leave something open: with rods, and with boards.

Rods are told by the view that would help most. A board shows so much in each view that what is
missing is variety, which words say better than a place does.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.next_view import next_view
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import DISTORTION_MODELS
from sheetoflight.model.rig import Rig

_OF_RODS = {
    "camera": "swing the target about marker 0 to all sides: left, right, up, down, near and far",
    "plane": "lay the target into the sheet in further positions, moved by its own length and "
    "turned by 30° to 90°",
}
"""Where no next view can be computed from what is known."""

_OF_BOARDS = {
    "camera": "take more views: the board tilted by 20° to 50° to all sides, held into the corners "
    "of the picture, nearer and farther",
    "plane": "take pictures of the line across the board at further depths, the board tilted "
    "otherwise",
}

_FEWER = 'distortion = "radial1"'
_SEPARATE = ("alpha", "beta", "gamma")
"""Camera parameters that more tilt tells, however the lens is described."""


def stage_of(rig: Rig, about: str) -> str:
    """The stage to name for what is open: where there are boards only, there is no other.

    Parameters
    ----------
    rig : Rig
    about : {"camera", "plane", "joint"}
        The camera, a sheet of light, or everything.
    """
    return "board" if _boards_only(rig) else about


def _boards_only(rig: Rig) -> bool:
    return len(rig.observations.board) > 0 and not rig.observations.stages()


def remedy(rig: Rig, about: str, parameter: str = "") -> str:
    """What to do about a camera or sheet that is not known well enough, in general.

    Parameters
    ----------
    rig : Rig
    about : {"camera", "plane"}
        The camera, or a sheet of light.
    parameter : str, optional
        The shared parameter that is known least.
    """
    if not _boards_only(rig):
        return _OF_RODS[about]
    owner, _, part = parameter.partition(".")
    crowded = len(DISTORTION_MODELS[rig.distortion]) > len(DISTORTION_MODELS["radial1"])
    if owner == "camera" and part not in _SEPARATE and crowded:
        return (
            f"{_OF_BOARDS[about]}; or let fewer coefficients of the lens be estimated: {_FEWER} "
            "under [camera] in rig.toml"
        )
    return _OF_BOARDS[about]


def advice(fit: Fit, information: Array, about: str, parameter: str) -> str:
    """Which picture to take next.

    Parameters
    ----------
    fit : Fit
    information : (P, P) array
        On its shared parameters; may be singular.
    about : {"camera", "plane"}
        The camera, or a sheet of light.
    parameter : str
        The shared parameter that is known least.
    """
    if _boards_only(fit.rig):
        return remedy(fit.rig, about, parameter)
    parameters = fit.adjustment.parameters
    importance = np.zeros_like(information)
    place = parameters.index(parameter)
    importance[place, place] = 1.0
    known = np.nan_to_num(information)
    try:
        best = next_view(fit.rig, fit.state, fit.noise, parameters, known, importance, about)
    except np.linalg.LinAlgError:
        best = None
    return remedy(fit.rig, about) if best is None else f"next, {best.in_words}"
