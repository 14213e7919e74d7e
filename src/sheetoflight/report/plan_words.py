"""A plan's findings in sentences, for terminal and page."""

from __future__ import annotations

import math

from sheetoflight.measurement.length_plan import MOST_VIEWS, LengthPlan, Wanted

_WAYS = {
    "image points": "more pixels a millimetre, a sharper lens or longer exposures for the ends",
    "target length": "marker positions measured better (tolerance_mm)",
    "temperature": "a better known temperature of the target",
}


def views_in_words(plan: LengthPlan) -> str:
    """How many views of which kind, and how they come about."""
    counts = plan.options.counts
    each = " in each sheet" if len(plan.nominal.light_planes) > 1 else " in the sheet"
    kinds = [
        (counts.camera, "camera view", ""),
        (counts.plane, "position", each),
        (counts.crossing, "crossing view", each if len(plan.nominal.light_planes) > 1 else ""),
    ]
    parts = [f"{n} {name}{'s' if n != 1 else ''}{where}" for n, name, where in kinds if n]
    how = "chosen" if plan.options.best else "at random"
    return f"{', '.join(parts[:-1])} and {parts[-1]}, {how}" if parts[1:] else f"{parts[0]}, {how}"


def bound_in_words(wanted: Wanted) -> str:
    """What no number of pictures takes away, and where it stands in the way, what would."""
    parts = " and ".join(f"{name} {three_digits(part)} mm" for name, part in wanted.bound)
    bound = three_digits(wanted.bound_mm)
    if wanted.possible:
        return f"no number of random views gets below {bound} mm: {parts} remain"
    largest = max(wanted.bound, key=lambda source: source[1], default=("", 0.0))[0]
    way = f" – what helps: {_WAYS[largest]}" if largest in _WAYS else ""
    return (
        f"{wanted.std_mm:g} mm cannot be reached by any number of views: {parts} remain, "
        f"together {bound} mm{way}"
    )


def wanted_in_words(plan: LengthPlan, wanted: Wanted) -> tuple[str, ...]:
    """What it takes to reach an uncertainty, in sentences."""
    if not wanted.possible:
        return (bound_in_words(wanted),)
    with_views = f"with {plan.options.counts.camera} camera views"
    chosen = wanted.chosen_positions
    if wanted.positions is None and chosen is None:
        first = f"{wanted.std_mm:g} mm needs more than {MOST_VIEWS} positions, {with_views}"
    else:
        random = f"more than {MOST_VIEWS}" if wanted.positions is None else f"{wanted.positions}"
        also = f", or {chosen} chosen ones" if chosen else ""
        first = f"{wanted.std_mm:g} mm needs {random} random positions{also}, {with_views}"
    pairs = ", ".join(
        f"{camera} and {f'more than {MOST_VIEWS}' if plane is None else plane}"
        for camera, plane in wanted.choices
    )
    second = (f"camera views and positions that reach it: {pairs}",) if pairs else ()
    return (first, *second, bound_in_words(wanted))


def next_in_words(plan: LengthPlan) -> tuple[str, ...]:
    """Which position helps most, stage by stage, with its gain."""
    after = "the views of the calibration" if plan.after_taken else "the planned views"
    return tuple(
        f"after {after}, in stage {position.view.stage}: {position.view.in_words}. It lowers the "
        f"uncertainty of lengths by {_share(position.view.gain)} in the mean over the field (a "
        f"random one by {_share(position.view.typical_gain)}), its median from "
        f"{three_digits(position.before_mm)} to {three_digits(position.after_mm)} mm"
        for position in plan.next_positions
    )


def three_digits(value: float) -> str:
    """An uncertainty to its third digit, so that plans can be compared; "undetermined" where it
    is infinite.

    Examples
    --------
    >>> three_digits(0.1), three_digits(12.345), three_digits(math.inf)
    ('0.100', '12.3', 'undetermined')
    """
    if not math.isfinite(value):
        return "undetermined"
    if value <= 0:
        return "0"
    decimals = max(2 - math.floor(math.log10(value)), 0)
    return f"{value:.{decimals}f}"


def _share(variance_gain: float) -> str:
    """A gain in variance as one in standard uncertainty."""
    percent = round(100.0 * (1.0 - math.sqrt(max(1.0 - variance_gain, 0.0))), 1)
    return f"{percent + 0.0:.1f} %"
