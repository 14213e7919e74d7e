"""A rig folder calibrated."""

from __future__ import annotations

import platform
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, overload

from sheetoflight.calibration import methods
from sheetoflight.calibration.camera_free_method import camera_free
from sheetoflight.calibration.control_forms import FORMS
from sheetoflight.calibration.known_camera import doubts_of_known_camera
from sheetoflight.calibration.match_methods import MATCH_METHODS
from sheetoflight.calibration.methods import CAMERA_FREE, CalibrationOptions
from sheetoflight.calibration.self_generated_method import SELF_GENERATED, refuse_places
from sheetoflight.errors import UntrustworthyError
from sheetoflight.io.calibration_json import read_any_calibration, read_calibration
from sheetoflight.io.exchange import is_calibration, read_exchange
from sheetoflight.measurement.second_opinion import second_opinion
from sheetoflight.model.board import Board, PlanarBoard
from sheetoflight.model.calibration import AnyCalibration, Calibration, SheetCalibration
from sheetoflight.model.rig import Rig
from sheetoflight.model.second_opinion import SecondOpinion
from sheetoflight.workflow.rig_folder import load_rig
from sheetoflight.workflow.spread import ALONE, Execution

_LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "pymoo")


def load_calibration(path: str | Path) -> Calibration:
    """Read ``calibration.json``.

    Raises
    ------
    FileError, InputError
        If the file cannot be read or does not hold a calibration.
    """
    return read_calibration(path)


def load_any_calibration(path: str | Path) -> AnyCalibration:
    """Read ``calibration.json``, with or without a camera: all that can be measured with.

    Raises
    ------
    FileError, InputError
        If the file cannot be read or does not hold a calibration.
    """
    return read_any_calibration(path)


@overload
def calibrate_folder(  # pyright: ignore[reportOverlappingOverload] – the literal comes first
    folder: str | Path,
    method: Literal["camera-free"],
    options: CalibrationOptions | None = None,
    run: Execution = ALONE,
) -> SheetCalibration: ...


@overload
def calibrate_folder(
    folder: str | Path,
    method: str = "joint",
    options: CalibrationOptions | None = None,
    run: Execution = ALONE,
) -> Calibration: ...


def calibrate_folder(
    folder: str | Path,
    method: str = "joint",
    options: CalibrationOptions | None = None,
    run: Execution = ALONE,
) -> AnyCalibration:
    """Load a rig folder and calibrate it, noting in the result what was used.

    Raises
    ------
    FileError, InputError
        As for `load_rig`.
    UntrustworthyError
        If no trustworthy number can be had from these views.
    """
    return calibrate(load_rig(folder, run), method, options)


@overload
def calibrate(  # pyright: ignore[reportOverlappingOverload] – the literal comes first
    rig: Rig, method: Literal["camera-free"], options: CalibrationOptions | None = None
) -> SheetCalibration: ...


@overload
def calibrate(
    rig: Rig, method: str = "joint", options: CalibrationOptions | None = None
) -> Calibration: ...


def calibrate(
    rig: Rig, method: str = "joint", options: CalibrationOptions | None = None
) -> AnyCalibration:
    """Calibrate a rig, noting in the result what was used.

    Parameters
    ----------
    rig : Rig
    method : str
        See `calibration.methods.calibrate`; beside those ``camera-free``, which needs no camera
        stage and gives a `SheetCalibration`, with which lengths on the sheet are measured.
    options : CalibrationOptions, optional
    """
    options = options or CalibrationOptions()
    provenance = _provenance(rig, method, options)
    alone = ("paper", SELF_GENERATED, *FORMS, *MATCH_METHODS)  # of one kind of evidence
    if method not in alone:
        refuse_places(rig, method)
    if method == CAMERA_FREE:
        return replace(camera_free(rig), provenance=provenance)
    if method in alone:
        found = methods.calibrate(rig, method, options)
    else:
        doubts = doubts_of_known_camera(rig)
        found = _with_second_opinion(rig, method, options)
        found = replace(found, warnings=(*doubts, *found.warnings))
    return replace(found, provenance=provenance)


def _with_second_opinion(rig: Rig, method: str, options: CalibrationOptions) -> Calibration:
    """Calibrate all together, and where there are rod and board, each of them alone as well.

    Raises
    ------
    UntrustworthyError
        If no trustworthy number can be had; it says so where the two contradict each other.
    """

    def alone(part: Rig) -> Calibration:
        return methods.calibrate(part, method, options)

    try:
        together = alone(rig)
    except UntrustworthyError as refusal:
        opinion = second_opinion(rig, alone)
        if opinion is None or opinion.agrees:
            raise
        raise _contradiction(opinion, refusal) from refusal
    opinion = second_opinion(rig, alone)
    warnings = together.warnings
    if opinion is not None and not opinion.agrees:
        warnings = (*warnings, "; ".join(opinion.verdict[:2]))
    return replace(together, second_opinion=opinion, warnings=warnings)


def _contradiction(opinion: SecondOpinion, refusal: UntrustworthyError) -> UntrustworthyError:
    """A refusal of all together, where what each says alone tells why."""
    what, remedy = opinion.difference
    together = "" if opinion.scale_only else f"; taken together, {refusal.what}"
    return UntrustworthyError("joint", f"{opinion.judgement}; {what}{together}", remedy)


def _board(board: Board) -> dict[str, Any]:
    """A board as ``[board]`` has it."""
    if isinstance(board, PlanarBoard):
        return asdict(board)
    return {"kind": "solid", "points_mm": board.points.tolist(), "faces": board.face_points}


def with_camera(rig: Rig, path: str | Path) -> Rig:
    """The rig with a camera that is known already.

    Parameters
    ----------
    rig : Rig
    path : str or Path
        A ``calibration.json``, whose covariance is kept, or a file of another tool
        (`sheetoflight.io.exchange`), whose camera is taken to be exact.

    Raises
    ------
    FileError, InputError
        If the file cannot be read, holds no camera, or one of another picture size.
    """
    if is_calibration(path):
        known = read_calibration(path)
        return replace(rig, camera=known.camera, camera_covariance=known.covariance)
    return replace(rig, camera=read_exchange(path, image_size=rig.image_size).camera)


def _provenance(rig: Rig, method: str, options: CalibrationOptions) -> dict[str, Any]:
    """What anybody needs to get the same numbers again; the same for the same input."""
    return {
        "software": f"sheetoflight {version('sheetoflight')}",
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in _LIBRARIES},
        "rig": Path(rig.source).parent.name if rig.source else "",
        "lens_model": rig.distortion,
        "skew": rig.skew,
        "views": rig.observations.counts(),
        "board": None if rig.board is None else _board(rig.board),
        "known_camera": rig.camera is not None,
        "stated_pixel_std": rig.pixel_std,
        "stated_placement_std_mm": rig.placement_std,
        "options": _options(method, options),
    }


def _options(method: str, options: CalibrationOptions) -> dict[str, Any]:
    """Those that the method has, and that are not as they come."""
    if method == "paper":
        return asdict(options.paper)
    return {"flat": True} if method == "joint" and options.flat else {}
