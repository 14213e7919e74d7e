"""``sol verify``."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape
from rich.table import Table

from sheetoflight.cli.telling import (
    AsJson,
    Inputs,
    Output,
    on_all_cores,
    plain_table,
    refuse_to_overwrite,
    tell,
    tell_json,
    tell_table,
    warn,
)
from sheetoflight.errors import InputError, ToleranceError
from sheetoflight.io.verification_json import verification_document, write_verification
from sheetoflight.measurement.comparison import Comparison, Decision, PermissibleError
from sheetoflight.measurement.error_statistics import ErrorStatistics, Estimate
from sheetoflight.measurement.verification import Verification
from sheetoflight.workflow.verified import verify as verified
from sheetoflight.workflow.verified import write_verification_page

_COLUMNS = ("known", "measured", "error", "U95", "E_n")
_LIMIT_COLUMNS = ("MPE", "conformity")
_DECISIONS: dict[Decision, str] = {
    "conformity proven": "proven",
    "not proven": "not proven",
    "nonconformity proven": "disproven",
}


def verify(
    calibration: Path,
    inputs: Inputs,
    /,
    *,
    known: str | None = None,
    known_std: float | None = None,
    mpe_mm: float | None = None,
    mpe_per_m: float | None = None,
    laser: str | None = None,
    output: Output = None,
    page: Path | None = None,
    json: AsJson = False,
) -> None:
    """Known lengths against measured ones.

    Parameters
    ----------
    calibration
        The calibration.json.
    inputs
        One segments.csv, with columns known_mm and known_std_mm if you like; or pictures, pairs
        NAME_off.* and NAME_on.*, or a folder of these.
    known
        The length of all segments in mm, or a csv file with the columns segment, known_mm and,
        if you like, known_std_mm, the standard uncertainty of the known length.
    known_std
        Standard uncertainty in mm of the one length of all segments.
    mpe_mm
        Maximum permissible error in mm: a segment passes where its error is not larger. Where no
        such error is given, it passes where the stated uncertainties explain its error, |E_n| ≤ 1.
    mpe_per_m
        Part of the maximum permissible error that grows with the length, mm per metre.
    laser
        The laser that is on in the pictures, or whose sheet those segments lie on that name
        none. Needed where the calibration has several.
    output
        Where to write the result as JSON.
    page
        Where to write the result as a page, .html.
    json
        Print the result as JSON.
    """
    _refuse_same_files(calibration, inputs, known, [path for path in (output, page) if path])
    limit = None
    if mpe_mm is not None or mpe_per_m is not None:
        limit = PermissibleError(mpe_mm or 0.0, mpe_per_m or 0.0)
    with on_all_cores() as run:
        verification = verified(calibration, inputs, known, limit, run, known_std, laser)
    if output:
        write_verification(output, verification)
    if page:
        write_verification_page(page, verification)
    for warning in verification.warnings:
        warn(warning)
    if json:
        tell_json(verification_document(verification))
    else:
        _tell(verification)
        for path in (output, page):
            if path:
                tell(f"written to {path}")
    if not verification.passed:
        raise _failure(verification)


def _refuse_same_files(
    calibration: Path, inputs: list[Path], known: str | None, outputs: list[Path]
) -> None:
    read = [calibration, *inputs, *([Path(known)] if known else [])]
    for path in outputs:
        refuse_to_overwrite(path, read)
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise InputError(f"{outputs[0]} is to be both JSON and page", "name two files")


def _failure(verification: Verification) -> ToleranceError:
    worst, failed = verification.worst, len(verification.failed)
    allowed = (
        f"its 95 % uncertainty ±{worst.expanded:.4f} mm"
        if worst.limit is None
        else f"the permissible ±{worst.limit:.4f} mm"
    )
    return ToleranceError(
        f"{failed} of {len(verification.comparisons)} lengths fail; worst is segment "
        f"{worst.segment.name}, its error {worst.error:+.4f} mm against {allowed}",
        "check the ends and the known length of this segment, then the calibration",
    )


def _tell(verification: Verification) -> None:
    tell_table(_table(verification))
    for label, text in _summary(verification.statistics):
        tell(f"{label:<18}{text}")
    for finding in verification.findings:
        tell(f"finding: {finding}")
    tell(_verdict(verification))


def _table(verification: Verification) -> Table:
    limited = verification.limit is not None
    table = plain_table(
        "Lengths in mm",
        ("segment",),
        (*_COLUMNS, *(_LIMIT_COLUMNS if limited else ()), "verdict"),
    )
    for one in verification.comparisons:
        table.add_row(*_cells(one))
    for segment in verification.not_judged:
        gaps = ("–",) * (5 if limited else 3)
        table.add_row(escape(segment.name), "–", f"{segment.length.value:.4f}", *gaps, "not judged")
    return table


def _cells(one: Comparison) -> list[str]:
    limit = [] if one.decision is None else [f"{one.limit:.4f}", _DECISIONS[one.decision]]
    return [
        escape(one.segment.name),
        f"{one.known.value:.4f}",
        f"{one.segment.length.value:.4f}",
        f"{one.error:+.4f}",
        f"{one.expanded:.4f}",
        "–" if one.normalised_error is None else f"{one.normalised_error:+.2f}",
        *limit,
        "pass" if one.passed else "FAIL",
    ]


def _summary(statistics: ErrorStatistics) -> list[tuple[str, str]]:
    rows = [
        ("lengths judged", str(statistics.number)),
        ("mean error", _estimate(statistics.mean, "mm")),
        ("spread", "–" if statistics.spread is None else f"{statistics.spread:.4f} mm"),
        ("rms error", f"{statistics.rms:.4f} mm"),
        ("largest error", f"{statistics.largest:.4f} mm"),
        ("scale", _estimate(statistics.scale, "mm/m")),
    ]
    if statistics.offset:
        rows.append(("constant error", _estimate(statistics.offset, "mm")))
    if statistics.chi2 is not None:
        held = f"{statistics.chi2:.2f} for {statistics.number} lengths, p = {statistics.chi2_p:.2g}"
        rows.append(("chi-square", held))
    return rows


def _estimate(estimate: Estimate, unit: str) -> str:
    return f"{estimate.value:+.4f} {unit}, standard uncertainty {estimate.std:.4f}"


def _verdict(verification: Verification) -> str:
    total = len(verification.comparisons)
    by_limit = "|E_n| ≤ 1" if verification.limit is None else f"|error| ≤ {verification.limit}"
    also = (
        "" if verification.limit is None else f"; |E_n| ≤ 1 for {verification.explained} of {total}"
    )
    word = "PASS" if verification.passed else "FAIL"
    return f"{word}: {by_limit} for {total - len(verification.failed)} of {total}{also}"
