"""What all pages share: the templates' environment, and the code that draws the figures."""

from __future__ import annotations

from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from sheetoflight.report import numbers


@cache
def environment() -> Environment:
    """Templates of this package, escaping whatever is put into them."""
    made = Environment(
        loader=PackageLoader("sheetoflight.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["cell"] = _cell_text
    made.filters["two_digits"] = numbers.two_digits
    made.globals["plotly_js"] = plotly_js
    return made


@cache
def plotly_js() -> Markup:
    """The plotting library, to stand in a page's script element."""
    return Markup(get_plotlyjs())


def _cell_text(cell: str | int | float) -> str:
    return f"{cell:.6g}" if isinstance(cell, float) else str(cell)
