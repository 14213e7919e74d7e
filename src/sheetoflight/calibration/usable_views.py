"""Views that cannot be adjusted, found before anything is computed."""

from __future__ import annotations

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.model.rig import Rig

_SAME_POINT_PX = 1e-6
_FIXED_END_SHARE = 0.03
"""How far, as a part of the picture's diagonal, marker 0 may lie from where the other views see
it: farther than a slipped pivot, nearer than the other end of the target."""


def refuse_unusable_views(rig: Rig) -> None:
    """Refuse views that do not fit the target, or do not show enough of it.

    Raises
    ------
    InputError
        Naming the stage and the view.
    """
    markers = len(rig.target.markers_mm)
    for stage, views in rig.observations.stages().items():
        expected = markers + (len(rig.lasers) if stage == "crossing" else 0)
        if views.uv.shape[1] != expected:
            raise InputError(
                f"the views of stage {stage} have {views.uv.shape[1]} points, "
                f"expected {expected} for a target with {markers} markers",
                "give markers_mm of the target that was seen",
            )
        for name, uv, seen in zip(views.names, views.uv, views.seen, strict=True):
            if seen.sum() < 2:
                raise InputError(
                    f"view {name} of stage {stage} shows {int(seen.sum())} of {markers} markers, "
                    "at least 2 are needed",
                    "remove the view, or detect its markers again",
                )
            gaps = np.linalg.norm(np.diff(uv[seen], axis=0), axis=1)
            if gaps.min() < _SAME_POINT_PX:
                raise InputError(
                    f"view {name} of stage {stage}: two markers have the same image point",
                    "detect its markers again, or remove the view",
                )
    _refuse_other_fixed_points(rig)


def _refuse_other_fixed_points(rig: Rig) -> None:
    """Marker 0 is fixed in the camera stage: a view that shows it elsewhere is of another stage,
    or counts its markers from the other end."""
    views = rig.observations.camera
    seen = views.seen[:, 0] if len(views) else np.zeros(0, dtype=bool)
    if seen.sum() < 3:
        return
    offsets = np.linalg.norm(views.uv[:, 0] - np.median(views.uv[seen, 0], axis=0), axis=1)
    worst = int(np.argmax(np.where(seen, offsets, 0.0)))
    if offsets[worst] > _FIXED_END_SHARE * float(np.hypot(*rig.image_size)):
        raise InputError(
            f"view {views.names[worst]} of stage camera shows marker 0 {offsets[worst]:.0f} px "
            "away from its place in the other views",
            "marker 0 stays fixed in this stage: check the order of the markers, whether the view "
            "belongs to stage plane, and whether the fixed end is marker 0",
        )
