"""The points of all views in groups that are drawn and counted alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration, ViewResiduals
from sheetoflight.report.board_outlines import outline, seen_in_sheet

PointKind = Literal["markers", "spots", "board"]


@dataclass(frozen=True)
class PointGroup:
    """Alike points of the views of one stage.

    Parameters
    ----------
    stage : str
    kind : {"markers", "spots", "board"}
        In stage crossing the lasers' spots are a group of their own.
    laser : int, optional
        Number of the sheet in which the points lie; None for targets outside any sheet.
    title : str
        What to call the group.
    views : tuple of str
        The names of its N views.
    uv, residuals : tuple of N (m, 2) arrays
        px; NaN where a point was not seen.
    xyz : tuple of N (m, 3) arrays
        mm; NaN for a spot that was not seen.
    """

    stage: str
    kind: PointKind
    laser: int | None
    title: str
    views: tuple[str, ...]
    uv: tuple[Array, ...]
    residuals: tuple[Array, ...]
    xyz: tuple[Array, ...]

    def __len__(self) -> int:
        return len(self.views)

    @property
    def seen(self) -> int:
        """Number of points that were seen, in all views together."""
        return sum(int(np.isfinite(uv).all(axis=1).sum()) for uv in self.uv)

    @property
    def largest_px(self) -> float:
        """Greatest distance of a point from its prediction, px; NaN where nothing was seen."""
        return largest_px(np.concatenate(self.residuals))

    @property
    def rms_px(self) -> float:
        """Root mean square residual per image coordinate, px; NaN where nothing was seen."""
        every = np.concatenate([part.ravel() for part in self.residuals])
        seen = every[np.isfinite(every)]
        return float(np.sqrt(np.mean(seen**2))) if seen.size else np.nan


def point_groups(calibration: Calibration) -> tuple[PointGroup, ...]:
    """The groups that occur, stage by stage, and laser by laser within a stage."""
    views = calibration.residuals.views
    groups: list[PointGroup] = []
    for stage in stages_of(views):
        of_stage = [view for view in views if view.stage == stage]
        if stage == "plane":
            groups += _lying(calibration, of_stage)
        elif stage == "crossing":
            groups += _crossing(calibration, of_stage)
        else:
            kind = "board" if stage == "board" else "markers"
            groups.append(_group(of_stage, slice(None), stage, kind=kind))
    return tuple(groups)


def stages_of(views: Sequence[ViewResiduals]) -> tuple[str, ...]:
    """The stages that occur, in the order of their first view."""
    return tuple(dict.fromkeys(view.stage for view in views))


def largest_px(residuals: Array) -> float:
    """The longest of the residuals ``(N, 2)``, px; NaN where there is none."""
    lengths = np.linalg.norm(residuals[np.isfinite(residuals).all(axis=1)], axis=1)
    return float(lengths.max()) if len(lengths) else np.nan


def in_sheet(calibration: Calibration, laser: int) -> Array:
    """Points ``(N, 3)`` of all views that lie in the sheet of one laser, mm.

    Markers and spots, and where lines on boards were used, the ends of the lines, roughly.
    """
    groups = point_groups(calibration)
    parts = [xyz for group in groups if group.laser == laser for xyz in group.xyz]
    if has_lines(calibration):
        plane = calibration.light_planes[laser]
        parts += [
            seen_in_sheet(xyz[outline(uv)], plane)
            for group in groups
            if group.kind == "board"
            for uv, xyz in zip(group.uv, group.xyz, strict=True)
        ]
    points = np.concatenate([np.empty((0, 3)), *parts])
    return points[np.isfinite(points).all(axis=1)]


def has_lines(calibration: Calibration) -> bool:
    """Whether lines of light on boards were used: their scatter is always estimated."""
    return "stripe" in calibration.covariance.components.names


def _lying(calibration: Calibration, views: Sequence[ViewResiduals]) -> list[PointGroup]:
    lasers = [_nearest_sheet(calibration, view) for view in views]
    several = len(calibration.light_planes) > 1
    return [
        _group(
            [view for view, own in zip(views, lasers, strict=True) if own == laser],
            slice(None),
            f"plane, {plane.name}" if several else "plane",
            laser,
        )
        for laser, plane in enumerate(calibration.light_planes)
        if laser in lasers
    ]


def _nearest_sheet(calibration: Calibration, view: ViewResiduals) -> int:
    """The laser in whose sheet a target lies: estimated markers lie in it exactly."""
    markers = view.xyz[np.isfinite(view.xyz).all(axis=1)]
    if not len(markers):
        return 0
    distances = [np.abs(plane.heights(markers)).mean() for plane in calibration.light_planes]
    return int(np.argmin(distances))


def _crossing(calibration: Calibration, views: Sequence[ViewResiduals]) -> list[PointGroup]:
    lasers = len(calibration.light_planes)
    markers = max(len(views[0].uv) - lasers, 0)
    groups = [_group(views, slice(0, markers), "crossing, markers")]
    for laser, plane in enumerate(calibration.light_planes):
        spot = slice(markers + laser, markers + laser + 1)
        seen = [view for view in views if np.isfinite(view.uv[spot]).all(axis=1).any()]
        name = f"crossing, spots of {plane.name}" if lasers > 1 else "crossing, spots"
        if seen:
            groups.append(_group(seen, spot, name, laser, "spots"))
    return groups


def _group(
    views: Sequence[ViewResiduals],
    points: slice,
    title: str,
    laser: int | None = None,
    kind: PointKind = "markers",
) -> PointGroup:
    return PointGroup(
        views[0].stage,
        kind,
        laser,
        title,
        tuple(view.view for view in views),
        tuple(view.uv[points] for view in views),
        tuple(view.residuals[points] for view in views),
        tuple(view.xyz[points] for view in views),
    )
