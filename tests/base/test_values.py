"""Classes of values behave as those of the standard library, which makes the same methods of each."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from cmm_uq.base import values

KINDS: tuple[dict[str, bool], ...] = (
    {}, {"frozen": True}, {"frozen": True, "eq": False}, {"eq": False}, {"frozen": True, "kw_only": True},
    {"frozen": True, "repr": False}, {"frozen": True, "slots": True},
)  # fmt: skip


def classes(decorator: Callable[..., Any], kinds: dict[str, bool]) -> tuple[type[Any], ...]:
    @decorator(**kinds)
    class Base:
        length: float
        name: str = "bar"
        further: list[int] = values.field(default_factory=list, repr=False)
        unit: ClassVar[str] = "mm"

    @decorator(**kinds)
    class Derived(Base):
        doubled: float = values.field(init=False)
        noise: float = values.field(default=0.5, compare=False, kw_only=True)

        def __post_init__(self) -> None:
            object.__setattr__(self, "doubled", 2 * self.length)

    @decorator(**kinds)
    class Said:
        one: int

        def __eq__(self, other: object) -> bool:
            return True

        def __repr__(self) -> str:
            return "said"

    return Base, Derived, Said


def outcome(call: Callable[[], Any]) -> Any:
    try:
        return call()
    except (TypeError, AttributeError) as error:
        return type(error), str(error)


def deeds(made: tuple[type[Any], ...]) -> list[Any]:
    base, derived, said = made
    calls: list[Callable[[], Any]] = [
        lambda: base(length=1.0) == base(length=1.0, name="bar", further=[]),
        lambda: base(length=1.0) == base(length=2.0),
        lambda: base(length=1.0) == derived(length=1.0),
        lambda: derived(length=1.0, noise=1.0) == derived(length=1.0, noise=2.0),
        lambda: repr(derived(length=1.0)) if "__repr__" in vars(derived) else "as any object",
        lambda: base(1.0, "gauge", [3]).further,
        lambda: derived(1.0, "gauge", [3], 4.0),
        lambda: base(),
        lambda: base(name="gauge"),
        lambda: base(length=1.0, width=2.0),
        lambda: derived(length=3.0).doubled,
        lambda: base(length=1.0).further is base(length=1.0).further,
        lambda: setattr(base(length=1.0), "length", 2.0),
        lambda: setattr(base(length=1.0), "width", 2.0),
        lambda: delattr(base(length=1.0), "name"),
        lambda: hash(base(length=1.0)) == hash(base(length=1.0)),
        lambda: hash(said(one=1)) == hash(said(one=1)),
        lambda: (said(one=1) == 5, repr(said(one=1))),
        lambda: dataclasses.asdict(derived(length=1.0, name="gauge")),
        lambda: dataclasses.replace(base(length=1.0), name="gauge").name,
        lambda: [field.name for field in dataclasses.fields(derived)],
        lambda: (base.__match_args__, derived.__match_args__),
        lambda: type("Undecorated", (base,), {})(length=1.0).name,
        lambda: setattr(type("Undecorated", (base,), {})(length=1.0), "length", 3.0),
        lambda: vars(setting(type("Undecorated", (base,), {})(length=1.0))).get("width"),
    ]
    return [outcome(call) for call in calls]


def setting(one: Any) -> Any:
    one.width = 2.0
    return one


@pytest.mark.parametrize("kinds", KINDS, ids=lambda kinds: "-".join(kinds) or "plain")
def test_an_instance_does_what_one_of_the_standard_library_does(kinds: dict[str, bool]) -> None:
    assert deeds(classes(values.dataclass, kinds)) == deeds(classes(dataclasses.dataclass, kinds))


def test_a_text_shows_what_it_contains_once() -> None:
    @values.dataclass
    class Chain:
        link: Any = None

    one = Chain(Chain())
    one.link.link = one
    name = Chain.__qualname__
    assert repr(one) == f"{name}(link={name}(link=...))"


@values.dataclass(frozen=True)
class Stored:
    length: float


def test_what_is_stored_comes_back() -> None:
    assert pickle.loads(pickle.dumps(Stored(2.5))) == Stored(2.5)


def test_a_value_that_is_no_number_equals_itself_as_in_a_tuple() -> None:
    one = Stored(float("nan"))
    assert one == Stored(one.length)
