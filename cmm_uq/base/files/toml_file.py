"""TOML files as checked objects: read within limits, and wrong values named by line and key."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, cast, get_origin

import numpy as np
import tomlkit
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from tomlkit.exceptions import TOMLKitError

from cmm_uq.base.errors import MOST_GATHERED, CmmUqError, shortened, suggestion
from cmm_uq.base.files.csv_table import conversion
from cmm_uq.base.files.limits import DEPTH, LISTED, NUMERAL, TEXT, TOML_KEY, WORD, text_of
from cmm_uq.base.files.table import sentences

_STRING = (
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})?+'
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5})?+"
    r'|"(?:[^"\\\n]++|\\.)*+"?+'
    r"|'[^'\n]*+'?+"
)
# every alternative takes all that it can and never gives back, so that the time is linear in the text
_TOKEN = re.compile(
    rf"(?P<dotted>(?:(?:[\w-]++|{_STRING})[ \t]*+\.[ \t]*+){{{DEPTH.most}}}+)"
    rf"|(?P<string>{_STRING})|(?P<comment>\#[^\n]*+)"
    rf"|(?P<long>[\w-]{{{NUMERAL.most + 1},}}+)|[\w-]++|(?P<open>[\[{{])|(?P<close>[\]}}])",
    re.DOTALL,
)
_MARKS = frozenset("\u200c\u200d\u200e\u200f\u061c\u00ad\ufeff")
"""Invisible characters that ordinary text of some languages needs; all others steer terminals and change what is read."""


def toml_of(text: str, where: str, *, most_word: int = WORD.most, most_listed: int = LISTED.most) -> dict[str, Any]:
    _check_text(text, where)
    try:
        data = tomllib.loads(text)
    except RecursionError:  # whatever the check of the text let through
        raise _too_deep(where) from None
    for key, item in _items(data, where):
        _check_item(key, item, where, most_word, most_listed)
    return data


def _check_text(text: str, where: str) -> None:
    depth = 0
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        depth += (kind == "open") - (kind == "close")
        if kind in ("dotted", "long") or depth > DEPTH.most:
            line = text.count("\n", 0, token.start()) + 1
            if kind != "long":
                raise _too_deep(f"{where} line {line}")
            long = f"{token[0][:20]!r} … has {len(token[0])} characters"
            problem = f"{long}: as a number, date or key, {NUMERAL.most} are the most"
            raise CmmUqError(problem, where=f"{where} line {line}", fix="Put text in quotes")


def _too_deep(where: str) -> CmmUqError:
    return CmmUqError("is nested too deeply", where=where, fix=f"{DEPTH.most} levels are the most")


def _items(data: dict[str, Any], where: str) -> Iterator[tuple[str, Any]]:
    """Everything in it with its key, without recursion."""
    left: list[tuple[str, Any, int]] = [("", data, 0)]
    while left:
        key, item, depth = left.pop()
        if depth > DEPTH.most:
            raise _too_deep(where)
        yield key, item
        if isinstance(item, dict):
            left.extend((f"{key}.{name}" if key else name, value, depth + 1) for name, value in item.items())
        elif isinstance(item, list):
            left.extend((key, value, depth + 1) for value in item if isinstance(value, (dict, list, str)))


def _check_item(key: str, item: Any, where: str, most_word: int, most_listed: int) -> None:
    place = f"{where}: {key}"
    if isinstance(item, dict):
        for name in item:
            if len(name) > TOML_KEY.most:
                raise CmmUqError(f"a key of {len(name)} characters: {name[:20]!r} …", where=place,
                                 fix=f"{TOML_KEY.most} are the most")  # fmt: skip
            _check_characters(name, place)
    elif isinstance(item, list) and len(item) > most_listed:
        raise CmmUqError(f"has {len(item)} entries", where=place, fix=f"{most_listed} are the most")
    elif isinstance(item, str):
        _check_characters(item, place)
        if len(item) > TEXT.most:
            raise CmmUqError(f"a text of {len(item)} characters", where=place, fix=f"{TEXT.most} are the most")
        word = max(map(len, item.split()), default=0)
        if word > most_word:
            raise CmmUqError(f"a word of {word} characters", where=place,
                             fix=f"{most_word} are the most: shorten it, or put blanks into it")  # fmt: skip


def _check_characters(text: str, place: str) -> None:
    if text.isascii() and text.isprintable():
        return
    for c in text:
        if unicodedata.category(c)[0] == "C" and c not in "\n\t\r" and c not in _MARKS:
            raise CmmUqError(f"has the control character U+{ord(c):04X} in it", where=place, fix="Remove it")


Facts = TypeVar("Facts", bound=BaseModel)

# of the names that stand in a location for one of several tables that a key may have, none of which the user wrote
_CHOICE = re.compile("GuardBand|FalseAccept|UncertaintyRatio|PosteriorProbability|UnconditionalRisk|literal")
_ONE_MEANT = re.compile(r"Did you mean '([^']*)'\?")
_SHOWN = 60  # characters of a key or a value in a message


def checked(
    content: bytes, path: Path, model: type[Facts] | Callable[[dict[str, Any]], type[Facts]], context: object = None,
    *, most_word: int = WORD.most, most_listed: int = LISTED.most,
    beside: Callable[[dict[str, Any]], dict[str, Any]] | None = None,
) -> Facts:  # fmt: skip
    """The contents of a TOML file as a checked object."""
    text = text_of(content, str(path))
    try:
        data = toml_of(text, str(path), most_word=most_word, most_listed=most_listed)
    except tomllib.TOMLDecodeError as error:
        fix = "Text stands in quotes, dates as 2026-01-31, decimals with a point"
        invalid = CmmUqError(f"is not valid TOML: {error}", where=str(path), fix=fix)
        raise _said_twice(str(error), text, str(path)) or invalid from None
    data = data if beside is None else beside(data)
    table = cast("type[Facts]", model if isinstance(model, type) else model(data))
    try:
        return table.model_validate(data, context=context)
    except ValidationError as error:
        # of a key that may be several things, what is wrong as the first of them
        problems: dict[tuple[str, ...], CmmUqError] = {}
        for details in error.errors(include_url=False):
            named = _named(details)
            if tuple(named) not in problems:
                problems[tuple(named)] = _located(details, named, text, path, table)
        first, *others = list(problems.values())[:MOST_GATHERED]
        first.also = tuple(others)
        raise first from None


def as_toml(data: Mapping[str, Any], where: str) -> bytes:
    """Tables, lists, texts, numbers, dates and truth values as the bytes of a TOML file; ``None`` leaves its key out."""
    try:
        return tomlkit.dumps(_plain(data)).encode()
    except (TOMLKitError, TypeError, ValueError) as error:
        raise CmmUqError(f"holds what TOML cannot say: {error}", where=where,
                         fix="Give texts, numbers, dates, lists and tables") from None  # fmt: skip


def nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table in which dotted keys, such as ``certificate.file``, are keys of tables, over what stands in these."""
    found = {key: value for key, value in table.items() if "." not in key}
    for dotted in table.keys() - found.keys():
        *above, last = dotted.split(".")
        inner = found
        for name in above:
            there = inner.get(name)
            inner[name] = inner = dict(there) if isinstance(there, Mapping) else {}
        inner[last] = table[dotted]
    return found


def _plain(value: Any) -> Any:
    """Without keys that say nothing, and with Python's numbers instead of NumPy's."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _named(error: ErrorDetails) -> list[str]:
    """Keys that the user wrote, of the location of an error."""
    keys = [str(part) for part in error["loc"] if not (isinstance(part, str) and ("[" in part or "(" in part))]
    return [key for key in keys if not _CHOICE.match(key)] or [str(error["loc"][0])]


def _located(error: ErrorDetails, named: list[str], text: str, path: Path, model: type[BaseModel]) -> CmmUqError:
    """A validation error, with line and key, as ``[artefact] u_um`` or ``[[conformity]] 1 rule`` of the first of several."""
    line = line_of(named, text)
    table, word, value = _table_of(named[:-1], model), named[-1], error["input"]
    top, *keys = [shortened(key, _SHOWN) for key in named]
    head = f"[[{top}]] {int(keys.pop(0)) + 1}" if keys and keys[0].isdigit() else f"[{top}]"
    where = f"{path}{f' line {line}' if line else ''}: {' '.join(filter(None, (head, '.'.join(keys))))}"
    if error["type"] == "missing":
        return CmmUqError("is missing", where=where, fix=f"Add it to {path.name}.{_explained(word, table)}".rstrip("."))
    if error["type"] == "extra_forbidden":
        return CmmUqError("unknown key", where=where, fix=_meant(shortened(word, _SHOWN), table))
    message = error["msg"].removeprefix("Value error, ")
    if error["type"] == "model_type":
        message = "must be a table of keys"
    tables = isinstance(value, dict) or (isinstance(value, list) and any(isinstance(item, dict) for item in value))
    shown = "" if tables else f" (it says {shortened(repr(value), _SHOWN)})"
    return CmmUqError(f"{message[0].lower()}{message[1:]}{shown}", where=where, fix=_near(error))


_WRITTEN: Mapping[str, str] = {
    "float_type": "Write a number without quotes, with a decimal point",
    "int_type": "Write a whole number without quotes",
    "int_from_float": "Write a whole number",
    "bool_type": "Write true or false, without quotes",
    "string_type": "Put it in quotes",
    "date_type": "Write it as 2026-01-31, without quotes",
    "date_from_datetime_parsing": "Write it as 2026-01-31, without quotes",
    "list_type": "Put it in brackets: [ … ]",
    "tuple_type": "Put it in brackets: [ … ]",
}
"""How a value of each type is written in TOML, by the reader's name of the mistake."""


def _meant(word: str, table: type[BaseModel] | None) -> str:
    """The key that an unknown one may stand for, with its sentence."""
    known = [] if table is None else [field.alias or name for name, field in table.model_fields.items()]
    if converted := conversion(word, known):
        return converted
    meant = suggestion(word, known)
    if (match := _ONE_MEANT.fullmatch(meant)) is not None:
        return f"{meant}{_explained(match[1], table)}"
    noun, _, last = word.partition("_")  # as of a diameter, which another key states
    told = sentences(table).items() if table is not None and last and len(noun) > len("mass") else ()
    named = [key for key, sentence in told if key.endswith(f"_{last}") and noun in sentence.casefold()]
    return f"Did you mean {named[0]!r}?{_explained(named[0], table)}" if len(named) == 1 else meant


def _explained(key: str, table: type[BaseModel] | None) -> str:
    """The sentence of a key, to follow another; nothing where there is none."""
    sentence = sentences(table).get(key, "") if table is not None else ""
    return f" {sentence.rstrip('.')}" if sentence else ""


def _near(error: ErrorDetails) -> str | None:
    """Of the words that a key may have, the one that a wrong word is near to; of other values, how they are written."""
    given = error["input"]
    if error["type"] == "list_type" and isinstance(given, dict):
        return f"Head it [[{'.'.join(_named(error))}]], in double brackets"
    if error["type"] != "literal_error" or not isinstance(given, str):
        return _WRITTEN.get(error["type"])
    words = re.findall(r"'([^']*)'", str(error.get("ctx", {}).get("expected", "")))
    meant = suggestion(given, words)
    return meant if _ONE_MEANT.fullmatch(meant) else None


def _table_of(parents: list[str], top: type[BaseModel]) -> type[BaseModel] | None:
    """The class of the table that these keys lead to: ``Table`` itself, ``Table | None`` or ``list[Table]``."""
    model: object = top
    by_name = False
    for parent in parents:
        if parent.isdigit() or by_name:
            by_name = False
            continue
        fields = getattr(model, "model_fields", {})
        if parent not in fields:
            return None
        annotation = fields[parent].annotation
        candidates = (annotation, *getattr(annotation, "__args__", ()))
        model = next((candidate for candidate in candidates if hasattr(candidate, "model_fields")), annotation)
        by_name = get_origin(annotation) is dict
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


_TWICE = re.compile(r"Cannot (?:declare|mutate|overwrite).*\(at line (\d+)")
_NAMED = re.compile(r"""\s*(?:\[{1,2}([^\[\]]+)\]|([\w."' -]+?)\s*=)""")


def _said_twice(error: str, text: str, where: str) -> CmmUqError | None:
    """Of a table or key that stands in a file twice, as ``[artefact.certificate]`` beside ``certificate = { … }``."""
    at, lines, table = _TWICE.search(error), text.splitlines(), ""
    places: dict[int, str] = {}  # dotted name that each line states
    for number, line in enumerate(lines, 1):
        if named := _NAMED.match(line):
            table = table if named[1] is None else named[1].replace(" ", "")
            places[number] = table if named[2] is None else f"{table}.{named[2].strip()}".removeprefix(".")
    own = places.pop(int(at[1]), None) if at else None
    if at is None or own is None:
        return None
    above = [(number, name) for number, name in places.items() if f"{own}.".startswith(f"{name}.")]
    others = [(number, name) for number, name in above if name == own or not lines[number - 1].lstrip().startswith("[")]
    if not others:
        return None
    other, name = others[0]
    fix = f"Keep one of both: write all keys of [{name}] below its heading, or all of them in the line of its key"
    fix = fix if "{" in lines[other - 1] + lines[int(at[1]) - 1] else "Keep one of them"
    return CmmUqError(
        f"states {name} twice: in line {other} and in line {at[1]}", where=f"{where} line {at[1]}", fix=fix
    )


def line_of(keys: list[str], text: str) -> int | None:
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
