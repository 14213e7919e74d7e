"""What was seen: the image points of markers, view by view."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.image_points import checked_points, seen_points
from sheetoflight.model.matches import PointMatches


@dataclass(frozen=True, eq=False)
class TargetViews:
    """Image points of the target's markers in the views of one stage.

    Parameters
    ----------
    names : tuple of str
        A name for each of the N views, unique in its stage.
    uv : (N, M, 2) array
        Image point of each of the M markers in px; NaN where a marker was not seen. In stage
        crossing the spots follow, one column for each laser: ``(N, M + lasers, 2)``.
    std : (N, M) array, optional
        Standard uncertainty of each image coordinate in px; NaN or absent where unknown.
    laser : (N,) int array, optional
        In stage plane the laser in whose sheet the target lies, counted from 0; all 0 where
        absent.

    Raises
    ------
    InputError
        If shapes disagree, or a name is not unique.
    """

    names: tuple[str, ...]
    uv: Array
    std: Array | None = None
    laser: np.ndarray | None = None

    def __post_init__(self) -> None:
        uv, std = checked_points(self.names, self.uv, self.std)
        laser = np.zeros(len(uv)) if self.laser is None else np.asarray(self.laser)
        if laser.shape != (len(uv),) or (laser < 0).any() or (laser % 1 != 0).any():
            raise InputError(
                f"laser is {laser.tolist()}, expected {len(uv)} whole numbers from 0",
                "give the number of the laser for each view",
            )
        laser = laser.astype(int)
        laser.setflags(write=False)
        object.__setattr__(self, "laser", laser)
        if self.std is not None:
            object.__setattr__(self, "std", std)
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "uv", uv)

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def seen(self) -> np.ndarray:
        """``(N, M)`` mask of the markers that were seen."""
        return seen_points(self.uv)

    def take(self, views: np.ndarray) -> TargetViews:
        """The views that an index array or mask ``views`` selects."""
        index = np.arange(len(self))[views]
        std = None if self.std is None else self.std[index]
        return TargetViews(
            tuple(self.names[i] for i in index), self.uv[index], std, self.lasers[index]
        )

    def without(self, points: np.ndarray) -> TargetViews:
        """The views with the points of a mask ``(N, M)`` taken as not seen."""
        uv = np.where(points[..., None], np.nan, self.uv)
        return TargetViews(self.names, uv, self.std, self.laser)

    @property
    def lasers(self) -> np.ndarray:
        """``(N,)`` number of each view's laser."""
        assert self.laser is not None  # set when the views are made
        return self.laser


def no_views(markers: int = 3) -> TargetViews:
    """Views of a stage that was not recorded."""
    return TargetViews((), np.empty((0, markers, 2)))


@dataclass(frozen=True, eq=False)
class Observations:
    """All views of a rig, by stage.

    Parameters
    ----------
    camera : TargetViews
        The target pivots about marker 0, laser off.
    plane : TargetViews
        All markers lie in the sheet of light.
    crossing : TargetViews
        The sheet crosses the target, and the laser's spot on it is seen.
    board : BoardViews
        A board or a solid body of known points, with or without lines of light on it.
    matches : PointMatches
        Points of an unknown scene, for a camera that is calibrated without any target.
    """

    camera: TargetViews = field(default_factory=no_views)
    plane: TargetViews = field(default_factory=no_views)
    crossing: TargetViews = field(default_factory=no_views)
    board: BoardViews = field(default_factory=BoardViews)
    matches: PointMatches = field(default_factory=PointMatches)

    def stages(self) -> dict[str, TargetViews]:
        """The stages of the collinear target that hold at least one view."""
        every = {"camera": self.camera, "plane": self.plane, "crossing": self.crossing}
        return {stage: views for stage, views in every.items() if len(views)}

    def counts(self) -> dict[str, int]:
        """How many views each stage holds that holds any."""
        counts = {stage: len(views) for stage, views in self.stages().items()}
        further = {"board": len(self.board), "match": len(self.matches)}
        return counts | {stage: count for stage, count in further.items() if count}
