"""Every effect by its name: built in, of other packages (entry points of the group ``cmm_uq.effects``), registered, stated.

``CATALOGUE`` holds the effects that every job file may count on. ``FURTHER`` holds rarer ones: a job may name them, simulate
them and have them estimated like the others; a diagnosis thinks of them less readily. ``OWN`` holds the faults of the artefact
itself. An entry point has the name of the effect and gives an ``Effect``, or a class of one that is made without arguments;
the same is registered in a running program. What a job states of its own is there while a command is at that job.
"""

from __future__ import annotations

import sys
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property, lru_cache
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.messages import Text, foreign
from cmm_uq.base.plugins import EFFECTS, BrokenPluginError, Plugin, offered
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.effect import (
    CONTRACT,
    FURTHER as RARER,
    OWN as OF_ARTEFACTS,
    Amount,
    Effect,
    Parameter,
    Shape,
)
from cmm_uq.machine.physics.effects import (
    drives,
    own_errors,
    own_states,
    probing,
    rigid_body,
    rotary,
    structure,
    thermal,
)


class EffectPlugin(Plugin):
    """An effect that another package offers."""

    @cached_property
    def effect(self) -> Effect:
        """With its package's name, where it says all that it must."""
        made = self.loaded(Effect)  # type: ignore[type-abstract]
        for field in ("title", "formula", "mechanism", "points_to", "coefficients"):
            if not getattr(made, field, None):
                raise self.broken(f"says no {field}")
        return _Outside(made, self)


@dataclass(frozen=True)
class _Registered(EffectPlugin):
    """The same that a running program registers."""

    given: object = None

    def loaded(self, of: type[Any]) -> Any:
        made = self.attempt(self.given) if isinstance(self.given, type) else self.given
        if not isinstance(made, of):
            raise self.broken(f"is no {of.__name__} but {type(made).__name__}")
        if not str(getattr(made, "name", "")).isidentifier():
            raise self.broken("has no name of letters, digits and _")
        return made

    def broken(self, why: str) -> BrokenPluginError:
        return BrokenPluginError(f"{self.what} {why}", where=f"registered by {self.package}", fix="Mend its class")


class _Outside(Effect):
    """An effect of another package: the same, but what its code does wrong is said with its package's name."""

    def __init__(self, effect: Effect, plugin: EffectPlugin) -> None:
        self._effect, self._plugin = effect, plugin
        self.name, self.title, self.formula = effect.name, foreign(effect.title), effect.formula
        self.mechanism, self.points_to = effect.mechanism, foreign(effect.points_to)
        self.coefficients, self.shape, self.columns = effect.coefficients, effect.shape, effect.columns
        self.tier, self.idealised_over, self.imitated_by = effect.tier, effect.idealised_over, effect.imitated_by
        self.along_motion, self.plane, self.stands_for = effect.along_motion, effect.plane, effect.stands_for

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        found = np.asarray(self._plugin.attempt(lambda: self._effect.basis(points, shape)))
        wanted = (len(points), 3, len(self.coefficients))
        if found.shape != wanted or found.dtype != np.float64 or not np.isfinite(found).all():
            raise self._plugin.broken(f"gives a basis {found.shape} {found.dtype}, not one {wanted} of finite float64")
        return found

    def lean(self, points: Points) -> Floats:
        return np.asarray(self._plugin.attempt(lambda: self._effect.lean(points)), dtype=np.float64)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        return foreign(self._plugin.attempt(lambda: self._effect.meaning(amounts)))

    def course(self, points: Points) -> Floats | None:
        found = self._plugin.attempt(lambda: self._effect.course(points))
        return None if found is None else np.asarray(found, dtype=np.float64)

    def trials(self) -> Iterator[tuple[float, ...]]:
        return self._effect.trials()

    @property
    def prior_weight(self) -> float:
        return self._effect.prior_weight

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        return self._effect.reported

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        return self._effect.to_reported(coefficients, shape)

    def from_reported(self, parameters: Mapping[str, float]) -> tuple[Floats, tuple[float, ...]]:
        return self._effect.from_reported(parameters)


def _offered() -> dict[str, EffectPlugin]:
    """Effects that the installed packages offer, by name; none is imported."""
    found: dict[str, EffectPlugin] = {}
    for plugin in offered(EFFECTS, EffectPlugin):
        name = plugin.name
        other = "cmm-uq" if name in EVERY else found[name].package if name in found else None
        if other is not None:
            problem = f"{plugin.what} comes from {other} and from {plugin.package}"
            raise CmmUqError(problem, fix=f"Uninstall {plugin.package}, or rename it")
        found[name] = plugin
    return found


_ROOMS = (rigid_body, drives, thermal, probing, structure, rotary, own_errors, own_states)


def _of_tier(tier: str) -> Mapping[str, Effect]:
    return MappingProxyType({effect.name: effect for room in _ROOMS for effect in room.EFFECTS if effect.tier == tier})


# built-in effects by name; of faults of the artefact itself, what they do follows from the artefact that has them
CATALOGUE, FURTHER, OWN = _of_tier(CONTRACT), _of_tier(RARER), _of_tier(OF_ARTEFACTS)
EVERY = MappingProxyType({**CATALOGUE, **FURTHER, **OWN})


def every() -> Mapping[str, Effect]:
    """All effects by name: built in, of other packages in the order of their names, registered, stated by the job at hand.

    Of an arm of joints only those that its job brings: the others are of carriages.
    """
    stated, alone = _STATED.get()
    if alone:
        return stated
    found, own = _every(tuple(sys.path)), _own()
    return MappingProxyType({**found, **own}) if own else found


def effects(names: Sequence[str], *, where: str | None = None) -> tuple[Effect, ...]:
    """The named effects, in order. Of other packages only those named are imported."""
    outside, own, chosen, wrong = _outside(tuple(sys.path)), _own(), list[Effect](), Gathered()
    known = {*own} if _STATED.get()[1] else {*EVERY, *outside, *own}
    for i, name in enumerate(names):
        with wrong.going_on():
            if name not in known:
                what = "the arm of this job has no" if _STATED.get()[1] else "unknown"
                raise CmmUqError(f"{what} effect {name!r}", where=where, fix=suggestion(name, known))
            if name in names[:i]:
                raise CmmUqError(f"the effect {name!r} is named twice", where=where, fix="Name it once")
            chosen.append(EVERY.get(name) or own.get(name) or outside[name].effect)
    wrong.refuse()
    return tuple(chosen)


def plugins(names: Iterable[str] | None = None) -> dict[str, str]:
    """Version of every package whose effects are in the catalogue here, or of those with effects named, by its name."""
    outside = _outside(tuple(sys.path))
    asked = None if names is None else set(names)
    each = {**outside, **_REGISTERED}.items()
    return {plugin.package: plugin.version for name, plugin in each if asked is None or name in asked}


Registered = TypeVar("Registered", Effect, type[Effect])


def register(effect: Registered) -> Registered:
    """An effect, or a class of one, in the catalogue of this process, as if a package offered it; given back as it is.

    Raises
    ------
    CmmUqError : it is none, does not say all that one must, or another has its name; the same class may come again.
    """
    of = effect if isinstance(effect, type) else type(effect)
    entry = EntryPoint(of.__qualname__, f"{of.__module__}:{of.__qualname__}", EFFECTS)
    plugin = _Registered(of.__module__, "(registered)", entry, effect)
    name = plugin.effect.name
    if name not in _REGISTERED or _REGISTERED[name].entry != entry:
        refuse_known(name, f"registered by {of.__module__}")
    _REGISTERED[name] = plugin
    return effect


def refuse_known(name: str, where: str, further: Container[str] = ()) -> None:
    """Refuse the name of an effect that there is already, or ``further`` ones."""
    if name in EVERY or name in _outside(tuple(sys.path)) or name in _REGISTERED or name in further:
        raise CmmUqError(f"there is a {name!r} already", where=where, fix="Call the effect otherwise")


@contextmanager
def beside_the_catalogue(stated: Mapping[str, Effect], *, alone: bool = False) -> Iterator[None]:
    """What a job brings of its own is in the catalogue for a while, or is all of it; nothing of another job."""
    token = _STATED.set((stated, alone))
    try:
        yield
    finally:
        _STATED.reset(token)


def registered() -> tuple[str, ...]:
    return tuple(_REGISTERED)


def stated_effects() -> Mapping[str, Effect]:
    return _STATED.get()[0]


_REGISTERED: dict[str, _Registered] = {}
# effects of the job at hand, and whether these are all that its machine has
_STATED: ContextVar[tuple[Mapping[str, Effect], bool]] = ContextVar("stated", default=(MappingProxyType({}), False))


def _own() -> dict[str, Effect]:
    return {**{name: plugin.effect for name, plugin in _REGISTERED.items()}, **stated_effects()}


# What is installed follows from where packages are looked for, so that is the key.
@lru_cache(maxsize=4)
def _outside(path: tuple[str, ...]) -> Mapping[str, EffectPlugin]:
    return _offered()


@lru_cache(maxsize=4)
def _every(path: tuple[str, ...]) -> Mapping[str, Effect]:
    outside = {name: plugin.effect for name, plugin in _outside(path).items()}
    return MappingProxyType({**EVERY, **outside})
