"""A minimum, the adjustment it belongs to, and what follows from both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.noise import NoiseModel
from sheetoflight.calibration.pose_reselection import reselected
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import (
    Solution,
    SolverOptions,
    scaled_inverse,
    solve,
)
from sheetoflight.estimation.variance_components import (
    Contrasts,
    ReducedModel,
    reduced_model,
)
from sheetoflight.geometry.directions import Array
from sheetoflight.model.rig import Rig

_RESELECTIONS = 5


@dataclass(frozen=True)
class Fit:
    """A minimum, the adjustment it belongs to, and the noise that its residuals show.

    Parameters
    ----------
    rig : Rig
    adjustment : Adjustment
    solution : Solution
    noise : NoiseModel
        With the estimated variances in place.
    size_covariance : (7, 7) array
        Of the estimated variances; zero where they were stated.
    """

    rig: Rig
    adjustment: Adjustment
    solution: Solution[RigState]
    noise: NoiseModel
    size_covariance: Array

    @property
    def state(self) -> RigState:
        """The estimates."""
        return self.solution.state

    @property
    def chi2(self) -> float:
        """Sum of squared residuals in units of the noise that the adjustment was given."""
        return 2.0 * self.solution.cost

    @property
    def degrees_of_freedom(self) -> int:
        """Observations less unknowns."""
        return self.adjustment.degrees_of_freedom

    @cached_property
    def contrasts(self) -> list[Contrasts]:
        """The residuals with each view's pose eliminated, stage by stage."""
        return self.noise.contrasts(self.adjustment, self.state, {})

    @cached_property
    def information(self) -> Array:
        """On the shared parameters, all poses eliminated."""
        size = self.adjustment.shared_size
        return reduced_model(self.contrasts, size, self.noise.variances).information

    @cached_property
    def covariance(self) -> Array:
        """Of the shared parameters.

        Raises
        ------
        numpy.linalg.LinAlgError
            If they are undetermined.
        """
        return scaled_inverse(self.information)[0]

    def model(self, moves: Mapping[str, list[Array]] | None = None) -> ReducedModel:
        """Information on the shared parameters; with a move for each of the target's markers by
        stage, also on these, and on the relative size of the boards behind them."""
        size = self.adjustment.shared_size
        if moves is None:
            return reduced_model(self.contrasts, size, self.noise.variances)
        last = size + len(self.adjustment.positions)
        groups = self.noise.contrasts(self.adjustment, self.state, moves, last)
        return reduced_model(groups, last + 1, self.noise.variances)


def settled(
    adjustment: Adjustment, state: RigState, stage: str, options: SolverOptions | None = None
) -> Solution[RigState]:
    """Solve; test views for another pose, and solve again until none changes."""
    solution = _solved(adjustment, state, stage, options)
    for _ in range(_RESELECTIONS):
        state, changed = reselected(solution.state, adjustment.stages, adjustment.positions)
        if not changed:
            break
        again = _solved(adjustment, state, stage, options)
        if again.cost >= solution.cost:
            break
        solution = again
    return solution


def _solved(
    adjustment: Adjustment, state: RigState, stage: str, options: SolverOptions | None
) -> Solution[RigState]:
    try:
        return solve(adjustment, state, options)
    except np.linalg.LinAlgError as reason:
        raise _no_pose(adjustment, state, stage) from reason


def _no_pose(adjustment: Adjustment, state: RigState, stage: str) -> UntrustworthyError:
    """The refusal of a view whose own parameters are open."""
    who = "a view"
    for name, block in zip(adjustment.block_names, adjustment.blocks(state), strict=True):
        singular = np.linalg.matrix_rank(block.by_local) < block.by_local.shape[2]
        if singular.any():
            stage, views = name, adjustment.views_of(name)
            who = f"view {views.names[int(np.argmax(singular))]}"
            break
    return UntrustworthyError(
        stage,
        f"{who} does not determine its own pose",
        "remove views with fewer than two markers, or with markers that coincide",
    )


def undetermined(stage: str) -> UntrustworthyError:
    """The views leave something open that was to be estimated."""
    return UntrustworthyError(
        stage,
        "the views do not determine the parameters",
        "take further views with the target turned into other directions",
    )
