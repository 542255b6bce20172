"""Writes tables as TOML: just enough to give a mutated file back, wrong values included."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Mapping

from benchmarks.hostile.values import Raw


def dumps(tables: Mapping[str, object]) -> str:
    """A file of these tables: each table and list of tables under its own header, deeper ones in line."""
    plain = {key: item for key, item in tables.items() if not _is_table(item) and not _are_tables(item)}
    lines = [_line(key, item) for key, item in plain.items()]
    for key, item in tables.items():
        for each in item if _are_tables(item) else [item] if _is_table(item) else []:
            lines.append(f"[[{_key(key)}]]" if _are_tables(item) else f"[{_key(key)}]")
            lines += [_line(inner, value) for inner, value in each.items()]
    return "\n".join(lines) + "\n"


def _is_table(item: object) -> bool:
    return isinstance(item, Mapping)


def _are_tables(item: object) -> bool:
    return isinstance(item, list) and bool(item) and all(isinstance(each, Mapping) for each in item)


def _line(key: str, item: object) -> str:
    return f"{_key(key)} = {_value(item)}"


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _text(key)


def _value(item: object) -> str:
    if isinstance(item, Raw):
        return str(item)
    if isinstance(item, str):
        return _text(item)
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, Mapping):
        return "{ " + ", ".join(_line(key, inner) for key, inner in item.items()) + " }"
    if isinstance(item, list):
        return "[" + ", ".join(map(_value, item)) + "]"
    return item.isoformat() if isinstance(item, dt.date | dt.time) else repr(item)


def _text(item: str) -> str:
    quoted = json.dumps(item, ensure_ascii=False).replace("\x7f", "\\u007f")
    return re.sub(r"[\ud800-\udfff]", "?", quoted)
