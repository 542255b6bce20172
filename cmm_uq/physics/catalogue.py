"""Every effect by its name."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.physics import drives, probing, rigid_body, thermal
from cmm_uq.physics.effect import Effect

CATALOGUE = MappingProxyType(
    {effect.name: effect for effect in (*rigid_body.EFFECTS, *drives.EFFECTS, *thermal.EFFECTS, *probing.EFFECTS)}
)
"""Effects by name."""


def effects(names: Sequence[str], *, where: str | None = None) -> tuple[Effect, ...]:
    """The named effects, in order.

    Raises
    ------
    CmmUqError : a name is unknown or stands twice.
    """
    for i, name in enumerate(names):
        if name not in CATALOGUE:
            raise CmmUqError(f"unknown effect {name!r}", where=where, fix=suggestion(name, CATALOGUE))
        if name in names[:i]:
            raise CmmUqError(f"the effect {name!r} is named twice", where=where, fix="Name it once")
    return tuple(CATALOGUE[name] for name in names)
