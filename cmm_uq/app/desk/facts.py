"""What job.toml states as fields of a form, and changes of these in its text, with all else in it as it stands."""

from __future__ import annotations

import datetime as dt
import tomllib
from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable

from cmm_uq.app.desk.questions import fields, tables_of
from cmm_uq.base.errors import CmmUqError


def facts(text: str) -> dict[str, Any]:
    """Fields of the kind that job.toml names, and what it says of each; what it does not is empty."""
    try:
        data = tomllib.loads(text)
        asked = fields(str(data["artefact"]["kind"]))
    except (tomllib.TOMLDecodeError, KeyError, TypeError, RecursionError):
        raise CmmUqError("names no kind of measurement", where="job.toml", fix="Mend it in its text") from None
    return {"fields": asked, "values": {one["key"]: _shown(_stated(data, one["key"])) for one in asked}}


def _stated(data: Any, dotted: str) -> Any:
    """A value by its dotted key, of the first of several tables; ``None`` where it is not stated."""
    for key in dotted.split("."):
        data = data[0] if isinstance(data, list) and data else data
        data = data.get(key) if isinstance(data, dict) else None
    return data


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return " to ".join(map(_shown, value))
    if isinstance(value, float):
        return f"{value:.12g}"
    return (
        ""
        if value is None or isinstance(value, dict)
        else value.isoformat()
        if isinstance(value, dt.date)
        else str(value)
    )


def with_facts(text: str, values: Mapping[str, str]) -> str:
    """The text of job.toml with those of the fields that say something else than it does."""
    before = facts(text)["values"]
    changed = {key: value.strip() for key, value in values.items() if key in before and value.strip() != before[key]}
    if not changed:
        return text
    document = tomlkit.parse(text)
    standard = {"conformity.standard": values.get("conformity.standard", "")}
    tables = tables_of({**standard, **{key: value for key, value in changed.items() if value}})
    for dotted, value in changed.items():
        *path, key = dotted.split(".")
        place: Any = document
        for name in path:
            if name not in place:
                place[name] = (
                    tomlkit.aot()
                    if name == "conformity"
                    else tomlkit.table()
                    if place is document
                    else tomlkit.inline_table()
                )
            place = place[name]
            if isinstance(place, list):
                if not place:
                    place.append(tomlkit.table())
                place = place[0]
        if value:
            place[key] = _stated(tables, dotted)
        elif isinstance(place, AbstractTable | tomlkit.items.InlineTable):
            place.remove(key)
    if "artefact.U_um" in changed and changed["artefact.U_um"] and "k" not in document["artefact"]:
        document["artefact"]["k"] = 2.0
    return tomlkit.dumps(document)
