"""Foreign text made fit for a one-line message."""

from __future__ import annotations

from pathlib import Path

_LONGEST = 60


def shown(value: object) -> str:
    """A value as a message shows it: text in quotes, on one line, shortened where it is long."""
    if isinstance(value, str):
        return f"'{one_line(value[: _LONGEST + 1])}'"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, int) and value.bit_length() > 4 * _LONGEST:
        return "a number of too many digits"
    return one_line(str(value))


def one_line(text: str, longest: int = _LONGEST) -> str:
    """Text with everything unprintable escaped, cut after so many characters."""
    escaped = _printable(text[: longest + 1])
    return escaped if len(escaped) <= longest else f"{escaped[:longest]}…"


def file_name(path: str | Path) -> str:
    """A path as a message shows it: on one line, at full length."""
    return _printable(str(path))


def _printable(text: str) -> str:
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii")
        for c in text
    )
