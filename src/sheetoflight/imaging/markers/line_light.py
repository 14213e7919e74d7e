"""Bright straight lines in a picture, and the picture with them bridged over.

A laser line through a marker hides its centre. What is seen on both sides of the line still
tells enough to recognise the marker once the line itself is bridged by interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.markers.grey import GreyPicture, Picture


@dataclass(frozen=True)
class LineLightOptions:
    """What is taken for a bright straight line.

    Parameters
    ----------
    most : int
        Lines at most.
    least_support_px : float
        Ridge pixels along a line, counted at half resolution.
    least_strength : float
        Ridge strength: minus the curvature across, times the scale squared, grey values.
    reach_px : float
        Half the widest band that is bridged.
    """

    most: int = 3
    least_support_px: float = 40.0
    least_strength: float = 6.0
    reach_px: float = 24.0


@dataclass(frozen=True)
class _Ridge:
    """Ridge points ``(N, 2)`` px at half resolution and the unit normals of the ridge there."""

    points: Array
    normals: Array

    def without(self, used: np.ndarray) -> _Ridge:
        return _Ridge(self.points[~used], self.normals[~used])


@dataclass(frozen=True)
class _Course:
    """A nearly straight line: ``origin + a·along + p(a)·across`` for a from low to high, px."""

    origin: Array
    along: Array
    bend: np.polynomial.Polynomial
    low: float
    high: float

    @property
    def across(self) -> Array:
        return np.array([-self.along[1], self.along[0]])

    def at(self, a: Array, n: Array) -> np.ndarray:
        """Image points ``(len(a), len(n), 2)`` at a along and n across."""
        middle = self.origin + a[:, None] * self.along + self.bend(a)[:, None] * self.across
        return (middle[:, None, :] + n[None, :, None] * self.across).astype(np.float32)


_SCALES = (1.5, 3.0)
_ANGLE_BINS, _OFFSET_BIN, _SPREAD = 180, 2.0, 3
_GATHERED_PX, _GATHERED_RAD = 8.0, 0.15


def bridged(picture: GreyPicture, options: LineLightOptions = LineLightOptions()) -> Picture | None:
    """The picture with its bright straight lines bridged, or None where it has none."""
    ridge = _ridge(np.asarray(cv2.pyrDown(picture.values), dtype=np.float32), options)
    values = picture.values
    courses = []
    while len(courses) < options.most:
        line = _strongest_line(ridge, options)
        if line is None:
            break
        course, used = line
        courses.append(course)
        ridge = ridge.without(used)
    for course in courses:
        values = _bridged_over(values, course, options.reach_px)
    return values if courses else None


def _ridge(values: Picture, options: LineLightOptions) -> _Ridge:
    """Centres of bright ridges (Steger, "An unbiased detector of curvilinear structures",
    IEEE PAMI 20(2), 1998), at two scales."""
    points, normals = [], []
    for scale in _SCALES:
        smooth = cv2.GaussianBlur(values, (0, 0), scale)
        uu = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3, scale=0.25)
        vv = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3, scale=0.25)
        # Only curved pixels are worth an eigenvector.
        rows, columns = np.nonzero(-(uu + vv) * scale**2 > options.least_strength)
        inside = (rows > 0) & (columns > 0)
        inside &= (rows < values.shape[0] - 1) & (columns < values.shape[1] - 1)
        rows, columns = rows[inside], columns[inside]
        a, c = uu[rows, columns].astype(float), vv[rows, columns].astype(float)
        b = (
            smooth[rows + 1, columns + 1].astype(float) + smooth[rows - 1, columns - 1]
            - smooth[rows + 1, columns - 1] - smooth[rows - 1, columns + 1]
        ) / 4  # fmt: skip
        root = np.hypot((a - c) / 2, b)
        strongest, weakest = (a + c) / 2 - root, (a + c) / 2 + root
        angle = 0.5 * np.arctan2(-b, (c - a) / 2)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        gradient = np.stack(
            [
                smooth[rows, columns + 1].astype(float) - smooth[rows, columns - 1],
                smooth[rows + 1, columns].astype(float) - smooth[rows - 1, columns],
            ],
            axis=-1,
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -(gradient * normal).sum(-1) / 2 / strongest
        good = (-strongest * scale**2 > options.least_strength) & (np.abs(step) < 0.7)
        good &= np.abs(weakest) < 0.4 * np.abs(strongest)
        centre = np.stack([columns, rows], axis=-1) + step[:, None] * normal
        points.append(centre[good])
        normals.append(normal[good])
    return _Ridge(np.concatenate(points), np.concatenate(normals))


def _strongest_line(ridge: _Ridge, options: LineLightOptions) -> tuple[_Course, np.ndarray] | None:
    """The line that most ridge points vote for, and which points lie on it.

    Each point votes for the lines through it that its own normal allows (Hough, with the
    directions narrowed).
    """
    if len(ridge.points) < options.least_support_px:
        return None
    middle = ridge.points.mean(axis=0)
    offsets = ridge.points - middle
    angle = np.arctan2(ridge.normals[:, 1], ridge.normals[:, 0])
    nearest = np.rint(angle / np.pi * _ANGLE_BINS).astype(int)
    angle_bin = np.mod(nearest[:, None] + np.arange(-_SPREAD, _SPREAD + 1), _ANGLE_BINS)
    turned = angle_bin * (np.pi / _ANGLE_BINS)
    distance = offsets[:, :1] * np.cos(turned) + offsets[:, 1:] * np.sin(turned)
    reach = float(np.abs(distance).max())
    offset_bin = np.rint((distance + reach) / _OFFSET_BIN).astype(int)
    bins = int(2 * reach / _OFFSET_BIN) + 2
    votes = np.bincount((angle_bin * bins + offset_bin).ravel(), minlength=_ANGLE_BINS * bins)
    best = int(votes.argmax())
    if votes[best] < options.least_support_px:
        return None
    best_angle = (best // bins) * np.pi / _ANGLE_BINS
    normal = np.array([np.cos(best_angle), np.sin(best_angle)])
    away = np.abs(offsets @ normal - ((best % bins) * _OFFSET_BIN - reach))
    on_line = (away < _GATHERED_PX) & (np.abs(ridge.normals @ normal) > np.cos(_GATHERED_RAD))
    return _course(ridge.points[on_line], normal, options), away < _GATHERED_PX


def _course(points: Array, normal: Array, options: LineLightOptions) -> _Course:
    """A parabola through the points of a line, at full resolution; outliers lose their say."""
    along = np.array([normal[1], -normal[0]])
    origin = points.mean(axis=0)
    a, n = (points - origin) @ along, (points - origin) @ normal
    kept = np.ones(len(a), bool)
    bend = np.polynomial.Polynomial([0.0])
    for limit in (4.0, 2.0, 1.0):
        bend = np.polynomial.Polynomial.fit(a[kept], n[kept], 2).convert()
        kept = np.abs(n - bend(a)) < limit
        if kept.sum() < options.least_support_px / 2:
            kept = np.ones(len(a), bool)
    low, high = np.percentile(a[kept], [1, 99])
    # a and n at full resolution are twice those at half: p(a) becomes 2 p(a/2).
    coefficients = np.array(bend.coef, dtype=float)
    full = np.polynomial.Polynomial(2.0 * coefficients * 0.5 ** np.arange(len(coefficients)))
    room = 0.1 * (high - low)
    return _Course(2 * origin, along, full, 2 * (low - room), 2 * (high + room))


def _bridged_over(values: Picture, course: _Course, reach: float) -> Picture:
    half_width = _half_width(values, course, reach)
    height, width = values.shape
    a = np.arange(course.low, course.high, 0.5)
    middle = course.at(a, np.zeros(1))[:, 0]
    mask = np.zeros(values.shape, np.uint8)
    cv2.polylines(
        mask, [np.rint(middle).astype(np.int32)], False, 1, int(np.ceil(2 * half_width)) + 3
    )
    rows, columns = np.nonzero(mask)
    offset = np.stack([columns, rows], axis=-1) - course.origin
    along = offset @ course.along
    across = offset @ course.across - course.bend(along)
    inside = np.abs(across) <= half_width
    rows, columns, along, across = rows[inside], columns[inside], along[inside], across[inside]
    beside = half_width + 1.5
    smooth = cv2.GaussianBlur(values, (0, 0), 1.0)
    sides = []
    for side in (-beside, beside):
        uv = course.origin + along[:, None] * course.along
        uv = uv + (course.bend(along) + side)[:, None] * course.across
        u = np.clip(np.rint(uv[:, 0]).astype(int), 0, width - 1)
        v = np.clip(np.rint(uv[:, 1]).astype(int), 0, height - 1)
        sides.append(smooth[v, u])
    share = ((across + beside) / (2 * beside)).astype(np.float32)
    out = values.copy()
    out[rows, columns] = (1 - share) * sides[0] + share * sides[1]
    return out


def _half_width(values: Picture, course: _Course, reach: float) -> float:
    """Where the line's flanks level out: beyond the steepest point, a tenth of its slope."""
    n = np.arange(-reach, reach + 0.25, 0.5)
    a = np.linspace(course.low, course.high, 400)
    grid = course.at(a, n)
    read = cv2.remap(
        values, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    profile = np.median(np.asarray(read), axis=0)
    half = len(n) // 2
    folded = (profile[half:] + profile[half::-1]) / 2
    slope = -np.diff(folded)
    steepest = int(slope.argmax())
    level = np.nonzero(slope[steepest:] < 0.1 * slope[steepest])[0]
    last = steepest + int(level[0]) if len(level) else len(slope) - 1
    return float(min(0.5 * last + 1.0, reach))
