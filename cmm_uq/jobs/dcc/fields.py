"""How the fields of a class stand in XML: as an attribute, an element, several, one of a choice, or the text itself.

A class of the model is a :class:`Part` whose fields, in the order of the schema, are annotated so. A field without a default
has to be there. Parts are made without :mod:`dataclasses`, which would take longer to make seventy classes than it takes to
write a certificate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType, NoneType
from typing import Any, ClassVar, NoReturn, Self, dataclass_transform, get_args, get_type_hints

from cmm_uq.jobs.dcc.simple import Simple


class _Missing:
    """In place of a default."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Part:
    """A part of a certificate: a frozen record, equal to another of its class with the same fields.

    Parameters
    ----------
    SPACE : prefix of the namespace of its elements.
    UNORDERED : whether these may stand in any order.
    """

    SPACE: ClassVar[str] = "dcc"
    UNORDERED: ClassVar[bool] = False
    FIELDS: ClassVar[Mapping[str, Any]] = MappingProxyType({})

    def __init_subclass__(cls, *, kw_only: bool = True) -> None:
        own = [name for name, hint in cls.__annotations__.items() if not hint.startswith("ClassVar")]
        cls.FIELDS = MappingProxyType({**cls.FIELDS, **{name: cls.__dict__.get(name, _Missing) for name in own}})

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
class Foreign:
    """Elements of other namespaces, as they stand."""


Place = Attribute | Child | Many | Choice | Content | Foreign


@dataclass(frozen=True)
class Field:
    """A field of a class.

    Parameters
    ----------
    name : of it.
    place : in XML.
    tags : of its elements, with prefix, and the class of each; none of a simple one.
    required : whether it has to be there.
    """

    name: str
    place: Place
    tags: Mapping[str, type[Part] | None]
    required: bool

    @property
    def repeated(self) -> bool:
        """Whether it holds several."""
        return isinstance(self.place, Many | Foreign) or (isinstance(self.place, Choice) and self.place.many)

    @property
    def outer(self) -> tuple[str, ...]:
        """Tags by which it is known among the children."""
        if isinstance(self.place, Many) and self.place.within:
            return (prefixed(self.place.within, next(iter(self.tags)).partition(":")[0]),)
        return tuple(self.tags)


def prefixed(tag: str, space: str) -> str:
    """A tag with its prefix."""
    return tag if ":" in tag else f"{space}:{tag}"


def fields_of(cls: type[Part]) -> tuple[Field, ...]:
    """How a class stands in XML."""
    if cls not in _FIELDS:
        hints = get_type_hints(cls, include_extras=True)
        _FIELDS[cls] = tuple(
            _field(name, hints[name], cls.SPACE, default is _Missing) for name, default in cls.FIELDS.items()
        )
    return _FIELDS[cls]


_FIELDS: dict[type[Part], tuple[Field, ...]] = {}
"""What was asked for before."""


def _field(name: str, hint: Any, space: str, required: bool) -> Field:
    annotated, place = hint.__origin__, hint.__metadata__[0]
    if isinstance(place, Choice):
        tags: dict[str, type[Part] | None] = dict(
            zip((prefixed(tag, space) for tag in place.tags), _classes(annotated), strict=True)
        )
    elif isinstance(place, Child | Many):
        tags = {prefixed(place.tag, space): None if place.simple else _classes(annotated)[0]}
    else:
        tags = {}
    return Field(name, place, tags, required)


def _classes(annotated: Any) -> list[type[Part]]:
    """The classes of an annotation, without None and the tuple around them."""
    parts = get_args(annotated)
    if not parts:
        return [annotated]
    return [cls for part in parts if part not in (NoneType, Ellipsis) for cls in _classes(part)]


def by_tag(cls: type[Part]) -> Mapping[str, int]:
    """Index of the field that an element belongs to."""
    return {tag: i for i, field in enumerate(fields_of(cls)) for tag in field.outer}
