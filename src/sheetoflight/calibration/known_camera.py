"""Whether a camera that was known before fits what the boards show.

The boards' points alone give the camera once more. Its estimate c with covariance V and the known
one c₀ with covariance V₀ differ by chance only as ``(c − c₀)ᵀ (V + V₀)⁻¹ (c − c₀) / p`` does, which
is an F variable (Wald's test) where V's scale was estimated from the residuals.

Boards bend, and published cameras come without a covariance: in real sets of pictures, right
cameras differ by more than noise explains, but their residuals hardly grow. So a camera is refused
only where it makes the residuals at least twice as large as well; else it is told.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, fdtrc

from sheetoflight.calibration.board_planes import point_errors
from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.board_start import boards_alone
from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import UntrustworthyError
from sheetoflight.model.board_views import LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import DISTORTION_MODELS, Camera
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig

_TOLD_ODDS = 1e-3
_REFUSED_ODDS = 1e-5

_REFUSED_GROWTH = 2.0
"""Ratio of the residuals with the known camera to those without, from which it is refused: right
cameras of real sets reach 1.3."""

_FEWEST_VIEWS = 3
"""Of a flat board that tell a camera."""

_ROUNDING_PX = 1e-4
"""Residuals below which nothing is wrong."""

_REMEDY = (
    "give a calibration of this camera as it is now, with the same focus, zoom and picture size, "
    "or leave out --camera: the boards give the camera as well"
)


@dataclass(frozen=True)
class CameraTest:
    """How a known camera agrees with what the boards' points say.

    Parameters
    ----------
    odds : float
        Of so large a difference by chance.
    growth : float
        Root mean square residual with the known camera, over that with the boards' own.
    residual_px : float
        The former.
    parameter : str
        The camera parameter that is most off, ``alpha`` …
    known, found, std : float
        Its known value, the boards', and the standard uncertainty of their difference.
    """

    odds: float
    growth: float
    residual_px: float
    parameter: str
    known: float
    found: float
    std: float

    @property
    def in_words(self) -> str:
        """Which parameter is off, and by how much."""
        return (
            f"its {self.parameter} is {self.known:.6g}, by the boards {self.found:.6g}, which is "
            f"known to {self.std:.2g}"
        )


def doubts_of_known_camera(rig: Rig) -> tuple[str, ...]:
    """Test the camera of a rig by its boards.

    Parameters
    ----------
    rig : Rig

    Returns
    -------
    warnings : tuple of str
        Empty where the camera fits, or the boards cannot tell.

    Raises
    ------
    UntrustworthyError
        If the camera cannot be that of these pictures.
    """
    found = known_camera_test(rig)
    if found is None or found.odds > _TOLD_ODDS:
        return ()
    if found.odds <= _REFUSED_ODDS and found.growth >= _REFUSED_GROWTH:
        raise UntrustworthyError(
            "board",
            f"the known camera is not that of these pictures: {found.in_words}; with it the "
            f"residuals are {found.growth:.1f} times as large ({found.residual_px:.2g} px)",
            _REMEDY,
        )
    return (
        "the known camera differs from what the boards show by more than noise explains: "
        f"{found.in_words}; with it the residuals are {found.growth:.2f} times as large – "
        f"{_REMEDY}",
    )


def known_camera_test(rig: Rig) -> CameraTest | None:
    """Compare the camera of a rig with the one that its boards' points give; None where the
    camera is not known before, or they give none."""
    if rig.camera is None or rig.board is None or len(rig.observations.board) < _FEWEST_VIEWS:
        return None
    try:
        screened = screened_boards(_camera_open(rig, rig.camera)).rig
        found = calibrate(screened)
    except UntrustworthyError:
        return None
    known = _residual_px(replace(screened, camera=rig.camera))
    own = found.residuals.rms_px
    if known <= _ROUNDING_PX:
        return None
    return _tested(rig, rig.camera, found, known, known / max(own, _ROUNDING_PX))


def _camera_open(rig: Rig, known: Camera) -> Rig:
    """The points of the boards alone, and a lens of as many coefficients as the known one has."""
    points = replace(rig.observations.board, line=LinePixels())
    return replace(
        rig,
        camera=None,
        camera_covariance=None,
        skew=rig.skew or known.gamma != 0.0,
        distortion=_lens_model(rig, known),
        observations=Observations(board=points),
    )


def _lens_model(rig: Rig, known: Camera) -> str:
    """The least model that holds the rig's coefficients and those of the known camera."""
    coefficients = dict(zip(DISTORTION_MODELS["brown"], known.distortion, strict=True))
    needed = {name for name, value in coefficients.items() if value}
    needed |= set(DISTORTION_MODELS[rig.distortion])
    return min(
        (name for name, held in DISTORTION_MODELS.items() if needed <= set(held)),
        key=lambda name: len(DISTORTION_MODELS[name]),
    )


def _residual_px(rig: Rig) -> float:
    """Root mean square residual of the boards' points, px, with the rig's camera."""
    state = boards_alone(rig).state
    return float(np.sqrt(np.nanmean(point_errors(rig, state) ** 2)))


def _tested(
    rig: Rig, known: Camera, found: Calibration, residual_px: float, growth: float
) -> CameraTest:
    names = tuple(name for name in found.covariance.parameters if name.startswith("camera."))
    places = [Camera.PARAMETERS.index(name.removeprefix("camera.")) for name in names]
    covariance = found.covariance.block(names)
    if rig.camera_covariance is not None:
        covariance = covariance + rig.camera_covariance.block(names)
    off = (found.camera.parameters - known.parameters)[places]
    std = np.sqrt(np.diag(covariance))
    scaled = off / std
    square = float(scaled @ np.linalg.solve(covariance / np.outer(std, std), scaled))
    worst = int(np.abs(scaled).argmax())
    return CameraTest(
        odds=_odds(square, len(names), found),
        growth=growth,
        residual_px=residual_px,
        parameter=Camera.PARAMETERS[places[worst]],
        known=float(known.parameters[places[worst]]),
        found=float(found.camera.parameters[places[worst]]),
        std=float(std[worst]),
    )


def _odds(square: float, parameters: int, found: Calibration) -> float:
    """Of a squared Mahalanobis distance, the noise being known or estimated."""
    spread = found.covariance.components.relative_covariance
    if not spread.size:
        return float(chdtrc(parameters, square))
    return float(fdtrc(parameters, 2.0 / spread[0, 0], square / parameters))
