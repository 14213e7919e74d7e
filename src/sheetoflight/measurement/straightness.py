"""Straight lines fitted to the laser line in space, and how straight it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.triangulation import is_curved, triangulate_with_jacobians
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.point_cloud import PointCloud

OUTLYING = 3.0
"""Robust standard deviations from the line beyond which a point pulls no harder."""

_MEDIAN_TO_STD = 1.4826
"""Standard deviation of normal errors over the median of their sizes."""

_FEWEST = 3
_ROUNDS = 50
_SETTLED = 1e-12
_STRAIGHT = 1e-12
"""Residuals below this part of the length are rounding."""

_GROUPS = 32
_GRID = np.linspace(0.0, 8.0, 161)


@dataclass(frozen=True, eq=False)
class SpaceLine:
    """A straight line fitted to points of the laser line, within their sheet of light.

    All uncertainties come from the picture's noise alone. What the calibration adds moves, turns
    and bends the line as a whole, and is not in them.

    Parameters
    ----------
    point : (3,) array
        The point of the line amid the points, mm.
    direction, across : (3,) arrays
        Unit vectors along the line, from the first to the last point, and across it in the sheet.
    length_mm : float
        Extent of the points along the line.
    rms_mm : float
        Root mean square distance of the points from the line.
    straightness_mm : float
        Least distance of two parallel lines in the sheet that hold *all* points between them
        (minimum zone, ISO 12780-1).
    noise_straightness_mm : float
        What a perfectly straight line would show on average, by the noise of its points: the
        expected range of their residuals. The zone of least width is a few per cent narrower.
    direction_std : float
        Standard uncertainty of the direction within the sheet, rad.
    offset_std_mm : float
        Standard uncertainty of `point` across the line.
    residuals_mm : (N,) array
        Of each point, along `across`.
    outlying : (N,) bool array
        Points beyond `OUTLYING` robust standard deviations. They count in everything, but pull on
        the line no harder than a point at that distance.
    picture : str
    line : int
        Which line of which picture it is.
    """

    point: Array
    direction: Array
    across: Array
    length_mm: float
    rms_mm: float
    straightness_mm: float
    noise_straightness_mm: float
    direction_std: float
    offset_std_mm: float
    residuals_mm: Array
    outlying: NDArray[np.bool_]
    picture: str = ""
    line: int = 0

    @property
    def points(self) -> int:
        """How many points it was fitted to."""
        return len(self.residuals_mm)


def lines_of(
    cloud: PointCloud, calibration: AnyCalibration | None = None, laser: str | None = None
) -> list[SpaceLine]:
    """A straight line for each line of each picture, in their order.

    Lines of fewer than three points say nothing of straightness; they are left out. In a curved
    sheet there are none (see `fitted_line_in_space`).

    Parameters
    ----------
    cloud : PointCloud
    calibration, laser
        As for `fitted_line_in_space`.
    """
    if calibration is not None and is_curved(calibration, laser):
        return []
    order = np.lexsort((cloud.line, cloud.picture))  # stable: the order along each line is kept
    keys = np.stack([cloud.picture[order], cloud.line[order]])
    begins = np.flatnonzero(np.any(np.diff(keys, axis=1), axis=0)) + 1
    parts = [part for part in np.split(order, begins) if len(part) >= _FEWEST]
    return [fitted_line_in_space(cloud.taken(part), calibration, laser) for part in parts]


def fitted_line_in_space(
    part: PointCloud, calibration: AnyCalibration | None = None, laser: str | None = None
) -> SpaceLine:
    """The straight line through the points of one line of one picture.

    Least squares of the distances within the sheet, each point weighed by its noise; beyond
    `OUTLYING` robust standard deviations the weight falls with the distance (Huber, Annals of
    Mathematical Statistics 35(1), 1964). No point is taken away.

    Parameters
    ----------
    part : PointCloud
        In order along the line, all in one plane, as points of one picture and laser are.
    calibration : Calibration or SheetCalibration, optional
        What the points were reconstructed with. It tells how much of a point's noise acts across
        the line in space; without it all is taken to, which is never too little.
    laser : str, optional
        In whose sheet the line lies.

    Raises
    ------
    InputError
        If there are fewer than three points, or all are one; or the sheet is curved: its line on
        a straight edge or a flat face is a curve, which says nothing of what it falls on.
    """
    if calibration is not None and is_curved(calibration, laser):
        raise InputError(
            f"the sheet of {laser or calibration.lasers[0]} is curved: its line on a flat face is "
            "no straight one",
            "judge the points, or a plane through those of many lines",
        )
    where = f"line {part.line[0]} of {_picture(part)}" if len(part) else "the line"
    if len(part) < _FEWEST:
        raise InputError(
            f"{where} has {len(part)} points", "give three or more: two are always straight"
        )
    centre = part.xyz.mean(axis=0)
    _, extents, axes = np.linalg.svd(part.xyz - centre, full_matrices=False)
    if not extents[0] > 0:
        raise InputError(f"all points of {where} are one and the same", "give points of a line")
    frame = _oriented(axes[:2], centre, part.xyz[-1] - part.xyz[0])
    noise = part.noise_std
    if calibration is not None:
        noise = noise * _share_across(calibration, part.uv, frame[1], laser)
    fit = _fitted((part.xyz - centre) @ frame.T, noise)
    return SpaceLine(
        point=centre + _in_space(fit.origin, frame),
        direction=_in_space(fit.direction, frame),
        across=_in_space(1j * fit.direction, frame),
        length_mm=float(np.ptp(fit.along)),
        rms_mm=float(np.sqrt(np.mean(np.square(fit.across)))),
        straightness_mm=_least_zone(fit.along, fit.across),
        noise_straightness_mm=_expected_range(noise * np.sqrt(np.maximum(1.0 - fit.leverage, 0.0))),
        direction_std=fit.direction_std,
        offset_std_mm=fit.offset_std,
        residuals_mm=fit.across,
        outlying=fit.outlying,
        picture=_picture(part),
        line=int(part.line[0]),
    )


def _picture(part: PointCloud) -> str:
    return part.pictures[part.picture[0]] if part.pictures else ""


def _in_space(number: complex, frame: Array) -> Array:
    return number.real * frame[0] + number.imag * frame[1]


def _oriented(axes: Array, centre: Array, forward: Array) -> Array:
    """Axes ``(2, 3)`` of the sheet: forward along the line, and across it so that their cross
    product points away from the camera – in a sheet's own frame, along z."""
    direction = axes[0] if axes[0] @ forward >= 0 else -axes[0]
    normal = np.cross(direction, axes[1])
    distance = float(normal @ centre)
    side = distance if abs(distance) > 1e-9 * np.linalg.norm(centre) else normal[2]
    return np.stack([direction, axes[1] if side >= 0 else -axes[1]])


def _share_across(
    calibration: AnyCalibration, uv: Array, across: Array, laser: str | None
) -> Array:
    """Part ``(N,)`` of each point's noise that acts across the line in space.

    Across the line's image is a step along ``a = Jᵀ m``, m the direction across the line in the
    sheet, for J moves image points along the line by a vector at right angles to m. That step
    moves the point by ``J a``, of which ``m · J a`` acts across.
    """
    by_pixel = triangulate_with_jacobians(calibration, uv, laser).by_pixel
    step = across @ by_pixel
    moved = (by_pixel @ step[..., None])[..., 0]
    return np.sum(np.square(step), axis=-1) / np.linalg.norm(moved, axis=-1)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A line in the plane of complex numbers: a point of it and its direction; the points as
    seen along it from there; and what `SpaceLine` says of it."""

    origin: complex
    direction: complex
    along: Array
    across: Array
    leverage: Array
    outlying: NDArray[np.bool_]
    direction_std: float
    offset_std: float


def _fitted(flat: Array, noise: Array) -> _Fit:
    """Weighted line through points ``(N, 2)`` that lie near the first axis.

    The frame is turned into the line again and again, so that in the end distances are at right
    angles to it.
    """
    certain = noise if np.all(noise > 0) else np.ones_like(noise)
    weight = np.square(certain.min() / certain)
    seen, origin, direction = flat[:, 0] + 1j * flat[:, 1], 0j, 1 + 0j
    for _ in range(_ROUNDS):
        pull = weight * _pull(seen.imag / certain)
        centre = complex(pull @ seen / pull.sum())
        seen = seen - centre
        slope = float(pull @ (seen.real * seen.imag) / (pull @ np.square(seen.real)))
        turn = (1 + 1j * slope) / np.hypot(1.0, slope)
        origin += centre * direction
        direction, seen = direction * turn, seen * np.conj(turn)
        if abs(slope) < _SETTLED and abs(centre.imag) < _SETTLED * np.ptp(seen.real):
            break
    outlying = _pull(seen.imag / certain) < 1.0
    free = weight * ~outlying
    inertia = float(free @ np.square(seen.real))
    return _Fit(
        origin,
        direction,
        seen.real,
        seen.imag,
        free / free.sum() + free * np.square(seen.real) / inertia,
        outlying,
        float(np.linalg.norm(free * seen.real * noise)) / inertia,
        float(np.linalg.norm(free * noise) / free.sum()),
    )


def _pull(scaled: Array) -> Array:
    """Huber's weights of residuals in units of their noise; 1 within the limit.

    The scale is the median's, whatever the noise was stated to be: a real edge is rougher.
    """
    distance = np.abs(scaled)
    limit = OUTLYING * _MEDIAN_TO_STD * float(np.median(distance))
    if not limit > 0:  # half of the points lie on the line: what is usual cannot be told
        return np.ones_like(scaled)
    return limit / np.maximum(distance, limit)


def _least_zone(along: Array, across: Array) -> float:
    """Least width of a strip that holds all points: one of its sides is a side of their convex
    hull (Houle and Toussaint, IEEE Trans. PAMI 10(5), 1988)."""
    from scipy.spatial import ConvexHull

    reach, length = float(np.ptp(across)), float(np.ptp(along))
    if reach <= _STRAIGHT * length:
        return reach
    points = np.stack([along, across], axis=-1)
    corners = points[ConvexHull(points / [length, reach]).vertices]
    sides = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-sides[:, 1], sides[:, 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    heights = normals @ corners.T - np.sum(normals * corners, axis=-1)[:, None]
    return float(np.abs(heights).max(axis=1).min())


def _expected_range(std: Array) -> float:
    """Mean of highest less lowest of independent normal errors with mean 0, mm.

    ``2 ∫₀^∞ 1 − Π Φ(x/σᵢ) − Π (1 − Φ(x/σᵢ)) dx``, from the distributions of both extremes (David
    and Nagaraja, Order Statistics, 2003, sec. 3.1). Errors of nearly the same size share a factor.
    """
    highest = float(std.max())
    if not highest > 0:
        return 0.0
    groups = np.array_split(np.sort(std), min(_GROUPS, len(std)))
    sizes = np.array([len(group) for group in groups])
    sigma = np.maximum([np.sqrt(np.mean(np.square(group))) for group in groups], 1e-9 * highest)
    scaled = _GRID[:, None] * (highest / sigma)
    below, above = (np.exp(log_ndtr(sign * scaled) @ sizes) for sign in (1.0, -1.0))
    return 2.0 * highest * float(np.trapezoid(1.0 - below - above, _GRID))
