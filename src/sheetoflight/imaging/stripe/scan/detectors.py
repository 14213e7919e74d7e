"""The steps of a scan, from the frame to the results. Loads Numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.scan.centroid import centroids
from sheetoflight.imaging.stripe.scan.fir import derivative_taps, filtered
from sheetoflight.imaging.stripe.scan.gaussian import gaussians
from sheetoflight.imaging.stripe.scan.layout import LANES
from sheetoflight.imaging.stripe.scan.parabola import parabolas
from sheetoflight.imaging.stripe.scan.search import column_peaks, row_peaks
from sheetoflight.imaging.stripe.scan.steger import along_taps, band_half, ridges
from sheetoflight.imaging.stripe.scan.windows import full_scale


def scanned(
    frame: NDArray, detector: str, by_rows: bool, least_snr: float, half: int, smoothing: float
) -> tuple[Array, NDArray[np.bool_], float]:
    """Scan a frame that has been checked.

    Returns
    -------
    values : (4, N) array
        Centre, standard uncertainty, width and peak.
    good : (N,) bool array
    noise : float
        Standard deviation, grey levels.
    """
    count = frame.shape[0 if by_rows else 1]
    top, at = _peaks(frame, by_rows, count)
    values, good = np.empty((4, count)), np.empty(count, np.bool_)
    common = (frame, by_rows, at, LANES, np.uint64(half), least_snr)
    if detector == "centroid":
        noise = centroids(*common, values, good)
    elif detector == "fir":
        noise = filtered(*common, *derivative_taps(smoothing), values, good)
    elif detector == "parabola":
        noise = parabolas(*common, full_scale(frame, by_rows, top, at), values, good)
    elif detector == "gaussian":
        noise = gaussians(*common, full_scale(frame, by_rows, top, at), values, good)
    else:
        band = np.uint64(band_half(smoothing))
        noise = ridges(*common, along_taps(smoothing), smoothing, band, values, good)
    return values, good, noise


def _peaks(frame: NDArray, by_rows: bool, count: int) -> tuple[NDArray, NDArray[np.int64]]:
    top, at = np.empty(count, frame.dtype), np.empty(count, np.int64)
    if by_rows:
        row_peaks(frame, top, at)
    else:
        column_peaks(frame, top, np.empty(count, frame.dtype), at)
    return top, at
