"""Whether the views determine what is to be estimated, before any number is given out.

All evidence is judged together, at the solution, by the information matrix and the noise:

- A matrix that is singular to working precision leaves something undetermined.
- A covariance is a linear notion. Where a quantity's relative standard uncertainty (radians for
  angles) is q, the neglected second order is q²; above a tenth it moves an interval's middle by
  more than a twentieth of its half width.
- Noise alone can make a degenerate set of views look determined: at the solution, the estimated
  poses are not quite degenerate. Such a valley shows when it is followed: with the weakest
  quantity held five standard uncertainties away and everything else adjusted again, chi-squared
  must have risen beyond what chance allows once in 200 times; in a healthy set it has risen by
  25. Where it has fallen, that way lies a better minimum, which is then taken.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.fit import Fit, settled
from sheetoflight.calibration.fitting import fitted
from sheetoflight.calibration.next_view import size_of
from sheetoflight.calibration.remedies import advice, stage_of
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.weaknesses import (
    LINEAR_LIMIT,
    WEAK,
    Weakness,
    in_the_corners,
    null_direction,
    weaknesses_of,
    worst_of_each_stage,
)
from sheetoflight.errors import UntrustworthyError
from sheetoflight.estimation.block_least_squares import (
    Solution,
    SolverOptions,
    scaled_inverse,
)
from sheetoflight.geometry.directions import Array

_BEYOND_DOUBT = 0.002
"""Relative standard uncertainty below which no valley is followed: in degenerate sets the
information comes from the noise itself, and gives some hundredths whatever the noise."""

_FOLLOWED = 5.0

_CHANCE = 5e-3

_BETTER = 0.1
"""Fall of chi-squared beside a minimum that shows it is not the least."""

_MINIMA = 3

_NEARLY = SolverOptions(tolerance=1e-6, iterations=80)
"""Chi-squared beside a minimum is asked for to a tenth."""

_LIKE_NONE = 0.5
"""Relative standard uncertainty of a distance that cannot be told from 0."""

_OUTSIDE = (
    "in the corners of the picture, where no board was, ",
    "measure only where the boards were, or ",
)


def determined(fit: Fit, stage: str) -> tuple[Fit, tuple[str, ...]]:
    """Refuse a fit whose views do not determine it; warn where they do so weakly.

    Returns
    -------
    fit : Fit
        The same, or that of a better minimum, where one was met.
    warnings : tuple of str

    Raises
    ------
    UntrustworthyError
        Naming the stage, what is undetermined, and which picture to take next.
    """
    weaknesses: list[Weakness] = []
    for _ in range(_MINIMA):
        weaknesses = _require_little_spread(fit)
        lower = _lower_beside(fit, weaknesses, stage)
        if lower is None:
            return fit, _warnings(fit, weaknesses)
        stages, parameters = fit.adjustment.stages, fit.adjustment.parameters
        fit = fitted(fit.rig, stages, parameters, lower, fit.noise, stage)
    weakest = max(weaknesses, key=lambda w: w.where_seen)
    text = f"hardly determine {{what}}: there are {_MINIMA} minima, each beside a lower one"
    raise _refusal(fit, fit.information, weakest, text)


def _warnings(fit: Fit, weaknesses: list[Weakness]) -> tuple[str, ...]:
    weak = [(w, "", "") for w in weaknesses if w.where_seen > WEAK]
    weak += [(w, *_OUTSIDE) for w in in_the_corners(fit) if w.relative_std > WEAK]
    return tuple(
        f"stage {stage_of(fit.rig, w.stage)}: {where}{w.in_words} is known to {w.relative_std:.1%} "
        f"only – {instead}{advice(fit, fit.information, w.stage, w.parameter)}"
        for w, where, instead in weak
    )


def _require_little_spread(fit: Fit) -> list[Weakness]:
    """What is known least in each stage, none of it beyond the linear."""
    information = fit.information
    try:
        covariance = fit.covariance
    except np.linalg.LinAlgError as reason:
        weakest = null_direction(fit, information)
        raise _refusal(fit, information, weakest, "do not determine {what}") from reason
    weaknesses = weaknesses_of(fit, covariance)
    for weakness in weaknesses:
        if not weakness.where_seen <= LINEAR_LIMIT:
            _refuse_edge_on(fit, weakness)
            text = (
                f"leave {{what}} uncertain by {weakness.where_seen:.0%} (limit {LINEAR_LIMIT:.0%})"
            )
            raise _refusal(fit, information, weakness, text, _cause(fit, weakness, weaknesses))
    worst = worst_of_each_stage(weaknesses)
    if not fit.solution.converged:
        text = f"hardly determine {{what}}: no convergence after {fit.solution.iterations} steps"
        raise _refusal(fit, information, max(worst, key=lambda w: w.where_seen), text)
    return worst


def _refuse_edge_on(fit: Fit, weakness: Weakness) -> None:
    """A sheet's distance that cannot be told from none may itself be known well."""
    owner, part = weakness.parameter.split(".")
    if part != "d" or weakness.relative_std < _LIKE_NONE:
        return
    laser = int(owner.removeprefix("sheet"))
    distance = abs(float(fit.state.distances[laser]))
    reach = _reach(fit)
    if weakness.relative_std * size_of(fit.state, weakness.parameter) <= _BEYOND_DOUBT * reach:
        raise edge_on(fit.rig.lasers[laser], distance, reach, stage_of(fit.rig, "plane"))


def _reach(fit: Fit) -> float:
    """How far away targets and boards typically were, mm."""
    placed = [
        fit.adjustment.placed(fit.state, stage).points.reshape(-1, 3)
        for stage in fit.adjustment.stages
    ]
    if fit.adjustment.boards is not None:
        placed.append(fit.state.poses["board"][:, :, 3])
    return float(np.nanmedian(np.linalg.norm(np.concatenate(placed), axis=1)))


def require_open_sheets(fit: Fit) -> None:
    """Refuse a sheet that the camera sees all but edge on.

    A point is ``X = d r / (n · r)``: a pixel's noise moves its depth by the relative amount
    ``σ ‖(K⁻ᵀ n)_uv‖ / (n · r)``, which grows without bound as the sheet comes near the camera's
    centre.

    Raises
    ------
    UntrustworthyError
        Where that exceeds `LINEAR_LIMIT` for the points by which the sheet is known.
    """
    state, pixel_std = fit.state, np.sqrt(fit.noise.variances[PIXEL])
    inverse = np.linalg.inv(state.camera.matrix)
    for laser, name in enumerate(fit.rig.lasers):
        points = _points_on(fit, laser)
        normal, distance = state.frames[laser][:, 2], abs(float(state.distances[laser]))
        slopes = np.abs(points @ normal) / points[:, 2]
        across = float(np.linalg.norm((inverse.T @ normal)[:2]))
        relative = pixel_std * across / max(float(np.median(slopes)), 1e-300)
        if not relative <= LINEAR_LIMIT:
            reach = float(np.median(np.linalg.norm(points, axis=1)))
            raise edge_on(name, distance, reach, stage_of(fit.rig, "plane"))


def edge_on(laser: str, distance: float, reach: float, stage: str = "plane") -> UntrustworthyError:
    """The refusal of a sheet through or near the camera's centre."""
    seen = "boards" if stage == "board" else "targets"
    return UntrustworthyError(
        stage,
        f"the sheet of {laser} passes through or near the camera's centre ({distance:.2g} mm from "
        f"it, the {seen} are {reach:.0f} mm away), so that depth cannot be told",
        "move the laser aside until the camera looks at the sheet from 15° or more",
    )


def _points_on(fit: Fit, laser: int) -> Array:
    """The markers ``(N, 3)`` that lie in a sheet, and its spots on targets."""
    found: list[Array] = [np.empty((0, 3))]
    for stage, views in fit.adjustment.stages.items():
        points = fit.adjustment.placed(fit.state, stage).points
        if stage == "plane":
            found.append(points[views.lasers == laser].reshape(-1, 3))
        if stage == "crossing":
            spot = len(fit.adjustment.positions) + laser
            found.append(points[views.seen[:, spot], spot])
    boards = fit.adjustment.boards
    if boards is not None and boards.lines is not None:
        rays = boards.lines.ends[boards.lines.laser == laser].reshape(-1, 3)
        normal, distance = fit.state.frames[laser][:, 2], float(fit.state.distances[laser])
        found.append(rays * (distance / (rays @ normal))[:, None])
    return np.concatenate(found)


def roughly_determined(fit: Fit) -> bool:
    """Whether the information at the solution leaves nothing open, valleys apart."""
    try:
        weaknesses = weaknesses_of(fit, fit.covariance)
    except np.linalg.LinAlgError:
        return False
    return all(weakness.where_seen <= LINEAR_LIMIT for weakness in weaknesses)


def _lower_beside(fit: Fit, weaknesses: list[Weakness], stage: str) -> RigState | None:
    """Follow the valleys of what is known least, until one leads farther down."""
    for weakness in weaknesses:
        if weakness.where_seen > _BEYOND_DOUBT:
            lower = _follow_valley(fit, weakness, stage)
            if lower is not None:
                return lower
    return None


def _follow_valley(fit: Fit, weakness: Weakness, stage: str) -> RigState | None:
    """Hold the weakest parameter away from its estimate, adjust everything else again.

    Returns
    -------
    RigState or None
        A state that fits better than the fit does, if there is one.
    """
    parameters, covariance = fit.adjustment.parameters, fit.covariance
    place = parameters.index(weakness.parameter)
    column = covariance[:, place] / np.sqrt(covariance[place, place])
    others = tuple(name for name in parameters if name != weakness.parameter)
    held = fit.noise.adjustment(fit.rig, fit.adjustment.stages, others, fit.state)
    whole = fit.noise.adjustment(fit.rig, fit.adjustment.stages, parameters, fit.state)
    # lines are reduced anew where they stand now: only in the same terms can costs be compared
    base = settled(whole, fit.state, stage, _NEARLY).cost
    limit = float(chdtri(1, _CHANCE))
    for side in (_FOLLOWED, -_FOLLOWED):
        beside = _solution_beside(fit, held, side * column, stage)
        rise = np.inf if beside is None else 2.0 * (beside.cost - base)
        if beside is not None and rise < -_BETTER:
            return beside.state
        if rise < limit:
            shift = abs(side) * weakness.relative_std
            text = (
                "do not determine {what}: "
                f"changed by {shift:.0%}, all fits nearly as well (chi-squared "
                f"{rise:+.1f} where {_FOLLOWED**2:.0f} was to be expected)"
            )
            raise _refusal(fit, fit.information, weakness, text)
    return None


def _solution_beside(
    fit: Fit, held: Adjustment, step: Array, stage: str
) -> Solution[RigState] | None:
    """The minimum near a step away; none where no such rig could be seen like this."""
    try:
        moved = _moved(fit, step)
        return None if moved is None else settled(held, moved, stage, _NEARLY)
    except (np.linalg.LinAlgError, UntrustworthyError):
        return None


def _moved(fit: Fit, step: Array) -> RigState | None:
    """The state after a step of the shared parameters, the poses following."""
    local = {}
    blocks = fit.adjustment.blocks(fit.state)
    for stage, block in zip(fit.adjustment.block_names, blocks, strict=True):
        pull = np.einsum("nrk,nrs,s->nk", block.by_local, block.by_shared, step[block.columns])
        normal = np.swapaxes(block.by_local, 1, 2) @ block.by_local
        local[stage] = -np.linalg.solve(normal, pull[..., None])[..., 0]
    shared = dict(zip(fit.adjustment.parameters, step.tolist(), strict=True))
    return fit.state.moved(shared, local)


def _cause(fit: Fit, weakness: Weakness, others: list[Weakness]) -> Weakness:
    """What to mend: the camera, where the sheet would be known well enough if it were held."""
    names = fit.adjustment.parameters
    camera = [other for other in others if other.stage == "camera"]
    if weakness.stage == "camera" or not camera:
        return weakness
    rest = [i for i, name in enumerate(names) if not name.startswith("camera.")]
    held = np.diag(scaled_inverse(fit.information[np.ix_(rest, rest)])[0])
    own = np.sqrt(held[rest.index(names.index(weakness.parameter))])
    if own > LINEAR_LIMIT * size_of(fit.state, weakness.parameter):
        return weakness
    return max(camera, key=lambda one: one.where_seen)


def _refusal(
    fit: Fit, information: Array, weakness: Weakness, text: str, cause: Weakness | None = None
) -> UntrustworthyError:
    cause = cause or weakness
    return UntrustworthyError(
        stage_of(fit.rig, weakness.stage),
        f"the views {text.format(what=weakness.in_words)}",
        advice(fit, information, cause.stage, cause.parameter),
    )
