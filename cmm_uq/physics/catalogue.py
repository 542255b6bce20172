"""Every effect by its name.

``CATALOGUE`` holds the effects that every job file may count on. ``FURTHER`` holds rarer ones: a job may name them, simulate
them and have them estimated like the others; whether they are thought of unasked is for the diagnosis to decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.physics import drives, probing, reversal, rigid_body, scales, scanning, stylus, thermal, warming
from cmm_uq.physics.effect import Effect

CATALOGUE = MappingProxyType(
    {effect.name: effect for effect in (*rigid_body.EFFECTS, *drives.EFFECTS, *thermal.EFFECTS, *probing.EFFECTS)}
)
"""Effects by name."""

FURTHER = MappingProxyType(
    {
        effect.name: effect
        for effect in (*reversal.EFFECTS, *scales.EFFECTS, *warming.EFFECTS, *stylus.EFFECTS, *scanning.EFFECTS)
    }
)
"""Further effects by name."""

EVERY = MappingProxyType({**CATALOGUE, **FURTHER})
"""All of them by name."""


def effects(names: Sequence[str], *, where: str | None = None) -> tuple[Effect, ...]:
    """The named effects, in order.

    Raises
    ------
    CmmUqError : a name is unknown or stands twice.
    """
    for i, name in enumerate(names):
        if name not in EVERY:
            raise CmmUqError(f"unknown effect {name!r}", where=where, fix=suggestion(name, EVERY))
        if name in names[:i]:
            raise CmmUqError(f"the effect {name!r} is named twice", where=where, fix="Name it once")
    return tuple(EVERY[name] for name in names)
