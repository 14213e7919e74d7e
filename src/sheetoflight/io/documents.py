"""JSON documents: strict, readable, and the same bytes for the same content."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.quoting import file_name, one_line, shown
from sheetoflight.io.reading import naming, read_text

_LINE_WIDTH = 100


def json_text(document: Mapping[str, Any]) -> str:
    """A document as JSON text: numbers in full precision, short lists on one line.

    Parameters
    ----------
    document : mapping
        Of text, numbers, true and false, None, lists, tuples, arrays and further mappings.

    Raises
    ------
    InputError
        If a number is not finite, or a value has no JSON form; its place is named.
    """
    try:
        return _laid_out(_plain(document, ""), "") + "\n"
    except RecursionError as error:
        raise InputError(
            "the document is nested too deeply, or holds itself", "make it flatter"
        ) from error


def write_json(path: str | Path, document: Mapping[str, Any]) -> None:
    """Write a document as JSON, whole or not at all.

    Raises
    ------
    InputError, FileError
        As `json_text` and `write_whole`.
    """
    with naming(path):
        text = json_text(document)
    write_whole(path, text)


def read_json(path: str | Path) -> dict[str, Any]:
    """A JSON file that holds one object; `NaN` and a key given twice are refused.

    Raises
    ------
    FileError
        If the file cannot be read, or is not JSON; line and column are named.
    InputError
        If it holds something that JSON or this package does not allow.
    """
    text, name = read_text(path), file_name(path)
    try:
        with naming(path):
            document = json.loads(
                text, parse_constant=_refuse_constant, object_pairs_hook=_once_each
            )
    except InputError:
        raise
    except json.JSONDecodeError as error:
        raise FileError(
            f"{name} line {error.lineno} column {error.colno} is not JSON ({one_line(error.msg)})",
            "the file is damaged or cut short: write it again",
        ) from error
    except RecursionError as error:
        raise FileError(f"{name} is nested too deeply", "write it again") from error
    except ValueError as error:
        raise FileError(
            f"{name} holds a number of too many digits", "the file is damaged: write it again"
        ) from error
    if not isinstance(document, dict):
        raise InputError(
            f"{name} holds {shown(document)}, expected an object {{…}}", "write it again"
        )
    return document


def _refuse_constant(constant: str) -> None:
    raise InputError(f"the value {constant} is no JSON number", "give a finite number or null")


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise InputError(f"key {shown(twice)} is given twice", "keep one of the two")
    return found


def _plain(value: Any, place: str) -> Any:
    """The value in Python's own types, checked to be sayable in JSON."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        if not np.isfinite(value):
            raise InputError(f"{place} is {value}, which JSON cannot say", "give a finite number")
        return value
    if isinstance(value, Mapping):
        return {
            _key(key, place): _plain(item, f"{place}.{key}" if place else key)
            for key, item in value.items()
        }
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [_plain(item, f"{place}[{index}]") for index, item in enumerate(value)]
    raise InputError(
        f"{place} is of type {type(value).__name__}, which JSON cannot say",
        "give text, numbers, lists or mappings",
    )


def _key(key: object, place: str) -> str:
    if not isinstance(key, str):
        raise InputError(f"{place or 'the document'} has the key {shown(key)}", "use text as keys")
    return key


def _laid_out(value: Any, indent: str) -> str:
    """One line where it fits or is a row of numbers, else one entry a line."""
    line = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(line) <= _LINE_WIDTH or not _holds_more(value):
        return line
    deeper = indent + " "
    if isinstance(value, dict):
        entries = [
            f"{json.dumps(key, ensure_ascii=False)}: {_laid_out(item, deeper)}"
            for key, item in value.items()
        ]
        opening, closing = "{", "}"
    else:
        entries = [_laid_out(item, deeper) for item in value]
        opening, closing = "[", "]"
    body = f",\n{deeper}".join(entries)
    return f"{opening}\n{deeper}{body}\n{indent}{closing}"


def _holds_more(value: Any) -> bool:
    return isinstance(value, dict) or (
        isinstance(value, list) and any(isinstance(item, dict | list) for item in value)
    )
