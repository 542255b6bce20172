"""How the fields of a class stand in XML: as an attribute, an element, several, one of a choice, or the text itself.

A class of the model is a frozen dataclass whose fields, in the order of the schema, are annotated so. A field without a
default has to be there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from types import NoneType
from typing import Any, get_args, get_type_hints

from cmm_uq.dcc.simple import Simple


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
    tags: Mapping[str, type | None]
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


@cache
def fields_of(cls: type) -> tuple[Field, ...]:
    """How a class stands in XML."""
    hints = get_type_hints(cls, include_extras=True)
    return tuple(
        _field(field.name, hints[field.name], getattr(cls, "SPACE", "dcc"), field.default is MISSING)
        for field in fields(cls)
    )


def _field(name: str, hint: Any, space: str, required: bool) -> Field:
    annotated, place = hint.__origin__, hint.__metadata__[0]
    if isinstance(place, Choice):
        tags: dict[str, type | None] = dict(
            zip((prefixed(tag, space) for tag in place.tags), _classes(annotated), strict=True)
        )
    elif isinstance(place, Child | Many):
        tags = {prefixed(place.tag, space): None if place.simple else _classes(annotated)[0]}
    else:
        tags = {}
    return Field(name, place, tags, required)


def _classes(annotated: Any) -> list[type]:
    """The classes of an annotation, without None and the tuple around them."""
    parts = get_args(annotated)
    if not parts:
        return [annotated]
    return [cls for part in parts if part not in (NoneType, Ellipsis) for cls in _classes(part)]


@cache
def by_tag(cls: type) -> Mapping[str, int]:
    """Index of the field that an element belongs to."""
    return {tag: i for i, field in enumerate(fields_of(cls)) for tag in field.outer}
