"""Accuracy of the laser line's centres on drawn lines, beside the bound of the pixels.

Two bounds are shown. The formula, 1.062 √w σ/A, is that of a line sampled at points; pixels
average over their squares, and 8 bits round, so the bound of the pixels lies above it: by 1.14
for w = 0.8 px and σ = 1, which no detector can go below. Rows or columns are counted as found where
a centre that is called good lies within 3 widths of the line; the others count as not found, and
not as errors. Centres smoothed along the line (steger) err less than a row's own bound and share
their noise with their neighbours. Near a corner that cuts a wide line off slantwise, its last
centres are lost. Run with ``python -m bench.stripe_accuracy [--quick]``.
"""

from __future__ import annotations

import sys
from itertools import product

import numpy as np
from rich.console import Console
from rich.table import Table

from bench._dark_pictures import DARK_PICTURES, HARD_PICTURES, Drawing
from bench._drawn_stripes import DrawnLine
from bench._stripe_errors import Errors, stripe_errors
from sheetoflight.imaging.stripe.detectors import DETECTORS
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe

SEED = 6
WIDTHS = (0.8, 1.0, 1.5, 2.0, 3.0, 4.0)
LIGHTS = ((30, 1), (220, 1), (30, 3), (100, 3), (220, 3), (30, 10), (60, 10), (100, 10), (220, 10))
SLOPES = (0, 7, 20, 33, 44, 60, 80)
POINTS = ((0.8, 200, 2), (1.0, 200, 4), (2.0, 200, 4), (2.0, 100, 10), (4.0, 100, 5))
SHARES = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
LARGE = (300, 400)

# Below this peak over noise one row does not hold its centre, and rows are asked together.
LEAST_PEAK_TO_NOISE = 5.0

_OPTIONS = {name: StripeOptions(detector=name) for name in ("auto", *DETECTORS)}


def default_grid(quick: bool) -> list[Errors]:
    """The default detector for all widths, lights and slopes."""
    widths, lights, slopes = WIDTHS, LIGHTS, SLOPES
    if quick:
        widths, lights, slopes = (0.8, 2.0, 4.0), ((30, 3), (220, 3), (60, 10)), (0, 20, 60)
    pictures = 2 if quick else 6
    return [
        stripe_errors(DrawnLine(w, a, noise, slope), pictures, SEED)
        for w, (a, noise), slope in product(widths, lights, slopes)
    ]


def grid_table(cells: list[Errors]) -> Table:
    """One line for each width and light; of the slopes the worst in each column."""
    table = _table("Default detector, all slopes: median – worst", "w px", "A", "noise", "detector")
    groups: dict[tuple[float, float, float], list[Errors]] = {}
    for cell in cells:
        line = cell.line
        groups.setdefault((line.width, line.amplitude, line.noise), []).append(cell)
    for (w, a, noise), group in groups.items():
        detectors = ", ".join(sorted({cell.detector for cell in group}))
        table.add_row(f"{w:g}", f"{a:g}", f"{noise:g}", detectors, *_columns(group))
    return table


def worst_table(cells: list[Errors], count: int = 6) -> Table:
    """The cells with the largest ratio to the bound, at peak/noise 5 and more."""
    table = _table("Worst cells, peak/noise ≥ 5", "w px", "A", "noise", "slope °", "detector")
    rated = [c for c in cells if c.line.amplitude >= LEAST_PEAK_TO_NOISE * c.line.noise]
    for cell in sorted(rated, key=lambda cell: -cell.over_bound)[:count]:
        line = cell.line
        what = (f"{v:g}" for v in (line.width, line.amplitude, line.noise, line.slope_deg))
        table.add_row(*what, cell.detector, *_columns([cell]))
    return table


def detectors_table(quick: bool) -> Table:
    """Every detector at a few points, lines of 3 to 60°; and its bias without noise."""
    table = Table(
        "detector", "w px", "A", "noise", "rms px", "rms/pixel bound", "pull", "found",
        "bias over phases px: noisy", "noise-free",
        title="Every detector, slopes 3, 20 and 60° (bias: lines along the rows)",
    )  # fmt: skip
    pictures = 2 if quick else 6
    for name, (w, a, noise) in product(DETECTORS, POINTS[1:4:2] if quick else POINTS):
        line = DrawnLine(w, a, noise)
        group = [
            stripe_errors(DrawnLine(w, a, noise, slope), pictures, SEED, _OPTIONS[name])
            for slope in (3, 20, 60)
        ]
        table.add_row(
            name,
            f"{w:g}",
            f"{a:g}",
            f"{noise:g}",
            f"{np.sqrt(np.mean([cell.rms**2 for cell in group])):.4f}",
            f"{np.sqrt(np.mean([cell.over_bound**2 for cell in group])):.3f}",
            f"{np.sqrt(np.mean([cell.pull**2 for cell in group])):.2f}",
            f"{np.mean([cell.found for cell in group]):.3f}",
            *(
                _bias(stripe_errors(one, 4 if quick else 20, SEED, _OPTIONS[name]))
                for one in (line, DrawnLine(w, a, 0.0))
            ),
        )
    return table


def saturation_table(quick: bool) -> Table:
    """Errors by the share of the visible width, ± 2 standard deviations, that is clipped."""
    table = Table(
        "w px", "clipped", "A", "rms px", "largest px", "bias px", "pull", "found",
        title="Saturated lines, default detector, noise 2, slopes 0, 10 and 40°",
    )  # fmt: skip
    for w, share in product((0.8, 2.0, 4.0) if quick else WIDTHS, SHARES):
        group = [
            stripe_errors(DrawnLine(w, 1.0, 2.0, slope).clipped(share), 2 if quick else 6, SEED)
            for slope in (0, 10, 40)
        ]
        errors = np.concatenate([cell.errors for cell in group])
        table.add_row(
            f"{w:g}",
            f"{100 * share:.0f} %",
            f"{group[0].line.amplitude:.0f}",
            f"{np.sqrt(np.mean(errors**2)):.4f}",
            f"{np.abs(errors).max():.3f}",
            f"{errors.mean():+.4f}",
            f"{np.sqrt(np.mean([cell.pull**2 for cell in group])):.2f}",
            f"{np.mean([cell.found for cell in group]):.3f}",
        )
    return table


def false_centres(draw: Drawing, pictures: int, seed: int = SEED) -> tuple[int, int]:
    """Pictures without a line in which centres were found, and how many centres."""
    found = [
        len(extract_stripe(draw(np.random.default_rng([seed, index])))) for index in range(pictures)
    ]
    return sum(count > 0 for count in found), sum(found)


def dark_table(quick: bool) -> Table:
    """False centres of each kind of picture."""
    pictures = 20 if quick else 1000
    table = Table("picture", "with a false line", "false centres",
                  title=f"{pictures} pictures of each kind without a line")  # fmt: skip
    for name, draw in {**DARK_PICTURES, **HARD_PICTURES}.items():
        table.add_row(name, *(str(count) for count in false_centres(draw, pictures)))
    return table


def found_table(quick: bool) -> Table:
    """Faint lines from border to border."""
    table = _table(f"Faint lines, noise 10, {LARGE[1]} x {LARGE[0]} px, slopes 0 to 80°: "
                   "median – worst", "w px", "peak/noise", "detector")  # fmt: skip
    slopes = (7, 44) if quick else SLOPES
    for snr, w in product((3, 5, 10), (0.8, 2.0) if quick else WIDTHS):
        group = [
            stripe_errors(DrawnLine(w, 10.0 * snr, 10.0, slope, LARGE), 2 if quick else 4, SEED)
            for slope in slopes
        ]
        detectors = ", ".join(sorted({cell.detector for cell in group}))
        table.add_row(f"{w:g}", f"{snr:g}", detectors, *_columns(group))
    return table


def _table(title: str, *what: str) -> Table:
    return Table(
        *what, "rms px", "rms/pixel bound", "rms/formula", "|bias| px", "error/stated", "found",
        "false", title=title,
    )  # fmt: skip


def _columns(group: list[Errors]) -> list[str]:
    seen = [cell for cell in group if len(cell.errors)]

    def spread(values: list[float], digits: int, worst: float) -> str:
        middle = f"{np.median(values):.{digits}f}"
        return middle if len(values) == 1 else f"{middle} – {worst:.{digits}f}"

    rms = [cell.rms for cell in seen]
    by_bound = [cell.over_bound for cell in seen]
    by_formula = [cell.over_formula for cell in seen]
    bias = [abs(cell.bias) for cell in seen]
    pull = [cell.pull for cell in seen]
    found = [cell.found for cell in group]
    return [
        spread(rms, 4, max(rms)),
        spread(by_bound, 3, max(by_bound)),
        spread(by_formula, 3, max(by_formula)),
        spread(bias, 4, max(bias)),
        spread(pull, 2, max(pull, key=lambda p: abs(np.log(p)))),
        spread(found, 3, min(found)),
        str(sum(cell.false for cell in group)),
    ]


def _bias(cell: Errors) -> str:
    """The mean error, and the largest of one phase's."""
    phases = cell.by_phase
    return f"{cell.bias:+.4f}, largest {np.abs(phases).max():.4f}"


def main() -> None:
    quick = "--quick" in sys.argv[1:]
    console = Console(width=170)
    cells = default_grid(quick)
    console.print(grid_table(cells))
    console.print(worst_table(cells))
    for table in (detectors_table, saturation_table, found_table, dark_table):
        console.print(table(quick))


if __name__ == "__main__":
    main()
