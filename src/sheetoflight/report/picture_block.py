"""Measured pictures as the page shows them: picture, ends, lengths, the line in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from sheetoflight.errors import InputError
from sheetoflight.measurement.length import lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.report import space
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.report.numbers import NO_UNCERTAINTY, rounded, two_digits
from sheetoflight.report.picture_png import embedded
from sheetoflight.report.plots import Plot, plot

_RADIUS_SHARE = 1 / 90
_TEXT_SHARE = 1 / 32


@dataclass(frozen=True)
class PieceRow:
    """A piece of the laser line with its length in mm as text."""

    number: int
    points: int
    length: str
    std: str
    from_calibration: str
    low: str
    high: str


@dataclass(frozen=True)
class EndMark:
    """An end of a piece in the picture, and where the piece's number stands beside it, px."""

    number: int
    u: float
    v: float
    text_u: float
    text_v: float


@dataclass(frozen=True)
class PictureBlock:
    """A measured picture with everything the page shows of it."""

    name: str
    width: int
    height: int
    grey: Markup
    binary: Markup
    radius: float
    text_size: float
    marks: tuple[EndMark, ...]
    rows: tuple[PieceRow, ...]
    left_out: int
    plot: Plot | None


def picture_blocks(
    calibration: Calibration, pictures: Sequence[MeasuredPicture]
) -> list[PictureBlock]:
    """All pictures, measured and made ready for the page.

    Raises
    ------
    InputError
        If a picture has another size than the calibrated camera's, or an end of a whole piece
        does not lie on the sheet of light.
    """
    for picture in pictures:
        _check_size(picture, calibration)
    return [
        _block(calibration, picture, number, *uris)
        for number, (picture, uris) in enumerate(
            zip(pictures, embedded(pictures), strict=True), start=1
        )
    ]


def _check_size(picture: MeasuredPicture, calibration: Calibration) -> None:
    height, width = picture.image.shape
    expected = calibration.camera.image_size
    if (width, height) != expected:
        raise InputError(
            f"picture {picture.name} has {width} × {height} pixels, the camera was calibrated "
            f"with {expected[0]} × {expected[1]}",
            "give pictures of the calibrated camera at their full size",
        )


def _block(
    calibration: Calibration, picture: MeasuredPicture, number: int, grey: str, binary: str
) -> PictureBlock:
    height, width = picture.image.shape
    rows = _piece_rows(calibration, picture)
    return PictureBlock(
        name=picture.name,
        width=width,
        height=height,
        grey=Markup(grey),
        binary=Markup(binary),
        radius=round(_RADIUS_SHARE * width, 2),
        text_size=round(_TEXT_SHARE * width, 2),
        marks=_end_marks(picture),
        rows=rows,
        left_out=len(picture.pieces) - len(rows),
        plot=_in_space(calibration, picture, number) if picture.pieces else None,
    )


def _in_space(calibration: Calibration, picture: MeasuredPicture, number: int) -> Plot:
    return plot(
        space.reconstructed(calibration, picture.pieces),
        f"figure-reconstructed-{number}",
        "The laser line in space",
        "Camera frame in mm; turn it with the mouse. The paper's figure 8.",
        "space",
    )


def _end_marks(picture: MeasuredPicture) -> tuple[EndMark, ...]:
    """Both ends of each piece, the number to the upper right where the picture has room."""
    width = picture.image.shape[1]
    text = _TEXT_SHARE * width
    gap = 1.5 * _RADIUS_SHARE * width
    marks = []
    for number, piece in enumerate(picture.pieces, start=1):
        for u, v in piece.ends:
            text_u = u + gap if u + gap + text < width else u - gap - text
            text_v = v - gap if v - gap - text > 0 else v + gap + text
            places = (round(float(x), 2) for x in (u, v, text_u, text_v))
            marks.append(EndMark(number, *places))
    return tuple(marks)


def _piece_rows(calibration: Calibration, picture: MeasuredPicture) -> tuple[PieceRow, ...]:
    """Lengths of the whole pieces; a piece that leaves the picture has none."""
    whole = [(n, piece) for n, piece in enumerate(picture.pieces, start=1) if piece.whole]
    if not whole:
        return ()
    measured = lengths(
        calibration,
        np.stack([piece.ends for _, piece in whole]),
        np.stack([piece.ends_std for _, piece in whole]),
        tuple(f"{number} of {picture.name}" for number, _ in whole),
    )
    rows = []
    for (number, piece), found in zip(whole, measured, strict=True):
        value, std = rounded(found.value, found.std)
        low, high = (rounded(bound, found.std)[0] for bound in found.interval)
        known = calibration.covariance.parameters
        share = two_digits(dict(found.budget)["calibration"]) if known else NO_UNCERTAINTY
        rows.append(PieceRow(number, len(piece), value, std, share, low, high))
    return tuple(rows)
