"""Views that cannot be what a camera saw, found before anything is computed.

A marker at a wrong place inside the picture is not looked for here: the calibration knows where
the target can be, and names the point that does not fit.
"""

from __future__ import annotations

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.quoting import one_line
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_Views = TargetViews | BoardViews | PointMatches


def check_views(rig: Rig) -> None:
    """Refuse views that no picture of the rig's camera can have given.

    Raises
    ------
    InputError
        For the first view with a marker or a laser's spot outside the picture, or the points of
        an earlier view of its stage; stage, view and marker are named.
    """
    markers = [f"marker {number}" for number in range(len(rig.target.markers_mm))]
    spots = [f"the spot of laser {one_line(name)}" for name in rig.lasers]
    for stage, views in rig.observations.stages().items():
        points = [*markers, *spots] if stage == "crossing" else markers
        _refuse_outside(views, stage, points, rig.image_size)
        _refuse_copies(views, stage)
    boards = rig.observations.board
    numbers = [f"point {number}" for number in range(boards.uv.shape[1])]
    _refuse_outside(boards, "board", numbers, rig.image_size)
    _refuse_copies(boards, "board")
    matches = rig.observations.matches
    numbers = [f"point {number}" for number in matches.labels]
    _refuse_outside(matches, "match", numbers, rig.image_size)
    _refuse_copies(matches, "match")


def _refuse_outside(
    views: _Views, stage: str, points: list[str], image_size: tuple[int, int]
) -> None:
    width, height = image_size
    within = ((views.uv >= -0.5) & (views.uv <= np.array([width, height]) - 0.5)).all(axis=-1)
    for view, point in np.argwhere(views.seen & ~within):
        u, v = views.uv[view, point]
        raise InputError(
            f"stage {stage}, view {one_line(views.names[view])}: {points[point]} at "
            f"({u:.6g}, {v:.6g}) lies outside the picture of {width} × {height} px",
            "check the point, and image_size in rig.toml",
        )


def _refuse_copies(views: _Views, stage: str) -> None:
    first: dict[bytes, str] = {}
    for name, uv, seen in zip(views.names, views.uv, views.seen, strict=True):
        if not seen.any():
            continue
        points = np.where(seen[:, None], uv, np.nan).tobytes()
        if points in first:
            raise InputError(
                f"stage {stage}: view {one_line(name)} repeats view {one_line(first[points])} "
                "exactly; a copied picture adds no information",
                "remove one of the two",
            )
        first[points] = name
