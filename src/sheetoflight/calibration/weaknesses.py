"""How well each shared parameter is known, in units of its size; and what is known least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.next_view import DISTORTION_POWERS, size_of
from sheetoflight.calibration.rig_state import ANCHOR
from sheetoflight.geometry.directions import Array

LINEAR_LIMIT = 0.1
"""Greatest relative standard uncertainty (radians for angles) at which a covariance still
describes the result."""

WEAK = 0.03
"""Relative standard uncertainty above which a result is called weak: second order is still only
a thousandth, but a view or two may decide over it."""

_TAKES_PART = 0.1
"""Component of a unit vector above which a parameter has a part in what is undetermined."""

_IN_WORDS = {
    "alpha": "the focal length alpha",
    "beta": "the focal length beta",
    "gamma": "the skew gamma",
    "u0": "the principal point u0",
    "v0": "the principal point v0",
    "tilt1": "the direction of the sheet {laser}",
    "tilt2": "the direction of the sheet {laser}",
    "d": "the distance of the sheet {laser}",
}


@dataclass(frozen=True)
class Weakness:
    """What is known least.

    Parameters
    ----------
    parameter : str
        A shared parameter.
    stage : {"camera", "plane"}
        Where it should have come from.
    in_words : str
    relative_std : float
        In units of the parameter's size, radians for angles.
    seen_share : float
        By how much less it matters where something was seen.
    """

    parameter: str
    stage: str
    in_words: str
    relative_std: float
    seen_share: float = 1.0

    @property
    def where_seen(self) -> float:
        """Relative standard uncertainty as far as it matters there."""
        return self.relative_std * self.seen_share


def in_the_corners(fit: Fit) -> list[Weakness]:
    """The coefficient of the lens that is known least where nothing was seen."""
    outside = [weak for weak in weaknesses_of(fit, fit.covariance) if weak.where_seen <= WEAK]
    return sorted(outside, key=lambda weak: weak.relative_std)[-1:]


def _seen_share(fit: Fit, parameter: str) -> float:
    """By how much less a coefficient of the lens moves the outermost point that was seen of a board
    than it moves the corners of the picture, as parts of their distances from the middle.

    The image is linear in these coefficients, so that boards amid the picture leave nothing open
    there; only the corners must not be measured in.
    """
    boards, (owner, part) = fit.adjustment.boards, parameter.split(".")
    if (
        fit.adjustment.stages
        or boards is None
        or owner != "camera"
        or part not in DISTORTION_POWERS
    ):
        return 1.0
    camera = fit.state.camera
    focal, middle = (camera.alpha, camera.beta), (camera.u0, camera.v0)
    seen = float(np.nanmax(np.linalg.norm((boards.views.uv - middle) / focal, axis=-1)))
    corner = float(np.hypot(*(np.array(camera.image_size) / (2.0 * camera.alpha))))
    return min(seen / corner, 1.0) ** DISTORTION_POWERS[part]


def weaknesses_of(fit: Fit, covariance: Array) -> list[Weakness]:
    """Every shared parameter of a fit, with this covariance ``(P, P)``; fixed points are nobody's
    aim."""
    std = np.sqrt(np.diag(covariance))
    return [
        _weakness(fit, name, float(s) / size_of(fit.state, name))
        for name, s in zip(fit.adjustment.parameters, std, strict=True)
        if name not in ANCHOR
    ]


def _weakness(fit: Fit, parameter: str, relative_std: float) -> Weakness:
    owner, part = parameter.split(".")
    stage = "camera" if owner in ("camera", "anchor") else "plane"
    laser = "" if stage == "camera" else fit.rig.lasers[int(owner.removeprefix("sheet"))]
    default = f"the distortion {part}" if owner == "camera" else "the fixed point"
    words = _IN_WORDS.get(part, default).format(laser=laser)
    return Weakness(parameter, stage, words, relative_std, _seen_share(fit, parameter))


def worst_of_each_stage(weaknesses: list[Weakness]) -> list[Weakness]:
    """What is known least of the camera, and of the sheets."""
    worst: dict[str, Weakness] = {}
    for weakness in weaknesses:
        worst[weakness.stage] = max(
            worst.get(weakness.stage, weakness), weakness, key=lambda one: one.where_seen
        )
    return list(worst.values())


def null_direction(fit: Fit, information: Array) -> Weakness:
    """The parameter that leads in the direction of least information."""
    sizes = np.array([size_of(fit.state, name) for name in fit.adjustment.parameters])
    scaled = information * sizes[:, None] * sizes
    vector = np.abs(np.linalg.eigh(np.nan_to_num(scaled))[1][:, 0])
    names = fit.adjustment.parameters
    camera = [i for i, name in enumerate(names) if name.startswith("camera.")]
    every = [i for i, name in enumerate(names) if name not in ANCHOR]
    # where the camera is open, the sheet is too, but not the other way round
    open_camera = camera and vector[camera].max() > _TAKES_PART
    leading = max(camera if open_camera else every, key=lambda i: vector[i])
    return _weakness(fit, names[leading], np.inf)
