"""How a class of the DCC stands in XML: its fields as attributes, elements, choices or text, and the simple types of these.

A class of the model is an :class:`Element` whose fields stand in the order of the schema; one without a default has to be
there. A field is an element of its name in camelCase, and simple by its Python type, where its annotation says nothing else.
Classes are made without :mod:`dataclasses`, which would take longer to make seventy of them than it takes to write a
certificate. Numbers are :class:`~decimal.Decimal`, so that a certificate keeps the digits it was printed with.
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
from typing import Any, ClassVar, NoReturn, Self, dataclass_transform, get_args, get_origin, get_type_hints

from cmm_uq.base.files.limits import NUMERAL


@dataclass(frozen=True, eq=False)
class Simple:
    """What the text of an element or an attribute may be: ``what`` follows "is not", ``read`` raises ValueError."""

    what: str
    plural: str
    read: Callable[[str], Any]
    write: Callable[[Any], str] = str


def matching(what: str, pattern: str, plural: str = "") -> Simple:
    form = re.compile(pattern)

    def read(text: str) -> str:
        if form.fullmatch(text) is None:
            raise ValueError(text)
        return text

    return Simple(what, plural, read)


def one_of(*words: str, plural: str = "") -> Simple:
    return matching(f"one of {', '.join(words)}", "|".join(words), plural)


def listed(simple: Simple) -> Simple:
    """A list of them, with spaces between."""
    return Simple(
        f"a list of {simple.plural}",
        "",
        lambda text: tuple(simple.read(part) for part in text.split()),
        lambda values: " ".join(simple.write(value) for value in values),
    )


def _number(what: str, plural: str, pattern: str, write: Callable[[Decimal], str] = str) -> Simple:
    form = re.compile(pattern)

    def read(text: str) -> Decimal:
        text = text.strip()
        try:
            value = Decimal(text) if len(text) <= NUMERAL.most and form.fullmatch(text) else Decimal("NaN")
        except InvalidOperation:
            raise ValueError(text) from None
        if not math.isfinite(float(value)):
            raise ValueError(text)
        return value

    return Simple(what, plural, read, write)


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
STRING = Simple("a text", "words", str)
NOT_EMPTY = Simple("a text without spaces at its ends", "words", _not_empty)
COUNTRY = matching("a country of ISO 3166-1, two capital letters", "[A-Z]{2}")
LANGUAGE = matching("a language of ISO 639-1, two small letters", "[a-z]{2}")
NAME = matching("a name that XML takes as an id", r"[^\W\d][\w.\-]*", "ids")
DECIMAL = _number("a number", "numbers", rf"[-+]?{_UNSIGNED}")
UNCERTAINTY = _number("a number, 0 or more", "numbers, 0 or more", rf"\+?{_UNSIGNED}")
FACTOR = _number(
    "a coverage factor, 1 or more", "coverage factors, 1 or more", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))", _plain
)
PROBABILITY = _number("a probability", "probabilities", r"\+?((0(\.\d*)?)|(1(\.0*)?))", _plain)
_BY_TYPE: Mapping[type, Simple] = {
    str: NOT_EMPTY, Decimal: DECIMAL,
    bool: Simple("true or false", "true and false", _boolean, lambda value: "true" if value else "false"),
    bytes: Simple("base64", "", _bytes, lambda data: b64encode(data).decode()),
    dt.date: Simple("a date", "", lambda text: dt.date.fromisoformat(text.strip()[:10]), dt.date.isoformat),
    dt.datetime: Simple("a date with time", "dates with times", lambda text: dt.datetime.fromisoformat(text.strip()),
                        dt.datetime.isoformat),
}  # fmt: skip

_LAST = ("id", "ref_id", "ref_type")  # fields that stand behind all others of a class, in this order
_MISSING = object()  # in place of a default


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Element:
    """A frozen record of a certificate; ``SPACE`` is the namespace's prefix, ``UNORDERED`` whether elements have no order."""

    SPACE: ClassVar[str] = "dcc"
    UNORDERED: ClassVar[bool]
    FIELDS: ClassVar[Mapping[str, Any]] = MappingProxyType({})

    def __init_subclass__(cls, *, kw_only: bool = True, unordered: bool = False) -> None:
        cls.UNORDERED = unordered
        names = [name for name, hint in cls.__annotations__.items() if not hint.startswith("ClassVar")]
        fields = {**cls.FIELDS, **{name: cls.__dict__.get(name, _MISSING) for name in names}}
        last = {name: fields.pop(name) for name in _LAST if name in fields}
        cls.FIELDS = MappingProxyType(fields | last)

    def __init__(self, *positional: Any, **named: Any) -> None:
        values = {**self.FIELDS, **dict(zip(self.FIELDS, positional, strict=False)), **named}
        if len(values) > len(self.FIELDS) or any(value is _MISSING for value in values.values()):
            unknown, lacking = values.keys() - self.FIELDS.keys(), [name for name in values if values[name] is _MISSING]
            raise TypeError(f"{type(self).__name__} takes no {sorted(unknown)} and needs {lacking}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} is frozen")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        changed = (f"{name}={value!r}" for name, value in self.__dict__.items() if value != self.FIELDS[name])
        return f"{type(self).__name__}({', '.join(changed)})"

    def with_changes(self, **changes: Any) -> Self:
        return type(self)(**{**self.__dict__, **changes})


@dataclass(frozen=True)
class Attribute:
    """An attribute of the element."""

    tag: str
    simple: Simple


@dataclass(frozen=True)
class Child:
    """An element; one of several, in the order of the classes annotated; ``many`` times, in an element ``within``."""

    tag: str | tuple[str, ...] = ""
    simple: Simple | None = None
    many: bool = False
    within: str = ""


@dataclass(frozen=True)
class Content:
    """The text of the element itself."""

    simple: Simple


@dataclass(frozen=True)
class ForeignElements:
    """Elements of other namespaces, as they stand."""


@dataclass(frozen=True)
class Field:
    """A field of a class: ``tags`` of its elements with the class of each, ``outer`` of the element that they stand in."""

    name: str
    place: Attribute | Child | Content | ForeignElements
    tags: Mapping[str, type[Element] | None]
    outer: tuple[str, ...]
    simple: Simple | None
    repeated: bool
    required: bool


_FIELDS: dict[type[Element], tuple[Field, ...]] = {}


def fields_of(cls: type[Element]) -> tuple[Field, ...]:
    """How a class stands in XML."""
    if cls not in _FIELDS:
        hints, space = get_type_hints(cls, include_extras=True), cls.SPACE
        _FIELDS[cls] = tuple(_field(name, hints[name], space, cls.FIELDS[name] is _MISSING) for name in cls.FIELDS)
    return _FIELDS[cls]


def _field(name: str, hint: Any, space: str, required: bool) -> Field:
    annotated, place = (hint.__origin__, hint.__metadata__[0]) if hasattr(hint, "__metadata__") else (hint, Child())
    if not isinstance(place, Child):
        return Field(name, place, {}, (), None, isinstance(place, ForeignElements), required)
    head, *rest = name.split("_")
    named = place.tag or head + "".join(word.capitalize() for word in rest)
    tags = tuple(tag if ":" in tag else f"{space}:{tag}" for tag in ((named,) if isinstance(named, str) else named))
    classes, sequence = _classes(annotated), get_origin(annotated) is tuple
    outer = (f"{tags[0].partition(':')[0]}:{place.within}",) if place.within else tags
    if issubclass(classes[0], Element):
        return Field(name, place, dict(zip(tags, classes, strict=True)), outer, None, sequence, required)
    simple = place.simple or (STRING if space == "si" and classes[0] is str else _BY_TYPE[classes[0]])
    simple = listed(simple) if sequence and not place.many else simple
    return Field(name, place, {tags[0]: None}, outer, simple, place.many, required)


def _classes(annotated: Any) -> list[type[Any]]:
    """The classes of an annotation, without None and the tuple around them."""
    parts = get_args(annotated)
    if not parts:
        return [annotated]
    return [cls for part in parts if part not in (NoneType, Ellipsis) for cls in _classes(part)]


def by_tag(cls: type[Element]) -> Mapping[str, int]:
    """Index of the field that an element belongs to."""
    return {tag: i for i, field in enumerate(fields_of(cls)) for tag in field.outer}
