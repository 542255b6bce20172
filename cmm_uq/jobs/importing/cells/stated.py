"""What an export says of its measurement around the table: date, temperatures, machine, limit; offered with its words.

Nothing of it is taken by itself: a file may mean another date or another thermometer. What can be read in two ways, or is
said twice and differently, has no value, only the words.
"""

from __future__ import annotations

import datetime as dt
import re
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import suppress

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.importing.cells.encodings import decoded, is_number
from cmm_uq.jobs.importing.format import FileKeys, Format, ImportKeys, format_of
from cmm_uq.jobs.importing.header import printed_words, text_of

_FIRST, _LAST, _LONGEST = 300, 60, 400  # lines at both ends that are looked at, and characters of one
_SHOWN, _MOST = 90, 12  # characters of the words, and cells of a line that says what a machine is
_CELLS = re.compile(r"[\t;|]|\s{2,}|\"?,\"|,(?!\d)|(?<!\d),")
_WORDS = {name: "|".join(parts) for name, parts in printed_words("stated").items()}
_MONTHS = _WORDS["months"].split("|")
_WHOLE = r"(?<![^\W_])(?:{})\.?(?![^\W_])|{}"  # a word by itself, or a part of one
_DAY, _SERIAL = (re.compile(_WHOLE.format(_WORDS[name], _WORDS[f"{name}_within"])) for name in ("day", "serial"))
_OTHER_DAY, _WARMTH, _NO_WARMTH, _OF_ARTEFACT, _OF_SCALE, _OF_INSTRUMENT = (
    re.compile(_WORDS[name]) for name in ("other_day", "warmth", "no_warmth", "artefact", "scale", "instrument")
)
_MACHINE = re.compile(
    rf"^\W*(?:measuring |mess|mer)?(?:{_WORDS['machine']})(?: model| type| name)?\s*(?P<rest>[:=.].*)?$"
)
_DATES = (
    re.compile(r"(?<!\d)(?P<y>(?:19|20)\d\d)\s?[-/.年년]\s?(?P<m>\d{1,2})\s?[-/.月월]\s?(?P<d>\d{1,2})(?!\d)"),
    re.compile(r"(?<!\d)(?P<d>\d{1,2})(?P<sign>\.|\. |/|-)(?P<m>\d{1,2})(?P=sign)(?P<y>(?:19|20)\d\d)(?!\d)"),
    re.compile(r"(?<!\d)(?P<d>\d{1,2})[. -]{1,2}(?P<name>[^\W\d]{3,9})\.?,?[ -](?P<y>(?:19|20)\d\d)(?!\d)"),
    re.compile(r"(?<!\w)(?P<name>[^\W\d]{3,9})\.?\s(?P<d>\d{1,2}),?\s(?P<y>(?:19|20)\d\d)(?!\d)"),
    re.compile(r"(?<!\d)(?P<y>20\d\d)(?P<m>\d\d)(?P<d>\d\d)(?!\d)"),
)
_ODD_DATE = re.compile(r"(?<!\d)\d{1,2}[-/.]\d{1,2}[-/.]\d\d(?!\d)")
_FIGURE = re.compile(r"(?<![\d.,±/])[-+]?\d{1,3}(?:[.,]\d{1,3})?(?![\d.,]*\d)")
_FAHRENHEIT = re.compile(r"°\s?f\b|\(f\)|\bdegf\b|\d\s?f\b", re.IGNORECASE)
_COLDEST, _WARMEST = 10.0, 40.0  # °C, of rooms where machines are calibrated
_DEVICE = re.compile(r"\bDMEID\s*/\s*'([^']{3,60})'")
_OF_SERIAL = re.compile(r"[\s:.№#=]*([\w][\w./-]*(?: \d[\w.-]*)?)")
_LIMIT = re.compile(
    r"(?<![\d.,])\d{1,2}(?:[.,]\d{1,3})?\s?\+\s?(?:\d{1,2}(?:[.,]\d{1,3})?\s?[*·×]?\s?)?L\s?/\s?\d{2,4}(?![.,\d])"
)
AIR, ARTEFACT = "recording.constant.temp_air_c", "recording.constant.temp_artefact_c"
_LABELS = {
    "job.date": "date of the measurement",
    AIR: "temperature of the air",
    ARTEFACT: "temperature of the artefact",
    "machine.name": "machine",
    "machine.serial": "serial number of the machine",
    "conformity.mpe": "limit",
}


@dataclass(frozen=True)
class Offer:
    """What a file says: key of job.toml, its value, empty where the words leave it open, and the words with their line."""

    key: str
    value: str
    words: str
    line: int

    @property
    def row(self) -> tuple[Text, Text]:
        return Verbatim(_LABELS[self.key].capitalize()), Verbatim(str(self))

    @property
    def taken(self) -> bool:
        """Whether it may be taken over as it is; lengths that a program corrected already would be corrected once more."""
        return bool(self.value) and self.key != ARTEFACT

    @property
    def setting(self) -> str:
        """As ``--set`` takes it: a serial number that looks like a figure is a text."""
        return f'{self.key}="{self.value}"' if self.key == "machine.serial" else f"{self.key}={self.value}"

    def __str__(self) -> str:
        return (
            f"{self.value}, by line {self.line}: {self.words}" if self.value else f"line {self.line} says: {self.words}"
        )


def offers(content: bytes, where: str, keys: FileKeys) -> tuple[Offer, ...]:
    """One of each key that the file says anything of; none of what cannot be read."""
    try:
        lines = [*_lines(format_of(content, where), content, where, keys)]
    except CmmUqError:  # which reading it tells
        return ()
    by_key: dict[str, list[Offer]] = {}
    for one in (*_days(lines), *_warmths(lines), *_machines(lines), *_limits(lines)):
        by_key.setdefault(one.key, []).append(one)
    return tuple(_one(same) for same in by_key.values())


def _one(same: Sequence[Offer]) -> Offer:
    """The one that all agree on, else the first words of each, without a value."""
    if len({one.value for one in same}) == 1:
        return same[0]
    words = "; ".join(dict.fromkeys(one.words for one in same))
    return Offer(same[0].key, "", words[: 2 * _SHOWN], same[0].line)


Line = tuple[int, str, list[str]]  # number, text, cells


def _lines(form: Format, content: bytes, where: str, keys: FileKeys) -> Iterator[Line]:
    """Lines at both ends of a file, as text and as cells; tags of a page or a document are what parts them."""
    if content.startswith(b"PK"):
        sheets = form.read(content, where, ImportKeys())
        rows = [(n, "\t".join(map(text_of, row))) for one in sheets for row, n in zip(one.rows, one.lines, strict=True)]
    else:
        rows = [*enumerate(_plain(form.name, decoded(content, where, keys.encoding)[0]).splitlines(), 1)]
    both = rows if len(rows) <= _FIRST + _LAST else [*rows[:_FIRST], *rows[-_LAST:]]
    for number, text in both:
        cells = [cell.strip("\" \u00a0'") for cell in _CELLS.split(text)] if len(text) < _LONGEST else []
        words = [cell for cell in cells if cell and not is_number(cell)]
        if words:
            yield number, text, [cell for cell in cells if cell]


def _plain(form: str, text: str) -> str:
    if form in ("html", "qif", "xml", "dcc"):
        begun = r"</t[dh]\s*>|<(?!/)([\w:]{1,40})[^<>]{0,200}>"
        text = re.sub(begun, lambda of: f"\t{of[1]}: " if of[1] and form != "html" else "\t", text)
        text = re.sub(r"</?[^<>]{1,200}>", "\t", text)
        return text.replace("&nbsp;", " ").replace("&deg;", "°")
    return text.replace('"', "").replace(": ", ":\t") if form == "json" else text


def _folded(text: str) -> str:
    plain = unicodedata.normalize("NFKD", text.casefold().translate(str.maketrans("ıøłđ№", "ioldn")))
    return unicodedata.normalize("NFC", "".join(one for one in plain if not unicodedata.combining(one)))


def _valued(cells: Sequence[str], label: re.Pattern[str]) -> Iterator[tuple[str, str]]:
    """Each label with what stands behind it in its cell, or else with the next cells."""
    folded = [*map(_folded, cells)]
    for k, text in enumerate(folded):
        for match in label.finditer(text):
            behind = cells[k][match.end() :] if len(text) == len(cells[k]) else text[match.end() :]
            yield cells[k], behind if re.search(r"\d", behind) else "\t".join(cells[k + 1 : k + 3])


def _days(lines: Sequence[Line]) -> Iterator[Offer]:
    called, others = list[tuple[int, str, str]](), list[tuple[int, str, str]]()
    for number, text, cells in lines:
        own = [(label, value) for label, value in _valued(cells, _DAY) if not _OTHER_DAY.search(_folded(label))]
        plain = text.strip()
        own += [(plain, plain)] if re.match(r"DATE\s*[/=]", plain) else []
        called += [(number, label, value) for label, value in own if _date_in(value) or _ODD_DATE.search(value)]
        others += [(number, "", cell) for cell in cells if _date_in(cell) and not _OTHER_DAY.search(_folded(text))]
    texts = [value for *_, value in (*called, *others)]
    for number, label, value in called or others:
        day = _day_of(value, texts, label) if called else None
        yield Offer("job.date", day.isoformat() if day else "", _words(label, value), number)
        if not called:
            return


def _date_in(text: str) -> re.Match[str] | None:
    found = (match for one in _DATES if (match := one.search(text)))
    return next((one for one in found if "name" not in one.groupdict() or _month(one["name"]) > 0), None)


def _month(name: str) -> int:
    short = _folded(name)[:3]
    return next((k for k, names in enumerate(_MONTHS, 1) if short in names.split()), 0)


def _day_of(text: str, every: Sequence[str], label: str) -> dt.date | None:
    """The date of a text; of one with the month perhaps ahead of the day only where others, or the language, tell which."""
    found = _date_in(text)
    if found is None:
        return None
    parts = found.groupdict()
    day, month = int(found["d"]), _month(found["name"]) if parts.get("name") else int(found["m"])
    if parts.get("sign") in ("/", "-"):
        alike = [one for text in every if (one := _DATES[1].search(text)) and one["sign"] in "/-"]
        pairs = [(int(one["d"]), int(one["m"])) for one in alike]
        swapped, kept = any(m > 12 for _, m in pairs), any(d > 12 for d, _ in pairs)
        kept |= not re.search(r"\bdate\b", _folded(label)) and not swapped
        if swapped == kept and day != month:
            return None
        day, month = (month, day) if swapped else (day, month)
    with suppress(ValueError):
        return dt.date(int(found["y"]), month, day)
    return None


def _warmths(lines: Sequence[Line]) -> Iterator[Offer]:
    for number, _, cells in lines:
        for label, value in _valued(cells, _WARMTH):
            whole = _folded(f"{label} {value}")
            figures = [float(one.replace(",", ".")) for one in _FIGURE.findall(value.replace("−", "-"))]
            if _NO_WARMTH.search(whole) or not figures:
                continue
            if _FAHRENHEIT.search(f"{label} {value}"):
                figures = [round((one - 32) / 1.8, 2) for one in figures]
            fit = [*dict.fromkeys(one for one in figures if _COLDEST <= one <= _WARMEST)]
            of = _folded(label)
            key = ARTEFACT if _OF_ARTEFACT.search(of) else "" if _OF_SCALE.search(of) else AIR
            if fit and key:
                yield Offer(key, f"{fit[0]:g}" if len(fit) == 1 else "", _words(label, value), number)


def _machines(lines: Sequence[Line]) -> Iterator[Offer]:
    for place, (number, text, cells) in enumerate(lines[:_LAST]):
        device, folded = _DEVICE.search(text), [*map(_folded, cells)]
        k, match = next(((k, m) for k, one in enumerate(folded) if (m := _MACHINE.match(one))), (0, None))
        if (device is None and match is None) or len(cells) > _MOST:
            continue  # or the head of a table
        name = device[1] if device else cells[k].partition(match["rest"][0])[2] if match and match["rest"] else ""
        name = (name.strip(" .:=") or next((one for one in cells[k + 1 :] if device is None), "")).strip(" :")
        serial = _SERIAL.search(_folded(name))
        if serial is not None and len(_folded(name)) == len(name):
            name = name[: serial.start()].rstrip(" ,(-")
        if not re.search(r"[^\W\d]{2}", name) or sum(map(is_number, cells)) > 2:
            continue
        yield Offer("machine.name", name[:_SHOWN], _short(text), number)
        for line, own, near in lines[place : place + 3]:
            beside = [*_valued(near[k:] if line == number else near, _SERIAL)]
            if line != number and any(one.search(_folded(own)) for one in (_OF_ARTEFACT, _OF_INSTRUMENT)):
                continue
            token = _OF_SERIAL.match(beside[0][1]) if beside else None
            if token is not None and re.search(r"\d", token[1]):
                yield Offer("machine.serial", token[1].rstrip(".,-"), _short(own), line)
                break
        return


def _limits(lines: Sequence[Line]) -> Iterator[Offer]:
    for number, text, _ in lines:
        plain = unicodedata.normalize("NFKC", text)
        if (found := _LIMIT.search(plain)) and not re.search(r"(?i)\bu\b|uncert|unsich|k\s?=\s?2", plain):
            yield Offer("conformity.mpe", found[0].replace(" ", "").replace("+", " + "), _short(text), number)


def _words(label: str, value: str) -> str:
    """A label with its value, which may stand in it."""
    return _short(label if label and _folded(value) in _folded(label) else f"{label} {value}")


def _short(text: str) -> str:
    return " ".join(text.split())[:_SHOWN].rstrip(" .,;")
