"""JSON Schema of the TOML files that are read, from the very tables that check them, for editors that complete and explain.

References are written out and ``null``, which TOML has not, is left out: the editors' libraries know draft 7 at most, and some
show nothing of a key whose schema is a reference. What a check of several keys together asks for is not in it. From a schema
follows a file as a person would write it: what is given, and all else commented out with its default and its sentence.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from cmm_uq.base.files.table import sentences, unit_of
from cmm_uq.jobs.job import JobFile
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.identification import EXAMPLE

Schema = dict[str, Any]
DRAFT = "http://json-schema.org/draft-07/schema#"
_REFERENCE = "#/$defs/"
_BARE = re.compile("[A-Za-z0-9_-]+")


class _Described(GenerateJsonSchema):
    """With the sentence of each key, and what its table says may stand for others."""

    def encode_default(self, dft: Any) -> Any:
        """As a file says it: a message as its text."""
        return str(dft) if isinstance(dft, str) else super().encode_default(dft)

    def model_schema(self, schema: Any) -> Any:
        found, table = super().model_schema(schema), schema["cls"]
        told = sentences(table)
        for name, key in found.get("properties", {}).items():
            key["description"] = told.get(name, "")
        found["description"] = re.sub(r"\s+", " ", (table.__doc__ or "").split("\n\n")[0]).replace("``", "`").strip()
        return found


def schema_of(table: type[BaseModel], title: str = "") -> Schema:
    """Schema of a table, with everything in it written out."""
    whole = table.model_json_schema(schema_generator=_Described, mode="validation")
    found: Schema = _written_out(whole, whole.pop("$defs", {}))
    found.pop("description", None)
    return ({"$schema": DRAFT, "title": title} if title else {}) | found


def job_schema(
    tables: Mapping[str, type[ArtefactFacts]], effects: Mapping[str, str], standards: Iterable[str]
) -> Schema:
    """Schema of job.toml for every kind of measurement."""
    found = schema_of(JobFile, "job.toml of cmm-uq")
    keys = found["properties"]
    each = {kind: schema_of(table) for kind, table in tables.items()}
    keys["artefact"] = {"description": keys["artefact"]["description"], **chosen_by("kind", each, "Kinds")}
    known = {"enum": list(effects), "x-taplo": {"docs": {"enumValues": list(effects.values())}}}
    own = {"type": "string", "pattern": keys["effect"]["items"]["properties"]["name"]["pattern"]}  # of the job's own
    keys["model"]["properties"]["effects"]["items"] = {"anyOf": [known, own]}
    named = {"properties": {"model": {"properties": {"effects": {"items": {"enum": list(effects)}}}}}}
    # an arm has effects of its own
    joined = {"properties": {"machine": {"required": ["joint"]}}, "required": ["machine"]}
    found["allOf"] = [{"if": {"not": {"anyOf": [{"required": ["effect"]}, joined]}}, "then": named}]
    keys["conformity"]["items"]["properties"]["standard"]["enum"] = list(standards)
    without = [name for name, table in tables.items() if not table.with_recording]
    found["required"] = [name for name in found["required"] if name != "recording"]
    found["if"] = {"properties": {"artefact": {"properties": {"kind": {"not": {"enum": without}}}}}}
    found["then"] = {"required": ["recording"]}
    return found


def chosen_by(key: str, each: Mapping[str, Schema], word: str) -> Schema:
    """Schema of a table whose other keys depend on one: those of all its values, each with the values that have it."""
    keys: dict[str, Schema] = {}
    for value, found in each.items():
        for name, item in found["properties"].items():
            if name not in keys:
                keys[name] = {**item, "x-for": [value]}
            else:
                keys[name]["x-for"].append(value)
                if item["description"] not in keys[name]["description"]:  # another package's key of the same name
                    keys[name]["description"] += f" In {value}: {item['description']}"
                _widen(keys[name], item)
    for item in keys.values():
        if len(item["x-for"]) < len(each):
            item["description"] = f"{item['description']} {word}: {', '.join(item['x-for'])}."
        else:
            del item["x-for"]
    keys[key] = {name: item for name, item in keys[key].items() if name != "anyOf"}
    keys[key] |= {"type": "string", "enum": list(each)}
    cases = []
    for value, found in each.items():
        foreign = {name: False for name in keys if name not in found["properties"]}
        then = {"required": found.get("required", [])} | ({"properties": foreign} if foreign else {})
        cases.append({"if": {"properties": {key: {"enum": [value]}}, "required": [key]}, "then": then})
    return {"type": "object", "properties": keys, "required": [key], "additionalProperties": False, "allOf": cases}


def _widen(known: Schema, other: Schema) -> None:
    """Let a key be what either of two kinds takes; which of them it is in one kind, its own table checks."""
    said = ("description", "x-for", "x-unit", "default")
    one, two = ({name: item for name, item in key.items() if name not in said} for key in (known, other))
    if one != two and two not in known.get("anyOf", ()):
        for name in one:
            del known[name]
        known["anyOf"] = [*one.get("anyOf", [one]), two]


def keys_of(schema: Mapping[str, Any], parent: str = "") -> Iterable[tuple[str, Schema]]:
    """Every key in a schema with its dotted name; of a list of tables ``[]`` stands behind its name."""
    for name, key in schema.get("properties", {}).items():
        dotted = f"{parent}.{name}" if parent else name
        yield dotted, key
        for part in (key, *key.get("anyOf", ())):
            yield from keys_of(part, dotted)
            yield from keys_of(part.get("items", {}), f"{dotted}[]")
            if isinstance(part.get("additionalProperties"), dict):
                yield from keys_of(part["additionalProperties"], f"{dotted}.NAME")


def _written_out(part: Any, inside: Mapping[str, Any]) -> Any:
    if isinstance(part, list):
        return [_written_out(item, inside) for item in part]
    if not isinstance(part, dict):
        return part
    if "$ref" in part:
        named = inside[part["$ref"].removeprefix(_REFERENCE)]
        return _written_out({**named, **{key: item for key, item in part.items() if key != "$ref"}}, inside)
    found = {key: _written_out(item, inside) for key, item in part.items() if key != "properties"}
    if "properties" in part:
        found["properties"] = {name: _key(name, _written_out(key, inside)) for name, key in part["properties"].items()}
    choices = [choice for choice in found.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        found = {**choices[0], **{key: item for key, item in found.items() if key != "anyOf"}}
    elif choices:
        found["anyOf"] = choices
    if found.get("default", 0) is None or isinstance(found.get("default"), dict):
        del found["default"]
    if "const" in found:
        found["enum"] = [found.pop("const")]
    found.pop("title", None)
    return found


def _key(name: str, key: Schema) -> Schema:
    """With its unit at the end of its sentence."""
    unit, sentence = unit_of(name), key.get("description", "")
    if unit:
        key["x-unit"] = unit
        key["description"] = sentence if unit in sentence else f"{sentence} Unit: {unit}."
    return key


AnySchema = Mapping[str, Any]
# what stands where a key has no default; uncommented as it is, most of it is refused by name
_EXAMPLES: AnySchema = {"string": "", "number": 0.0, "integer": 0, "boolean": False, "array": [], "object": {}}


def commented(
    schema: AnySchema, given: Mapping[str, Any], leave_out: Iterable[str] = (), asked_by: str = "", comment: bool = True,
    examples: Collection[str] = (),
) -> str:  # fmt: skip
    """Tables of a file, in the order of its schema; ``asked_by``: value by which the keys of a table are chosen.

    ``comment``: whether what is not given stands there as a comment; ``examples``: dotted keys with an example's values.
    """
    out, parts = set(leave_out), []
    for name, table in schema["properties"].items():
        if name in out:
            continue
        several = table.get("type") == "array"
        keys = (table["items"] if several else table).get("properties", {})
        shown = {key: item for key, item in keys.items()
                 if f"{name}.{key}" not in out and asked_by in item.get("x-for", [asked_by])}  # fmt: skip
        header, stated = f"[[{name}]]" if several else f"[{name}]", given.get(name) or []
        marked = {key for key in shown if f"{name}.{key}" in examples}
        tables: list[Any] = list(stated) if several or not stated else [stated]
        for values in tables or ([None] if comment else []):
            lines = [f"{'# ' if values is None else ''}{header}  # {table.get('description', '')}"]
            parts.append("\n".join([*lines, *_lines(shown, values or {}, comment, marked)]))
    return "\n\n".join(parts) + "\n"


def written(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", r"\u007f")
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (dt.date, dt.datetime)):
        return value.isoformat()
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{written_key(key)} = {written(item)}" for key, item in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(written, value)) + "]"
    raise TypeError(f"TOML has no {type(value).__name__}")


def written_key(key: str) -> str:
    """A key as TOML has it: in quotes, where it is more than ASCII letters, digits, ``_`` and ``-``."""
    return key if _BARE.fullmatch(key) else written(key)


def without_place(description: str) -> str:
    """The sentence of a key without what the schema puts behind it: unit, and kinds or methods that have the key."""
    return re.sub(r" (?:Unit|Kinds|Methods): [^.]*\.", "", description)


def _lines(
    keys: Mapping[str, AnySchema], given: Mapping[str, Any], comment: bool, marked: Collection[str]
) -> list[str]:
    lines = []
    for key in (name for name in keys if name in given):
        mark = f"{EXAMPLE}, put in your own: " if key in marked else ""
        lines.append(f"{key} = {written(given[key])}  # {mark}{without_place(keys[key]['description'])}")
    lines += [f"{written_key(key)} = {written(value)}" for key, value in given.items() if key not in keys]
    left = [(key, item) for key, item in keys.items() if key not in given and comment]
    return lines + [f"# {key} = {written(_example(item))}  # {item['description']}" for key, item in left]


def _example(key: AnySchema) -> Any:
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
