"""The report page and the printable target, as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sheetoflight.imaging.stripe.binary import binary_line
from sheetoflight.io.atomic import write_whole
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.contents import MeasuredPicture, Table
from sheetoflight.report.page import build_report
from sheetoflight.report.sheet_layout import SheetPage
from sheetoflight.report.target_sheet import sheet_format, target_sheet
from sheetoflight.workflow.measured import PictureLengths, laser_pictures


def write_report(
    path: str | Path,
    calibration: Calibration,
    pictures: Sequence[PictureLengths] = (),
    tables: Sequence[Table] = (),
) -> None:
    """Write one self-contained HTML page, whole or not at all.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    shown = [_shown(measured) for measured in pictures]
    write_whole(path, build_report(calibration, shown, tables))


def write_target(path: str | Path, target: CollinearTarget, page: SheetPage = "strip") -> None:
    """Write the target to print, true to scale, as SVG or PDF by the path's ending.

    Raises
    ------
    InputError
        If the ending is another, or the target does not fit the page.
    FileError
        If the file cannot be written.
    """
    write_whole(path, target_sheet(target, sheet_format(path), page))


def _shown(measured: PictureLengths) -> MeasuredPicture:
    on, off = laser_pictures(measured.file)
    grey = on if on.ndim == 2 else on.max(axis=2).astype(on.dtype)
    return MeasuredPicture(
        measured.file.name,
        np.asarray(grey),
        binary_line(on, off),
        measured.pieces,
        measured.segments,
        measured.laser,
    )
