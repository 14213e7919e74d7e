"""Points of the laser line in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array


@dataclass(frozen=True)
class PointCloud:
    """Points in space with their standard uncertainties.

    Parameters
    ----------
    xyz : (N, 3) array
        mm, camera frame (of a camera-free calibration, the sheet's own frame).
    std_xyz : (N, 3) array
        Standard uncertainty of each coordinate, mm: the picture's noise and the calibration.
    noise_std : (N,) array
        The part of the uncertainty that comes from the picture's noise, root of the sum of squares
        over the coordinates, mm. It is independent from point to point; what the calibration adds
        is common to neighbouring points.
    uv : (N, 2) array
        The image points, px.
    peak : (N,) array
        Height of the laser line over its surroundings, grey levels.
    line : (N,) int array
        Which line of its picture each point belongs to.
    picture : (N,) int array
        Which of `pictures` each point comes from.
    pictures : tuple of str
        Names of the pictures.

    Raises
    ------
    InputError
        If the arrays do not belong together, or a point is not finite.
    """

    xyz: Array
    std_xyz: Array
    noise_std: Array
    uv: Array
    peak: Array
    line: NDArray[np.int64]
    picture: NDArray[np.int64]
    pictures: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(self.xyz)
        for name, parts in _PARTS.items():
            shape, expected = np.shape(getattr(self, name)), (count, *parts)
            if shape != expected:
                raise InputError(
                    f"{name} of a point cloud has shape {shape}, expected {expected}",
                    "give one value for each point",
                )
        if not np.isfinite(self.xyz).all():
            raise InputError(
                f"{int((~np.isfinite(self.xyz)).any(axis=1).sum())} points of a cloud are not "
                "finite",
                "leave out the image points whose rays do not meet the sheet",
            )

    def __len__(self) -> int:
        return len(self.xyz)

    @cached_property
    def std(self) -> Array:
        """Standard uncertainty of each position ``(N,)``, mm: root of the sum of squares of
        `std_xyz`."""
        return np.sqrt(np.sum(np.square(self.std_xyz), axis=1))

    def taken(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> PointCloud:
        """Some of the points."""
        return PointCloud(
            **{name: getattr(self, name)[index] for name in _PARTS}, pictures=self.pictures
        )


_PARTS: dict[str, tuple[int, ...]] = {
    "xyz": (3,),
    "std_xyz": (3,),
    "noise_std": (),
    "uv": (2,),
    "peak": (),
    "line": (),
    "picture": (),
}


def joined_clouds(clouds: Sequence[PointCloud]) -> PointCloud:
    """Clouds one after another, the pictures of each after those of the one before."""
    offsets = np.cumsum([0, *(len(cloud.pictures) for cloud in clouds)])
    parts = {
        name: np.concatenate(
            [np.empty((0, *shape), dtype=_KINDS.get(name, float))]
            + [getattr(cloud, name) for cloud in clouds]
        )
        for name, shape in _PARTS.items()
        if name != "picture"
    }
    pictures = [cloud.picture + offset for cloud, offset in zip(clouds, offsets, strict=False)]
    return PointCloud(
        **parts,
        picture=np.concatenate([np.empty(0, dtype=np.int64), *pictures]),
        pictures=tuple(name for cloud in clouds for name in cloud.pictures),
    )


_KINDS: dict[str, type] = {"line": np.int64}
