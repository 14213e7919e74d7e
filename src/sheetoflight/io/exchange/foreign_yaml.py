"""YAML documents as other tools write them, OpenCV's dialect among them.

The text is composed by PyYAML into its tree of nodes, and the tree is turned into numbers, text,
lists and mappings here: no tag makes an object, ``1e-05`` is a number as in YAML 1.2 and in all
that C++ writes, and a key given twice is refused.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.quoting import one_line, shown

_HEADER = re.compile(r"\A%YAML[^\n]*\n")
"""OpenCV's ``%YAML:1.0`` is no directive that YAML knows."""

_END = re.compile(r"(\n---\s*)+\Z")
"""What ``ros2 topic echo`` ends a message with."""

_INTEGER = re.compile(r"[-+]?[0-9]{1,300}\Z")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,4})?\Z")
_CONSTANTS = {"true": True, "false": False, "null": None, "~": None, "": None}


def yaml_document(text: str) -> Any:
    """What the one document of a YAML text holds.

    Raises
    ------
    FileError
        If the text is no YAML; the line is named.
    InputError
        If a key is given twice, or the document is nested too deeply or holds itself.
    """
    try:
        return _value(_composed(_END.sub("\n", _HEADER.sub("", text))), {})
    except RecursionError as error:
        raise InputError("the document is nested too deeply", "write it again") from error


def _composed(text: str) -> yaml.Node | None:
    try:
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"line {mark.line + 1}" if mark else "the text"
        raise FileError(
            f"{place} is not YAML ({one_line(str(error.problem))})",
            "give a file of a known format; this one is damaged, or another kind of text",
        ) from error
    except (yaml.YAMLError, ValueError) as error:
        raise FileError(
            f"the text is not YAML ({one_line(str(error))})", "the file is damaged: write it again"
        ) from error


def _value(node: yaml.Node | None, done: dict[int, Any]) -> Any:
    """The value of a node; one that several places refer to is turned into a value once."""
    if node is None:
        return None
    if id(node) not in done:
        done[id(node)] = _UNFINISHED
        done[id(node)] = _converted(node, done)
    if done[id(node)] is _UNFINISHED:
        raise InputError("the document holds itself", "write it again")
    return done[id(node)]


_UNFINISHED = object()


def _converted(node: yaml.Node, done: dict[int, Any]) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_value(entry, done) for entry in node.value]
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, done)
    return _scalar(node)


def _mapping(node: yaml.MappingNode, done: dict[int, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise InputError("a key is a list or a table", "use text as keys")
        if key.value in found:
            raise InputError(f"key {shown(key.value)} is given twice", "keep one of the two")
        found[key.value] = _value(value, done)
    return found


def _scalar(node: yaml.Node) -> Any:
    text = node.value
    if getattr(node, "style", None) in ("'", '"', "|", ">"):
        return text
    if text.lower() in _CONSTANTS:
        return _CONSTANTS[text.lower()]
    if _INTEGER.match(text):
        return int(text)
    return float(text) if _FLOAT.match(text) else text
