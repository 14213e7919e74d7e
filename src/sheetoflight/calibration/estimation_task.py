"""What is to be estimated, and from what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.rig_state import ANCHOR, RigState, intrinsic_names, sheet_names
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
    start : RigState, optional
        Camera and poses of the boards, where there are boards.
    """

    rig: Rig
    noise: NoiseModel
    stages: Mapping[str, TargetViews]
    others: tuple[str, ...]
    blamed: str = "joint"
    start: RigState | None = None

    @classmethod
    def of_everything(
        cls, rig: Rig, noise: NoiseModel, start: RigState | None = None
    ) -> EstimationTask:
        """Camera, fixed point and sheets from all views together."""
        stages = rig.observations.stages()
        anchor = ANCHOR if "camera" in stages else ()
        blamed = "joint" if stages else "board"
        others = (*anchor, *sheet_names(len(rig.lasers)))
        return cls(rig, noise, stages, others, blamed, start)

    @property
    def without_distortion(self) -> tuple[str, ...]:
        """The shared parameters to estimate where the lens distorts as the start has it."""
        pinhole = [name for name in self.rig.free_intrinsics if name in Camera.PARAMETERS[:5]]
        return (*intrinsic_names(pinhole), *self.others)

    @property
    def free(self) -> tuple[str, ...]:
        """All shared parameters to estimate."""
        return (*intrinsic_names(self.rig.free_intrinsics), *self.others)
