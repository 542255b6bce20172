"""Dataclasses whose methods are made when they are first used: most classes that a command imports, it never makes.

On import only the fields are collected, by the standard library, and a class behaves as one of its own does.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError, asdict, astuple, field, fields, is_dataclass, replace
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["MISSING", "asdict", "astuple", "dataclass", "field", "fields", "is_dataclass", "replace"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(cls=None, /, **kinds):
        return (lambda each: _with_methods(each, **kinds)) if cls is None else _with_methods(cls, **kinds)


def _with_methods(cls: type, *, eq: bool = True, frozen: bool = False, **kinds: bool) -> type:
    if kinds.get("slots"):
        return dataclasses.dataclass(eq=eq, frozen=frozen, **kinds)(cls)
    cls.__doc__ = cls.__doc__ or cls.__name__  # or it would be made of the signature
    own, shown = set(vars(cls)), kinds.pop("repr", True)
    dataclasses.dataclass(init=False, repr=False, eq=False, **kinds)(cls)
    names = [one.name for one in fields(cls) if one.compare]
    values: Any = attrgetter(*names) if len(names) > 1 else lambda self: tuple(getattr(self, name) for name in names)

    def compiled_when_called(self: object, /, *values: object, **named: object) -> None:
        cls.__init__ = compiled = _compiled(cls, frozen=frozen)  # type: ignore[misc]
        compiled(self, *values, **named)

    def equal(self: object, other: object) -> bool:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    methods: dict[str, object] = {"__init__": compiled_when_called, **({"__repr__": _repr} if shown else {})}
    if eq:
        methods |= {"__eq__": equal, "__hash__": (lambda self: hash(values(self))) if frozen else None}
    if frozen:
        methods |= {"__setattr__": _refuse_change, "__delattr__": _refuse_change}
    for name, method in methods.items():
        if name not in own or (name == "__hash__" and vars(cls)[name] is None):  # which Python sets beside an __eq__
            setattr(cls, name, method)
    return cls


def _compiled(cls: type, *, frozen: bool) -> Callable[..., None]:
    """A function that takes the fields and stores them."""
    known: dict[str, Any] = {"_put": object.__setattr__}
    taken, taken_by_name, lines = ["self"], list[str](), list[str]()
    for one in fields(cls):
        name, value, factory = one.name, one.name, one.default_factory is not MISSING
        if one.init:
            optional = factory or one.default is not MISSING
            known |= {f"_default_{name}": one.default} if optional else {}
            (taken_by_name if one.kw_only else taken).append(f"{name}=_default_{name}" if optional else name)
        if factory:
            known[f"_new_{name}"] = one.default_factory
            value = f"_new_{name}() if {name} is _default_{name} else {name}" if one.init else f"_new_{name}()"
        if one.init or factory:
            lines.append(f"_put(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    lines.append("self.__post_init__()" if hasattr(cls, "__post_init__") else "pass")
    arguments = ", ".join([*taken, *(["*", *taken_by_name] if taken_by_name else [])])
    exec(f"def __init__({arguments}):\n " + "\n ".join(lines), known)  # noqa: S102 - of names of fields
    known["__init__"].__qualname__ = f"{cls.__qualname__}.__init__"
    return known["__init__"]  # type: ignore[no-any-return]


@recursive_repr()
def _repr(self: Any) -> str:
    return (
        f"{type(self).__qualname__}({', '.join(f'{f.name}={getattr(self, f.name)!r}' for f in fields(self) if f.repr)})"
    )


def _refuse_change(self: Any, name: str, *value: object) -> None:
    if "__dataclass_params__" in vars(type(self)) or name in self.__dataclass_fields__:
        raise FrozenInstanceError(f"cannot {'assign to' if value else 'delete'} field {name!r}")
    (object.__setattr__ if value else object.__delattr__)(self, name, *value)
