"""``sol compare``."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sheetoflight.cli.telling import (
    AsJson,
    Output,
    on_all_cores,
    plain_table,
    refuse_to_overwrite,
    tell,
    tell_json,
    tell_table,
)
from sheetoflight.errors import InputError
from sheetoflight.io.comparison_table import comparison_document, write_comparison
from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.contestants import PRINTED_MM
from sheetoflight.measurement.method_comparison import MethodComparison, MethodScore
from sheetoflight.workflow.compared import compare as compared
from sheetoflight.workflow.compared import write_comparison_page

_DEFAULT = ComparisonOptions()
_NOTHING = "–"


def compare(
    *,
    output: Output = None,
    report: Path | None = None,
    case: Literal["sheet", "paper"] = _DEFAULT.case,
    methods: str | None = None,
    pictures: int = _DEFAULT.pictures,
    camera_share: float = _DEFAULT.camera_share,
    pixel_std: float = _DEFAULT.pixel_std,
    line_std: float | None = None,
    end_std: float | None = None,
    line_points: int = _DEFAULT.line_points,
    lengths_mm: Annotated[tuple[float, ...] | None, Parameter(consume_multiple=True)] = None,
    distortion: tuple[float, float, float, float, float] = _DEFAULT.distortion,
    trials: int = _DEFAULT.trials,
    seed: int = _DEFAULT.seed,
    scheduler: str | None = None,
    times: Annotated[bool, Parameter(negative=())] = False,
    json: AsJson = False,
) -> None:
    """All methods of calibration side by side on one simulated rig.

    Parameters
    ----------
    output
        Where to write the comparison as CSV.
    report
        Where to write it as a page, .html.
    case
        sheet: all methods, 20 to 450 mm. paper: its Tables 3 and 4.
    methods
        Names of methods, separated by commas; all of the case where absent.
    pictures
        How many each method is given, over all its stages.
    camera_share
        Share of a rod's pictures in stage camera, and of a plate's that show boards.
    pixel_std
        Noise of markers, corners and the line's ends on a plate in px.
    line_std
        Noise of the laser line's points in px; pixel_std where absent.
    end_std
        Noise of the ends of measured lengths in px; pixel_std where absent.
    line_points
        Points of the laser line on a board.
    lengths_mm
        The lengths to be measured.
    distortion
        k1 k2 p1 p2 k3 of the lens.
    trials
        How often everything is repeated with other views and other noise.
    seed
        The same seed gives the same numbers, wherever the trials are made.
    scheduler
        Address of a dask scheduler whose workers make the trials.
    times
        Write into the files, too, how long calibrations took; they then differ from run to run.
    json
        Print the comparison as JSON.
    """
    outputs = [path for path in (output, report) if path]
    for path in outputs:
        refuse_to_overwrite(path, [])
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise InputError(f"{output} is to be both CSV and page", "name two files")
    options = ComparisonOptions(
        case=case,
        methods=_names(methods),
        pictures=pictures,
        camera_share=camera_share,
        pixel_std=pixel_std,
        line_std=line_std,
        end_std=end_std,
        line_points=line_points,
        lengths_mm=lengths_mm,
        distortion=distortion,
        trials=trials,
        seed=seed,
    )
    started = time.perf_counter()
    with on_all_cores() as run:
        found = compared(options, run, scheduler)
    taken = time.perf_counter() - started
    print(f"compare: {trials} trials in {taken:.1f} s", file=sys.stderr)
    if output:
        write_comparison(output, found, times)
    if report:
        write_comparison_page(report, found, times)
    if json:
        tell_json(comparison_document(found, times))
        return
    _tell(found)
    for path in outputs:
        tell(f"written to {path}")


def _names(methods: str | None) -> tuple[str, ...] | None:
    if methods is None:
        return None
    return tuple(name.strip() for name in methods.split(",") if name.strip())


def _tell(found: MethodComparison) -> None:
    options = found.options
    _tell_methods(found)
    _tell_lengths(found, "Errors that the calibration alone causes, mm rms", _exact)
    ends = f"Errors with the ends seen to {options.end_noise:g} px, mm"
    if options.case == "paper":
        _tell_lengths(found, f"{ends}, mean absolute (printed)", _printed)
    else:
        _tell_lengths(found, f"{ends} rms", _measured)
    for score in found.scores:
        if score.refused:
            tell(
                f"{score.name} refused {score.refused} of {score.trials} trials, the first: "
                f"{score.first_refusal}"
            )


def _tell_methods(found: MethodComparison) -> None:
    options = found.options
    table = plain_table(
        f"{options.pictures} pictures each, noise {options.pixel_std:g} px, "
        f"{options.trials} trials",
        ("method", "pictures"),
        ("normal", "sheet", "of bound", "95 % holds", "time", "refused"),
    )
    for score in found.scores:
        views = " + ".join(str(count) for count in score.views.values())
        table.add_row(
            score.name,
            views,
            _with(score.normal_deg, ".3f", "°"),
            _with(score.plane_mm, ".3f", " mm"),
            _share(score.bound_share, score.bound_share_std),
            _with(100 * score.coverage, ".0f", " %"),
            _with(score.seconds, ".2f", " s"),
            str(score.refused) if score.refused else "",
        )
    tell_table(table)


def _tell_lengths(
    found: MethodComparison, title: str, cell: Callable[[MethodScore, int], str]
) -> None:
    headings = tuple(f"{length:g} mm" for length in found.options.lengths)
    table = plain_table(title, ("method",), headings)
    for score in found.scores:
        table.add_row(score.name, *(cell(score, place) for place in range(len(headings))))
    tell_table(table)


def _exact(score: MethodScore, place: int) -> str:
    if not score.lengths:
        return _NOTHING
    return _mm(score.lengths[place].rms_mm)


def _measured(score: MethodScore, place: int) -> str:
    return _mm(score.lengths[place].measured_rms_mm) if score.lengths else _NOTHING


def _printed(score: MethodScore, place: int) -> str:
    if not score.lengths:
        return _NOTHING
    length = score.lengths[place]
    known = PRINTED_MM.get(score.name, {}).get(length.length_mm)
    printed = "" if known is None else f" ({known:.3f})"
    return f"{_mm(length.measured_mean_mm)}{printed}"


def _mm(value: float) -> str:
    return _with(value, ".4f" if value < 0.01 else ".3f", "")


def _share(share: float, std: float) -> str:
    return _with(100 * share, ".0f", f" ± {100 * std:.0f} %" if math.isfinite(std) else " %")


def _with(value: float, form: str, unit: str) -> str:
    return f"{value:{form}}{unit}" if math.isfinite(value) else _NOTHING
