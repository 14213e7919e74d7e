"""Names say what a thing is: no module or class called after having no name."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "sheetoflight"
MODULES = sorted(SOURCE.rglob("*.py"))
NAMELESS = re.compile(r"(?i)(^|_)(util|helper|manager|handler|misc)s?(_|$)")


def words(name: str) -> str:
    """``HTTPCamelCase`` as ``HTTP_Camel_Case``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)


def relative(path: Path) -> str:
    return str(path.relative_to(SOURCE))


@pytest.mark.parametrize("name", ["utils", "ImageHelper", "view_manager", "HTTPHandler", "misc"])
def test_the_rule_knows_such_names(name: str):
    assert NAMELESS.search(words(name))


@pytest.mark.parametrize("path", MODULES, ids=relative)
def test_no_module_or_class_is_nameless(path: Path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    classes = [node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    names = [*Path(relative(path)).with_suffix("").parts, *classes]
    assert [name for name in names if NAMELESS.search(words(name))] == []
