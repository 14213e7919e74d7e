"""Methods side by side on one simulated rig: what came of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import Contestant
from sheetoflight.measurement.method_trial import Attempt, LengthErrors


@dataclass(frozen=True)
class LengthScore:
    """Errors of one length, over all its segments and all trials with a result.

    Parameters
    ----------
    length_mm : float
    rms_mm : float
        Root mean square of the calibration's share: the ends are seen exactly.
    predicted_mm : float
        The same as the calibrations themselves state it.
    bound_mm : float
        The Cramér–Rao bound of it.
    bound_share, bound_share_std : float
        Bound over rms, and how well so many trials tell it.
    coverage : float
        Share of the 95 % intervals that hold.
    measured_rms_mm, measured_mean_mm : float
        Root mean square and mean absolute error, the ends seen with noise.
    measured_coverage : float
    """

    length_mm: float
    rms_mm: float
    predicted_mm: float
    bound_mm: float
    bound_share: float
    bound_share_std: float
    coverage: float
    measured_rms_mm: float
    measured_mean_mm: float
    measured_coverage: float


@dataclass(frozen=True)
class MethodScore:
    """What one method came to.

    Parameters
    ----------
    name : str
    views : mapping from stage to int
        The pictures it was given.
    trials, refused : int
    first_refusal : str
    normal_deg, plane_mm : float
        Root mean square over the trials; NaN of a method that knows no camera.
    seconds : float
        Median time of a calibration.
    bound_share, bound_share_std : float
        Over all lengths, each error in units of its length's bound.
    coverage, measured_coverage : float
        Over all lengths.
    lengths : tuple of LengthScore
        None where every trial was refused; all numbers are then NaN.
    """

    name: str
    views: Mapping[str, int]
    trials: int
    refused: int
    first_refusal: str = ""
    normal_deg: float = math.nan
    plane_mm: float = math.nan
    seconds: float = math.nan
    bound_share: float = math.nan
    bound_share_std: float = math.nan
    coverage: float = math.nan
    measured_coverage: float = math.nan
    lengths: tuple[LengthScore, ...] = ()


@dataclass(frozen=True)
class MethodComparison:
    """All methods' scores.

    Parameters
    ----------
    options : ComparisonOptions
    scores : tuple of MethodScore
        In the order of `ComparisonOptions.methods`.
    """

    options: ComparisonOptions
    scores: tuple[MethodScore, ...]


def compared(options: ComparisonOptions, trials: Sequence[Sequence[Attempt]]) -> MethodComparison:
    """Scores of all contestants.

    Parameters
    ----------
    options : ComparisonOptions
    trials : sequence of sequence of Attempt
        For each trial the contestants' attempts, in their order.

    Raises
    ------
    UntrustworthyError
        If no method had a result in any trial.
    """
    scores = tuple(
        _score(options, contestant, [trial[place] for trial in trials])
        for place, contestant in enumerate(options.contestants)
    )
    if not any(score.lengths for score in scores):
        raise UntrustworthyError(
            "comparison",
            f"every method refused every trial, the first because of: {scores[0].first_refusal}",
            "give the methods more pictures, or less noise",
        )
    return MethodComparison(options, scores)


def _score(
    options: ComparisonOptions, contestant: Contestant, attempts: Sequence[Attempt]
) -> MethodScore:
    refusals = [one.refused for one in attempts if one.refused]
    good = [one for one in attempts if not one.refused]
    views = options.views(contestant)
    first = refusals[0] if refusals else ""
    plain = MethodScore(contestant.name, views, len(attempts), len(refusals), first)
    if not good:
        return plain
    exact, noisy = _stacked(one.calibration for one in good), _stacked(one.measured for one in good)
    bound = np.array([one.bound_mm for one in good])
    squares = exact.error_mm**2 / _mean_square(bound)[:, None]
    share, spread = _share_of_bound(squares.mean(axis=(1, 2)))
    return MethodScore(
        contestant.name,
        views,
        len(attempts),
        len(refusals),
        first,
        normal_deg=_rms([one.normal_deg for one in good]),
        plane_mm=_rms([one.plane_mm for one in good]),
        seconds=float(np.median([one.seconds for one in good])),
        bound_share=share,
        bound_share_std=spread,
        coverage=float(exact.held.mean()),
        measured_coverage=float(noisy.held.mean()),
        lengths=_length_scores(options.lengths, exact, noisy, bound),
    )


def _length_scores(
    lengths_mm: Sequence[float], exact: LengthErrors, noisy: LengthErrors, bound: Array
) -> tuple[LengthScore, ...]:
    """For each length, from arrays ``(T, L, S)``."""
    least = _mean_square(bound)
    shares = np.moveaxis((exact.error_mm**2).mean(axis=2) / least, 0, 1)
    told = [_share_of_bound(own) for own in shares]
    columns = (
        np.sqrt(_mean_square(exact.error_mm)),
        np.sqrt(_mean_square(exact.std_mm)),
        np.sqrt(least),
        np.array([share for share, _ in told]),
        np.array([spread for _, spread in told]),
        exact.held.mean(axis=(0, 2)),
        np.sqrt(_mean_square(noisy.error_mm)),
        np.abs(noisy.error_mm).mean(axis=(0, 2)),
        noisy.held.mean(axis=(0, 2)),
    )
    rows = np.stack(columns, axis=1).tolist()
    return tuple(LengthScore(mm, *row) for mm, row in zip(lengths_mm, rows, strict=True))


def _stacked(parts: Iterable[LengthErrors | None]) -> LengthErrors:
    """Errors of all trials ``(T, L, S)``."""
    own = [part for part in parts if part is not None]
    return LengthErrors(
        np.array([one.error_mm for one in own]),
        np.array([one.std_mm for one in own]),
        np.array([one.held for one in own]),
    )


def _mean_square(values: Array) -> Array:
    """``(L,)`` of ``(T, L, S)``."""
    return np.mean(values**2, axis=(0, 2))


def _share_of_bound(squares: Array) -> tuple[float, float]:
    """Bound over rms error from each trial's mean square error ``(T,)`` in units of the squared
    bound, and its standard error: trials are independent, the segments of one are not."""
    mean = float(squares.mean())
    if mean <= 0:
        return math.inf, math.nan
    share = 1.0 / math.sqrt(mean)
    if len(squares) < 2:
        return share, math.nan
    relative = float(squares.std(ddof=1)) / mean / math.sqrt(len(squares))
    return share, 0.5 * share * relative


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
