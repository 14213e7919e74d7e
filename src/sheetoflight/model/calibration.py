"""The result of a calibration: camera, sheets of light, and how well they are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.diagnosis import Finding
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.monte_carlo import MonteCarlo
from sheetoflight.model.second_opinion import SecondOpinion
from sheetoflight.model.sheet_map import SheetMap
from sheetoflight.model.target import CollinearTarget

if TYPE_CHECKING:
    from sheetoflight.measurement.length import Length


@dataclass(frozen=True, eq=False)
class ViewResiduals:
    """How one view fits.

    Parameters
    ----------
    stage, view : str
    uv : (M, 2) array
        Observed image points, px; NaN where not seen.
    residuals : (M, 2) array
        Observed minus predicted, px.
    xyz : (M, 3) array
        Estimated markers in the camera frame, mm.
    """

    stage: str
    view: str
    uv: Array
    residuals: Array
    xyz: Array

    @property
    def rms_px(self) -> float:
        """Root mean square residual per image coordinate, px."""
        seen = self.residuals[np.isfinite(self.residuals)]
        return float(np.sqrt(np.mean(seen**2))) if seen.size else 0.0


@dataclass(frozen=True, eq=False)
class Residuals:
    """How the observations fit: root mean square per coordinate, chi-squared per degree of
    freedom (1 where the noise was estimated from the residuals themselves), and every view."""

    rms_px: float
    chi2_per_dof: float
    views: tuple[ViewResiduals, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class _Measuring:
    """What either kind of calibration holds beside its sheets, and what can be done with it."""

    method: str
    covariance: Covariance
    residuals: Residuals
    target: CollinearTarget | None
    pixel_std: float
    warnings: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.pixel_std) and self.pixel_std >= 0):
            raise InputError(f"pixel_std is {self.pixel_std} px", "give a value of 0 or more")

    @property
    def lasers(self) -> tuple[str, ...]:
        """Names of the sheets of light."""
        raise NotImplementedError

    def _number(self, laser: str | None) -> int:
        """The place of a laser's sheet.

        Raises
        ------
        InputError
            If there is no laser of that name, or several and none is named.
        """
        if not self.lasers:
            raise InputError(
                "the calibration holds a camera and no sheet of light",
                "calibrate with views that show the laser's line",
            )
        names = " | ".join(self.lasers)
        if laser is None and len(self.lasers) > 1:
            raise InputError(f"the calibration has the lasers {names}", "say which one is meant")
        if laser is not None and laser not in self.lasers:
            raise InputError(f"the calibration has no laser '{laser}'", f"choose {names}")
        return 0 if laser is None else self.lasers.index(laser)

    # The three methods below are the public face of higher floors; the import contract
    # names these imports one by one (docs/decisions/0002-methods-on-calibration.md).

    def triangulate(self, uv: Array, laser: str | None = None) -> Array:
        """Image points ``(N, 2)`` px on the laser line to points ``(N, 3)`` mm, camera frame.

        See `sheetoflight.measurement.triangulation.triangulate`.
        """
        from sheetoflight.measurement.triangulation import triangulate

        return triangulate(cast("AnyCalibration", self), uv, laser)

    def length(
        self, uv_1: Array, uv_2: Array, std_px: float | None = None, laser: str | None = None
    ) -> Length:
        """Distance between two image points on the laser line, with its uncertainty.

        See `sheetoflight.measurement.length.length`.
        """
        from sheetoflight.measurement.length import length

        return length(cast("AnyCalibration", self), uv_1, uv_2, std_px, laser)

    def save(self, path: str | Path) -> None:
        """Write ``calibration.json``, whole or not at all."""
        from sheetoflight.io.calibration_json import write_calibration

        write_calibration(path, cast("AnyCalibration", self))


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration(_Measuring):
    """A calibrated sensor.

    Parameters
    ----------
    method : str
        How it was calibrated: ``joint``, ``two-step``, ``paper`` …
    camera : Camera
    light_planes : tuple of LightPlane
        None where the camera alone was calibrated.
    covariance : Covariance
    residuals : Residuals
    target : CollinearTarget, optional
        What gave the scale; its tolerance is part of every length's uncertainty.
    pixel_std : float
        Standard uncertainty of a marker's image coordinate, px, given or estimated.
    warnings : tuple of str
        What a careful user should know before trusting the numbers.
    findings : tuple of Finding
        What the residuals point to, where they are larger than noise.
    provenance : mapping
        What was used to get them: files, versions, options.
    monte_carlo : MonteCarlo, optional
        What re-simulated calibrations say of the covariance, where that was asked for.
    second_opinion : SecondOpinion, optional
        Rod and board, each solved alone and compared, where there are both.
    """

    camera: Camera
    light_planes: tuple[LightPlane, ...]
    monte_carlo: MonteCarlo | None = None
    second_opinion: SecondOpinion | None = None

    @property
    def light_plane(self) -> LightPlane:
        """The first, and most often the only, sheet of light."""
        return self.sheet(self.lasers[0] if self.lasers else None)

    def sheet(self, laser: str | None = None) -> LightPlane:
        """The sheet of light of a laser.

        Parameters
        ----------
        laser : str, optional
            Its name; may be left out where there is one.

        Raises
        ------
        InputError
            If there is no laser of that name, or several and none is named.
        """
        return self.light_planes[self._number(laser)]

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the pictures in px."""
        return self.camera.image_size

    @property
    def lasers(self) -> tuple[str, ...]:
        """Names of the sheets of light."""
        return tuple(plane.name for plane in self.light_planes)


@dataclass(frozen=True, eq=False, kw_only=True)
class SheetCalibration(_Measuring):
    """Sheets of light that can be measured in, the camera being unknown (method camera-free).

    Points are in the frame of their own sheet, z being 0.

    Parameters
    ----------
    method : str
    sheet_maps : tuple of SheetMap
    covariance : Covariance
        Of ``laser.a``, ``laser.b``, ``laser.c``, ``laser.l1``, ``laser.l2``.
    residuals, target, pixel_std, warnings, findings, provenance
        As of `Calibration`; the residuals' ``xyz`` are in the frame of the view's sheet.
    """

    sheet_maps: tuple[SheetMap, ...]

    def sheet(self, laser: str | None = None) -> SheetMap:
        """The sheet of light of a laser; its name may be left out where there is one.

        Raises
        ------
        InputError
            If there is no laser of that name, or several and none is named.
        """
        return self.sheet_maps[self._number(laser)]

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the pictures in px."""
        return self.sheet_maps[0].image_size

    @property
    def lasers(self) -> tuple[str, ...]:
        """Names of the sheets of light."""
        return tuple(sheet.name for sheet in self.sheet_maps)


AnyCalibration = Calibration | SheetCalibration
"""What can be measured with."""
