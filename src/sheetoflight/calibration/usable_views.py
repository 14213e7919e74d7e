"""Views that cannot be adjusted, found before anything is computed."""

from __future__ import annotations

import numpy as np

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.lines import fitted_line
from sheetoflight.model.rig import Rig

_SAME_POINT_PX = 1e-6

_NOISE_FLOOR_PX = 5.0
"""Where a target is seen almost end on, noise alone puts its markers out of order."""

_MOST_VIEWS = 0.7


def refuse_unusable_views(rig: Rig) -> None:
    """Refuse views that do not fit the target, or do not show enough of it.

    Raises
    ------
    InputError
        Naming the stage and the view.
    UntrustworthyError
        If there is no view at all.
    """
    if not rig.observations.stages() and not len(rig.observations.board):
        raise UntrustworthyError(
            "camera",
            "there are no views at all",
            "take pictures of the target or of a board, and calibrate from these",
        )
    markers = len(rig.target.markers_mm)
    for stage, views in rig.observations.stages().items():
        expected = markers + (len(rig.lasers) if stage == "crossing" else 0)
        if views.uv.shape[1] != expected:
            raise InputError(
                f"the views of stage {stage} have {views.uv.shape[1]} points, "
                f"expected {expected} for a target with {markers} markers",
                "give markers_mm of the target that was seen",
            )
        shown = views.seen.sum(axis=1)
        if (shown < 2).any():
            view = int(np.argmax(shown < 2))
            raise InputError(
                f"view {views.names[view]} of stage {stage} shows {shown[view]} of {markers} "
                "markers, at least 2 are needed",
                "remove the view, or detect its markers again",
            )
        same = _same_points(views.uv, views.seen)
        if same.any():
            raise InputError(
                f"view {views.names[int(np.argmax(same))]} of stage {stage}: two markers have the "
                "same image point",
                "detect its markers again, or remove the view",
            )
    _refuse_misnumbered_markers(rig)


def _same_points(uv: Array, seen: np.ndarray) -> np.ndarray:
    """Which views ``(N,)`` show two neighbouring points, of those seen, in one place."""
    order = np.argsort(~seen, axis=1, kind="stable")  # those seen first
    packed = np.take_along_axis(np.where(seen[..., None], uv, np.nan), order[..., None], axis=1)
    gaps = np.linalg.norm(np.diff(packed, axis=1), axis=2)
    return (gaps < _SAME_POINT_PX).any(axis=1)


def _refuse_misnumbered_markers(rig: Rig) -> None:
    """Single views with their markers in another order are found wrong later; where it is most of
    a stage, the numbering itself is."""
    markers = len(rig.target.markers_mm)
    for stage, views in rig.observations.stages().items():
        whole = views.seen[:, :markers].all(axis=1)
        if not whole.any():
            continue
        uv = views.uv[whole, :markers]
        centre, direction = fitted_line(uv)
        along = np.sum((uv - centre[:, None]) * direction[:, None], axis=-1)
        backward = np.diff(along, axis=1) < -_NOISE_FLOOR_PX
        disordered = backward[:, int(np.argmax(backward.mean(axis=0)))]
        if disordered.mean() > _MOST_VIEWS:
            first = np.array(views.names)[whole][disordered][0]
            raise InputError(
                f"in {disordered.sum()} of {len(uv)} views of stage {stage} the markers are not in "
                f"their order along the target, first in view {first}",
                "number the markers along the target from 0, as markers_mm lists them",
            )
