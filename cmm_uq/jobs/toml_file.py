"""TOML files as checked objects, with errors that name line and key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import tomlkit
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from tomlkit.exceptions import TOMLKitError

from cmm_uq.errors import CmmUqError, shortened, suggestion
from cmm_uq.files.content import text_of
from cmm_uq.files.toml import toml_of
from cmm_uq.jobs.other_units import conversion

Facts = TypeVar("Facts", bound=BaseModel)

_CHOICE = re.compile("GuardBand|FalseAccept|UncertaintyRatio|PosteriorProbability|UnconditionalRisk|literal")
"""Of the names that stand in a location for one of several tables that a key may have, none of which the user wrote."""

_SHOWN = 60
"""Characters of a key or a value in a message."""


def checked(
    content: bytes, path: Path, model: type[Facts] | Callable[[dict[str, Any]], type[Facts]], context: object = None
) -> Facts:  # fmt: skip
    """The contents of a TOML file as a checked object.

    Parameters
    ----------
    content : the file's bytes, UTF-8.
    path : of the file, for messages.
    model : what it must say, or what that is for a file that says this.
    context : what its checks go by beside the file.

    Raises
    ------
    CmmUqError : it is no TOML, says something unknown, missing or contradictory, or goes beyond a limit; with line and key.
    """
    text = text_of(content, str(path))
    try:
        data = toml_of(text, str(path))
    except tomllib.TOMLDecodeError as error:
        raise CmmUqError(f"is not valid TOML: {error}", where=str(path),
                         fix="Text stands in quotes, dates as 2026-01-31, decimals with a point") from None  # fmt: skip
    wanted = cast("type[Facts]", model if isinstance(model, type) else model(data))
    try:
        return wanted.model_validate(data, context=context)
    except ValidationError as error:
        raise _located(error.errors(include_url=False)[0], text, path, wanted) from None


def as_toml(data: Mapping[str, Any], where: str) -> bytes:
    """What a TOML file says, as its bytes.

    Parameters
    ----------
    data : tables, lists, texts, numbers, dates, truth values; ``None`` leaves its key out.
    where : for messages.

    Raises
    ------
    CmmUqError : something in it is none of these.
    """
    try:
        return tomlkit.dumps(_plain(data)).encode()
    except (TOMLKitError, TypeError, ValueError) as error:
        raise CmmUqError(f"holds what TOML cannot say: {error}", where=where,
                         fix="Give texts, numbers, dates, lists and tables") from None  # fmt: skip


def _plain(value: Any) -> Any:
    """Without keys that say nothing, and with Python's numbers instead of NumPy's."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _located(error: ErrorDetails, text: str, path: Path, model: type[BaseModel]) -> CmmUqError:
    """The first validation error, with line and key."""
    keys = [str(part) for part in error["loc"] if not (isinstance(part, str) and "[" in part)]
    named = [key for key in keys if not _CHOICE.match(key)] or [str(error["loc"][0])]
    line = _line_of(named, text)
    named = [shortened(key, _SHOWN) for key in named]
    where = f"{path}{f' line {line}' if line else ''}: [{named[0]}]{' ' + '.'.join(named[1:]) if named[1:] else ''}"
    if error["type"] == "missing":
        return CmmUqError("is missing", where=where, fix=f"Add it to {path.name}")
    if error["type"] == "extra_forbidden":
        known = _known_keys(named[:-1], model)
        return CmmUqError("unknown key", where=where, fix=conversion(named[-1], known) or suggestion(named[-1], known))
    message = error["msg"].removeprefix("Value error, ")
    tables = isinstance(error["input"], dict) or (
        isinstance(error["input"], list) and any(isinstance(item, dict) for item in error["input"])
    )
    given = "" if tables else f" (it says {shortened(repr(error['input']), _SHOWN)})"
    return CmmUqError(f"{message[0].lower()}{message[1:]}{given}", where=where)


def _known_keys(parents: list[str], top: type[BaseModel]) -> list[str]:
    model: object = top
    for parent in parents:
        if parent.isdigit() or not isinstance(model, type):
            continue
        model = _model_inside(model.model_fields[parent].annotation) if hasattr(model, "model_fields") else model
    fields = getattr(model, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _model_inside(annotation: object) -> object:
    """The table class in ``Table``, ``Table | None`` or ``list[Table]``."""
    for candidate in (annotation, *getattr(annotation, "__args__", ())):
        if hasattr(candidate, "model_fields"):
            return candidate
    return annotation


def _line_of(keys: list[str], text: str) -> int | None:
    """Line of the deepest of ``keys`` that stands in its table; the table's own line when none does."""
    table, found, count = "", None, -1
    wanted = int(keys[1]) if len(keys) > 1 and keys[1].isdigit() else None
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[{1,2}([^\[\]]+)\]", line)
        if header:
            table = header[1].strip()
            count += table == keys[0]
            here = table == keys[0] and wanted in (None, count)
            found = number if here and found is None else found
        elif table.split(".")[0] == keys[0] and wanted in (None, count):
            key = re.match(r"\s*[\"']?([A-Za-z0-9_-]+)[\"']?\s*[.=]", line)
            if key and key[1] in keys[1:]:
                return number
    return found
