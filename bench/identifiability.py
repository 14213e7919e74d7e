"""Whether views that leave something undetermined are refused, and all others calibrated.

Every degenerate recording of `simulation.degenerate`, with the skew known to be zero and with it
estimated, on the paper's rig and on random ones; a few further ones; and healthy random rigs.
For each:

- ``solved``, ``weak``: calibrations that gave a result, without and with a warning,
- ``refused``, and the first words of the reasons,
- ``hold``: share of the solved ones in which the 95 % interval of a random length, its image points
  free of noise, holds the true one,
- ``should``: ``refuse`` where the views do not determine the rig at all; ``solve`` where all
  stages together do, so that a refusal must say that an uncertainty is above its limit; nothing
  where it depends on the poses,
- ``wrong``: results that should have been refusals, or refusals that should have been results.

Run with ``python -m bench.identifiability [HEALTHY_RIGS [RIGS_OF_EACH_DEGENERATE_KIND]]``.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

import sheetoflight as sol
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.length import lengths
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.degenerate import DEGENERATE, Degenerate, with_sheet_at
from sheetoflight.simulation.poses import Recording, recorded, segments_in_sheet
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

SEED = 47
HEALTHY, EACH = 1000, 50
RECORDING = Recording(30, 10, pixel_std=0.1)
LENGTH_SHARE = 0.5
"""Of the target's length: the segment that is measured."""
CENTRAL = 0.1
"""Part of the picture, along its sides, in which all markers of a central recording are."""
NEAR_SHARE = 0.01
"""Of the working distance: how near the sheet comes to the camera in "sheet near camera"."""
FIRST_WORDS = 8

Should = Literal["refuse", "solve", ""]
LIMIT_WORDS = "uncertain by"
"""What a refusal says where the views do determine the rig, but too badly."""

UNDETERMINED = (
    "one camera view",
    "two camera views",
    "repeated position",
    "sheet through camera",
)
"""Not determined whatever is known of the skew."""
SWINGS = ("planar swings", "swings in two planes", "conical swings")
"""Degenerate by themselves, but not together with ten in-plane views and zero skew."""


def paper(_: np.random.Generator) -> SimulatedRig:
    """The paper's rig."""
    return paper_rig()


def narrow_rig(_: np.random.Generator) -> SimulatedRig:
    """The paper's rig with a target so small and so far that all its views can be in the middle
    of the picture; the sheet crosses the optical axis at 1386 mm."""
    rig = paper_rig(target=CollinearTarget((0.0, 20.0, 40.0), marker_size_mm=4.0))
    return replace(rig, anchor_mm=np.array([0.0, -10.0, 1386.0]), depth_mm=(1300.0, 1470.0))


def central(rig: SimulatedRig, recording: Recording, rng: np.random.Generator) -> Observations:
    """All markers within a tenth of the picture around its centre: a lens's distortion moves
    them alike."""
    camera = rig.camera
    size = (round(CENTRAL * camera.image_size[0]), round(CENTRAL * camera.image_size[1]))
    corner = (np.array(camera.image_size) - size) // 2
    cut = replace(
        camera, image_size=size, u0=camera.u0 - float(corner[0]), v0=camera.v0 - float(corner[1])
    )
    seen = recorded(replace(rig, camera=cut), recording, rng)
    return Observations(_shifted(seen.camera, corner), _shifted(seen.plane, corner))


def _shifted(views: TargetViews, by: Array) -> TargetViews:
    return TargetViews(views.names, views.uv + by, laser=views.laser)


def sheet_alone(rig: SimulatedRig, recording: Recording, rng: np.random.Generator) -> Observations:
    """In-plane views of one sheet, nothing else: two constraints on four parameters of the
    camera."""
    return recorded(rig, replace(recording, camera_views=0), rng)


def unchanged(rig: SimulatedRig) -> SimulatedRig:
    """The rig that was recorded is the one that was given."""
    return rig


def with_sheet_near(rig: SimulatedRig) -> SimulatedRig:
    """What "sheet near camera" makes of a rig."""
    return with_sheet_at(rig, NEAR_SHARE * sum(rig.depth_mm) / 2)


@dataclass(frozen=True)
class Case:
    """A kind of recording, of rig, and what is estimated; `lit` gives the rig's true sheet where
    the recording moves it."""

    name: str
    record: Degenerate
    rig: Callable[[np.random.Generator], SimulatedRig]
    skew: bool = False
    distortion: str = "none"
    should: Should = ""
    lit: Callable[[SimulatedRig], SimulatedRig] = unchanged

    @property
    def rig_name(self) -> str:
        """For the table."""
        return "random" if self.rig is random_rig else "paper"


def should(name: str, skew: bool) -> Should:
    """What is known beforehand of a degenerate recording."""
    if name in UNDETERMINED or (name == "planar swings" and skew):
        return "refuse"
    return "solve" if name in SWINGS and not skew else ""


def cases() -> Iterator[Case]:
    """Every degenerate one."""
    for name, record in DEGENERATE.items():
        for skew in (False, True):
            for rig in (paper, random_rig):
                lit = with_sheet_near if name == "sheet near camera" else unchanged
                yield Case(name, record, rig, skew, should=should(name, skew), lit=lit)
    yield Case("sheet alone", sheet_alone, paper, should="refuse")
    yield Case("sheet alone", sheet_alone, random_rig, should="refuse")
    yield Case("markers about the centre, brown", central, narrow_rig, False, "brown", "refuse")


HEALTHY_CASE = Case("healthy", recorded, random_rig, should="solve")


@dataclass(frozen=True)
class Trial:
    """What came of one recording."""

    ending: Literal["solved", "weak", "refused", "not simulated"]
    reason: str = ""
    holds: bool = False


@dataclass(frozen=True)
class Result:
    """What came of all recordings of a case."""

    case: Case
    trials: tuple[Trial, ...]

    def count(self, *endings: str) -> int:
        """Trials that ended so."""
        return sum(trial.ending in endings for trial in self.trials)

    @property
    def reasons(self) -> Counter[str]:
        """First words of the refusals."""
        words = (t.reason.split()[:FIRST_WORDS] for t in self.trials if t.ending == "refused")
        return Counter(" ".join(first) for first in words)

    @property
    def hold(self) -> float:
        """Share of the results whose interval holds; NaN where there are none."""
        held = [trial.holds for trial in self.trials if trial.ending in ("solved", "weak")]
        return float(np.mean(held)) if held else float("nan")

    @property
    def wrong(self) -> int:
        """Trials that ended as they should not."""
        if self.case.should == "refuse":
            return self.count("solved", "weak")
        if self.case.should == "solve":
            return sum(t.ending == "refused" and LIMIT_WORDS not in t.reason for t in self.trials)
        return 0


def trial(case: Case, seed: int, number: int) -> Trial:
    """Simulate, calibrate, measure."""
    rng = np.random.default_rng([seed, number])
    truth = case.rig(rng)
    try:
        observations = case.record(truth, RECORDING, rng)
    except InputError as reason:
        return Trial("not simulated", str(reason))
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        distortion=case.distortion,
        skew=case.skew,
        observations=observations,
    )
    try:
        calibration = sol.calibrate(rig)
    except UntrustworthyError as refusal:
        return Trial("refused", str(refusal))
    length_mm = LENGTH_SHARE * truth.target.length_mm
    uv = truth.camera.project(segments_in_sheet(case.lit(truth), length_mm, 1, rng))
    try:
        low, high = lengths(calibration, uv, np.array([1e-9]))[0].interval
    except InputError:  # the sheet found is not where the true one is
        low = high = float("nan")
    return Trial("weak" if calibration.warnings else "solved", holds=low <= length_mm <= high)


def run(case: Case, count: int, pool: Executor, seed: int = SEED) -> Result:
    """All trials of a case."""
    return Result(case, tuple(pool.map(partial(trial, case, seed), range(count), chunksize=5)))


def row(result: Result) -> list[str]:
    """The case as a line of the table."""
    case, results = result.case, result.count("solved", "weak")
    reasons = (f"{count} × {words} …" for words, count in result.reasons.most_common(3))
    return [
        case.name,
        "true" if case.skew else "false",
        case.rig_name,
        str(result.count("solved")),
        str(result.count("weak")),
        str(result.count("refused")),
        f"{result.hold:.0%}" if results else "–",
        case.should,
        str(result.wrong) if case.should else "",
        "\n".join(reasons),
    ]


def main(healthy: int = HEALTHY, each: int = EACH) -> None:
    """Print the table."""
    table = Table(title=f"{each} of each degenerate kind, {healthy} healthy rigs", show_lines=True)
    headings = ("views", "skew", "rig", "solved", "weak", "refused", "hold", "should", "wrong",
                "first words of the reasons")  # fmt: skip
    for heading in headings:
        text = heading in ("views", "skew", "rig", "should", headings[-1])
        table.add_column(heading, justify="left" if text else "right")
    with ProcessPoolExecutor(2) as pool:
        table.add_row(*row(run(HEALTHY_CASE, healthy, pool)))
        for case in cases():
            table.add_row(*row(run(case, each, pool)))
    Console(width=160).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
