"""Targets that are not straight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.simulation.poses import PlacedTargets
from sheetoflight.simulation.rig import SimulatedRig

_NEWTON_STEPS = 6


def across(points: Array, roll: Array | float) -> Array:
    """Unit vectors ``(N, 3)`` across targets with markers ``(N, M, 3)``, turned about their axes
    by `roll` from the direction towards the camera, radians."""
    along = normalised(points[:, -1] - points[:, 0])
    middle = (points[:, 0] + points[:, -1]) / 2
    towards = normalised(np.sum(middle * along, axis=-1, keepdims=True) * along - middle)
    turn = np.asarray(roll)[..., None]
    return np.cos(turn) * towards + np.sin(turn) * np.cross(along, towards)


def bent_targets(
    rig: SimulatedRig, placed: PlacedTargets, camera: Array, plane: Array, crossing: Array
) -> PlacedTargets:
    """Straight targets bent to parabolas through their first and last marker.

    Parameters
    ----------
    rig : SimulatedRig
    placed : PlacedTargets
    camera, plane, crossing : (N, 3) arrays
        How far the middle of each target moves, across it, mm, camera frame.
    """
    return replace(
        placed,
        camera=_bent(rig, placed.camera, camera),
        plane=_bent(rig, placed.plane, plane),
        crossing=_bent(rig, placed.crossing, crossing),
        spots=_spots_on_bent(rig, placed, crossing),
    )


def _bent(rig: SimulatedRig, points: Array, bows: Array) -> Array:
    share = rig.target.positions / rig.target.positions[-1]
    return points + (4.0 * share * (1.0 - share))[:, None] * bows[:, None, :]


def _spots_on_bent(rig: SimulatedRig, placed: PlacedTargets, bows: Array) -> Array:
    """Where the sheets meet the parabolas: Newton's iteration from the straight target's spot.

    At the share t of its length a target has the height ``rise (t − t0) + lift t (1 − t)``
    over the sheet, with t0 the share of the straight target's spot.
    """
    spots, every = placed.spots.copy(), np.arange(len(placed.spots))
    lasers = range(len(rig.light_planes))
    sheets = [rig.flat_sheet(laser, "bent targets are crossed by flat ones") for laser in lasers]
    normal = np.stack([plane.normal for plane in sheets])[placed.crossing_lasers]
    start, along = placed.crossing[:, 0], placed.crossing[:, -1] - placed.crossing[:, 0]
    rise, lift = np.sum(normal * along, axis=-1), 4.0 * np.sum(normal * bows, axis=-1)
    straight = np.sum((spots[every, placed.crossing_lasers] - start) * along, axis=-1)
    straight /= np.sum(along**2, axis=-1)
    share = straight.copy()
    for _ in range(_NEWTON_STEPS):
        height = rise * (share - straight) + lift * share * (1.0 - share)
        share -= height / (rise + lift * (1.0 - 2.0 * share))
    bow = (4.0 * share * (1.0 - share))[:, None] * bows
    spots[every, placed.crossing_lasers] = start + share[:, None] * along + bow
    return spots
