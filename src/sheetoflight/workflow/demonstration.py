"""The main job on the paper's rig, rendered: from pictures to lengths, by every method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sheetoflight.io.pictures import list_pictures
from sheetoflight.io.segments_csv import write_lengths
from sheetoflight.measurement.length import lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.report.contents import Table
from sheetoflight.simulation.poses import segments_in_sheet
from sheetoflight.simulation.rig import paper_rig
from sheetoflight.workflow.calibrated import calibrate
from sheetoflight.workflow.measured import (
    PictureLengths,
    length_row,
    measure_pictures,
    piece_lengths,
)
from sheetoflight.workflow.reported import write_report
from sheetoflight.workflow.rig_folder import detect
from sheetoflight.workflow.simulated import TABLE_2_MM, TABLE_4_MM, SimulationOptions, simulate
from sheetoflight.workflow.spread import ALONE, Execution

PAPER_TABLES = (
    ("Table 2", TABLE_2_MM, (0.02, 0.04, 0.12, 0.14, 0.40, 0.03)),
    ("Table 4", TABLE_4_MM, (0.00, 0.01, 0.01, 0.04, 0.09, 0.03)),
)
"""The paper's lengths and the absolute errors it prints, mm."""

ROD_METHODS: tuple[Literal["joint"], Literal["two-step"], Literal["paper"]] = (
    "joint",
    "two-step",
    "paper",
)
"""Those that calibrate with the paper's target."""

_SHOWN_PICTURES = 3
_LENGTHS_MM = (150.0, 450.0)
_SEGMENTS = 200


@dataclass(frozen=True)
class LengthComparison:
    """One bar, measured by every method.

    Parameters
    ----------
    table : str
        The paper's table that it belongs to.
    name : str
        The picture.
    true_mm, paper_error_mm : float
        True length, and the absolute error that the paper prints for one of this length.
    measured_mm, std_mm : mapping from method to float
    """

    table: str
    name: str
    true_mm: float
    paper_error_mm: float
    measured_mm: dict[str, float]
    std_mm: dict[str, float]


@dataclass(frozen=True)
class Demonstration:
    """What the demonstration found.

    Parameters
    ----------
    methods : tuple of str
    detection_error_px : (N,) array
        Distance of every detected marker from its true image point.
    pictures, missed : int
        Pictures of the target, and how many of them were missed.
    comparisons : tuple of LengthComparison
    calibration_error_mm : mapping from length in mm to mapping from method to float
        Mean absolute error of segments all over the sheet, their ends' image points exact: what
        the calibration alone contributes.
    calibrations : mapping from method to Calibration
    """

    methods: tuple[str, ...]
    detection_error_px: np.ndarray
    pictures: int
    missed: int
    comparisons: tuple[LengthComparison, ...]
    calibration_error_mm: dict[float, dict[str, float]]
    calibrations: dict[str, Calibration]

    def mean_error_mm(self, table: str, method: str) -> float:
        """Mean absolute error of a method over one of the paper's tables."""
        errors = [
            abs(c.measured_mm[method] - c.true_mm) for c in self.comparisons if c.table == table
        ]
        return float(np.mean(errors))


def demonstrate(
    folder: str | Path,
    methods: Sequence[str] = ROD_METHODS,
    seed: int = 0,
    run: Execution = ALONE,
) -> Demonstration:
    """Render the paper's rig, detect, calibrate by every method, measure, and write the report.

    The folder then holds the rig folder with its pictures and ``points.csv``, one
    ``calibration-METHOD.json`` and ``lengths-METHOD.csv`` a method, and ``report.html``.

    Raises
    ------
    InputError, FileError
        As for `simulate`.
    """
    folder = Path(folder)
    bars = [length for _, lengths_mm, _ in PAPER_TABLES for length in lengths_mm]
    truth = simulate(folder, SimulationOptions(bars_mm=bars, seed=seed), run)
    detection = detect(folder, run)
    calibrations: dict[str, Calibration] = {}
    for done, method in enumerate(methods):
        run.progress("calibrate", done, len(methods))
        calibrations[method] = calibrate(detection.rig, method)
        calibrations[method].save(folder / f"calibration-{method}.json")
    run.progress("calibrate", len(methods), len(methods))
    best = calibrations[methods[0]]
    measured = measure_pictures(best, list_pictures(folder / "measure"), run)
    demonstration = Demonstration(
        methods=tuple(methods),
        detection_error_px=_detection_errors(detection.rig.observations.stages(), truth),
        pictures=len(truth["views"]["camera"]) + len(truth["views"]["plane"]),
        missed=len(detection.missed),
        comparisons=tuple(_compared(calibrations, measured, truth)),
        calibration_error_mm=_calibration_errors(calibrations),
        calibrations=calibrations,
    )
    for method, calibration in calibrations.items():
        rows = [
            length_row(found)
            for picture in measured
            for found in piece_lengths(calibration, picture.file.name, picture.pieces)
        ]
        write_lengths(folder / f"lengths-{method}.csv", rows)
    tables = comparison_tables(demonstration)
    write_report(folder / "report.html", best, measured[:_SHOWN_PICTURES], tables)
    return demonstration


def comparison_tables(demonstration: Demonstration) -> list[Table]:
    """The methods side by side: the paper's tables, and the calibration alone."""
    tables = [_paper_table(demonstration, name) for name, _, _ in PAPER_TABLES]
    return [*tables, _calibration_table(demonstration)]


def _calibration_table(demonstration: Demonstration) -> Table:
    return Table(
        title="What the calibration alone contributes: mean absolute error, mm",
        columns=("length, mm", *demonstration.methods),
        rows=tuple(
            (f"{length:g}", *(f"{errors[m]:.4f}" for m in demonstration.methods))
            for length, errors in demonstration.calibration_error_mm.items()
        ),
        note=f"{_SEGMENTS} segments all over the sheet, their ends' image points exact.",
    )


def _paper_table(demonstration: Demonstration, name: str) -> Table:
    chosen = [c for c in demonstration.comparisons if c.table == name]
    rows: list[tuple[str | int | float, ...]] = [
        (
            f"{c.true_mm:g}",
            *(f"{c.measured_mm[m] - c.true_mm:+.3f} ± {c.std_mm[m]:.3f}" for m in c.measured_mm),
            f"{c.paper_error_mm:.2f}",
        )
        for c in chosen
    ]
    rows.append(
        (
            "mean |error|",
            *(f"{demonstration.mean_error_mm(name, m):.3f}" for m in demonstration.methods),
            f"{np.mean([c.paper_error_mm for c in chosen]):.3f}",
        )
    )
    return Table(
        title=f"The paper's {name}: measured minus true length, mm",
        columns=("length, mm", *demonstration.methods, "printed in the paper (absolute)"),
        rows=tuple(rows),
        note="Each error stands with its standard uncertainty. All methods measure the same ends "
        "found in the same rendered pictures.",
        highlight=(len(rows) - 1,),
    )


def _detection_errors(stages: dict[str, Any], truth: dict[str, Any]) -> np.ndarray:
    errors = [
        np.linalg.norm(uv - np.array(truth["views"][stage][name]["markers_uv"]), axis=-1)
        for stage, views in stages.items()
        for name, uv in zip(views.names, views.uv, strict=True)
    ]
    return np.concatenate(errors)


def _calibration_errors(calibrations: dict[str, Calibration]) -> dict[float, dict[str, float]]:
    truth = paper_rig()
    found: dict[float, dict[str, float]] = {}
    for length_mm in _LENGTHS_MM:
        ends = segments_in_sheet(truth, length_mm, _SEGMENTS, np.random.default_rng(0))
        uv = truth.camera.project(ends)
        found[length_mm] = {
            method: float(np.mean([abs(one.value - length_mm) for one in lengths(calibration, uv)]))
            for method, calibration in calibrations.items()
        }
    return found


def _compared(
    calibrations: dict[str, Calibration], measured: list[PictureLengths], truth: dict[str, Any]
) -> list[LengthComparison]:
    expected = [(table, error) for table, _, errors in PAPER_TABLES for error in errors]
    found = []
    for (table, error), picture in zip(expected, measured, strict=True):
        by_method = {
            method: piece_lengths(calibration, picture.file.name, picture.pieces)
            for method, calibration in calibrations.items()
        }
        if all(len(values) == 1 for values in by_method.values()):
            found.append(
                LengthComparison(
                    table=table,
                    name=picture.file.name,
                    true_mm=truth["views"]["measure"][picture.file.name]["length_mm"],
                    paper_error_mm=error,
                    measured_mm={m: v[0].length.value for m, v in by_method.items()},
                    std_mm={m: v[0].length.std for m, v in by_method.items()},
                )
            )
    return found
