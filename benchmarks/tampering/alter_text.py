"""Single alterations of texts: HTML, results.json, XML and inputs; bytes in, bytes and words out, nothing of the package."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Mapping

Altered = tuple[bytes, str]
"""What became of a file, and what was done."""

_DIGIT = re.compile(rb"\d")
_DATE = re.compile(rb"\d{4}-\d\d-\d\d")
_NUMBER = re.compile(rb"(?<![\w.#-])-?\d+\.\d+")
_UNITS = ((b"\xc2\xb5m", b"mm"), (b"ppm", b"ppb"), (b"\xe2\x80\xb3", b"\xe2\x80\xb2"), (b"mm", b"cm"))
_HASH = re.compile(rb"[0-9a-f]{64}")


def one_byte(content: bytes, rng: random.Random) -> Altered:
    """Any byte, to any other."""
    at = rng.randrange(len(content))
    new = rng.choice([value for value in range(256) if value != content[at]])
    return content[:at] + bytes([new]) + content[at + 1 :], f"byte {at}: {content[at]:02x} to {new:02x}"


def one_digit(content: bytes, rng: random.Random) -> Altered:
    """A digit, to another."""
    found = rng.choice([match.start() for match in _DIGIT.finditer(content)])
    new = rng.choice([digit for digit in b"0123456789" if digit != content[found]])
    return content[:found] + bytes([new]) + content[
        found + 1 :
    ], f"digit at {found}: {chr(content[found])} to {chr(new)}"


def one_number(content: bytes, rng: random.Random) -> Altered:
    """A number with decimals: its sign turned."""
    found = list(_NUMBER.finditer(content))
    if not found:
        return one_digit(content, rng)
    match = rng.choice(found)
    new = match[0][1:] if match[0].startswith(b"-") else b"-" + match[0]
    return content[: match.start()] + new + content[
        match.end() :
    ], f"{match[0].decode()} at {match.start()} to {new.decode()}"


def one_date(content: bytes, rng: random.Random) -> Altered:
    """A date: another year."""
    found = list(_DATE.finditer(content))
    if not found:
        return one_digit(content, rng)
    match = rng.choice(found)
    new = str(int(match[0][:4]) + rng.choice((-1, 1))).encode() + match[0][4:]
    return content[: match.start()] + new + content[match.end() :], f"date {match[0].decode()} to {new.decode()}"


def one_unit(content: bytes, rng: random.Random) -> Altered:
    """A unit, to another."""
    found = [(match, new) for old, new in _UNITS for match in re.finditer(re.escape(old), content)]
    if not found:
        return one_byte(content, rng)
    match, new = rng.choice(found)
    what = f"unit {match[0].decode()} at {match.start()} to {new.decode()}"
    return content[: match.start()] + new + content[match.end() :], what


def one_hash(content: bytes, rng: random.Random) -> Altered:
    """A hash: one digit of it."""
    found = list(_HASH.finditer(content))
    if not found:
        return one_byte(content, rng)
    match = rng.choice(found)
    at = match.start() + rng.randrange(64)
    new = rng.choice([digit for digit in b"0123456789abcdef" if digit != content[at]])
    return content[:at] + bytes([new]) + content[at + 1 :], f"hash at {at}"


def one_line(content: bytes, rng: random.Random) -> Altered:
    """A line removed, doubled, or exchanged with the next."""
    lines = content.split(b"\n")
    pairs = [i for i in range(len(lines) - 1) if lines[i] != lines[i + 1] and lines[i].strip()]
    if not pairs:
        return one_byte(content, rng)
    at, how = rng.choice(pairs), rng.choice(("removed", "doubled", "exchanged with the next"))
    new = {"removed": [], "doubled": [lines[at]] * 2, "exchanged with the next": [lines[at + 1], lines[at]]}[how]
    rest = lines[at + (2 if how.startswith("exchanged") else 1) :]
    return b"\n".join([*lines[:at], *new, *rest]), f"line {at + 1} {how}"


def html_rows(content: bytes, rng: random.Random) -> Altered:
    """Two rows of a table exchanged, or one removed."""
    rows = list(re.finditer(rb"<tr role=\"row\">(?:(?!</tr>).)*<td.*?</tr>", content, re.DOTALL))
    pairs = [
        i for i in range(len(rows) - 1) if rows[i][0] != rows[i + 1][0] and rows[i + 1].start() - rows[i].end() < 4
    ]
    if not pairs:
        return one_digit(content, rng)
    at = rng.choice(pairs)
    a, b = rows[at], rows[at + 1]
    if rng.random() < 0.5:
        return content[: a.start()] + content[a.end() :], f"row {at} removed"
    between = content[a.end() : b.start()]
    return content[: a.start()] + b[0] + between + a[0] + content[b.end() :], f"rows {at} and {at + 1} exchanged"


def html_added(content: bytes, rng: random.Random) -> Altered:
    """Something that hides, acts or overlays."""
    piece = rng.choice((
        b"<script>document.title='x'</script>", b'<p style="display:none">U = 1</p>', b'<img src="http://example.org/x.png">',
        b"<style>.figures{visibility:hidden}</style>", b"<!-- U = 1 -->", b"<p>Also: 3.0</p>", b'<p hidden>3.0</p>',
        b'<div onclick="x()">1</div>', b'<iframe src="x.html"></iframe>', b"&#49;", b'<svg><text x="1" y="1">9</text></svg>',
    ))  # fmt: skip
    places = [match.end() for match in re.finditer(rb"</(?:p|h2|section|figure|dl)>", content)]
    at = rng.choice(places)
    return content[:at] + piece + content[at:], f"{piece.decode()} added at {at}"


def html_picture(content: bytes, rng: random.Random) -> Altered:
    """A coordinate in a picture."""
    found = list(re.finditer(rb'(?<= d=")[^"]*\d[^"]*', content))
    if not found:
        return one_digit(content, rng)
    match = rng.choice(found)
    new, what = one_digit(match[0], rng)
    return content[: match.start()] + new + content[match.end() :], f"picture, {what}"


def html_style(content: bytes, rng: random.Random) -> Altered:
    """A class of an element, which the style goes by."""
    found = list(re.finditer(rb'class="([^"]+)"', content))
    match = rng.choice(found)
    new = rng.choice((b"decision pass", b"note", b"endless", b"banner", b"verdict"))
    if match[1] == new:
        new = b"hidden"
    return content[: match.start(1)] + new + content[match.end(1) :], f"class {match[1].decode()} to {new.decode()}"


def json_value(content: bytes, rng: random.Random) -> Altered:
    """A value of results.json, written as the package writes it."""
    data = json.loads(content)
    places = list(_leaves(data))
    holder, key, value = rng.choice(places)
    holder[key] = _other(value, rng)
    return _written(data), f"{key}: {value!r} to {holder[key]!r}"


def json_keys(content: bytes, rng: random.Random) -> Altered:
    """Two values of one object exchanged, a key removed, or a list turned round."""
    data = json.loads(content)
    objects = [one for one in _holders(data) if len(one) > 1 and len({json.dumps(v) for v in _values(one)}) > 1]
    one = rng.choice(objects)
    if isinstance(one, list):
        before = json.dumps(one)
        one.reverse()
        if json.dumps(one) == before:
            one.pop()
        return _written(data), "a list turned round"
    a, b = rng.sample(list(one), 2)
    if rng.random() < 0.5 or one[a] == one[b]:
        del one[a]
        return _written(data), f"key {a} removed"
    one[a], one[b] = one[b], one[a]
    return _written(data), f"values of {a} and {b} exchanged"


def json_form(content: bytes, rng: random.Random) -> Altered:
    """The same figures written otherwise, a key twice, or what is no number."""
    how = rng.choice(("compact", "twice", "nan", "large", "deep", "sorted"))
    data = json.loads(content)
    if how == "compact":
        return json.dumps(data).encode(), how
    if how == "sorted":
        return json.dumps(data, indent=2, sort_keys=True, ensure_ascii=False).encode() + b"\n", how
    piece = {"twice": b'"schema": "cmm-uq/results/1",', "nan": b'"x": NaN,', "large": b'"x": 1e999,',
             "deep": b'"x": ' + b"[" * 100_000 + b"]" * 100_000 + b","}[how]  # fmt: skip
    return content.replace(b"{", b"{" + piece, 1), how


TEXT = (one_byte, one_digit, one_number, one_date, one_unit, one_line)
HTML = (one_byte, one_digit, one_digit, one_number, one_date, one_unit, html_rows, html_added, html_picture, html_style)
JSON = (
    one_byte,
    one_digit,
    one_digit,
    one_number,
    one_date,
    one_hash,
    one_line,
    json_value,
    json_value,
    json_keys,
    json_form,
)


def _leaves(data: object) -> list[tuple[dict | list, str | int, object]]:
    found = []
    for holder in _holders(data):
        pairs = holder.items() if isinstance(holder, dict) else enumerate(holder)
        found += [(holder, key, value) for key, value in pairs if not isinstance(value, (dict, list))]
    return found


def _holders(data: object) -> list[dict | list]:
    if not isinstance(data, (dict, list)):
        return []
    return [data, *(one for value in _values(data) for one in _holders(value))]


def _values(data: Mapping | list) -> list:
    return list(data.values()) if isinstance(data, dict) else list(data)


def _other(value: object, rng: random.Random) -> object:
    if isinstance(value, bool):
        return not value
    if value is None:
        return 1.0
    if isinstance(value, int):
        return value + rng.choice((-1, 1, 10))
    if isinstance(value, float):
        new = float(f"{value * rng.choice((1 + 1e-9, 1 + 1e-6, 1.01, 2.0, -1.0, 1000.0)):.10g}")
        return new if new != value else value + 1.0
    words = {"pass": "fail", "fail": "pass", "undecided": "pass", "incomplete": "pass", "consistent": "explained"}
    return words.get(str(value), f"{value}x")


def _written(data: object) -> bytes:
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()
