"""A calibration verified: known lengths against measured ones."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.known_csv import read_known
from sheetoflight.io.quoting import file_name, shown
from sheetoflight.io.segments_csv import Segments, read_segments
from sheetoflight.measurement.comparison import KnownLength, MeasuredSegment, PermissibleError
from sheetoflight.measurement.verification import Verification, verify_lengths
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.workflow.calibrated import load_any_calibration
from sheetoflight.workflow.measured import measure_pictures, measured_segments, pictures_named
from sheetoflight.workflow.spread import ALONE, Execution

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NEAR = 3


@dataclass(frozen=True)
class _Measured:
    """What was measured, the known lengths that came with it, and what went missing."""

    segments: list[MeasuredSegment]
    known: dict[str, KnownLength]
    warnings: tuple[str, ...] = ()


def verify(
    calibration: str | Path,
    inputs: Sequence[str | Path],
    known: str | Path | float | None = None,
    limit: PermissibleError | None = None,
    run: Execution = ALONE,
    known_std: float | None = None,
    laser: str | None = None,
) -> Verification:
    """Measure segments or pictures and compare the lengths with known ones.

    Parameters
    ----------
    calibration : path
        The ``calibration.json``.
    inputs : sequence of paths
        One ``segments.csv``, which may have columns ``known_mm`` and ``known_std_mm``; or
        pictures and folders of these.
    known : path or float, optional
        A table ``segment,known_mm[,known_std_mm]``, or the length of all segments in mm.
    limit : PermissibleError, optional
        The maximum permissible error; without one, errors are held against their uncertainties.
    run : Execution
    known_std : float, optional
        Standard uncertainty of `known` in mm where that is one length; exact where absent.
    laser : str, optional
        In whose sheet the pictures, or segments that name no laser, lie; may be left out where
        there is one.

    Raises
    ------
    FileError, InputError
        If a file cannot be used, no length is known, one is known twice, or one belongs to no
        segment.
    UntrustworthyError
        If nothing can be measured, or there is nothing to judge an error by.
    """
    calibrated = load_any_calibration(calibration)
    measured = _measured(calibrated, [Path(path) for path in inputs], run, laser)
    names = [segment.name for segment in measured.segments]
    stated = _stated(known, known_std, names)
    for name in stated:
        if name in measured.known:
            raise InputError(
                f"segment {shown(name)} has a known length in segments.csv and in --known",
                "keep one of the two",
            )
    verification = verify_lengths(calibrated, measured.segments, measured.known | stated, limit)
    return replace(
        verification,
        warnings=(*_of_calibration(calibrated), *measured.warnings),
        provenance={
            "software": f"sheetoflight {version('sheetoflight')}",
            "calibration": Path(calibration).name,
            "method": calibrated.method,
            "inputs": [Path(path).name for path in inputs],
            "known": Path(known).name if isinstance(known, str | Path) else known,
        },
    )


def write_verification_page(path: str | Path, verification: Verification) -> None:
    """Write a verification as one self-contained HTML page, whole or not at all.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    from sheetoflight.report.verification_page import build_verification_page

    write_whole(path, build_verification_page(verification))


def _measured(
    calibration: AnyCalibration, inputs: list[Path], run: Execution, laser: str | None
) -> _Measured:
    tables = [path for path in inputs if path.suffix.lower() == ".csv"]
    if not tables:
        return _in_pictures(calibration, inputs, run, laser)
    if len(inputs) > 1:
        raise InputError(
            f"{len(inputs)} inputs with {tables[0].name} among them",
            "give one segments.csv, or pictures, not both",
        )
    table = read_segments(tables[0])
    return _Measured(measured_segments(calibration, table, laser), _known_in(table))


def _known_in(table: Segments) -> dict[str, KnownLength]:
    unknown = np.full(len(table), np.nan)
    values = unknown if table.known_mm is None else table.known_mm
    std = np.nan_to_num(unknown if table.known_std_mm is None else table.known_std_mm)
    return {
        name: KnownLength(float(value), float(uncertainty))
        for name, value, uncertainty in zip(table.names, values, std, strict=True)
        if math.isfinite(value)
    }


def _in_pictures(
    calibration: AnyCalibration, inputs: list[Path], run: Execution, laser: str | None
) -> _Measured:
    pictures = measure_pictures(calibration, pictures_named(inputs), run, laser)
    segments = [segment for picture in pictures for segment in picture.segments]
    if not segments:
        raise UntrustworthyError(
            "verify",
            f"no piece of the laser line with both its ends in {len(pictures)} pictures",
            "take pictures in which both ends of the lit object are seen, with the laser on",
        )
    empty = [picture.file.name for picture in pictures if not picture.segments]
    return _Measured(segments, {}, tuple(f"{name}: nothing measured" for name in empty))


def _stated(
    known: str | Path | float | None, known_std: float | None, names: Sequence[str]
) -> dict[str, KnownLength]:
    """Known lengths by segment, from a number for all or from a table."""
    if isinstance(known, int | float) or _NUMBER.fullmatch(str(known)):
        return dict.fromkeys(names, KnownLength(float(str(known)), known_std or 0.0))
    if known_std is not None:
        raise InputError(
            "a standard uncertainty of the known length is given, but not one length for all",
            "give a column known_std_mm in the table of known lengths",
        )
    if known is None:
        return {}
    path = Path(known)
    if not path.exists():
        raise InputError(
            f"the known lengths {shown(str(known))} are neither a number of mm nor a file",
            "give one length such as 300, or a table segment,known_mm",
        )
    return _refuse_strangers(read_known(path), names, path)


def _refuse_strangers(
    known: Mapping[str, KnownLength], names: Sequence[str], path: Path
) -> dict[str, KnownLength]:
    for name in known:
        if name not in names:
            near = difflib.get_close_matches(name, names, n=_NEAR)
            meant = f"perhaps {' or '.join(map(shown, near))} is meant" if near else "correct it"
            raise InputError(
                f"{file_name(path)}: segment {shown(name)} was not measured",
                f"{meant}, or remove its row",
            )
    return dict(known)


def _of_calibration(calibration: AnyCalibration) -> tuple[str, ...]:
    if calibration.covariance.parameters:
        return ()
    return (
        "The calibration carries no covariance: the stated uncertainties are those of the image "
        "points alone.",
    )
