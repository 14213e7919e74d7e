"""What is to be estimated, and from what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import ANCHOR, intrinsic_names, sheet_names
from sheetoflight.model.camera import Camera
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig


@dataclass(frozen=True)
class EstimationTask:
    """A camera with what else is to be found beside it.

    Parameters
    ----------
    rig : Rig
    noise : NoiseModel
    stages : mapping from stage to TargetViews
        The views to use.
    others : tuple of str
        Shared parameters beside the camera's.
    blamed : str
        The stage to name where nothing fits.
    """

    rig: Rig
    noise: NoiseModel
    stages: Mapping[str, TargetViews]
    others: tuple[str, ...]
    blamed: str = "joint"

    @classmethod
    def of_everything(cls, rig: Rig, noise: NoiseModel) -> EstimationTask:
        """Camera, fixed point and sheets from all views together."""
        stages = rig.observations.stages()
        anchor = ANCHOR if "camera" in stages else ()
        return cls(rig, noise, stages, (*anchor, *sheet_names(len(rig.lasers))))

    @property
    def without_distortion(self) -> tuple[str, ...]:
        """The shared parameters to estimate where the lens distorts as the start has it."""
        pinhole = [name for name in self.rig.free_intrinsics if name in Camera.PARAMETERS[:5]]
        return (*intrinsic_names(pinhole), *self.others)

    @property
    def free(self) -> tuple[str, ...]:
        """All shared parameters to estimate."""
        return (*intrinsic_names(self.rig.free_intrinsics), *self.others)
