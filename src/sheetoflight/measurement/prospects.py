"""Sets of views that could be taken, and the uncertainties that they would give."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sheetoflight.calibration.choice_of_views import LengthScore, best_sets, next_for_lengths
from sheetoflight.calibration.components import PIXEL
from sheetoflight.calibration.plan import (
    Kind,
    Told,
    ViewCounts,
    length_variances,
    pools,
    predicted_covariance,
    shared_slopes,
    told,
    told_by_many,
)
from sheetoflight.calibration.planned_rig import PlannedRig
from sheetoflight.calibration.predicted_views import PredictedViews
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.expected_lengths import LengthGrid
from sheetoflight.measurement.length import lengths
from sheetoflight.measurement.length_plan import (
    MOST_VIEWS,
    Expected,
    ExpectedField,
    NextPosition,
    PlanOptions,
    Wanted,
)
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals

SETS = 24
"""Random sets of views of which the median is told."""

POSITIONS = (3, 5, 10, 20, 40)
"""Numbers of positions in the sheet that a plan compares."""

CAMERA_VIEWS = (10, 20, 30, 60, 120)
"""Numbers of camera views that are tried where a certain uncertainty is wanted."""

_FEW_SETS, _MANY_SETS = 0.1, 0.9
_UNLIMITED = 1e8
_NOTHING = 1e-3
"""A source that makes up less of an uncertainty is left out of its bound."""

Progress = Callable[[str, int, int], None]


def prospects_of(
    planned: PlannedRig, grids: Sequence[LengthGrid], options: PlanOptions, progress: Progress
) -> Prospects:
    """Sets of random views, and of chosen ones where these are asked for.

    Parameters
    ----------
    planned : PlannedRig
    grids : sequence of LengthGrid
        The lengths to judge by, one grid for each laser.
    options : PlanOptions
    progress : callable
        Called with what is being done, how many parts are done, and how many there are.

    Raises
    ------
    InputError
        If hardly any pose lies wholly in the picture.
    """
    counts, rng = options.counts, np.random.default_rng(options.seed)
    stages = [s for s in ("camera", "plane", "crossing") if s == "plane" or getattr(counts, s)]
    pool = pools(planned, stages, rng)
    random = {kind: rng.integers(len(views), size=(SETS, MOST_VIEWS))
              for kind, views in pool.items()}  # fmt: skip
    slopes = np.concatenate(
        [shared_slopes(planned, grid.by_parameter, laser) for laser, grid in enumerate(grids)]
    )
    pixel_std = float(np.sqrt(planned.noise.variances[PIXEL]))
    image = np.concatenate([grid.image_variances(pixel_std) for grid in grids])
    chosen: Mapping[Kind, np.ndarray] = {}
    if options.best:
        score = LengthScore(planned, slopes, image)
        chosen = best_sets(pool, counts, score, max(POSITIONS), progress)
    return Prospects(planned, pool, random, chosen, slopes, image, progress)


@dataclass(frozen=True)
class ViewSet:
    """One set of views: what it tells, which it is, and its uncertainties ``(F,)`` in mm."""

    told: Told
    views: Mapping[Kind, PredictedViews]
    std: Array


@dataclass(frozen=True)
class Prospects:
    """Sets of views to choose from, and the lengths they are judged by.

    Parameters
    ----------
    planned : PlannedRig
    pool : mapping from kind to PredictedViews
    random : mapping from kind to (SETS, n) int array
        Views of each set, the first n of which are a set of n.
    chosen : mapping from kind to (n,) int array
        Views in the order of their use; empty unless the best are asked for.
    slopes : (F, P) array
        Derivatives of the lengths by the shared parameters.
    image : (F,) array
        Variances of the lengths by the image points of their ends, mm².
    progress : callable
    """

    planned: PlannedRig
    pool: Mapping[Kind, PredictedViews]
    random: Mapping[Kind, np.ndarray]
    chosen: Mapping[Kind, np.ndarray]
    slopes: Array
    image: Array
    progress: Progress

    @property
    def pixel_std(self) -> float:
        """Noise of the image points, px."""
        return float(np.sqrt(self.planned.noise.variances[PIXEL]))

    def told(self, counts: ViewCounts, sets: Mapping[Kind, np.ndarray]) -> Told:
        """What sets of so many views tell."""
        parts = [
            told(self.pool[kind], sets[kind][:, : counts.of(kind)])
            for kind in self.pool
            if counts.of(kind)
        ]
        return sum(parts[1:], parts[0])

    def std(self, known: Told) -> Array:
        """Uncertainties ``(K, F)`` of all lengths for K sets, mm."""
        return np.sqrt(length_variances(self.planned, known, self.slopes) + self.image)

    def medians(self, counts: ViewCounts) -> Array:
        """Medians over the field ``(SETS,)``."""
        return np.median(self.std(self.told(counts, self.random)), axis=1)

    def expected(self, counts: ViewCounts) -> Expected:
        """What random sets of so many views give, and the chosen one."""
        found = np.sort(self.medians(counts))
        low, high = (float(found[round(share * (SETS - 1))]) for share in (_FEW_SETS, _MANY_SETS))
        best = float(np.median(self.std(self._chosen(counts)))) if self.chosen else None
        return Expected(float(np.median(found)), low, high, best)

    def _chosen(self, counts: ViewCounts) -> Told:
        return self.told(counts, {kind: order[None] for kind, order in self.chosen.items()})

    def typical(self, counts: ViewCounts) -> ViewSet:
        """The chosen set, or the random one nearest to the median of all."""
        if self.chosen:
            known, index = self._chosen(counts), self.chosen
        else:
            found = self.medians(counts)
            which = int(np.argmin(np.abs(found - np.median(found[np.isfinite(found)]))))
            known = self.told(counts, self.random).take(which)
            index = {kind: sets[which] for kind, sets in self.random.items()}
        views = {
            kind: self.pool[kind].take(index[kind][: counts.of(kind)])
            for kind in self.pool
            if counts.of(kind)
        }
        return ViewSet(known, views, self.std(known)[0])

    def table(self, counts: ViewCounts) -> tuple[tuple[int, Expected], ...]:
        """Other numbers of positions in the sheet."""
        numbers = sorted({*POSITIONS, counts.plane} - {0})
        rows = []
        for done, positions in enumerate(numbers):
            self.progress("plan", done, len(numbers))
            rows.append((positions, self.expected(replace(counts, plane=positions))))
        self.progress("plan", len(numbers), len(numbers))
        return tuple(rows)

    def fields(self, grids: Sequence[LengthGrid], counts: ViewCounts) -> tuple[ExpectedField, ...]:
        """The median over sets, place by place; or that of the chosen set."""
        known = self._chosen(counts) if self.chosen else self.told(counts, self.random)
        return tuple(self._field(grid, laser, known) for laser, grid in enumerate(grids))

    def _field(self, grid: LengthGrid, laser: int, known: Told) -> ExpectedField:
        slopes = shared_slopes(self.planned, grid.by_parameter, laser)
        calibration = np.median(length_variances(self.planned, known, slopes), axis=0)
        image = grid.image_variances(self.pixel_std)
        return ExpectedField(
            grid.laser,
            grid.u,
            grid.v,
            grid.depth_mm,
            grid.spread(np.sqrt(calibration + image)),
            grid.spread(np.sqrt(calibration)),
            grid.spread(np.sqrt(image)),
        )

    def calibration(self, nominally: Calibration, views: ViewSet) -> Calibration:
        """The nominal rig with the covariance to expect of a set of views."""
        lasers, markers = self.planned.rig.lasers, len(self.planned.rig.target.markers_mm)
        seen = tuple(
            ViewResiduals(
                stage,
                _name(self, stage, laser, number),
                _in_columns(uv, markers, laser, len(lasers)),
                _in_columns(np.zeros_like(uv), markers, laser, len(lasers)),
                _in_columns(points, markers, laser, len(lasers)),
            )
            for (stage, laser), part in views.views.items()
            for number, (uv, points) in enumerate(zip(part.uv, part.points, strict=True), start=1)
        )
        return replace(
            nominally,
            covariance=predicted_covariance(self.planned, views.told),
            residuals=Residuals(0.0, 1.0, seen),
        )

    def wanted(
        self, options: PlanOptions, grids: Sequence[LengthGrid], nominally: Calibration
    ) -> Wanted:
        """What it takes to reach an uncertainty."""
        assert options.wanted_mm is not None  # else nobody asks
        known = [told_by_many(views, _UNLIMITED) for views in self.pool.values()]
        without_end = sum(known[1:], known[0])
        limit = replace(nominally, covariance=predicted_covariance(self.planned, without_end))
        std = self.std(without_end)[0]
        bound = budget(limit, grids, std)
        bound_mm = float(np.median(std))
        bound = tuple((name, part) for name, part in bound if part > _NOTHING * bound_mm)
        chosen = self._chosen_positions(options)
        if bound_mm >= options.wanted_mm:
            return Wanted(options.wanted_mm, None, chosen, (), bound, bound_mm)
        choices = []
        for done, camera in enumerate(views := CAMERA_VIEWS if options.counts.camera else ()):
            self.progress("search", done, len(views))
            choices.append(
                (camera, self._positions(replace(options.counts, camera=camera), options))
            )
        return Wanted(
            options.wanted_mm,
            self._positions(options.counts, options),
            chosen,
            tuple(choices),
            bound,
            bound_mm,
        )

    def _positions(self, counts: ViewCounts, options: PlanOptions) -> int | None:
        """The least number of random positions that reaches what is wanted."""

        def reached(positions: int) -> bool:
            found = self.medians(replace(counts, plane=positions))
            return float(np.median(found)) <= (options.wanted_mm or 0.0)

        enough = 1
        while enough < MOST_VIEWS and not reached(enough):
            enough = min(2 * enough, MOST_VIEWS)
        if not reached(enough):
            return None
        too_few = enough // 2
        while enough - too_few > 1:
            middle = (enough + too_few) // 2
            enough, too_few = (middle, too_few) if reached(middle) else (enough, middle)
        return enough

    def _chosen_positions(self, options: PlanOptions) -> int | None:
        """The least number of chosen positions that reaches it."""
        for positions in range(1, max(POSITIONS) + 1 if self.chosen else 1):
            std = self.std(self._chosen(replace(options.counts, plane=positions)))
            if float(np.median(std)) <= (options.wanted_mm or 0.0):
                return positions
        return None

    def next_positions(self, known: Told) -> tuple[NextPosition, ...]:
        """The most useful further view of each stage, the best first."""
        score = LengthScore(self.planned, self.slopes, self.image)
        found = []
        for stage in dict.fromkeys(stage for stage, _ in self.pool):
            candidates = [views for kind, views in self.pool.items() if kind[0] == stage]
            best = next_for_lengths(known, candidates, score)
            if best is None:
                continue
            after = known + told(best.predicted, np.array([[0]]))
            medians = [float(np.median(self.std(told))) for told in (known, after)]
            found.append(NextPosition(best, *medians))
        return tuple(sorted(found, key=lambda position: -position.view.gain))


def budget(
    calibration: Calibration, grids: Sequence[LengthGrid], std: Array
) -> tuple[tuple[str, float], ...]:
    """What the uncertainty is made of where it is the median of all ``(F,)``, by source, mm."""
    place = int(np.argsort(std)[(len(std) - 1) // 2])
    for grid in grids:
        if place < len(grid.ends):
            return lengths(calibration, grid.ends[place][None], laser=grid.laser)[0].budget
        place -= len(grid.ends)
    return ()


def _in_columns(points: Array, markers: int, laser: int, lasers: int) -> Array:
    """Markers, and a laser's spot behind them, in the rows that a calibration's views have."""
    if len(points) == markers:
        return points
    rows = np.full((markers + lasers, points.shape[1]), np.nan)
    rows[[*range(markers), markers + laser]] = points
    return rows


def _name(prospects: Prospects, stage: str, laser: int, number: int) -> str:
    lasers = prospects.planned.rig.lasers
    of = "" if stage == "camera" or len(lasers) == 1 else f"{lasers[laser]} "
    return f"{of}{stage} {number}"
