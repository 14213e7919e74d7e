"""How well a calibration will know its parameters, before any picture is taken.

What single views tell on the shared parameters adds up to what a set of views tells, and its
inverse is the covariance to expect of the joint method (Cramér and Rao's bound, which maximum
likelihood reaches where the noise is small). Many sets of views are looked at together: an
operator's positions are as good as random.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.next_view import size_of
from sheetoflight.calibration.planned_poses import random_views
from sheetoflight.calibration.planned_rig import PlannedRig
from sheetoflight.calibration.predicted_views import PredictedViews
from sheetoflight.calibration.rig_state import ANCHOR, CAMERA, SHEET_PARTS
from sheetoflight.calibration.uncertainty import STAGE_SOURCES, Influence, covariance_of
from sheetoflight.calibration.weaknesses import LINEAR_LIMIT
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.covariance import Covariance, NoiseComponents

POOL = 300
"""Random views of each kind, of which sets are made."""

Kind = tuple[str, int]
"""A stage and the number of a laser."""


@dataclass(frozen=True)
class ViewCounts:
    """How many pictures are to be taken.

    Parameters
    ----------
    camera : int
        Of the pivoting target.
    plane, crossing : int
        Of the target in each sheet, and of the target that each sheet crosses.

    Raises
    ------
    InputError
        If a number is negative, or there is no view to find a sheet by.
    """

    camera: int = 30
    plane: int = 10
    crossing: int = 0

    def __post_init__(self) -> None:
        if min(self.camera, self.plane, self.crossing) < 0:
            raise InputError(
                f"{self.camera}, {self.plane} and {self.crossing} views",
                "give numbers of 0 or more",
            )
        if self.plane + self.crossing < 1:
            raise InputError(
                "no view shows the sheet of light", "plan positions in the sheet, or crossing views"
            )

    def of(self, kind: Kind) -> int:
        """Views of one kind."""
        return int(getattr(self, kind[0]))


@dataclass(frozen=True)
class Told:
    """What K sets of views tell on the P shared parameters: sums over each set's views.

    Parameters
    ----------
    information, placement : mapping from stage to (K, P, P) array
        As in `PredictedViews`.
    by_marker : (K, P, M) array
    """

    information: Mapping[str, Array]
    placement: Mapping[str, Array]
    by_marker: Array

    @property
    def whole(self) -> Array:
        """Information ``(K, P, P)`` of all stages."""
        return np.sum(list(self.information.values()), axis=0)

    def __add__(self, other: Told) -> Told:
        return Told(
            _added(self.information, other.information),
            _added(self.placement, other.placement),
            self.by_marker + other.by_marker,
        )

    def take(self, which: int) -> Told:
        """One of the sets."""
        return Told(
            {stage: part[which : which + 1] for stage, part in self.information.items()},
            {stage: part[which : which + 1] for stage, part in self.placement.items()},
            self.by_marker[which : which + 1],
        )


def _added(first: Mapping[str, Array], second: Mapping[str, Array]) -> dict[str, Array]:
    added = dict(first)
    for stage, part in second.items():
        added[stage] = added[stage] + part if stage in added else part
    return added


def told(views: PredictedViews, sets: np.ndarray) -> Told:
    """What K sets tell, each an index array ``(K, n)`` into the views."""
    return Told(
        {views.stage: views.information[sets].sum(axis=1)},
        {views.stage: views.placement[sets].sum(axis=1)},
        views.by_marker[sets].sum(axis=1),
    )


def told_by_many(views: PredictedViews, count: float) -> Told:
    """What a great many views tell: the mean view's share, ``count`` times over."""
    return Told(
        {views.stage: count * views.information.mean(axis=0, keepdims=True)},
        {views.stage: count * views.placement.mean(axis=0, keepdims=True)},
        count * views.by_marker.mean(axis=0, keepdims=True),
    )


def pools(
    planned: PlannedRig, stages: Sequence[str], rng: np.random.Generator
) -> dict[Kind, PredictedViews]:
    """Random views of each of some stages, for every laser where it matters.

    Raises
    ------
    InputError
        If hardly any pose lies wholly in the picture.
    """
    lasers = range(len(planned.rig.lasers))
    kinds = [(s, laser) for s in stages for laser in (lasers if s != "camera" else (0,))]
    return {kind: random_views(planned, *kind, POOL, rng) for kind in kinds}


def covariances(planned: PlannedRig, information: Array) -> Array:
    """Covariance ``(K, P, P)`` of each set's estimates; infinite where it leaves a parameter so
    uncertain that no covariance describes it (`identifiability.LINEAR_LIMIT`)."""
    sizes = np.array([size_of(planned.state, name) for name in planned.parameters])
    scaled = information * sizes[:, None] * sizes
    values, vectors = np.linalg.eigh(scaled)
    sound = values[:, 0] > len(sizes) * np.finfo(float).eps * values[:, -1]
    root = vectors / np.sqrt(np.where(sound[:, None], values, 1.0))[:, None, :]
    covariance = root @ np.swapaxes(root, 1, 2)
    watched = [name not in ANCHOR for name in planned.parameters]
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:, watched]
    sound &= (std <= LINEAR_LIMIT).all(axis=1)
    return np.where(sound[:, None, None], covariance * sizes[:, None] * sizes, np.inf)


def length_variances(planned: PlannedRig, told: Told, slopes: Array) -> Array:
    """Variances ``(K, F)`` of F lengths that the calibration brings, mm²; infinite where a set
    does not determine it.

    Parameters
    ----------
    planned : PlannedRig
    told : Told
        Of K sets.
    slopes : (F, P) array
        Derivatives of the lengths by the shared parameters.
    """
    covariance = covariances(planned, told.whole)
    sound = np.isfinite(covariance[:, 0, 0])
    covariance = np.where(sound[:, None, None], covariance, 0.0)
    variances = carried_variances(planned, covariance, told.by_marker, slopes)
    return np.where(sound[:, None], variances, np.inf)


def carried_variances(
    planned: PlannedRig, covariance: Array, by_marker: Array, slopes: Array
) -> Array:
    """`length_variances` from a covariance ``(K, P, P)`` by noise: with the target's own errors
    as they are carried through the adjustment."""
    target, gains = planned.rig.target, slopes @ covariance
    moved = gains @ by_marker
    variances = np.einsum("kfp,fp->kf", gains, slopes)
    variances += target.tolerance_mm**2 * np.sum(moved**2, axis=2)
    return variances + (target.thermal_std * (moved @ target.positions)) ** 2


def predicted_covariance(planned: PlannedRig, told: Told) -> Covariance:
    """The covariance to expect of a calibration, with its sources, from the first set.

    Raises
    ------
    InputError
        If the set does not determine the parameters.
    """
    covariance = covariances(planned, told.whole[:1])[0]
    if not np.isfinite(covariance).all():
        raise InputError(
            "the planned views do not determine camera and sheet of light", "plan more views"
        )
    kept = np.array([name not in ANCHOR for name in planned.parameters])
    gain = covariance[kept]
    noise: list[tuple[str, str | None, Array]] = []
    for stage, information in told.information.items():
        placement = told.placement[stage][0]
        noise.append((STAGE_SOURCES[stage], None, gain @ (information[0] - placement) @ gain.T))
        if placement.any():
            noise.append(("placement", None, gain @ placement @ gain.T))
    names = tuple(np.array(planned.parameters)[kept].tolist())
    influence = Influence(
        names,
        tuple(noise),
        -gain @ told.by_marker[0],
        np.zeros(len(names)),
        np.zeros((len(names), 0, 3)),
    )
    rig = planned.rig
    return covariance_of(influence, planned.state, rig.lasers, rig.target, NoiseComponents())


def shared_slopes(planned: PlannedRig, by_parameter: Array, laser: int) -> Array:
    """Derivatives ``(F, P)`` by the shared parameters from those by a calibration's parameters.

    Parameters
    ----------
    planned : PlannedRig
    by_parameter : (F, 14) array
        By the camera's ten parameters and by nx, ny, nz, d of one sheet.
    laser : int
        Whose sheet that is.
    """
    frame, sign = planned.state.frames[laser], planned.state.signs[laser]
    tilts = sign * by_parameter[:, 10:13] @ frame[:, :2]
    own = np.column_stack([by_parameter[:, :10], tilts, sign * by_parameter[:, 13]])
    names = [*CAMERA, *(f"sheet{laser}.{part}" for part in SHEET_PARTS)]
    slopes = np.zeros((len(own), len(planned.parameters)))
    for column, name in enumerate(planned.parameters):
        if name in names:
            slopes[:, column] = own[:, names.index(name)]
    return slopes
