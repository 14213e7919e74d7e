"""Measured pictures as the page shows them: picture, ends, lengths, the line in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from sheetoflight.errors import InputError
from sheetoflight.model.calibration import Calibration
from sheetoflight.report import space
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.report.numbers import rounded
from sheetoflight.report.picture_png import embedded
from sheetoflight.report.plots import Plot, plot

_RADIUS_SHARE = 1 / 90
_TEXT_SHARE = 1 / 32


@dataclass(frozen=True)
class PieceRow:
    """A whole piece of the laser line: its number in the picture, its name as in ``lengths.csv``,
    and its length in mm as text."""

    number: int
    segment: str
    points: int
    length: str
    std: str
    low: str
    high: str


@dataclass(frozen=True)
class EndMark:
    """An end of a piece in the picture, and where the piece's number stands beside it, px; a
    piece without a length has no number."""

    number: int | None
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
    """All pictures made ready for the page.

    Raises
    ------
    InputError
        If a picture has another size than the calibrated camera's.
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
    rows = _piece_rows(picture)
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
    names = [
        "piece without a length" if piece_number is None else f"piece {piece_number}"
        for piece_number in _numbers(picture)
    ]
    return plot(
        space.reconstructed(calibration, picture.pieces, names, picture.laser),
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
    for number, piece in zip(_numbers(picture), picture.pieces, strict=True):
        for u, v in piece.ends:
            text_u = u + gap if u + gap + text < width else u - gap - text
            text_v = v - gap if v - gap - text > 0 else v + gap + text
            places = (round(float(x), 2) for x in (u, v, text_u, text_v))
            marks.append(EndMark(number, *places))
    return tuple(marks)


def _numbers(picture: MeasuredPicture) -> list[int | None]:
    """Numbers of the whole pieces from 1, as ``lengths.csv`` counts them; None for others."""
    whole = [piece.whole for piece in picture.pieces]
    return [sum(whole[: place + 1]) if one else None for place, one in enumerate(whole)]


def _piece_rows(picture: MeasuredPicture) -> tuple[PieceRow, ...]:
    """Lengths of the whole pieces; a piece that leaves the picture has none."""
    whole = [piece for piece in picture.pieces if piece.whole]
    rows = []
    for number, (piece, measured) in enumerate(zip(whole, picture.segments, strict=True), 1):
        value, std = rounded(measured.length.value, measured.length.std)
        low, high = (rounded(bound, measured.length.std)[0] for bound in measured.length.interval)
        rows.append(PieceRow(number, measured.name, len(piece), value, std, low, high))
    return tuple(rows)
