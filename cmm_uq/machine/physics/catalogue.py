"""Every effect by its name.

``CATALOGUE`` holds the effects that every job file may count on. ``FURTHER`` holds rarer ones: a job may name them, simulate
them and have them estimated like the others; a diagnosis thinks of them less readily. ``OWN`` holds the faults of the artefact
itself. Other packages add theirs (:mod:`cmm_uq.machine.physics.plugins`); :func:`every` has them all.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.machine.physics.effect import CONTRACT, FURTHER as RARER, OWN as OF_ARTEFACTS, Effect
from cmm_uq.machine.physics.effects import drives, own_errors, own_states, probing, rigid_body, thermal
from cmm_uq.machine.physics.plugins import EffectPlugin, outside_effects

_ROOMS = (rigid_body, drives, thermal, probing, own_errors, own_states)


def _of_tier(tier: str) -> Mapping[str, Effect]:
    return MappingProxyType({effect.name: effect for room in _ROOMS for effect in room.EFFECTS if effect.tier == tier})


# built-in effects by name; of faults of the artefact itself, what they do follows from the artefact that has them
CATALOGUE, FURTHER, OWN = _of_tier(CONTRACT), _of_tier(RARER), _of_tier(OF_ARTEFACTS)
EVERY = MappingProxyType({**CATALOGUE, **FURTHER, **OWN})


def every() -> Mapping[str, Effect]:
    """All effects by name, the built-in ones first, then those of other packages in the order of their names."""
    return _every(tuple(sys.path))


def effects(names: Sequence[str], *, where: str | None = None) -> tuple[Effect, ...]:
    """The named effects, in order. Of other packages only those named are imported."""
    outside, chosen, wrong = _outside(tuple(sys.path)), list[Effect](), Gathered()
    for i, name in enumerate(names):
        with wrong.going_on():
            if name not in EVERY and name not in outside:
                raise CmmUqError(f"unknown effect {name!r}", where=where, fix=suggestion(name, {*EVERY, *outside}))
            if name in names[:i]:
                raise CmmUqError(f"the effect {name!r} is named twice", where=where, fix="Name it once")
            chosen.append(EVERY[name] if name in EVERY else outside[name].effect)
    wrong.refuse()
    return tuple(chosen)


def plugins(names: Iterable[str] | None = None) -> dict[str, str]:
    """Version of every package whose effects are in the catalogue here, or of those with effects named, by its name."""
    outside = _outside(tuple(sys.path))
    asked = outside.keys() if names is None else outside.keys() & set(names)
    return {plugin.package: plugin.version for name, plugin in outside.items() if name in asked}


# What is installed follows from where packages are looked for, so that is the key.
@lru_cache(maxsize=4)
def _outside(path: tuple[str, ...]) -> Mapping[str, EffectPlugin]:
    return outside_effects(EVERY)


@lru_cache(maxsize=4)
def _every(path: tuple[str, ...]) -> Mapping[str, Effect]:
    outside = {name: plugin.effect for name, plugin in _outside(path).items()}
    return MappingProxyType({**EVERY, **outside})
