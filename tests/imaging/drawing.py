"""An analytic drawing of a target strip, independent of the package's own renderer."""

from __future__ import annotations

import cv2
import numpy as np


def homography(focal, distance, centre, tilt, spin, roll):
    """Strip coordinates (mm; x along the axis, y across) to px, pinhole with principal point
    ``centre``; the strip's origin is ``distance`` mm ahead, tilted along and about its axis."""
    ct, st = np.cos(tilt), np.sin(tilt)
    cs, ss = np.cos(spin), np.sin(spin)
    cr, sr = np.cos(roll), np.sin(roll)
    about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1.0]])
    about_y = np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])
    about_x = np.array([[1, 0, 0], [0, cs, -ss], [0, ss, cs]])
    rotation = about_z @ about_y @ about_x
    pose = np.column_stack([rotation[:, 0], rotation[:, 1], [0.0, 0.0, distance]])
    camera = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]])
    return camera @ pose


def mapped(matrix, points):
    """Points ``(N, 2)`` through a homography."""
    out = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return out[:, :2] / out[:, 2:]


def strip_albedo(xy, markers, size, kind, ink, paper):
    """Reflectance at strip coordinates ``(..., 2)``; NaN off the strip."""
    x, y = xy[..., 0], xy[..., 1]
    value = np.full(x.shape, np.nan)
    on = (np.abs(y) <= size) & (x >= markers[0] - size) & (x <= markers[-1] + size)
    value[on] = paper
    for i, s in enumerate(markers):
        disc = np.hypot(x - s, y) <= size / 2
        if kind == "quadrant":
            along = np.abs(x - s) > np.abs(y)
            disc &= along if i == 0 else ~along
        value[disc] = ink
    return value


def draw(
    shape,
    matrix,
    markers,
    *,
    size=24.0,
    kind="quadrant",
    blur=0.7,
    noise=2.0,
    light=(1.0, 1.0),
    laser=None,
    ink=12.0,
    paper=180.0,
    wall=60.0,
    background=None,
    seed=0,
    samples=6,
):
    """A picture uint8 of one strip.

    ``light``: factors of illumination at the left and right border; ``laser``:
    (offset mm, sigma mm, peak relative to the paper's ambient brightness), along the axis.
    """
    height, width = shape
    canvas = np.full(shape, float(wall)) if background is None else background.astype(float).copy()
    reach = np.array(
        [[markers[0] - size, -size], [markers[-1] + size, -size],
         [markers[0] - size, size], [markers[-1] + size, size]]
    )  # fmt: skip
    corners = mapped(matrix, reach)
    low = np.maximum(np.floor(corners.min(0)).astype(int) - 12, 0)
    high = np.minimum(np.ceil(corners.max(0)).astype(int) + 13, [width, height])
    fine = (np.arange(samples) + 0.5) / samples - 0.5
    u = (np.arange(low[0], high[0])[:, None] + fine).ravel()
    v = (np.arange(low[1], high[1])[:, None] + fine).ravel()
    inverse = np.linalg.inv(matrix)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    # Rows and columns of samples are shifted against each other by the golden section: a plain
    # grid would put an edge that runs along it at the nearest row of samples.
    shift = np.mod(np.arange(max(grid.shape[:2])) * 0.6180339887, 1.0) - 0.5
    grid[..., 0] += shift[: grid.shape[0], None] / samples
    grid[..., 1] += shift[None, : grid.shape[1]] / samples
    w = grid @ inverse[:, :2].T + inverse[:, 2]
    xy = w[..., :2] / w[..., 2:]
    value = strip_albedo(xy, markers, size, kind, ink, paper)
    if laser is not None:
        offset, sigma, peak = laser
        value = value * (1 + peak * np.exp(-0.5 * ((xy[..., 1] - offset) / sigma) ** 2))
    patch = canvas[low[1] : high[1], low[0] : high[0]]
    under = np.kron(patch, np.ones((samples, samples)))
    value = np.where(np.isnan(value), under, value)
    if blur:
        value = cv2.GaussianBlur(value, (0, 0), blur * samples)
    rows, columns = patch.shape
    value = value.reshape(rows, samples, columns, samples).mean((1, 3))
    canvas[low[1] : high[1], low[0] : high[0]] = value
    canvas *= np.linspace(light[0], light[1], width)
    canvas += np.random.default_rng(seed).normal(0, noise, shape) if noise else 0.0
    return np.clip(np.rint(canvas), 0, 255).astype(np.uint8)
