"""How a class of the DCC stands in XML: its fields as attributes, elements, choices or text, and the simple types of these.

Simple types of the schemas: what the text of an element or an attribute may be, and what it is in Python.

Numbers are :class:`~decimal.Decimal`, so that a certificate keeps the digits it was printed with.

How the fields of a class stand in XML: as an attribute, an element, several, one of a choice, or the text itself.

A class of the model is a :class:`Part` whose fields, in the order of the schema, are annotated so. A field without a default
has to be there. Parts are made without :mod:`dataclasses`, which would take longer to make seventy classes than it takes to
write a certificate.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from types import MappingProxyType, NoneType
from typing import Any, ClassVar, NoReturn, Self, dataclass_transform, get_args, get_type_hints

from cmm_uq.base.files.limits import NUMERAL


@dataclass(frozen=True, eq=False)
class Simple:
    """A simple type.

    what : it is, after "is not": "a date".
    read : value of a text; raises ``ValueError`` where it is none.
    write : text of a value; what ``read`` refuses is not written.
    """

    what: str
    read: Callable[[str], Any]
    write: Callable[[Any], str] = str


def _matching(what: str, pattern: str) -> Simple:
    wanted = re.compile(pattern)

    def read(text: str) -> str:
        if wanted.fullmatch(text) is None:
            raise ValueError(text)
        return text

    return Simple(what, read)


def one_of(*words: str) -> Simple:
    return _matching(f"one of {', '.join(words)}", "|".join(words))


def listed(simple: Simple, plural: str) -> Simple:
    """A list of them, with spaces between."""
    return Simple(
        f"a list of {plural}",
        lambda text: tuple(simple.read(part) for part in text.split()),
        lambda values: " ".join(simple.write(value) for value in values),
    )


def _number(what: str, pattern: str, write: Callable[[Decimal], str] = str) -> Simple:
    wanted = re.compile(pattern)

    def read(text: str) -> Decimal:
        text = text.strip()
        if len(text) > NUMERAL.most or wanted.fullmatch(text) is None:
            raise ValueError(text)
        try:
            value = Decimal(text)
        except InvalidOperation:
            raise ValueError(text) from None
        if not math.isfinite(float(value)):
            raise ValueError(text)
        return value

    return Simple(what, read, write)


def _plain(value: Decimal) -> str:
    return format(value, "f")


def _not_empty(text: str) -> str:
    if not text or text != text.strip():
        raise ValueError(text)
    return text


def _boolean(text: str) -> bool:
    return {"true": True, "1": True, "false": False, "0": False}[text.strip()]


def _bytes(text: str) -> bytes:
    try:
        return b64decode("".join(text.split()), validate=True)
    except Base64Error as error:
        raise ValueError(text) from error


_UNSIGNED = r"((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"

STRING = Simple("a text", str)
NOT_EMPTY = Simple("a text without spaces at its ends", _not_empty)
BOOLEAN = Simple("true or false", _boolean, lambda value: "true" if value else "false")
DATE = Simple("a date", lambda text: dt.date.fromisoformat(text.strip()[:10]), dt.date.isoformat)
DATE_TIME = Simple("a date with time", lambda text: dt.datetime.fromisoformat(text.strip()), dt.datetime.isoformat)
BYTES = Simple("base64", _bytes, lambda data: b64encode(data).decode())
COUNTRY = _matching("a country of ISO 3166-1, two capital letters", "[A-Z]{2}")
LANGUAGE = _matching("a language of ISO 639-1, two small letters", "[a-z]{2}")
NAME = _matching("a name that XML takes as an id", r"[^\W\d][\w.\-]*")
DECIMAL = _number("a number", rf"[-+]?{_UNSIGNED}")
UNCERTAINTY = _number("a number, 0 or more", rf"\+?{_UNSIGNED}")
FACTOR = _number("a coverage factor, 1 or more", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))", _plain)
PROBABILITY = _number("a probability", r"\+?((0(\.\d*)?)|(1(\.0*)?))", _plain)

NAMES = listed(NAME, "ids")
STRINGS = listed(NOT_EMPTY, "words")
BOOLEANS = listed(BOOLEAN, "true and false")
DATE_TIMES = listed(DATE_TIME, "dates with times")
DECIMALS = listed(DECIMAL, "numbers")
UNCERTAINTIES = listed(UNCERTAINTY, "numbers, 0 or more")
FACTORS = listed(FACTOR, "coverage factors, 1 or more")
PROBABILITIES = listed(PROBABILITY, "probabilities")


_LAST = ("id", "ref_id", "ref_type")
"""Fields that stand behind all others of a class, in this order."""


class _Missing:
    """In place of a default."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Element:
    """A part of a certificate: a frozen record, equal to another of its class with the same fields.

    SPACE : prefix of the namespace of its elements.
    UNORDERED : whether these may stand in any order.
    """

    SPACE: ClassVar[str] = "dcc"
    UNORDERED: ClassVar[bool] = False
    FIELDS: ClassVar[Mapping[str, Any]] = MappingProxyType({})

    def __init_subclass__(cls, *, kw_only: bool = True) -> None:
        own = [name for name, hint in cls.__annotations__.items() if not hint.startswith("ClassVar")]
        fields = {**cls.FIELDS, **{name: cls.__dict__.get(name, _Missing) for name in own}}
        last = {name: fields.pop(name) for name in _LAST if name in fields}
        cls.FIELDS = MappingProxyType(fields | last)

    def __init__(self, *given: Any, **named: Any) -> None:
        values = {**self.FIELDS, **dict(zip(self.FIELDS, given, strict=False)), **named}
        if len(values) > len(self.FIELDS) or _Missing in values.values():
            unknown, lacking = values.keys() - self.FIELDS.keys(), [name for name in values if values[name] is _Missing]
            raise TypeError(f"{type(self).__name__} takes no {sorted(unknown)} and needs {lacking}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} is frozen")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        said = (f"{name}={value!r}" for name, value in self.__dict__.items() if value != self.FIELDS[name])
        return f"{type(self).__name__}({', '.join(said)})"

    def with_changes(self, **changes: Any) -> Self:
        """The same with other values of some fields."""
        return type(self)(**{**self.__dict__, **changes})


@dataclass(frozen=True)
class Attribute:
    """An attribute of the element."""

    tag: str
    simple: Simple


@dataclass(frozen=True)
class Child:
    """An element; of the class that is annotated, or simple."""

    tag: str
    simple: Simple | None = None


@dataclass(frozen=True)
class Many:
    """Elements one after the other; in an element of their own where ``within`` names it."""

    tag: str
    simple: Simple | None = None
    within: str | None = None


@dataclass(frozen=True)
class Choice:
    """One of several elements; their names, in the order of the classes that are annotated."""

    tags: tuple[str, ...]
    many: bool = False


@dataclass(frozen=True)
class Content:
    """The text of the element itself."""

    simple: Simple


@dataclass(frozen=True)
class ForeignElements:
    """Elements of other namespaces, as they stand."""


Place = Attribute | Child | Many | Choice | Content | ForeignElements


@dataclass(frozen=True)
class Field:
    """A field of a class.

    name : of it.
    place : in XML.
    tags : of its elements, with prefix, and the class of each; none of a simple one.
    required : whether it has to be there.
    """

    name: str
    place: Place
    tags: Mapping[str, type[Element] | None]
    required: bool

    @property
    def repeated(self) -> bool:
        return isinstance(self.place, Many | ForeignElements) or (isinstance(self.place, Choice) and self.place.many)

    @property
    def outer(self) -> tuple[str, ...]:
        """Tags by which it is known among the children."""
        if isinstance(self.place, Many) and self.place.within:
            return (prefixed(self.place.within, next(iter(self.tags)).partition(":")[0]),)
        return tuple(self.tags)


def prefixed(tag: str, space: str) -> str:
    return tag if ":" in tag else f"{space}:{tag}"


def fields_of(cls: type[Element]) -> tuple[Field, ...]:
    """How a class stands in XML."""
    if cls not in _FIELDS:
        hints = get_type_hints(cls, include_extras=True)
        _FIELDS[cls] = tuple(
            _field(name, hints[name], cls.SPACE, default is _Missing) for name, default in cls.FIELDS.items()
        )
    return _FIELDS[cls]


_FIELDS: dict[type[Element], tuple[Field, ...]] = {}
"""What was asked for before."""


def _field(name: str, hint: Any, space: str, required: bool) -> Field:
    annotated, place = hint.__origin__, hint.__metadata__[0]
    if isinstance(place, Choice):
        tags: dict[str, type[Element] | None] = dict(
            zip((prefixed(tag, space) for tag in place.tags), _classes(annotated), strict=True)
        )
    elif isinstance(place, Child | Many):
        tags = {prefixed(place.tag, space): None if place.simple else _classes(annotated)[0]}
    else:
        tags = {}
    return Field(name, place, tags, required)


def _classes(annotated: Any) -> list[type[Element]]:
    """The classes of an annotation, without None and the tuple around them."""
    parts = get_args(annotated)
    if not parts:
        return [annotated]
    return [cls for part in parts if part not in (NoneType, Ellipsis) for cls in _classes(part)]


def by_tag(cls: type[Element]) -> Mapping[str, int]:
    """Index of the field that an element belongs to."""
    return {tag: i for i, field in enumerate(fields_of(cls)) for tag in field.outer}
