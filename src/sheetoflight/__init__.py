"""Calibrate a camera and a sheet of light, and measure with known uncertainty.

The public names load on first use, so that importing the package stays cheap.

Examples
--------
>>> import sheetoflight as sol
>>> rig = sol.load_rig("rig/")  # doctest: +SKIP
>>> calibration = sol.calibrate(rig)  # doctest: +SKIP
>>> calibration.length((700, 400), (720, 640)).value  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from sheetoflight.calibration.methods import CalibrationOptions as CalibrationOptions
    from sheetoflight.errors import FileError as FileError
    from sheetoflight.errors import InputError as InputError
    from sheetoflight.errors import SheetOfLightError as SheetOfLightError
    from sheetoflight.errors import ToleranceError as ToleranceError
    from sheetoflight.errors import UntrustworthyError as UntrustworthyError
    from sheetoflight.imaging.stripe.extraction import StripeOptions as StripeOptions
    from sheetoflight.imaging.stripe.extraction import extract_stripe as extract_stripe
    from sheetoflight.imaging.stripe.scan.scanner import ScanOptions as ScanOptions
    from sheetoflight.imaging.stripe.scan.scanner import scan as scan
    from sheetoflight.io.clouds import read_cloud as read_cloud
    from sheetoflight.io.clouds import write_cloud as write_cloud
    from sheetoflight.measurement.flatness import fitted_plane_in_space as fitted_plane_in_space
    from sheetoflight.measurement.reconstruction import reconstruct as reconstruct
    from sheetoflight.measurement.straightness import lines_of as lines_of
    from sheetoflight.model.calibration import Calibration as Calibration
    from sheetoflight.model.camera import Camera as Camera
    from sheetoflight.model.light_plane import LightPlane as LightPlane
    from sheetoflight.model.observations import Observations as Observations
    from sheetoflight.model.observations import TargetViews as TargetViews
    from sheetoflight.model.point_cloud import PointCloud as PointCloud
    from sheetoflight.model.rig import Rig as Rig
    from sheetoflight.model.stripe import Stripe as Stripe
    from sheetoflight.model.target import CollinearTarget as CollinearTarget
    from sheetoflight.workflow.calibrated import calibrate as calibrate
    from sheetoflight.workflow.calibrated import load_calibration as load_calibration
    from sheetoflight.workflow.rig_folder import load_rig as load_rig

_HOMES = {
    "Calibration": "model.calibration",
    "CalibrationOptions": "calibration.methods",
    "Camera": "model.camera",
    "CollinearTarget": "model.target",
    "FileError": "errors",
    "InputError": "errors",
    "LightPlane": "model.light_plane",
    "Observations": "model.observations",
    "PointCloud": "model.point_cloud",
    "Rig": "model.rig",
    "ScanOptions": "imaging.stripe.scan.scanner",
    "SheetOfLightError": "errors",
    "Stripe": "model.stripe",
    "StripeOptions": "imaging.stripe.extraction",
    "TargetViews": "model.observations",
    "ToleranceError": "errors",
    "UntrustworthyError": "errors",
    "calibrate": "workflow.calibrated",
    "extract_stripe": "imaging.stripe.extraction",
    "fitted_plane_in_space": "measurement.flatness",
    "lines_of": "measurement.straightness",
    "load_calibration": "workflow.calibrated",
    "load_rig": "workflow.rig_folder",
    "read_cloud": "io.clouds",
    "reconstruct": "measurement.reconstruction",
    "scan": "imaging.stripe.scan.scanner",
    "write_cloud": "io.clouds",
}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604  # pyright: ignore[reportUnsupportedDunderAll] – the keys are the names


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
