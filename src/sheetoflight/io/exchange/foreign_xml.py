"""OpenCV's XML storage as the document that the same storage in YAML or JSON would be."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.quoting import one_line, shown

_ROOT = "opencv_storage"
_ENTRY = "_"


def xml_document(text: str) -> dict[str, Any]:
    """What an ``<opencv_storage>`` holds.

    Raises
    ------
    FileError
        If the text is no XML.
    InputError
        If it defines entities, is not OpenCV's, has a key twice, or is nested too deeply.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("the XML text defines entities", "write it again without a DOCTYPE")
    try:
        root = ET.fromstring(text)  # entities are refused above
        found = _value(root)
    except (ET.ParseError, ValueError) as error:
        raise FileError(
            f"the text is not XML ({one_line(str(error))})", "the file is damaged: write it again"
        ) from error
    except RecursionError as error:
        raise InputError("the document is nested too deeply", "write it again") from error
    if root.tag != _ROOT or not isinstance(found, dict):
        raise InputError(
            f"the XML text is a {shown(root.tag)}, expected <{_ROOT}>",
            "give a file that OpenCV's FileStorage wrote",
        )
    return found


def _value(element: ET.Element) -> Any:
    if not len(element):
        return _plain(element.text or "")
    if all(child.tag == _ENTRY for child in element):
        return [_value(child) for child in element]
    found: dict[str, Any] = {}
    for child in element:
        if child.tag in found:
            raise InputError(f"key {shown(child.tag)} is given twice", "keep one of the two")
        found[child.tag] = _value(child)
    return found


def _plain(text: str) -> Any:
    """A number, a list of numbers, or text."""
    words = text.split()
    try:
        values = [int(word) if word.lstrip("+-").isdigit() else float(word) for word in words]
    except ValueError:
        return text.strip().strip('"')
    return values[0] if len(values) == 1 else values
