"""What a file of another tool holds, and what of a calibration such a file cannot hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.exchange.lens_fit import picture_grid
from sheetoflight.io.quoting import one_line
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane


@dataclass(frozen=True, eq=False, kw_only=True)
class Exchanged:
    """A camera, and the light planes if there are any, read from a file of another tool.

    Parameters
    ----------
    camera : Camera
    light_planes : tuple of LightPlane
        In the camera frame, mm; empty where the file holds none.
    format : str
        Which of `EXCHANGE_FORMATS` it was.
    notes : tuple of str
        What the file said that is not held here, and what had to be assumed.
    """

    camera: Camera
    light_planes: tuple[LightPlane, ...] = ()
    format: str
    notes: tuple[str, ...] = ()

    def as_calibration(self, pixel_std: float) -> Calibration:
        """A calibration whose camera and light planes have no stated uncertainty.

        Parameters
        ----------
        pixel_std : float
            Standard uncertainty of an image coordinate, px. No such file states it.

        Raises
        ------
        InputError
            If there is no light plane, or `pixel_std` is not above zero.
        """
        if not self.light_planes:
            raise InputError(
                f"the {self.format} file holds a camera and no light plane",
                "a calibration needs both: write it in a format for cameras, or calibrate",
            )
        if not (math.isfinite(pixel_std) and pixel_std > 0):
            raise InputError(f"pixel_std is {pixel_std} px", "give a value above 0")
        warning = (
            f"camera and light plane come from a {self.format} file, which states no uncertainty "
            "of them: intervals hold the noise of the image points alone"
        )
        return Calibration(
            method="imported",
            camera=self.camera,
            light_planes=self.light_planes,
            covariance=Covariance((), np.zeros((0, 0))),
            residuals=Residuals(0.0, 0.0),
            target=None,
            pixel_std=pixel_std,
            warnings=(warning,),
            provenance={"format": self.format, "notes": list(self.notes)},
        )


Source = Calibration | Exchanged
"""What can be written: both have a camera and light planes, an exchanged one perhaps none."""


def with_lens_checked(exchanged: Exchanged) -> Exchanged:
    """The same, with a note where the distortion has no inverse in a part of the picture."""
    rays = exchanged.camera.unproject(picture_grid(exchanged.camera.image_size))
    if np.isfinite(rays).all():
        return exchanged
    note = "its distortion has no inverse in a part of the picture: no point is had there"
    return replace(exchanged, notes=(*exchanged.notes, note))


def lost_uncertainty(source: Source) -> tuple[str, ...]:
    """The note that the covariance has no place in a file; none where there is no covariance."""
    known = isinstance(source, Calibration) and bool(source.covariance.parameters)
    return ("the uncertainties of camera and light plane have no place in it",) if known else ()


def lost_curvature(source: Source) -> tuple[str, ...]:
    """The note that the bend of curved sheets has no place in a file that holds light planes; none
    where all are flat."""
    curved = [plane.name for plane in source.light_planes if plane.curvature is not None]
    if not curved:
        return ()
    names = one_line(", ".join(curved))
    return (
        f"the curvature of {names} has no place in it: what it holds is the plane it bends from",
    )


def lost_planes(source: Source) -> tuple[str, ...]:
    """The note that light planes have no place in a file; none where there is no plane."""
    count = len(source.light_planes)
    planes = "the light plane has" if count == 1 else f"the {count} light planes have"
    return (f"{planes} no place in it",) if count else ()


def skew_lost_px(camera: Camera) -> float:
    """How far at most the image points move where the skew is left out, px."""
    height = camera.image_size[1]
    farthest = max(abs(-0.5 - camera.v0), abs(height - 0.5 - camera.v0))
    return abs(camera.gamma) * farthest / camera.beta
