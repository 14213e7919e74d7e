"""A verification as a JSON document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sheetoflight.io.documents import write_json
from sheetoflight.measurement.comparison import Comparison, MeasuredSegment, PermissibleError
from sheetoflight.measurement.error_statistics import ErrorStatistics, Estimate
from sheetoflight.measurement.verification import Verification

FORMAT = "sheetoflight.verification"
VERSION = 1


def verification_document(verification: Verification) -> dict[str, Any]:
    """The verification in JSON's own types; what cannot be had is None."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "passed": verification.passed,
        "rule": "|E_n| <= 1" if verification.limit is None else "|error| <= MPE",
        "mpe": _limit(verification.limit),
        "worst": verification.worst.segment.name,
        "summary": _summary(verification.statistics),
        "findings": list(verification.findings),
        "warnings": list(verification.warnings),
        "segments": [_judged(one) for one in verification.comparisons],
        "not_judged": [_measured(one) for one in verification.not_judged],
        "provenance": dict(verification.provenance),
    }


def write_verification(path: str | Path, verification: Verification) -> None:
    """Write a verification as JSON, whole or not at all.

    Raises
    ------
    InputError
        If a number is not finite.
    FileError
        If the file cannot be written.
    """
    write_json(path, verification_document(verification))


def _judged(comparison: Comparison) -> dict[str, Any]:
    return _measured(comparison.segment) | {
        "known_mm": comparison.known.value,
        "known_std_mm": comparison.known.std,
        "error_mm": comparison.error,
        "expanded_mm": comparison.expanded,
        "normalised_error": comparison.normalised_error,
        "mpe_mm": comparison.limit,
        "decision": comparison.decision,
        "passed": comparison.passed,
    }


def _measured(segment: MeasuredSegment) -> dict[str, Any]:
    low, high = segment.length.interval
    return {
        "segment": segment.name,
        "uv": segment.ends.tolist(),
        "length_mm": segment.length.value,
        "std_mm": segment.length.std,
        "low_mm": low,
        "high_mm": high,
    }


def _summary(statistics: ErrorStatistics) -> dict[str, Any]:
    return {
        "number": statistics.number,
        "mean_mm": _estimate(statistics.mean),
        "spread_mm": statistics.spread,
        "rms_mm": statistics.rms,
        "largest_mm": statistics.largest,
        "scale_mm_per_m": _estimate(statistics.scale),
        "offset_mm": None if statistics.offset is None else _estimate(statistics.offset),
        "chi2": statistics.chi2,
        "chi2_p": statistics.chi2_p,
    }


def _estimate(estimate: Estimate) -> dict[str, float | None]:
    return {"value": estimate.value, "std": estimate.std, "p_value": estimate.p_value}


def _limit(limit: PermissibleError | None) -> dict[str, float] | None:
    return None if limit is None else {"constant_mm": limit.constant, "mm_per_m": limit.per_m}
