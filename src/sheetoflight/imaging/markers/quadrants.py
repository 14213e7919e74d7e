"""Candidates for quadrant markers: saddles whose surroundings are a disc in four quarters."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.candidate import Candidate, without_duplicates
from sheetoflight.imaging.markers.grey import GreyPicture, Picture
from sheetoflight.imaging.markers.pyramid import held_down, pyramid
from sheetoflight.imaging.markers.saddles import saddle_points


@dataclass(frozen=True)
class QuadrantOptions:
    """What is taken for a quadrant marker.

    Parameters
    ----------
    levels : int
        Levels of the picture pyramid, each half as large as the one before.
    saddles_per_level : int
        How many saddles are looked at on each level, strongest first.
    most : int
        How many candidates are kept, those with the truest outline.
    least_contrast, least_contrast_in_noise : float
        Smallest difference of black and white: grey values (of 255), and multiples of the
        picture's noise; the larger of the two counts.
    most_asymmetry : float
        A ring about the centre looks the same when turned by 180°; the largest departure
        (root mean square) from that, in contrasts.
    most_outline_error : float
        Largest departure (root mean square) of the ink's outline from an ellipse, in radii.
    """

    levels: int = 5
    saddles_per_level: int = 400
    most: int = 150
    least_contrast: float = 8.0
    least_contrast_in_noise: float = 5.0
    most_asymmetry: float = 0.2
    most_outline_error: float = 0.12


_ANGLES = 64
_HALF = _ANGLES // 2
# In px of a level; each level serves markers of about 4 to 30 px radius.
_RADII = 2.0 * 1.08 ** np.arange(40)
_LEAST_RUN = 5
_STEADY_RAD = 0.15
# Angle between the edges: 90° on the marker, at least this in the picture.
_NARROWEST_RAD = 0.35
_INNER_SHARE = 0.7
_BEYOND_OUTLINE = 1.15
_WHITE_BEYOND_SHARE = 0.8
# Foreshortening narrows the edges' angle, and blur weakens the saddle of a small marker.
_SADDLE_SHARE = 0.25
_RESOLVED_PX = 0.5


def quadrant_candidates(
    picture: GreyPicture, options: QuadrantOptions = QuadrantOptions()
) -> list[Candidate]:
    """Patches of a picture that look like quadrant markers, of about 4 to 200 px radius."""
    contrast = max(options.least_contrast, options.least_contrast_in_noise * picture.noise)
    found: list[tuple[float, Candidate]] = []
    for level, reduced in enumerate(pyramid(picture.values, options.levels)):
        values = held_down(reduced)
        centres, _ = saddle_points(values, _SADDLE_SHARE * contrast, options.saddles_per_level)
        found += _verified(values, centres, 2.0**level, contrast, options)
    return without_duplicates(found, options.most)


@dataclass(frozen=True)
class _Rings:
    """Rings about N centres: brightness averaged over opposite points, and what it tells.

    ``dark_from`` and ``dark_width`` (N, R) are the dark sector's first edge and its width in
    radians, on the rings where ``good`` (N, R) holds.
    """

    samples: np.ndarray
    good: np.ndarray
    dark_from: Array
    dark_width: Array


def _verified(
    values: Picture, centres: Array, size: float, contrast: float, options: QuadrantOptions
) -> list[tuple[float, Candidate]]:
    """Candidates about the centres on a level whose pixels are ``size`` px wide."""
    if not len(centres):
        return []
    rings = _rings(_ring_samples(values, centres), contrast, options.most_asymmetry)
    found = []
    for i, run in _steady_runs(rings):
        candidate = _candidate(centres[i], rings, i, run, size, options)
        if candidate is not None:
            found.append(candidate)
    return found


def _ring_samples(values: Picture, centres: Array) -> np.ndarray:
    """Brightness ``(N, R, _ANGLES)`` on rings about the centres."""
    angles = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    middle = centres.astype(np.float32)
    u = middle[:, :1] + np.outer(_RADII, np.cos(angles)).astype(np.float32).ravel()
    v = middle[:, 1:] + np.outer(_RADII, np.sin(angles)).astype(np.float32).ravel()
    read = cv2.remap(values, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read).reshape(len(centres), len(_RADII), _ANGLES)


def _rings(samples: np.ndarray, contrast: float, most_asymmetry: float) -> _Rings:
    mean = (samples[..., :_HALF] + samples[..., _HALF:]) / 2
    difference = (samples[..., :_HALF] - samples[..., _HALF:]) / 2
    smooth = mean / 2 + (np.roll(mean, 1, -1) + np.roll(mean, -1, -1)) / 4
    high, low = smooth.max(-1), smooth.min(-1)
    middle = ((high + low) / 2)[..., None]
    dark = smooth < middle
    before = np.roll(dark, 1, -1)
    changes = (dark != before).sum(-1)
    asymmetry = np.sqrt((difference**2).mean(-1))
    good = (changes == 2) & (high - low > contrast)
    good &= asymmetry < most_asymmetry * (high - low)
    start = _crossing(smooth, middle, dark & ~before)
    end = _crossing(smooth, middle, ~dark & before)
    step = np.pi / _HALF
    width = np.mod(end - start, _HALF) * step
    good &= (width > _NARROWEST_RAD) & (width < np.pi - _NARROWEST_RAD)
    return _Rings(samples, good, start * step, width)


def _crossing(smooth: np.ndarray, middle: np.ndarray, at: np.ndarray) -> Array:
    """Where (in samples) brightness passes the middle, just before the first True of ``at``."""
    index = at.argmax(-1)[..., None]
    after = np.take_along_axis(smooth, index, -1)
    before = np.take_along_axis(smooth, np.mod(index - 1, _HALF), -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        back = (after - middle) / (after - before)
    return np.mod(index - np.nan_to_num(back), _HALF)[..., 0].astype(float)


def _steady_runs(rings: _Rings) -> list[tuple[int, slice]]:
    """Runs of rings on which the edges keep their directions: centre's index and rings.

    A centre may have two: the marker, and farther out the strip on a dark wall.
    """
    middle = rings.dark_from + rings.dark_width / 2
    turn = np.mod(np.diff(middle, axis=1) + np.pi / 2, np.pi) - np.pi / 2
    growth = np.diff(rings.dark_width, axis=1)
    joined = rings.good[:, 1:] & rings.good[:, :-1]
    joined &= (np.abs(turn) < _STEADY_RAD) & (np.abs(growth) < 2 * _STEADY_RAD)
    bounded = np.pad(joined, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(bounded, axis=1)
    centres, first = np.nonzero(change == 1)
    _, last = np.nonzero(change == -1)
    long = last - first + 1 >= _LEAST_RUN
    return [
        (int(i), slice(int(start), int(end) + 1))
        for i, start, end in zip(centres[long], first[long], last[long], strict=True)
    ]


def _candidate(
    centre: Array, rings: _Rings, index: int, run: slice, size: float, options: QuadrantOptions
) -> tuple[float, Candidate] | None:
    start, width = _edges(rings.dark_from[index, run], rings.dark_width[index, run])
    samples = rings.samples[index]
    angles = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    offset = np.mod(angles - start - width / 2 + np.pi / 2, np.pi) - np.pi / 2
    dark = np.abs(offset) < _INNER_SHARE * width / 2
    light = np.abs(offset) > width / 2 + 0.15 * (np.pi - width)
    black = float(np.median(samples[run, dark]))
    white = float(np.median(samples[run, light]))
    radius = _outline(samples[:, dark], run, (black + white) / 2)
    if radius is None:
        return None
    edges = np.array(
        [[np.cos(start), np.cos(start + width)], [np.sin(start), np.sin(start + width)]]
    )
    unit = np.stack([np.cos(angles[dark]), np.sin(angles[dark])])
    oblique = np.linalg.solve(edges, unit * radius)
    squares, *_ = np.linalg.lstsq(oblique.T**2, np.ones(len(radius)), rcond=None)
    if (squares <= 0).any():
        return None
    error = float(np.sqrt(np.mean((np.sqrt(squares @ oblique**2) - 1.0) ** 2)))
    if error > options.most_outline_error:
        return None
    return error, Candidate(size * centre, size * edges / np.sqrt(squares), white - black, white)


def _edges(dark_from: Array, dark_width: Array) -> tuple[float, float]:
    """Typical first edge and width of the dark sector over a run of rings, rad."""
    width = float(np.median(dark_width))
    middle = dark_from + dark_width / 2
    turned = middle[len(middle) // 2] + np.mod(middle - middle[len(middle) // 2] + np.pi / 2, np.pi)
    return float(np.median(turned)) - np.pi / 2 - width / 2, width


def _outline(dark: np.ndarray, run: slice, middle: float) -> Array | None:
    """Radius at which each dark ray ``(R, K)`` turns light beyond its darkest ring of the run."""
    rays = np.arange(dark.shape[1])
    darkest = run.start + dark[run].argmin(axis=0)
    beyond = (dark > middle) & (np.arange(len(dark))[:, None] > darkest)
    if (dark[darkest, rays] > middle).any() or not beyond.any(axis=0).all():
        return None
    first = beyond.argmax(axis=0)
    after, before = dark[first, rays], dark[first - 1, rays]
    step = np.log(_RADII[1] / _RADII[0])
    radius = _RADII[first] * np.exp(-step * (after - middle) / (after - before))
    further = np.searchsorted(_RADII, _BEYOND_OUTLINE * radius)
    further = np.minimum(further, len(_RADII) - 1)
    if (dark[further, rays] > middle).mean() < _WHITE_BEYOND_SHARE:
        return None
    return radius.astype(float)
