"""Zero of the smoothed frame's derivative along the line's normal, in a band about the line.

Steger (An unbiased detector of curvilinear structures, IEEE TPAMI 20(2), 1998) takes the normal
n as the eigenvector of the Hessian with the most negative eigenvalue λ, and one Taylor step to
the zero of n·∇f. Here the step is taken again and again, along the column, to the exact zero, with
the derivatives evaluated where it has led. With H n = λ n the step is ``−n·∇f / (λ n_v)``.

The frame is smoothed along the line too, so neighbouring centres share noise.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.finish import join, keep
from sheetoflight.imaging.stripe.scan.layout import (
    BACKGROUND,
    CENTRE,
    FOUND,
    LANES,
    LIT,
    ONE,
    PEAK,
    RECORD,
    ROUGH_CENTRE,
    ROUGH_WIDTH,
    STD,
    TWO,
    WIDTH,
    WORK,
    Index,
    exponential,
    take,
    tiles,
    window_size,
)
from sheetoflight.imaging.stripe.scan.rough import look
from sheetoflight.imaging.stripe.scan.windows import noise_std

_STEPS = 8
_AT_REST = 1e-3  # px
_MARGIN = 2  # px by which the zero may lie off the peak's sample
_PIXEL = 1.0 / 12.0  # variance that a pixel's width adds to the profile

_G, _RATIO, _UP_G, _UP_RATIO, _SAMPLE, _SMOOTH, _ALONG, _BEND = WORK[:8]
_F, _FV, _FVV, _FU, _FUV, _FUU, _STEP, _NV, _SLOPE = WORK[8:17]


@cache
def along_taps(smoothing: float) -> NDArray[np.float64]:
    """Taps ``(3, 2R + 1)`` along the line: Gaussian, first and second derivative."""
    reach = int(np.ceil(3.0 * smoothing))
    i = np.arange(-reach, reach + 1) / smoothing
    g = np.exp(-0.5 * i**2)
    g /= g.sum()
    second = (i**2 - 1.0) / smoothing**2 * g
    return np.stack([g, i / smoothing * g, second - second.mean()])


def band_half(smoothing: float) -> int:
    """Samples on either side of the peak that the filter across the line needs."""
    return int(np.ceil(3.5 * smoothing)) + _MARGIN


@kernel
def ridges(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    lanes: Index,
    half: Index,
    least_snr: float,
    taps: NDArray,
    smoothing: float,
    band: Index,
    values: NDArray,
    good: NDArray,
) -> float:
    """Scan a frame; return its noise.

    The standard uncertainty is that of n·∇f, ``σ √(Σ g² Σ g'²)``, over its slope ``|λ n_v|``.
    """
    noise = noise_std(frame, by_rows, at, np.int64(half))
    window, record = np.empty(window_size(half), frame.dtype), np.empty(RECORD)
    size = window_size(band)
    samples, bands = np.empty(size, frame.dtype), np.empty(np.uint64(3) * size)
    variance = smoothing * smoothing
    spread = noise * np.sqrt(1.0 / (8.0 * np.pi)) / variance
    for tile in range(tiles(len(at))):
        lit = look(frame, by_rows, at, tile, lanes, half, noise * least_snr, window, record)
        if lit and _leave_edges(frame, by_rows, at, tile, band, record):
            _smooth_along(frame, by_rows, at, tile, lanes, taps, band, record, samples, bands)
            for lane in range(LANES):
                record[CENTRE + lane] = record[ROUGH_CENTRE + lane]
            for _ in range(_STEPS):
                _derivatives(bands, lanes, band, 1.0 / variance, record)
                if _step(record):
                    break
            _results(spread, variance, record)
        keep(record, at, tile, values)
    join(values, good)
    return noise


@kernel
def _leave_edges(
    frame: NDArray, by_rows: bool, at: NDArray, tile: Index, half: Index, record: NDArray
) -> bool:
    """Give up columns whose band does not lie in the frame as a whole; whether any is left."""
    length = frame.shape[1 if by_rows else 0]
    left = False
    for lane in range(LANES):
        row = at[min(np.int64(tile * LANES + lane), len(at) - 1)]
        if row < np.int64(half) or row >= length - np.int64(half):
            record[LIT + lane] = 0.0
        left |= record[LIT + lane] > 0.0
    return left


@kernel
def _smooth_along(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    tile: Index,
    lanes: Index,
    taps: NDArray,
    half: Index,
    record: NDArray,
    samples: NDArray,
    bands: NDArray,
) -> None:
    """The band about the line, without its background, through the three filters along it."""
    size = TWO * half + ONE
    part = size * LANES
    bands[:] = 0.0
    reach = taps.shape[1] // 2
    for i in range(taps.shape[1]):
        _gather(frame, by_rows, at, tile, i - reach, half, samples)
        for k in range(size):
            take(samples, lanes, k * LANES, record, _SAMPLE)
            for q in range(np.uint64(3)):
                start = q * part + k * LANES
                _add_filtered(record, lanes, taps[q, i], start, bands)


@kernel
def _add_filtered(record: NDArray, lanes: Index, tap: float, start: Index, bands: NDArray) -> None:
    for lane in range(lanes):
        light = record[_SAMPLE + lane] - record[BACKGROUND + lane]
        bands[start + lane] += tap * light


@kernel
def _gather(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    tile: Index,
    shift: int,
    half: Index,
    samples: NDArray,
) -> None:
    """Samples about the peaks of a tile, taken from the columns `shift` px beside them."""
    flat = frame.reshape(-1)
    height, width = frame.shape
    across = 1 if by_rows else width
    along = width if by_rows else 1
    length = width if by_rows else height
    side = np.int64(half)
    start = np.empty(LANES, np.uint64)
    for lane in range(LANES):
        j = min(np.int64(tile * LANES + lane), len(at) - 1)
        beside = min(max(j + shift, 0), len(at) - 1)
        first = min(max(at[j] - side, 0), length - 2 * side - 1)
        start[lane] = beside * along + first * across
    for k in range(TWO * half + ONE):
        for lane in range(LANES):
            samples[k * LANES + lane] = flat[start[lane] + k * np.uint64(across)]


@kernel
def _derivatives(
    bands: NDArray, lanes: Index, half: Index, inverse: float, record: NDArray
) -> None:
    """Smoothed light and its derivatives at the present centres; u along the line, v across."""
    q = np.exp(-inverse)
    for lane in range(LANES):
        v = record[CENTRE + lane]
        g = exponential(-0.5 * v * v * inverse)
        down = exponential((-v - 0.5) * inverse)
        record[_G + lane] = g
        record[_RATIO + lane] = exponential((v - 0.5) * inverse)
        record[_UP_G + lane] = g * down
        record[_UP_RATIO + lane] = down * q
    for index in range(_F, _FUU + LANES):
        record[index] = 0.0
    for distance in range(half + ONE):
        _add(bands, lanes, half, half + distance, float(distance), inverse, q, record)
    for lane in range(LANES):
        record[_G + lane] = record[_UP_G + lane]
        record[_RATIO + lane] = record[_UP_RATIO + lane]
    for distance in range(ONE, half + ONE):
        _add(bands, lanes, half, half - distance, -float(distance), inverse, q, record)


@kernel
def _add(
    bands: NDArray,
    lanes: Index,
    half: Index,
    k: Index,
    x: float,
    inverse: float,
    q: float,
    record: NDArray,
) -> None:
    part = (TWO * half + ONE) * LANES
    take(bands, lanes, k * LANES, record, _SMOOTH)
    take(bands, lanes, part + k * LANES, record, _ALONG)
    take(bands, lanes, TWO * part + k * LANES, record, _BEND)
    for lane in range(LANES):
        g, ratio = record[_G + lane], record[_RATIO + lane]
        d = (x - record[CENTRE + lane]) * inverse
        smooth, along = g * record[_SMOOTH + lane], g * record[_ALONG + lane]
        record[_F + lane] += smooth
        record[_FV + lane] += d * smooth
        record[_FVV + lane] += (d * d - inverse) * smooth
        record[_FU + lane] += along
        record[_FUV + lane] += d * along
        record[_FUU + lane] += g * record[_BEND + lane]
        record[_G + lane] = g * ratio
        record[_RATIO + lane] = ratio * q


@kernel
def _step(record: NDArray) -> bool:
    """Step to the zero of n·∇f along the column; whether all centres are at rest."""
    for lane in range(LANES):
        fuu, fuv, fvv = record[_FUU + lane], record[_FUV + lane], record[_FVV + lane]
        half_difference = 0.5 * (fvv - fuu)
        root = np.sqrt(half_difference * half_difference + fuv * fuv)
        nu, nv = fuv, half_difference - root
        norm = np.sqrt(nu * nu + nv * nv)
        nu, nv = nu / norm, nv / norm
        slope = (0.5 * (fuu + fvv) - root) * nv
        step = -(nu * record[_FU + lane] + nv * record[_FV + lane]) / slope
        record[_STEP + lane] = step
        record[_NV + lane] = nv
        record[_SLOPE + lane] = slope
        record[CENTRE + lane] += min(max(step, -1.0), 1.0)
    moving = False
    for lane in range(LANES):
        moving |= record[LIT + lane] * abs(record[_STEP + lane]) > _AT_REST
    return not moving


@kernel
def _results(noise: float, variance: float, record: NDArray) -> None:
    """Width and height from the ratio of the smoothed light to its second derivative."""
    norm = np.sqrt(2.0 * np.pi * variance)
    for lane in range(LANES):
        f, nv = record[_F + lane] / norm, record[_NV + lane]
        smoothed = -record[_F + lane] / record[_FVV + lane]
        own = smoothed - variance / (nv * nv)
        moved = abs(record[CENTRE + lane] - record[ROUGH_CENTRE + lane])
        found = (record[LIT + lane] > 0.0) & (abs(record[_STEP + lane]) < _AT_REST)
        found &= (smoothed > 0.0) & (own > _PIXEL)
        found &= moved < 1.0 + record[ROUGH_WIDTH + lane]
        record[WIDTH + lane] = np.sqrt(own - _PIXEL) if found else 0.0
        record[PEAK + lane] = f * np.sqrt(smoothed / (own - _PIXEL)) if found else 0.0
        record[STD + lane] = noise * norm / abs(record[_SLOPE + lane])
        record[FOUND + lane] = 1.0 if found else 0.0
