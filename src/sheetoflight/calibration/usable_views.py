"""Views that cannot be adjusted, found before anything is computed."""

from __future__ import annotations

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.model.rig import Rig

_SAME_POINT_PX = 1e-6


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
