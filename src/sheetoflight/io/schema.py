"""What a pydantic model says of a wrong document, in one line with the key's name."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from sheetoflight.errors import InputError
from sheetoflight.io.quoting import one_line, shown

_EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotes",
    "string_unicode": "text without broken characters",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "none_required": "null",
    "finite_number": "a finite number",
    "literal_error": "one of {expected}",
    "too_short": "{min_length} entries or more",
    "too_long": "{max_length} entries or fewer",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number of {ge:g} or more",
    "string_too_short": "text that is not empty",
}


class StrictModel(BaseModel):
    """A table of a file: no key unknown, no number guessed from text, nothing infinite."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


_Model = TypeVar("_Model", bound=BaseModel)


def validated(model: type[_Model], document: Mapping[str, Any]) -> _Model:
    """The document as a checked model.

    Raises
    ------
    InputError
        For the first thing that is wrong, naming the key, what was found and what is expected.
        An unknown key comes first: misspelt, it is why another is missing.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
        raise _input_error(model, dict((unknown or problems)[0])) from error


def _input_error(model: type[BaseModel], problem: dict[str, Any]) -> InputError:
    location = tuple(problem["loc"])
    match problem["type"]:
        case "extra_forbidden":
            return _unknown_key(model, location)
        case "missing":
            return InputError(f"{_owner(location)}'{location[-1]}' is missing", "add it")
    expected = _EXPECTED.get(problem["type"])
    wanted = (
        expected.format(**problem.get("ctx", {})) if expected else one_line(str(problem["msg"]))
    )
    return InputError(
        f"{key_path(location)} is {shown(problem['input'])}, expected {wanted}", "correct it"
    )


def key_path(location: tuple[int | str, ...]) -> str:
    """A key's place in the document: ``camera.matrix[0][1]``."""
    path = ""
    for part in location:
        step = f"[{part}]" if isinstance(part, int) else f".{one_line(part)}"
        path += step if path or isinstance(part, int) else step[1:]
    return path or "the document"


def _owner(location: tuple[int | str, ...]) -> str:
    return f"{key_path(location[:-1])}: " if len(location) > 1 else ""


def _unknown_key(model: type[BaseModel], location: tuple[int | str, ...]) -> InputError:
    key = str(location[-1])
    allowed = _keys_at(model, location[:-1])
    where = f" in [{key_path(location[:-1])}]" if len(location) > 1 else ""
    close = get_close_matches(key, allowed, n=1)
    remedy = f"did you mean '{close[0]}'?" if close else f"known keys are {', '.join(allowed)}"
    return InputError(f"unknown key {shown(key)}{where}", remedy)


def _keys_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    for part in location:
        if isinstance(part, int):  # the place in a list, whose entries the model describes
            continue
        annotation = model.model_fields[part].annotation
        candidates = [annotation, *get_args(annotation)]
        model = next(c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel))
    return list(model.model_fields)
