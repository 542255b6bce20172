"""Positions of a bar swept about a fixed ball."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.set_up import SetUp, direction_words
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points

LEAST = 4
"""Positions from which on a centre can be found."""

_TRIED = 4000


def swept(volume: Volume, length: float, count: int, repeats: int, centre: Floats | None = None) -> tuple[SetUp, ...]:
    """Positions of the swept ball, spread evenly over all directions that stay inside the volume and are held.

    Parameters
    ----------
    volume : room of the swept ball.
    length : of the bar, mm.
    count : of positions, as nearly as the even spread allows; never more.
    repeats : of each.
    centre : (3,) of the fixed ball in scale readings; the middle of the volume by default.

    Raises
    ------
    CmmUqError : hardly any direction stays inside.
    """
    middle = volume.box.mean(axis=1) if centre is None else centre
    spiral = _spiral(_TRIED)
    held = np.array([volume.allows(direction) for direction in spiral])
    places = middle + length * spiral
    inside = np.all((places >= volume.box[:, 0] - 1e-6) & (places <= volume.box[:, 1] + 1e-6), axis=1)
    high = (places[:, 2] >= volume.heights[0]) & (places[:, 2] <= volume.heights[1])
    fitting = np.flatnonzero(held & inside & high)
    if len(fitting) < LEAST:
        raise CmmUqError(
            f"a bar of {length:g} mm about ({', '.join(f'{v:.0f}' for v in middle)}) mm has hardly any position",
            where="job.toml [plan]", fix="Use a shorter bar, a larger volume or more fixtures",
        )  # fmt: skip
    chosen = _spread(places[fitting], min(count, len(fitting)))
    found = []
    for i in fitting[chosen]:
        xyz = volume.machine.coordinates(np.tile(places[i], (repeats, 1)))
        one = np.ones(repeats, dtype=np.int64)
        points = Points(xyz, one, one, np.arange(1, repeats + 1), volume.machine)
        found.append(SetUp(direction_words(spiral[i]), points))
    return tuple(found)


def _spiral(count: int) -> Floats:
    """Directions (count, 3) spread evenly over the sphere (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    azimuth = np.pi * (1 + np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth), z])


def _spread(places: Floats, count: int) -> list[int]:
    """Indices of places, each as far as possible from those taken before it."""
    chosen = [int(np.argmax(places[:, 2]))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return chosen
