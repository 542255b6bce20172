"""Mutations that know what they break: tables of TOML, expressions, lines, bytes; cells have a module of their own."""

from __future__ import annotations

import copy
import csv
import random
import tomllib
from collections.abc import Callable

from benchmarks.hostile.table_mutators import cells, columns, rows_changed
from benchmarks.hostile.toml_text import dumps
from benchmarks.hostile.values import EXPRESSIONS, NUMBERS, WORDS, Raw, value

Mutator = Callable[[bytes, bytes, random.Random], bytes]
"""Of the content, of another file to take parts from, and of chance."""


def toml_values(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """One key of one table changed in value, name or place."""
    tables = tomllib.loads(content.decode("utf-8-sig"))
    places = list(_places(tables))
    table, key = random_.choice(places)
    change = random_.choice(
        ("value", "value", "value", "number", "number", "remove", "rename", "add", "repeat", "exchange")
    )
    if change == "number" and isinstance(table[key], int | float) and not isinstance(table[key], bool):
        factor = random_.choice((-1, 0, 2, 10, 1e-3, 1e3, 1e6, 1e-9, 1.01, 1e300))
        table[key] = table[key] * factor if random_.random() < 0.6 else Raw(random_.choice(NUMBERS))
    elif change == "remove":
        del table[key]
    elif change == "rename" and isinstance(table, dict):
        table[random_.choice((str(key)[:-1] + "x", str(key).upper(), *WORDS[:40], "kind", "u_um"))] = table.pop(key)
    elif change == "add" and isinstance(table, dict):
        table[random_.choice(_KEYS)] = value(random_)
    elif change == "repeat" and isinstance(table[key], list):
        table[key] = table[key] * random_.choice((0, 2, 50, 3000))
    elif change == "exchange":
        elsewhere, there = random_.choice(places)
        table[key] = copy.deepcopy(elsewhere[there])
    else:
        table[key] = value(random_)
    return dumps(tables).encode("utf-8", "replace")


_KEYS = ("kind", "file", "earlier", "length_mm", "u_um", "nominal", "form_um", "axis", "plane", "shifts_mm", "u_shift_um",
         "known", "error_map", "squareness_arcsec", "travel_mm", "origin_mm", "chain", "effects", "tolerances", "limit_um",
         "mpe", "rule", "standard", "set_aside", "u_coordinate_um", "id", "origin", "derived_from", "ready", "criterion",
         "number", "more", "candidates", "repeats", "grid", "pitch_mm", "lengths_mm", "volume_mm", "fixtures", "budget_min",
         "samples", "dof", "unit", "correlation", "seed", "noise", "coverage", "digits", "units", "méthod", "")  # fmt: skip


def _places(item: object) -> list[tuple[dict | list, object]]:
    """Every key of every table and every index of every list."""
    inside = list(item.items()) if isinstance(item, dict) else list(enumerate(item)) if isinstance(item, list) else []
    return [(item, key) for key, _ in inside] + [place for _, each in inside for place in _places(each)]


def expressions(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """Another expression for an output of a measurement model, or one spliced from two."""
    tables = tomllib.loads(content.decode("utf-8-sig"))
    outputs = tables.get("model", {}).get("outputs")
    if not isinstance(outputs, dict) or not outputs:
        return toml_values(content, other, random_)
    name = random_.choice(list(outputs))
    old, new = str(outputs[name]), random_.choice(EXPRESSIONS)
    names = [key for key in tables.get("inputs", {}) if key not in ("x1", "x2")]
    for wanted in ("x1", "x2"):
        new = new.replace(wanted, random_.choice(names)) if names and random_.random() < 0.8 else new
    cut = random_.randrange(len(old) + 1)
    outputs[name] = random_.choice((new, f"{old} + ({new})", old[:cut] + new, old[:cut] + old[cut + 1 :]))
    return dumps(tables).encode("utf-8", "replace")


def tables_of_another(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """One table as it stands in another seed: kinds, recordings and wishes that do not belong together."""
    tables, source = tomllib.loads(content.decode("utf-8-sig")), tomllib.loads(other.decode("utf-8-sig"))
    if not source:
        return content
    name = random_.choice(list(source))
    if random_.random() < 0.5 and isinstance(source[name], dict) and isinstance(tables.get(name), dict):
        key = random_.choice(list(source[name]) or ["x"])
        tables[name][key] = source[name].get(key, 0)
    else:
        tables[name] = source[name]
    return dumps(tables).encode("utf-8", "replace")


def lines_changed(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """A line twice, gone, moved, or one from another file."""
    lines = content.splitlines(keepends=True) or [b"\n"]
    at, to = random_.randrange(len(lines)), random_.randrange(len(lines))
    change = random_.choice(("twice", "gone", "moved", "foreign", "half"))
    if change == "foreign":
        lines.insert(at, random_.choice(other.splitlines(keepends=True) or [b"\n"]))
    elif change == "half":
        lines[at] = lines[at][: random_.randrange(len(lines[at]) + 1)] + b"\n"
    else:
        line = lines.pop(at)
        lines[to:to] = {"twice": [line, line], "gone": [], "moved": [line]}[change]
    return b"".join(lines)


def dressed(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """The same text in other clothes: quoting, delimiters, decimal commas, line ends, encodings, comments."""
    text = content.decode("utf-8", "replace")
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: text.replace(",", ";").encode(), lambda: text.replace(",", "\t").encode(),
        lambda: text.replace(".", ",").encode(), lambda: text.replace("\n", "\r\n").encode(),
        lambda: text.replace("\n", "\r").encode(), lambda: text.encode("utf-16"), lambda: text.encode("utf-16-be"),
        lambda: text.encode("utf-32"), lambda: b"\xef\xbb\xbf" + content, lambda: ("µ" + text).encode("latin-1", "replace"),
        lambda: b'"' + content, lambda: content + b'"', lambda: text.replace(",", '","').encode(),
        lambda: ("\n".join(f'"{line}"' for line in text.splitlines())).encode(), lambda: b"# note\n" * 50 + content,
        lambda: b"\n" * 5000 + content, lambda: content.replace(b"\n", b"\n\n"), lambda: content.strip(),
        lambda: content.replace(b"\n", b"\x0b"), lambda: content.replace(b"\n", "\u2028".encode()),
        lambda: content.replace(b",", b" , "), lambda: content.replace(b"0", "٠".encode()), lambda: b"sep=,\n" + content,
    )  # fmt: skip
    return random_.choice(kinds)()


def raw_bytes(content: bytes, other: bytes, random_: random.Random) -> bytes:
    """Bits flipped, bytes cut, put in, repeated or spliced with another file."""
    data = bytearray(content or b"\n")
    change = random_.choice(("flip", "flip", "cut", "truncate", "insert", "repeat", "splice", "empty", "noise"))
    at = random_.randrange(len(data))
    to = min(len(data), at + random_.choice((1, 2, 10, 100)))
    if change == "flip":
        for _ in range(random_.choice((1, 1, 2, 8))):
            data[random_.randrange(len(data))] ^= 1 << random_.randrange(8)
    elif change == "cut":
        del data[at:to]
    elif change == "truncate":
        del data[at:]
    elif change == "insert":
        data[at:at] = random_.choice(
            (b"\0", b"\xff\xfe", b"\x80", b"\x1b[2J", b"[[", b"\n[", b"=", b'"""', b"'''", b"," * 3000)
        )
    elif change == "repeat":
        data[at:at] = data[at:to] * random_.choice((1, 3, 300))
    elif change == "splice":
        data[at:] = other[random_.randrange(len(other) + 1) :]
    else:
        data = bytearray() if change == "empty" else bytearray(random_.randbytes(random_.choice((1, 50, 3000))))
    return bytes(data)


TOML: tuple[Mutator, ...] = (
    toml_values,
    toml_values,
    toml_values,
    toml_values,
    tables_of_another,
    lines_changed,
    dressed,
    raw_bytes,
)
BUDGET: tuple[Mutator, ...] = (
    toml_values,
    toml_values,
    expressions,
    expressions,
    tables_of_another,
    lines_changed,
    raw_bytes,
)
TABLE: tuple[Mutator, ...] = (
    cells,
    cells,
    cells,
    columns,
    columns,
    rows_changed,
    rows_changed,
    lines_changed,
    dressed,
    raw_bytes,
)


def mutate(name: str, content: bytes, other: bytes, random_: random.Random) -> tuple[str, bytes]:
    """The content of a file, mutated once; a mutation that needs a readable file falls back to its bytes."""
    family = TABLE if name.endswith(".csv") else BUDGET if name == "budget.toml" else TOML
    chosen = random_.choice(family)
    try:
        return chosen.__name__, chosen(content, other, random_)
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError, csv.Error):
        return raw_bytes.__name__, raw_bytes(content, other, random_)
