"""One centre of the laser line for every column (or row) of a frame, at the camera's rate.

For streams from a profile sensor, where the line crosses every column (or every row) once. For
single pictures, with lines of any direction, see `sheetoflight.imaging.stripe.tracks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array

Detector = Literal["centroid", "fir", "parabola", "gaussian", "steger"]
Frame = NDArray[np.uint8] | NDArray[np.uint16]
_HALF_HEIGHTS = (8, 64)
_SMOOTHINGS = (0.7, 3.0)


@dataclass(frozen=True)
class ScanOptions:
    """How to scan.

    Parameters
    ----------
    detector : str
        ``centroid``: under a smooth window that moves with the line. ``fir``: zero of a
        Gaussian-derivative filter across the line. ``parabola``: weighted parabola through the
        logarithms. ``gaussian``: least squares of a Gaussian integrated over each pixel.
        ``steger``: zero of the smoothed frame's derivative along the line's normal.
    along : str
        ``columns``: one centre in every column; ``rows``: one in every row.
    least_snr : float
        Least height of the line over its surroundings, in standard deviations of the noise.
    half_height : int
        Samples used on either side of the peak, px; at least three widths of the line, so that
        the ends of the window show the background.
    smoothing : float
        Standard deviation of the filters of ``fir`` and ``steger``, px; best near the line's own.

    Raises
    ------
    InputError
        Of an unknown detector or direction, or a number out of bounds.
    """

    detector: Detector = "gaussian"
    along: Literal["columns", "rows"] = "columns"
    least_snr: float = 5.0
    half_height: int = 12
    smoothing: float = 1.5

    def __post_init__(self) -> None:
        if self.detector not in get_args(Detector):
            names = ", ".join(get_args(Detector))
            raise InputError(f"detector {self.detector!r} is unknown", f"take one of {names}")
        if self.along not in ("columns", "rows"):
            raise InputError(f"along is {self.along!r}", "take 'columns' or 'rows'")
        if not self.least_snr > 0.0:
            raise InputError(f"least_snr is {self.least_snr}", "take a positive number")
        _check("half_height", self.half_height, _HALF_HEIGHTS)
        # The filter of "fir" must lie in the window wherever it is evaluated.
        greatest = min(_SMOOTHINGS[1], (self.half_height - 4) // 2 / 1.25)
        _check("smoothing", self.smoothing, (_SMOOTHINGS[0], greatest))


def _check(name: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(f"{name} is {value} px", f"take {bounds[0]} to {bounds[1]} px")


@dataclass(frozen=True)
class Scan:
    """What a scan found; arrays ``(N,)`` of one value for each column (or row).

    Parameters
    ----------
    across : (N,) array
        Centre of the line: its row in every column (or column in every row), px; NaN where there
        is no line.
    std : (N,) array
        Standard uncertainty of the centre from the noise of the frame's dark part, px.
    width : (N,) array
        Standard deviation of the line's profile along the column (or row), px.
    peak : (N,) array
        Height of the line over its surroundings, grey levels.
    good : (N,) bool array
        Whether a line was found.
    noise_std : float
        Standard deviation of the frame's noise, grey levels.
    """

    across: Array
    std: Array
    width: Array
    peak: Array
    good: NDArray[np.bool_]
    noise_std: float


_DEFAULT = ScanOptions()


def scan(frame: Frame, options: ScanOptions = _DEFAULT) -> Scan:
    """Find the line in every column (or row) of a frame.

    Runs without the interpreter's lock for nearly all of its time, so threads may scan frames at
    once. The first call compiles, which takes some seconds; later processes load the result.

    Parameters
    ----------
    frame : (H, W) uint8 or uint16 array
        C-contiguous.
    options : ScanOptions

    Raises
    ------
    InputError
        Of a frame of another type, shape or order, or with too few rows (columns).

    Examples
    --------
    >>> rows = np.arange(60.0)[:, None]
    >>> frame = np.rint(20 + 150 * np.exp(-0.5 * ((rows - 30.25) / 2.0) ** 2)).astype(np.uint8)
    >>> scan(np.tile(frame, (1, 5))).across.round(2)
    array([30.25, 30.25, 30.25, 30.25, 30.25])
    """
    _check_frame(frame, options)
    from sheetoflight.imaging.stripe.scan.detectors import scanned  # Numba takes its time to load

    values, good, noise = scanned(
        frame,
        options.detector,
        options.along == "rows",
        options.least_snr,
        options.half_height,
        options.smoothing,
    )
    return Scan(values[0], values[1], values[2], values[3], good, noise)


def _check_frame(frame: Frame, options: ScanOptions) -> None:
    if frame.ndim != 2 or frame.dtype not in (np.uint8, np.uint16):
        found = f"{frame.dtype} of shape {frame.shape}"
        raise InputError(f"the frame is {found}", "give grey levels (H, W), uint8 or uint16")
    if not frame.flags.c_contiguous:
        raise InputError("the frame's rows are not contiguous", "pass np.ascontiguousarray(frame)")
    length = frame.shape[1 if options.along == "rows" else 0]
    if length < 2 * options.half_height + 1 or 0 in frame.shape:
        least = 2 * options.half_height + 1
        raise InputError(
            f"the frame is {length} px across the line",
            f"give one of at least {least} px, or take a smaller half_height",
        )
