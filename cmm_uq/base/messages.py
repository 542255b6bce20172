"""Text that a document may show: every sentence a message with its arguments, so that it can be said in other languages.

A :class:`Message` is a ``str``, its English text, and keeps the pattern and the arguments that it was made of. What is no
sentence is a :class:`Number`, a :class:`Day`, a unit (:mod:`cmm_uq.base.units`) or :class:`Verbatim`: a name, a serial
number, words of the user. All are :class:`Text`, which is what the blocks of a document are made of. Patterns are
literals where they stand, so that a program can list them; texts are joined by the functions here, never by ``str.join``.
"""

from __future__ import annotations

import datetime as dt
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from html import escape
from types import MappingProxyType
from typing import Any, Self


class Text(str):
    """A text of a known sort; the empty one is :data:`NOTHING`."""

    __slots__ = ()

    def __str__(self) -> str:
        """Itself, of its sort: what asks for a ``str``, as a plot's lettering does, keeps the message."""
        return self

    def __deepcopy__(self, memo: Mapping[int, Any]) -> Self:
        """Itself: nothing of it changes."""
        return self


class Number(Text):
    """A number as printed: rounded, with a decimal point; a locale prints it again from this text."""

    __slots__ = ()


class Day(Text):
    """A date as printed, by ISO 8601."""

    __slots__ = ()


class Verbatim(Text):
    """A text that is the same in every language: a name, a file, an identifier, words of the user or of another package."""

    __slots__ = ()


Argument = Text | float  # what stands in a message: another text, or a number that the pattern says how to round


class Key(Verbatim):
    """Where a job states what a sentence speaks of, for the laboratory; a page for customers is without it."""

    __slots__ = ()


NOTHING = Text("")
DASH = Number("–")  # where a figure does not exist


class Message(Text):
    """A sentence, or words: the English text, with its pattern and arguments.

    Placeholders are those of ``str.format``; ``{why:capital}`` begins with a capital, ``{what:small}`` with a small letter.
    """

    __slots__ = ("arguments", "pattern")

    pattern: str
    arguments: Mapping[str, Argument]

    def __new__(cls, pattern: str, arguments: Mapping[str, Argument]) -> Self:
        parts = parts_of(pattern)
        english = [text + field(arguments[name], spec) if name is not None else text for text, name, spec in parts]
        message = super().__new__(cls, "".join(english))
        kept = {name: value if isinstance(value, Text) else _plain(value) for name, value in arguments.items()}
        message.pattern, message.arguments = pattern, MappingProxyType(kept)
        return message

    def __reduce__(self) -> tuple[type[Message], tuple[str, dict[str, Argument]]]:
        return Message, (self.pattern, dict(self.arguments))


class Plural(Message):
    """A message in the two forms of English, for one and for many; another language chooses by the ``number`` spoken of."""

    __slots__ = ("many", "number", "one")

    number: int
    one: Message
    many: Message

    def __new__(cls, number: int, one: Message, many: Message) -> Self:
        chosen = one if number == 1 else many
        message = super().__new__(cls, chosen.pattern, chosen.arguments)
        message.number, message.one, message.many = number, one, many
        return message

    def __reduce__(self) -> tuple[type[Plural], tuple[int, Message, Message]]:  # type: ignore[override]
        return Plural, (self.number, self.one, self.many)


def _plain(value: float) -> float:
    """A number without the sort that an array gave it."""
    item: Callable[[], float] | None = getattr(value, "item", None)
    return value if item is None else item()


@cache
def parts_of(pattern: str) -> tuple[tuple[str, str | None, str], ...]:
    """Each literal of a pattern with the name and the format of the placeholder behind it; ``None`` behind the last."""
    parts = string.Formatter().parse(pattern)
    return tuple((literal, name, f"!{quoted}" if quoted else spec or "") for literal, name, spec, quoted in parts)


def field(value: Any, spec: str) -> str:
    """One argument; ``capital`` and ``small`` change the first letter of a text, ``!r`` puts it in quotes."""
    if spec == "!r":
        return repr(value)
    if spec not in ("capital", "small"):
        return printed(value, spec)
    first, rest = str.__getitem__(value, slice(0, 1)), str.__getitem__(value, slice(1, None))
    return (first.upper() if spec == "capital" else first.lower()) + rest


def fields_of(pattern: str) -> frozenset[str]:
    """Names of a pattern's placeholders."""
    return frozenset(name for _, name, _ in parts_of(pattern) if name)


def say(pattern: str, /, **arguments: Argument) -> Message:
    """A message; the pattern is a literal and its placeholders are the names of the arguments.

    Examples
    --------
    >>> say("{count} of {total} lengths conform", count=19, total=20)
    '19 of 20 lengths conform'
    """
    return Message(pattern, arguments)


def plural(count: int, *, one: Message, many: Message) -> Plural:
    """A message in the form of a count."""
    return Plural(count, one, many)


def printed(value: Any, spec: str) -> str:
    """As a format specification says; of numbers ``100``, not ``1e+02``, and ``0.00``, not ``-0.00``."""
    text = format(value, spec)
    if spec.endswith("g") and "e+0" in text:
        return f"{float(text):.0f}"
    return text if isinstance(value, str) or text.strip("-0.") else text.removeprefix("-")


def number(value: float, spec: str = "") -> Number:
    """A number rounded as a format specification says: ``number(x, ".2f")``."""
    return Number(printed(value, spec))


def signed(value: float, spec: str) -> Number:
    """The same with the minus sign of print."""
    return Number(printed(value, spec).replace("-", "−"))


def day(date: dt.date) -> Day:
    return Day(date.isoformat())


def names(words: Iterable[str]) -> list[Text]:
    """Names, files, identifiers: each as it stands."""
    return [Verbatim(word) for word in words]


def listed(words: Sequence[Text]) -> Text:
    """Words with commas and an "and"."""
    if len(words) < 2:
        return words[0] if words else NOTHING
    return say("{words} and {last}", words=commas(words[:-1]), last=words[-1])


def _folded(join: Callable[[Text, Text], Message], texts: Iterable[Text]) -> Text:
    """Two by two, so that long lists do not nest deeply."""
    parts = list(texts)
    if len(parts) < 2:
        return parts[0] if parts else NOTHING
    half = len(parts) // 2
    return join(_folded(join, parts[:half]), _folded(join, parts[half:]))


# Texts one after the other: figures of ``in_a_row`` are coordinates, the ends of an interval, values of a list.
alternatives = partial(_folded, lambda before, after: say("{before} or {after}", before=before, after=after))
comma_or = partial(_folded, lambda before, after: say("{before}, or {after}", before=before, after=after))
together = partial(_folded, lambda before, after: say("{before} and {after}", before=before, after=after))
commas = partial(_folded, lambda before, after: say("{before}, {after}", before=before, after=after))
in_a_row = partial(_folded, lambda left, right: say("{left}, {right}", left=left, right=right))
semicolons = partial(_folded, lambda before, after: say("{before}; {after}", before=before, after=after))
sentences = partial(_folded, lambda before, after: say("{before} {after}", before=before, after=after))
lines = partial(_folded, lambda before, after: say("{before}\n{after}", before=before, after=after))


def after(text: Text, further: Text) -> Text:
    """A text and what follows it, where anything does."""
    return sentences(part for part in (text, further) if part)


def holding(*texts: tuple[object, Text]) -> list[Text]:
    """Those texts beside which something true stands."""
    return [text for true, text in texts if true]


def at_key(name: str) -> Key:
    """A key behind what it states, in brackets."""
    return Key(f" ({name})")


def without_keys(text: Text) -> Text:
    """A text for customers: the same words without the keys of a job."""
    if isinstance(text, Key):
        return NOTHING
    if isinstance(text, Plural):
        one, many = without_keys(text.one), without_keys(text.many)
        return Plural(text.number, one, many) if isinstance(one, Message) and isinstance(many, Message) else text
    if isinstance(text, Message):
        found = {name: without_keys(each) if isinstance(each, Text) else each for name, each in text.arguments.items()}
        return Message(text.pattern, found)
    return text


def foreign(text: str) -> Text:
    """Words of another package: a message where it says one, else as they stand."""
    return text if isinstance(text, Text) else Verbatim(text)


def html_table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table for a notebook; every text is escaped. Empty without rows."""
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>" for row in rows)
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>" if body else ""
