"""Image points of N named views, as every stage holds them: checked, and not to be changed."""

from __future__ import annotations

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


def checked_points(
    names: tuple[str, ...], uv: Array, std: Array | None, what: str = "image points"
) -> tuple[Array, Array]:
    """Points and their standard uncertainties, read-only, NaN where not seen or not known.

    Parameters
    ----------
    names : tuple of str
        Of the N views.
    uv : (N, M, 2) array
        Image points, px.
    std : (N, M) array, optional
        Standard uncertainty of each image coordinate, px.
    what : str
        What the points are called in errors.

    Raises
    ------
    InputError
        If shapes disagree, a name is not unique, or a std is not above zero.
    """
    uv = np.array(uv, dtype=float)
    if uv.ndim != 3 or uv.shape[0] != len(names) or uv.shape[2] != 2:
        raise InputError(
            f"{what} have shape {uv.shape}, expected ({len(names)}, M, 2)",
            "give one row of points for each named view",
        )
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"view {twice} is given twice", "give every view a name of its own")
    uv[~np.isfinite(uv).all(axis=-1)] = np.nan
    std = np.full(uv.shape[:2], np.nan) if std is None else np.array(std, dtype=float)
    if std.shape != uv.shape[:2] or (std <= 0).any():
        raise InputError(
            f"std has shape {std.shape} or is not above zero, expected {uv.shape[:2]}",
            "give one value above zero, or NaN, for each point",
        )
    uv.setflags(write=False)
    std.setflags(write=False)
    return uv, std


def seen_points(uv: Array) -> np.ndarray:
    """Read-only mask ``(N, M)`` of the points that were seen."""
    seen = np.asarray(np.isfinite(uv).all(axis=-1))
    seen.setflags(write=False)
    return seen
