"""Least squares of amplitude, centre, width and background by Gauss–Newton steps.

The model is that of `sheetoflight.imaging.stripe.gaussian`, a Gaussian integrated over each
pixel, here as a series that needs no error function (Taylor about the pixel's middle, integrated
term by term): with t = (x − c)/w and g = exp(−t²/2),

    ∫ g = g · [1 + (t² − 1)/(24 w²) + (t⁴ − 6t² + 3)/(1920 w⁴)],

good to 0.3 % of the peak at w = 0.5 and far better above. From one sample to the next the Gaussian
follows by two products: g(x + 1) = g(x) r(x), r(x + 1) = r(x) exp(−1/w²).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sheetoflight.imaging.stripe.scan.compiled import kernel
from sheetoflight.imaging.stripe.scan.finish import join, keep
from sheetoflight.imaging.stripe.scan.layout import (
    BACKGROUND,
    CENTRE,
    FIRST,
    FOUND,
    HEIGHT,
    LANES,
    LAST,
    LIT,
    ONE,
    PEAK,
    RECORD,
    ROUGH_CENTRE,
    ROUGH_WIDTH,
    STD,
    WIDTH,
    WORK,
    Index,
    exponential,
    tiles,
    window_size,
)
from sheetoflight.imaging.stripe.scan.rough import look
from sheetoflight.imaging.stripe.scan.windows import noise_std

_STEPS = 12
_AT_REST = 2e-3  # px
_REACH = 4.0, 1.5  # samples used on either side: so many widths, and so many px
_LEAST_WIDTH = 0.3  # px
_GREATEST_STEP = 0.6  # of the width, for the centre; the width changes by no greater part

_LEVEL, _G, _RATIO, _DOWN, _Q, _INVERSE, _STEP = WORK[:7]
# Normal matrix in the order background b, amplitude a, width w, centre c; then the right side
_BB, _BA, _BW, _BC, _AA, _AW, _AC, _WW, _WC, _CC, _RB, _RA, _RW, _RC = WORK[8:22]


@kernel
def gaussians(
    frame: NDArray,
    by_rows: bool,
    at: NDArray,
    lanes: Index,
    half: Index,
    least_snr: float,
    full: float,
    values: NDArray,
    good: NDArray,
) -> float:
    """Scan a frame; return its noise.

    Samples at the level `full` or above say only that the light was at least as bright; they are
    left out where the model is above them. The standard uncertainty is that of the inverse normal
    matrix.
    """
    noise = noise_std(frame, by_rows, at, np.int64(half))
    window, record = np.empty(window_size(half), frame.dtype), np.empty(RECORD)
    for tile in range(tiles(len(at))):
        if look(frame, by_rows, at, tile, lanes, half, noise * least_snr, window, record):
            reach = _start(half, record)
            for _ in range(_STEPS):
                _sum(window, lanes, half, reach, full, record)
                if _step(record):
                    break
            _results(noise, least_snr, float(half), record)
        keep(record, at, tile, values)
    join(values, good)
    return noise


@kernel
def _start(half: Index, record: NDArray) -> Index:
    """First values and the samples in use; the greatest distance of one from the peak."""
    reach = 2.0
    for lane in range(LANES):
        centre, width = record[ROUGH_CENTRE + lane], record[ROUGH_WIDTH + lane]
        radius = _REACH[0] * width + _REACH[1]
        record[_LEVEL + lane] = record[BACKGROUND + lane]
        record[PEAK + lane] = record[HEIGHT + lane]
        record[CENTRE + lane] = centre
        record[WIDTH + lane] = max(width, 0.5)
        record[FIRST + lane] = max(record[FIRST + lane], half + np.floor(centre + 0.5) - radius)
        record[LAST + lane] = min(record[LAST + lane], half + np.floor(centre + 0.5) + radius)
        if record[LIT + lane] > 0.0:
            reach = max(reach, half - record[FIRST + lane], record[LAST + lane] - half)
    return np.uint64(min(np.ceil(reach), float(half)))


@kernel
def _sum(
    window: NDArray,
    lanes: Index,
    half: Index,
    reach: Index,
    full: float,
    record: NDArray,
) -> None:
    """Normal equations at the present values, from the peak's sample outwards."""
    for lane in range(LANES):
        inverse = 1.0 / record[WIDTH + lane]
        square = 0.5 * inverse * inverse
        centre = record[CENTRE + lane]
        record[_INVERSE + lane] = inverse
        record[_G + lane] = exponential(-centre * centre * square)
        record[_RATIO + lane] = exponential((2.0 * centre - 1.0) * square)
        record[_DOWN + lane] = exponential((-2.0 * centre - 1.0) * square)
        record[_Q + lane] = exponential(-2.0 * square)
    _clear(record)
    for lane in range(LANES):
        record[_DOWN + lane], record[_STEP + lane] = (
            record[_DOWN + lane] * record[_Q + lane],
            record[_G + lane] * record[_DOWN + lane],
        )
    for distance in range(reach + ONE):
        _add(window, lanes, half + distance, float(distance), full, record)
    for lane in range(LANES):
        record[_G + lane], record[_RATIO + lane] = record[_STEP + lane], record[_DOWN + lane]
    for distance in range(ONE, reach + ONE):
        _add(window, lanes, half - distance, -float(distance), full, record)


@kernel
def _clear(record: NDArray) -> None:
    for index in range(_BB, _RC + LANES):
        record[index] = 0.0


@kernel
def _add(
    window: NDArray, lanes: Index, index: Index, x: float, full: float, record: NDArray
) -> None:
    """Add one sample of every lane, and go on to the next one's Gaussian."""
    start, place = index * LANES, float(index)
    for lane in range(lanes):
        inverse, amplitude = record[_INVERSE + lane], record[PEAK + lane]
        g = record[_G + lane]
        t = (x - record[CENTRE + lane]) * inverse
        square = t * t
        second = inverse * inverse * (1 / 24)
        fourth = second * second * (24 * 24 / 1920)
        series = 1.0 + (square - 1.0) * second + ((square - 6.0) * square + 3.0) * fourth
        slope = t * (2.0 * second + (4.0 * square - 12.0) * fourth)
        unit = g * series
        scale = amplitude * inverse * g
        by_centre = scale * (t * series - slope)
        by_width = scale * (square * series - t * slope - 2.0 * (square - 1.0) * second)
        sample = float(window[start + lane])
        residual = sample - record[_LEVEL + lane] - amplitude * unit
        out = (place < record[FIRST + lane]) | (place > record[LAST + lane])
        out |= (sample >= full) & (residual < 0.0)
        weight = 0.0 if out else 1.0
        a, w, c = weight * unit, weight * by_width, weight * by_centre
        record[_BB + lane] += weight
        record[_BA + lane] += a
        record[_BW + lane] += w
        record[_BC + lane] += c
        record[_AA + lane] += a * unit
        record[_AW + lane] += a * by_width
        record[_AC + lane] += a * by_centre
        record[_WW + lane] += w * by_width
        record[_WC + lane] += w * by_centre
        record[_CC + lane] += c * by_centre
        record[_RB + lane] += weight * residual
        record[_RA + lane] += a * residual
        record[_RW + lane] += w * residual
        record[_RC + lane] += c * residual
        record[_G + lane] = g * record[_RATIO + lane]
        record[_RATIO + lane] *= record[_Q + lane]


@kernel
def _step(record: NDArray) -> bool:
    """Solve the normal equations (L D Lᵀ), step; whether all centres are at rest.

    The centre comes last: the inverse of the last pivot is its variance, for noise 1.
    """
    for lane in range(LANES):
        bb = record[_BB + lane]
        l_a, l_w, l_c = (
            record[_BA + lane] / bb,
            record[_BW + lane] / bb,
            record[_BC + lane] / bb,
        )
        aa = record[_AA + lane] - l_a * record[_BA + lane]
        aw = record[_AW + lane] - l_a * record[_BW + lane]
        ac = record[_AC + lane] - l_a * record[_BC + lane]
        m_w, m_c = aw / aa, ac / aa
        ww = record[_WW + lane] - l_w * record[_BW + lane] - m_w * aw
        wc = record[_WC + lane] - l_w * record[_BC + lane] - m_w * ac
        n_c = wc / ww
        cc = record[_CC + lane] - l_c * record[_BC + lane] - m_c * ac - n_c * wc
        b = record[_RB + lane]
        a = record[_RA + lane] - l_a * b
        w = record[_RW + lane] - l_w * b - m_w * a
        c = (record[_RC + lane] - l_c * b - m_c * a - n_c * w) / cc
        w = w / ww - n_c * c
        a = a / aa - m_w * w - m_c * c
        b = b / bb - l_a * a - l_w * w - l_c * c
        width = record[WIDTH + lane]
        limit = _GREATEST_STEP * width
        record[_LEVEL + lane] += b
        record[PEAK + lane] += a
        record[WIDTH + lane] = max(width + min(max(w, -limit), limit), _LEAST_WIDTH)
        record[CENTRE + lane] += min(max(c, -limit), limit)
        record[STD + lane] = cc
        record[_STEP + lane] = c
    moving = False
    for lane in range(LANES):
        moving |= record[LIT + lane] * abs(record[_STEP + lane]) > _AT_REST
    return not moving


@kernel
def _results(noise: float, least_snr: float, half: float, record: NDArray) -> None:
    for lane in range(LANES):
        moved = abs(record[CENTRE + lane] - record[ROUGH_CENTRE + lane])
        pivot, width = record[STD + lane], record[WIDTH + lane]
        found = (record[LIT + lane] > 0.0) & (abs(record[_STEP + lane]) < _AT_REST)
        found &= (pivot > 0.0) & (width > _LEAST_WIDTH) & (width < 0.5 * half)
        found &= record[PEAK + lane] > least_snr * noise
        found &= moved < 1.0 + record[ROUGH_WIDTH + lane]
        record[STD + lane] = noise / np.sqrt(pivot) if found else 0.0
        record[FOUND + lane] = 1.0 if found else 0.0
