"""Where in the volume a length is measured: the name of its line, and how much of the travel along it there is."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Machine

ALIGNED = np.sin(np.radians(10.0))
"""A direction cosine below this does not count: the line is as good as square to that axis."""

CORNER_TO_CORNER = 0.75
"""Part of every axis' travel that a line, produced to the ends of travel, crosses on a space diagonal; this project's figure,
which leaves room for the fixture."""

_ROUNDING = 1e-6
"""mm; a line as near as this to the end of an axis' travel lies in it."""

PARALLELS = tuple(say("parallel to {axis}", axis=Verbatim(a.upper())) for a in AXES)
SPACE_DIAGONALS = tuple(say("space diagonal {axes}", axes=Verbatim(f"{x}X {y}Y +Z")) for x in "+−" for y in "+−")
FACE_DIAGONALS = tuple(
    say("face diagonal {axes}", axes=Verbatim(f"{s}{a} +{b}")) for a, b in ("XY", "YZ", "XZ") for s in "+−"
)


def position_of(direction: Floats) -> Text:
    """Position of a line in words, from its direction (3,), either way along it."""
    u = direction / np.linalg.norm(direction)
    counts = np.abs(u) > ALIGNED
    taken = [a.upper() for a, counted in zip(AXES, counts, strict=True) if counted]
    if len(taken) == 1:
        return say("parallel to {axis}", axis=Verbatim(taken[0]))
    axes = _signed(u, counts)
    return say("space diagonal {axes}", axes=axes) if len(taken) == 3 else say("face diagonal {axes}", axes=axes)


def position_on(machine: Machine, middle: Floats, direction: Floats) -> Text:
    """Position of a line through ``middle`` (3,), mm in the recorded frame, where the travel is known: by what it crosses.

    A space diagonal goes from corner to corner: by its direction alone a line across a corner, or one that hardly leaves the
    floor, would pass for one, and that of a long machine would not. Without travel the direction decides.
    """
    travel, place = machine.travel_mm, middle + machine.origin_mm
    return _position_on(tuple(travel.ravel().tolist()), tuple(place.tolist()), tuple(direction.tolist()))


@lru_cache(maxsize=16_384)  # conditions, figures and remarks of several standards ask for the same lines
def _position_on(ends: tuple[float, ...], place: tuple[float, ...], direction: tuple[float, ...]) -> Text:
    travel, along = np.reshape(ends, (-1, 2)), np.array(direction)
    crossed = _crossed(ends, place, direction)
    u = along / np.linalg.norm(along)
    named = position_of(u)
    if crossed is None:
        return named
    if np.all(crossed * np.abs(u) >= CORNER_TO_CORNER * np.ptp(travel, axis=1)):
        return say("space diagonal {axes}", axes=_signed(u, np.ones(3, dtype=bool)))
    if np.all(counts := np.abs(u) > ALIGNED):
        return say("oblique {axes}", axes=_signed(u, counts))
    return named


def crossed_travel(machine: Machine, middle: Floats, direction: Floats) -> float | None:
    """Travel, mm, along a line through ``middle`` (3,) in the recorded frame; 0 outside it, ``None`` where none is stated."""
    travel, place = machine.travel_mm, middle + machine.origin_mm
    return _crossed(tuple(travel.ravel().tolist()), tuple(place.tolist()), tuple(direction.tolist()))


@lru_cache(maxsize=16_384)
def _crossed(ends: tuple[float, ...], place_mm: tuple[float, ...], direction: tuple[float, ...]) -> float | None:
    """The same of scale readings ``place_mm``."""
    travel, place, along = np.reshape(ends, (-1, 2)), np.array(place_mm), np.array(direction)
    if not np.all(np.isfinite(travel)):
        return None
    u = along / np.linalg.norm(along)
    moving = np.abs(u) > 1e-9
    if np.any((np.abs(place - travel.mean(axis=1)) > 0.5 * np.ptp(travel, axis=1) + _ROUNDING)[~moving]):
        return 0.0
    crossed = (travel - place[:, None])[moving] / u[moving, None]
    return max(0.0, float(crossed.max(axis=1).min() - crossed.min(axis=1).max()))


def share_of_travel(machine: Machine, middle: Floats, direction: Floats, length: float) -> float | None:
    """Length, mm, over the travel along its line; ``None`` where no travel is stated or the line lies outside it."""
    available = crossed_travel(machine, middle, direction)
    return length / available if available else None


def _signed(u: Floats, counts: NDArray[np.bool_]) -> Text:
    signs = np.sign(u) * np.sign(u[counts][-1])
    taken = zip(AXES, signs, counts, strict=True)
    return Verbatim(" ".join(f"{'+' if sign > 0 else '−'}{axis.upper()}" for axis, sign, counted in taken if counted))
