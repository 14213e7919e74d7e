"""Candidates for disc markers: blobs, dark or light, with an elliptic outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.candidate import Candidate, without_duplicates
from sheetoflight.imaging.markers.grey import GreyPicture, Picture
from sheetoflight.imaging.markers.pyramid import held_down, opened, pyramid


@dataclass(frozen=True)
class DiscOptions:
    """What is taken for a disc marker.

    Parameters
    ----------
    levels : int
        Levels of the picture pyramid, each half as large as the one before.
    radii_px : (float, float)
        Smallest and largest radius looked for on a level.
    most : int
        How many candidates are kept, those with the truest outline.
    least_contrast, least_contrast_in_noise : float
        Smallest difference of disc and surround: grey values (of 255), and multiples of the
        picture's noise; the larger of the two counts.
    least_axis_ratio : float
        Of the outline's axes, the shorter over the longer.
    most_outline_error : float
        Largest departure (root mean square) of the outline from an ellipse, in radii.
    """

    levels: int = 5
    radii_px: tuple[float, float] = (3.0, 16.0)
    most: int = 150
    least_contrast: float = 8.0
    least_contrast_in_noise: float = 5.0
    least_axis_ratio: float = 0.25
    most_outline_error: float = 0.1


_SMOOTHING = 0.8
_WINDOW = 41
_ANGLES = np.arange(24) * (2 * np.pi / 24)
_INNER, _OUTER = 0.6, 1.35


def disc_candidates(picture: GreyPicture, options: DiscOptions = DiscOptions()) -> list[Candidate]:
    """Patches of a picture that look like plain discs, of about 4 to 250 px radius."""
    contrast = max(options.least_contrast, options.least_contrast_in_noise * picture.noise)
    found: list[tuple[float, Candidate]] = []
    for level, values in enumerate(pyramid(picture.values, options.levels)):
        size = 2.0**level
        # The line is as bright as a light disc it runs through, but narrow: it is opened away.
        found += _blobs(held_down(values), size, contrast, True, options)
        found += _blobs(opened(values), size, contrast, False, options)
    return without_duplicates(found, options.most)


def _blobs(
    values: Picture, size: float, contrast: float, dark: bool, options: DiscOptions
) -> list[tuple[float, Candidate]]:
    """Dark (or light) blobs on a level whose pixels are ``size`` px wide."""
    smooth = np.asarray(cv2.GaussianBlur(values, (0, 0), _SMOOTHING))
    window = cv2.getStructuringElement(cv2.MORPH_RECT, (_WINDOW, _WINDOW))
    low, high = cv2.erode(smooth, window), cv2.dilate(smooth, window)
    side = smooth < (low + high) / 2 if dark else smooth > (low + high) / 2
    mask = (side & (high - low > contrast)).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    found = []
    for contour in contours:
        ellipse = _ellipse(contour[:, 0, :].astype(float), values.shape, options)
        if ellipse is None:
            continue
        error, centre, frame = ellipse
        inner, outer = _brightness(values, centre, frame)
        if (outer - inner > contrast) if dark else (inner - outer > contrast):
            found.append((error, Candidate(size * centre, size * frame, outer - inner, outer)))
    return found


def _ellipse(
    points: Array, shape: tuple[int, ...], options: DiscOptions
) -> tuple[float, Array, Array] | None:
    """Departure from an ellipse, and its centre and frame, of a closed outline's pixels."""
    low, high = points.min(axis=0), points.max(axis=0)
    smallest, largest = options.radii_px
    if (high - low).max() < 2 * smallest - 1 or (high - low).max() > 2 * largest:
        return None
    if len(points) < 8 or (low < 1).any() or (high > [shape[1] - 2, shape[0] - 2]).any():
        return None
    (u, v), axes, degrees = cv2.fitEllipse(points.astype(np.float32))
    # The outline runs through the middles of the blob's outermost pixels.
    semi = np.array(axes) / 2 + 0.5
    if not np.isfinite(semi).all() or semi.min() < options.least_axis_ratio * semi.max():
        return None
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    frame = np.array([[cos, -sin], [sin, cos]]) * semi
    centre = np.array([u, v])
    ratio = np.linalg.norm(np.linalg.solve(frame, (points - centre).T), axis=0)
    error = float(np.sqrt(np.mean((ratio - (1.0 - 0.5 / np.sqrt(semi.prod()))) ** 2)))
    limit = options.most_outline_error + 0.3 / semi.min()
    return (error, centre, frame) if error < limit else None


def _brightness(values: Picture, centre: Array, frame: Array) -> tuple[float, float]:
    """Median grey value inside and outside the outline."""
    ring = frame @ np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
    medians = []
    for share in (_INNER, _OUTER):
        u, v = np.rint(centre[:, None] + share * ring).astype(int)
        u = np.clip(u, 0, values.shape[1] - 1)
        v = np.clip(v, 0, values.shape[0] - 1)
        medians.append(float(np.median(values[v, u])))
    return medians[0], medians[1]
