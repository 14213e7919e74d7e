"""What is known of a rig before it is calibrated."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sheetoflight.errors import InputError
from sheetoflight.model.board import Board
from sheetoflight.model.camera import DISTORTION_MODELS, Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.observations import Observations
from sheetoflight.model.target import CollinearTarget


@dataclass(frozen=True)
class Rig:
    """A rig folder's content: ``rig.toml`` and what was observed.

    Parameters
    ----------
    target : CollinearTarget
    image_size : (int, int)
        Width and height of the pictures in px.
    distortion : {"none", "radial1", "radial2", "brown"}
        Which coefficients of the lens are estimated.
    skew : bool
        Whether ``gamma`` is estimated.
    pixel_std : float, optional
        Standard uncertainty of an image coordinate in px; estimated where absent.
    placement_std : float, optional
        How far, as a standard deviation in mm, the ends of a target laid into the sheet lie off
        it; estimated where absent, 0 where the target is known to lie in the sheet.
    lasers : tuple of str
        Names of the sheets of light; none where a camera alone is calibrated.
    board : Board, optional
        What stage board shows.
    camera : Camera, optional
        The camera where it is known already; it is estimated where absent.
    camera_covariance : Covariance, optional
        Of the known camera's parameters; exact where absent.
    observations : Observations
    source : str
        Where it was read from, for reports.
    """

    target: CollinearTarget
    image_size: tuple[int, int]
    distortion: str = "none"
    skew: bool = False
    pixel_std: float | None = None
    placement_std: float | None = None
    lasers: tuple[str, ...] = ("laser",)
    board: Board | None = None
    camera: Camera | None = None
    camera_covariance: Covariance | None = None
    observations: Observations = field(default_factory=Observations)
    source: str = ""

    def __post_init__(self) -> None:
        if self.distortion not in DISTORTION_MODELS:
            raise InputError(
                f"distortion is '{self.distortion}'", f"choose {' | '.join(DISTORTION_MODELS)}"
            )
        if self.camera is not None and self.camera.image_size != tuple(self.image_size):
            raise InputError(
                f"the known camera's pictures have {list(self.camera.image_size)} px, the rig's "
                f"have {list(self.image_size)}",
                "give the calibration of this camera at this picture size",
            )
        if self.pixel_std is not None and not (
            math.isfinite(self.pixel_std) and self.pixel_std > 0
        ):
            raise InputError(
                f"pixel_std is {self.pixel_std} px", "give a value above zero, or leave it out"
            )
        if self.placement_std is not None and not (
            math.isfinite(self.placement_std) and self.placement_std >= 0
        ):
            raise InputError(
                f"placement_std is {self.placement_std} mm",
                "give a value of 0 or more, or leave it out",
            )
        if len(set(self.lasers)) != len(self.lasers) or "" in self.lasers:
            raise InputError(
                f"the lasers are called {list(self.lasers)}", "give each laser a name of its own"
            )
        if len(self.image_size) != 2 or min(self.image_size) < 1:
            raise InputError(
                f"image_size is {list(self.image_size)}", "give [width, height] in pixels"
            )

    @property
    def free_intrinsics(self) -> tuple[str, ...]:
        """Names of the camera parameters to estimate, in `Camera.PARAMETERS` order."""
        if self.camera is not None:
            return ()
        skew = ("gamma",) if self.skew else ()
        return ("alpha", "beta", *skew, "u0", "v0", *DISTORTION_MODELS[self.distortion])
