"""The stated uncertainties checked by Monte Carlo: the rig re-simulated and calibrated again.

The propagation of distributions of JCGM 101:2008 (GUM Supplement 1), 5.9 and 7, with two
differences that are derived in docs/uncertainty.md: the measurement function is the whole
calibration, which estimates the size of its noise too; and the interval is read from the
studentised results ``T = (y* − y) / u*``, u* being the trial's own standard uncertainty. For noise
of one unknown size T has the t-distribution that 6.4.9 of the Supplement assigns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from sheetoflight.calibration.methods import CalibrationOptions, calibrate
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.field_lengths import FieldSegment, field_segments
from sheetoflight.measurement.resimulation import Resimulation, resimulation
from sheetoflight.measurement.trial_results import Results, results
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import CURVATURE_PARTS
from sheetoflight.model.monte_carlo import MonteCarlo, PropagatedLength, PropagatedQuantity
from sheetoflight.model.rig import Rig

FEWEST_TRIALS = 100
"""So that either end of a 95 % interval lies between two trials' results."""

_FEWEST_ACCEPTED = 40
"""With fewer, the 2.5 % quantile lies beyond the least result."""

_NO_NOISE_PX = 1e-6
"""With less, the results differ by rounding errors."""

_TAIL = 0.025


@dataclass(frozen=True)
class MonteCarloOptions:
    """How a Monte Carlo is made.

    Parameters
    ----------
    trials : int
        1000 tell a standard uncertainty to 2 % and an interval's width to 3 %.
    seed : int

    Raises
    ------
    InputError
        If there are too few trials, or the seed is negative.
    """

    trials: int = 1000
    seed: int = 0

    def __post_init__(self) -> None:
        if self.trials < FEWEST_TRIALS:
            raise InputError(
                f"{self.trials} Monte Carlo trials cannot tell a 95 % interval",
                f"ask for {FEWEST_TRIALS} or more; 1000 tell its width to 3 %",
            )
        if self.seed < 0:
            raise InputError(f"the seed is {self.seed}", "give 0 or more")


@dataclass(frozen=True, eq=False)
class Experiment:
    """What every trial needs.

    Parameters
    ----------
    source : Resimulation
    method : str
    options : CalibrationOptions
        Where the sheets came out flat, they are held flat.
    parameters : tuple of str
        Those that the calibration found: of a trial that finds others none can be compared.
    segments : tuple of FieldSegment
        Whose lengths are compared.
    seed : int
    """

    source: Resimulation
    method: str
    options: CalibrationOptions
    parameters: tuple[str, ...]
    segments: tuple[FieldSegment, ...]
    seed: int


def experiment(
    rig: Rig, calibration: Calibration, options: CalibrationOptions, seed: int = 0
) -> Experiment:
    """Everything that the trials for a calibrated rig need.

    Raises
    ------
    InputError
        If the calibration was not made from this rig, carries no covariance, or there is no
        noise.
    """
    if calibration.pixel_std < _NO_NOISE_PX:
        raise InputError(
            f"the image points are known to {calibration.pixel_std:.2g} px, so that there is no "
            "noise to propagate",
            "leave the Monte Carlo out",
        )
    if not calibration.covariance.parameters:
        raise InputError(
            "the calibration carries no covariance that a Monte Carlo could check",
            "calibrate with another method",
        )
    source = resimulation(rig, calibration)
    segments = field_segments(calibration, source.rig.observations, rig.board)
    parameters = calibration.covariance.parameters
    # what is stated is the uncertainty of the model that was chosen, not of the choice
    curved = any(plane.curvature is not None for plane in calibration.light_planes)
    options = replace(options, flat=not curved)
    return Experiment(source, calibration.method, options, parameters, segments, seed)


def trial(task: tuple[Experiment, int]) -> Results | str:
    """One trial: simulate, calibrate, measure. A refusal is returned in its own words.

    Its random numbers depend on the seed and its own number alone, so that it does not matter
    which process makes it.

    Parameters
    ----------
    task : (Experiment, int)
        What to do, and the trial's number.
    """
    plan, number = task
    rng = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(number,)))
    try:
        calibration = calibrate(plan.source.drawn(rng), plan.method, plan.options)
        other = _not_comparable(calibration.covariance.parameters, plan.parameters)
        return other or results(calibration, plan.segments)
    except (InputError, UntrustworthyError) as refusal:
        return str(refusal)


def _not_comparable(found: tuple[str, ...], asked: tuple[str, ...]) -> str:
    """Why a trial's parameters are not those of the calibration; empty where they are."""
    if found == asked:
        return ""
    differing = sorted(set(found) ^ set(asked))
    if all(name.rpartition(".")[2] in CURVATURE_PARTS for name in differing):
        return (
            "a sheet that was calibrated as curved came out flat: it bends so little that chance "
            "decides – calibrate with --flat"
        )
    return (
        f"only one of calibration and trial determines {', '.join(differing)} – take more views, "
        "these determine the rig only just"
    )


def summarised(
    plan: Experiment, calibration: Calibration, trials: Sequence[Results | str]
) -> MonteCarlo:
    """The trials' results beside what the calibration states.

    Parameters
    ----------
    plan : Experiment
    calibration : Calibration
        The one they were simulated from.
    trials : sequence of Results or str

    Raises
    ------
    UntrustworthyError
        If so many trials were refused that the others tell nothing.
    """
    refusals = [one for one in trials if isinstance(one, str)]
    accepted = [one for one in trials if not isinstance(one, str)]
    if len(accepted) < _FEWEST_ACCEPTED:
        raise UntrustworthyError(
            "monte carlo",
            f"{len(refusals)} of {len(trials)} re-simulated rigs cannot be calibrated, the first "
            f"because of: {refusals[0] if refusals else 'nothing'}",
            "the views determine the rig only just: take more of them",
        )
    stated = results(calibration, plan.segments)
    columns = propagated(stated, accepted)
    names = calibration.covariance.parameters
    return MonteCarlo(
        trials=len(trials),
        refused=len(refusals),
        first_refusal=refusals[0] if refusals else "",
        seed=plan.seed,
        parameters=tuple(PropagatedQuantity(name, **columns[i]) for i, name in enumerate(names)),
        lengths=tuple(
            PropagatedLength(
                segment.name,
                **columns[len(names) + i],
                laser=segment.laser,
                uv=_pair(segment.uv),
            )
            for i, segment in enumerate(plan.segments)
        ),
    )


def propagated(stated: Results, accepted: Sequence[Results]) -> list[dict[str, float]]:
    """For each quantity the numbers of a `PropagatedQuantity`.

    Parameters
    ----------
    stated : Results
        Of the calibration that the trials were simulated from.
    accepted : sequence of Results
        Of the trials.
    """
    values = np.array([one.values for one in accepted])
    std = np.array([one.std for one in accepted])
    factors = np.array([one.factors for one in accepted])
    count, shifts = len(accepted), values - stated.values
    studentised = shifts / std
    # expected ranks: the outermost results of a few hundred would else be taken as too far out
    least, most = np.quantile(studentised, (_TAIL, 1.0 - _TAIL), axis=0, method="weibull")
    reach = stated.factors * stated.std
    table = {
        "value": stated.values,
        "mean_shift": shifts.mean(axis=0),
        "std": values.std(axis=0, ddof=1),
        "low": stated.values - most * stated.std,
        "high": stated.values - least * stated.std,
        "analytic_std": stated.std,
        "analytic_low": stated.values - reach,
        "analytic_high": stated.values + reach,
        "coverage": np.mean(np.abs(studentised) <= factors, axis=0),
        "std_ratio_std": np.full(reach.shape, 1.0 / np.sqrt(2.0 * (count - 1))),
        "width_ratio_std": _width_std(stated, count),
        "coverage_std": np.full(reach.shape, np.sqrt(2.0 * _TAIL * (1.0 - 2.0 * _TAIL) / count)),
    }
    rows = np.stack(list(table.values()), axis=1).tolist()
    return [dict(zip(table, row, strict=True)) for row in rows]


def _width_std(stated: Results, count: int) -> Array:
    """Standard deviation ``(Q,)`` of the ratio of widths, were all of linear theory right.

    A sample quantile has variance ``p (1 − p) / (n f²)``, f being the density there, and the two
    ends are correlated by ``p / (1 − p)`` (H. A. David and H. N. Nagaraja, Order Statistics,
    10.2).
    """
    density = _student_density(stated.factors, stated.degrees_of_freedom)
    one_end = np.sqrt(_TAIL * (1.0 - _TAIL) / count) / density
    both = one_end * np.sqrt(2.0 * (1.0 - _TAIL / (1.0 - _TAIL)))
    return both / (2.0 * stated.factors)


def _student_density(at: Array, freedom: Array) -> Array:
    """Density of Student's t-distribution; the normal one's for infinite degrees of freedom."""
    normal = np.exp(-0.5 * at**2) / np.sqrt(2.0 * np.pi)
    known = np.isfinite(freedom)
    nu = np.where(known, freedom, 1.0)
    log_scale = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(nu * np.pi)
    student = np.exp(log_scale - 0.5 * (nu + 1.0) * np.log1p(at**2 / nu))
    return np.where(known, student, normal)


def _pair(uv: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    (u1, v1), (u2, v2) = uv.tolist()
    return (u1, v1), (u2, v2)
