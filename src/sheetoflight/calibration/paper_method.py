"""The paper's own way: camera, triangulation, RANSAC, genetic search (sections 3 and 4.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.calibration.camera_alone import camera_alone, with_known_pixel_noise
from sheetoflight.calibration.components import COMPONENTS, PIXEL
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.paper_plane import PaperOptions, PaperPlane, paper_plane
from sheetoflight.calibration.rig_state import CAMERA, intrinsic_names, sheet_names
from sheetoflight.calibration.starts import triangulated_views, with_planes
from sheetoflight.calibration.uncertainty import Influence, chained, influence
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.geometry.planes import fitted_plane
from sheetoflight.model.observations import TargetViews
from sheetoflight.model.rig import Rig

_DIFFERENCE_PX = 0.01


def paper(rig: Rig, noise: NoiseModel, options: PaperOptions) -> Outcome:
    """Camera from the pivoting target alone, the plane from triangulated positions.

    Raises
    ------
    InputError
        If there are several lasers, or crossing views.
    UntrustworthyError
        If the views do not determine the camera, or the search for the plane fails.
    """
    camera, weak = camera_alone(rig, noise)
    if len(rig.lasers) > 1 or len(rig.observations.crossing):
        raise InputError(
            "method paper knows one sheet of light with targets lying in it, nothing else",
            "use --method joint",
        )
    points, used = triangulated_views(rig, camera.state.camera, "plane")
    plane = paper_plane(points, options)
    state = with_planes(rig, camera.state, [(plane.normal, plane.distance)])
    held = replace(with_known_pixel_noise(camera), free=np.zeros(len(COMPONENTS), dtype=bool))
    fit = fitted(rig, {"plane": rig.observations.plane}, (), state, held, "plane")
    names = intrinsic_names(rig.free_intrinsics)
    second, slope = _paper_influence(fit, rig, plane, used)
    both = chained(influence(camera, names, "camera"), second, slope)
    warnings = (*weak, *_few_inliers(plane, options))
    return Outcome(fit.state, both, (camera, fit), camera, warnings)


def _paper_influence(
    fit: Fit, rig: Rig, plane: PaperPlane, used: np.ndarray
) -> tuple[Influence, Array]:
    """Influence on the paper's plane of the in-plane pixels, and its slope by the camera.

    The genetic search ends at the least-squares plane through the inliers, so that plane's
    central differences tell how it moves: the points of one position share their depth error,
    which a covariance from the scatter of single points would miss.
    """
    views = rig.observations.plane.take(used)
    state = fit.state
    frame, base = state.frames[0], state.camera.parameters
    free = [CAMERA.index(name) for name in intrinsic_names(rig.free_intrinsics)]

    def points_at(uv: Array, parameters: Array, markers: Array) -> Array:
        seen = replace(rig.observations, plane=TargetViews(views.names, uv))
        target = replace(rig.target, markers_mm=tuple(markers - markers[0]), warmer_by_K=0.0)
        camera = state.camera.with_parameters(parameters)
        moved = replace(rig, observations=seen, target=target)
        return triangulated_views(moved, camera, "plane")[0]

    def plane_of(points: Array) -> Array:
        normal, distance = fitted_plane(points[plane.used])
        return np.array([*(normal @ frame[:, :2]), distance])

    positions = rig.target.positions
    by_camera = np.empty((3, len(free)))
    for column, index in enumerate(free):
        step = np.zeros(len(base))
        step[index] = 1e-4 * max(abs(base[index]), 1e-2)
        ends = [plane_of(points_at(views.uv, base + s, positions)) for s in (step, -step)]
        by_camera[:, column] = (ends[0] - ends[1]) / (2.0 * step[index])

    by_marker = np.empty((3, len(positions)))
    for marker in range(len(positions)):
        step = np.zeros(len(positions))
        step[marker] = 1e-4 * positions[-1]
        ends = [plane_of(points_at(views.uv, base, positions + s)) for s in (step, -step)]
        by_marker[:, marker] = (ends[0] - ends[1]) / (2.0 * step[marker])

    own = np.zeros((3, 3))
    now = points_at(views.uv, base, positions)
    variances = fit.noise.std("plane")[used] ** 2
    for marker in range(views.uv.shape[1]):
        for axis in range(2):
            step = np.zeros(views.uv.shape)
            step[:, marker, axis] = _DIFFERENCE_PX
            above, below = (points_at(views.uv + s, base, positions) for s in (step, -step))
            for view in np.flatnonzero(views.seen[:, marker]):
                ends = []
                for moved in (above, below):
                    points = now.copy()
                    points[view] = moved[view]
                    ends.append(plane_of(points))
                slope = (ends[0] - ends[1]) / (2.0 * _DIFFERENCE_PX)
                own += np.outer(slope, slope) * variances[view, marker]
    component = None if rig.pixel_std else COMPONENTS[PIXEL]
    return Influence(
        sheet_names(1), (("sheet", component, own),), by_marker, np.zeros(3), np.zeros((3, 0, 3))
    ), by_camera


def _few_inliers(plane: PaperPlane, options: PaperOptions) -> tuple[str, ...]:
    total = plane.used.size
    if plane.agreeing >= options.inlier_share * total:
        return ()
    return (
        f"only {plane.agreeing} of {total} triangulated points lie within "
        f"{options.threshold_mm} mm of the plane, the paper asks for "
        f"{options.inlier_share:.0%} – the depth of a tilted target is too noisy for this method; "
        "use --method joint",
    )
