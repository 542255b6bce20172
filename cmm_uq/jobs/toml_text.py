"""A TOML file as a person would write it: what is given, and all else commented out with its default and its sentence."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from cmm_uq.jobs.origin import EXAMPLE

Schema = Mapping[str, Any]

_WHERE = re.compile(r" (?:Unit|Kinds|Methods): [^.]*\.")
"""Of a description, what the name of the key and the file itself say."""

_EXAMPLES: Mapping[str, Any] = {
    "string": "", "number": 0.0, "integer": 0, "boolean": False, "array": [], "object": {},
}  # fmt: skip
"""What stands where a key has no default; uncommented as it is, most of it is refused by name."""


def commented(
    schema: Schema, given: Mapping[str, Any], leave_out: Iterable[str] = (), asked_by: str = "", comment: bool = True,
    examples: Collection[str] = (),
) -> str:  # fmt: skip
    """Tables of a file, in the order of its schema.

    Parameters
    ----------
    schema : of the file.
    given : what it says, by table and key; a list of tables as a list.
    leave_out : tables, and dotted keys, that are of no use here.
    asked_by : value by which the keys of a table are chosen (see :func:`cmm_uq.jobs.schema.chosen_by`).
    comment : whether what is not given stands there as a comment.
    examples : dotted keys whose values are an example's, and are said to be.
    """
    out, parts = set(leave_out), []
    for name, table in schema["properties"].items():
        if name in out:
            continue
        several = table.get("type") == "array"
        keys = (table["items"] if several else table).get("properties", {})
        shown = {key: item for key, item in keys.items() if f"{name}.{key}" not in out and _has(item, asked_by)}
        header = f"[[{name}]]" if several else f"[{name}]"
        for said in _said(given.get(name), several) or ([None] if comment else []):
            lines = [f"{'# ' if said is None else ''}{header}  # {table.get('description', '')}"]
            marked = {key for key in shown if f"{name}.{key}" in examples}
            lines += _lines(shown, said or {}, comment, marked)
            parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def written(value: Any) -> str:
    """A value as TOML has it.

    Raises
    ------
    TypeError : TOML has no such value.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (dt.date, dt.datetime)):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {written(item)}" for key, item in value.items()) + " }" if value else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(written, value)) + "]"
    raise TypeError(f"TOML has no {type(value).__name__}")


def without_place(description: str) -> str:
    """The sentence of a key without what the schema puts behind it: unit, and kinds or methods that have the key."""
    return _WHERE.sub("", description)


def _said(given: Any, several: bool) -> list[Any]:
    if not given:
        return []
    return list(given) if several else [given]


def _has(key: Schema, asked_by: str) -> bool:
    return asked_by in key.get("x-for", [asked_by])


def _lines(keys: Mapping[str, Schema], given: Mapping[str, Any], comment: bool, marked: Collection[str]) -> list[str]:
    told = {key: without_place(item["description"]) for key, item in keys.items()}
    mark = {key: f"{EXAMPLE}, put in your own: " if key in marked else "" for key in keys}
    first = [f"{key} = {written(given[key])}  # {mark[key]}{told[key]}" for key in keys if key in given]
    first += [f"{key} = {written(value)}" for key, value in given.items() if key not in keys]
    rest = [
        f"# {key} = {written(_example(item))}  # {item['description']}"
        for key, item in keys.items()
        if key not in given
    ]
    return [*first, *(rest if comment else ())]


def _example(key: Schema) -> Any:
    """Its default, else something of its form."""
    if "default" in key:
        return key["default"]
    if "anyOf" in key:
        return _example(key["anyOf"][-1])
    if "enum" in key:
        return key["enum"][0]
    if key.get("format") == "date":
        return dt.date(2026, 1, 31)
    if key.get("format") == "date-time":
        return dt.datetime(2026, 1, 31, 14, 30)
    if "minItems" in key:
        return [_example(key["items"])] * int(key["minItems"])
    if key.get("properties"):
        return {name: _example(item) for name, item in key["properties"].items()}
    return _EXAMPLES[key.get("type", "string")]
