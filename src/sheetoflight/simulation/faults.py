"""Recordings with one deliberate fault.

Each function gives the observations that a person would hand in who knows nothing of the fault:
they belong to the rig as it was passed, with its target as it is told. The faults draw from a
generator of their own, spawned from the one given, so that `recorded` with the same seed shows
the same targets with the same noise wherever the fault does not change them. (A distorting lens
shows other targets, since it has another field.) What a fault displaces may leave the picture.

Sizes in millimetres are, where they are left out, a share of the target's length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from sheetoflight.geometry.directions import Array, normalised, tangent_basis
from sheetoflight.geometry.rotations import rotation
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.simulation.bending import across, bent_targets
from sheetoflight.simulation.detection_faults import (
    bad_views,
    check_view,
    defocus,
    swapped_markers,
    wrong_detections,
)
from sheetoflight.simulation.poses import (
    Recording,
    crossed_targets,
    lying_targets,
    photographed,
    pivot_poses,
    placed_targets,
)
from sheetoflight.simulation.rig import SimulatedRig, field_centre
from sheetoflight.simulation.visible import target_points

Fault = Callable[[SimulatedRig, Recording, np.random.Generator], Observations]

_BOW_SHARE = 0.005
_SHIFT_SHARE = 0.01


def bent_target(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    bow_mm: float | None = None,
    roll_deg: float | None = 0.0,
) -> Observations:
    """The target is bent: its first and last marker stay, the others lie on a parabola.

    Parameters
    ----------
    rig : SimulatedRig
    recording : Recording
    rng : numpy.random.Generator
    bow_mm : float, optional
        Distance of the parabola's middle from the straight line.
    roll_deg : float, optional
        Angle about the target's axis from the direction towards the camera to the bow: 0 for
        a strip that is bent out of its face, 90 for one that is bent within it. None: random
        in every view, as of a round rod.
    """
    bow = _BOW_SHARE * rig.target.length_mm if bow_mm is None else bow_mm
    own = rng.spawn(1)[0]

    def bows(points: Array) -> Array:
        roll = own.uniform(0.0, 360.0, len(points)) if roll_deg is None else roll_deg
        return bow * across(points, np.radians(roll))

    placed = placed_targets(rig, recording, rng)
    bent = bent_targets(rig, placed, bows(placed.camera), bows(placed.plane), bows(placed.crossing))
    return photographed(rig.camera, bent, recording.pixel_std, rng)


def wrong_marker(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    index: int = 1,
    by_mm: float | None = None,
) -> Observations:
    """Marker `index` is `by_mm` farther along the target than told.

    Marker 0 stays the fixed point: where it is the wrong one, all others are nearer to it.
    """
    shift = np.zeros(len(rig.target.positions))
    shift[index] = _SHIFT_SHARE * rig.target.length_mm if by_mm is None else by_mm
    shift -= shift[0]
    placed = placed_targets(rig, recording, rng)

    def shifted(points: Array) -> Array:
        return points + shift[:, None] * normalised(points[:, -1:] - points[:, :1])

    wrong = replace(
        placed,
        camera=shifted(placed.camera),
        plane=shifted(placed.plane),
        crossing=shifted(placed.crossing),
    )
    return photographed(rig.camera, wrong, recording.pixel_std, rng)


def slipped_pivot(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    after_view: int | None = None,
    by_mm: Sequence[float] | Array | None = None,
) -> Observations:
    """From camera view `after_view` on, by default the middle one, the fixed point is elsewhere.

    Parameters
    ----------
    rig : SimulatedRig
    recording : Recording
    rng : numpy.random.Generator
    after_view : int, optional
    by_mm : (3,) array, optional
        How far it slips, camera frame; by default in a random direction.
    """
    first = _middle(recording.camera_views, after_view)
    check_view("camera", first, recording.camera_views)
    return _slipped(rig, recording, rng, slice(first, None), by_mm)


def slipped_view(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    view: int = 0,
    by_mm: Sequence[float] | Array | None = None,
) -> Observations:
    """In one camera view the fixed point is elsewhere; see `slipped_pivot`."""
    check_view("camera", view, recording.camera_views)
    return _slipped(rig, recording, rng, slice(view, view + 1), by_mm)


def unmodelled_distortion(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    coefficients: tuple[float, float, float, float, float] = (-0.1, 0.0, 0.0, 0.0, 0.0),
) -> Observations:
    """The lens distorts by ``(k1, k2, p1, p2, k3)`` in place of the rig's own coefficients."""
    distorting = replace(rig, camera=replace(rig.camera, distortion=coefficients))
    placed = placed_targets(distorting, recording, rng)
    return photographed(distorting.camera, placed, recording.pixel_std, rng)


def moved_laser(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    after_view: int | None = None,
    turn_deg: float = 0.5,
    shift_mm: float | None = None,
) -> Observations:
    """From view `after_view` of the stages plane and crossing on, by default their middle one,
    the first laser's sheet is elsewhere: turned about a random line in it that passes through
    the middle of the field, and shifted along its normal."""
    check_view("plane", _middle(recording.plane_views, after_view), recording.plane_views)
    own = rng.spawn(1)[0]
    shift = _SHIFT_SHARE * rig.target.length_mm if shift_mm is None else shift_mm
    moved = replace(
        rig, light_planes=(_moved_sheet(rig, turn_deg, shift, own), *rig.light_planes[1:])
    )
    placed = placed_targets(rig, recording, rng)
    plane, crossing, spots = placed.plane.copy(), placed.crossing.copy(), placed.spots.copy()
    lying = slice(_middle(recording.plane_views, after_view), recording.plane_views)
    crossed = slice(_middle(recording.crossing_views, after_view), recording.crossing_views)
    plane[lying] = lying_targets(moved, recording, own)[lying]
    crossing[crossed], spots[crossed] = (
        part[crossed] for part in crossed_targets(moved, recording, own)
    )
    changed = replace(placed, plane=plane, crossing=crossing, spots=spots)
    return photographed(rig.camera, changed, recording.pixel_std, rng)


def refocused(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    scale: float = 1.05,
) -> Observations:
    """After the stage camera the lens is focused anew, its focal length `scale` times as long."""
    placed = placed_targets(rig, recording, rng)
    seen = photographed(rig.camera, placed, recording.pixel_std, rng)
    before, after = (
        rig.camera,
        replace(rig.camera, alpha=scale * rig.camera.alpha, beta=scale * rig.camera.beta),
    )
    moved = {
        "plane": placed.plane,
        "crossing": np.concatenate([placed.crossing, placed.spots], axis=1),
    }
    return replace(
        seen,
        **{
            stage: replace(
                getattr(seen, stage),
                uv=getattr(seen, stage).uv + after.project(points) - before.project(points),
            )
            for stage, points in moved.items()
        },
    )


FAULTS: dict[str, Fault] = {
    "bent target": bent_target,
    "bent target, rolled": partial(bent_target, roll_deg=None),
    "wrong marker": wrong_marker,
    "slipped pivot": slipped_pivot,
    "slipped view": slipped_view,
    "unmodelled distortion": unmodelled_distortion,
    "moved laser": moved_laser,
    "refocused": refocused,
    "swapped markers, camera": swapped_markers,
    "swapped markers, plane": partial(swapped_markers, stage="plane"),
    "defocus, camera": partial(defocus, stage="camera"),
    "defocus, plane": defocus,
    "wrong detections": wrong_detections,
    "bad views": bad_views,
}
"""Every fault, in its usual size. The stages camera and plane must be recorded."""


def _middle(views: int, after_view: int | None) -> int:
    return views // 2 if after_view is None else after_view


def _slipped(
    rig: SimulatedRig,
    recording: Recording,
    rng: np.random.Generator,
    views: slice,
    by_mm: Sequence[float] | Array | None,
) -> Observations:
    """Camera views `views` pivot about another point."""
    own = rng.spawn(1)[0]
    if by_mm is None:
        by_mm = _SHIFT_SHARE * rig.target.length_mm * normalised(own.normal(size=3))
    elsewhere = replace(rig, anchor_mm=rig.anchor_mm + np.asarray(by_mm, dtype=float))
    placed = placed_targets(rig, recording, rng)
    poses = pivot_poses(elsewhere, recording.camera_views, own)
    camera = placed.camera.copy()
    camera[views] = target_points(*poses, rig.target.positions)[views]
    return photographed(rig.camera, replace(placed, camera=camera), recording.pixel_std, rng)


def _moved_sheet(
    rig: SimulatedRig, turn_deg: float, shift_mm: float, rng: np.random.Generator
) -> LightPlane:
    plane = rig.flat_sheet(0, "only flat ones are turned")
    first, second = tangent_basis(plane.normal)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    turn = rotation(math.radians(turn_deg) * (math.cos(angle) * first + math.sin(angle) * second))
    normal = turn @ plane.normal
    centre = field_centre(rig) + shift_mm * plane.normal
    return LightPlane(normal, float(normal @ centre), plane.name)
