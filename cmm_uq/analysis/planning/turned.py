"""An artefact turned about its own axes where it stands: what turns with it is its own, what does not is the machine's.

A bar or gauge changes ends; a plate is turned by quarters about its normal, and over. (Reversal: Evans, Hocken & Estler 1996,
*Self-calibration: reversal, redundancy, error separation, and absolute testing*.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cmm_uq.analysis.planning.placing import Pattern, Placing
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats

_FLAT = 1e-3
"""Extent across an artefact, over its length, below which it has none."""


def turned_placings(placings: Sequence[Placing], volume: Volume) -> Iterator[Placing]:
    """Each placing with the artefact turned about its own axes, where it then fits.

    Parameters
    ----------
    placings : in each of which the artefact stands by itself.
    volume : room.
    """
    for placing in placings:
        pattern, attitude, _ = Pattern.of_recording(placing.points)
        for words, turn in _turns(pattern.body):
            wanted = attitude @ turn
            room = volume.room(pattern.turned(wanted))
            if room is None or not _held(pattern.body, wanted, volume):
                continue
            middle = np.clip(placing.points.machine_xyz.mean(axis=0), room[:, 0], room[:, 1])
            title = say("{title}, {turned}", title=placing.title, turned=words)
            yield pattern.placed(volume.machine, wanted, middle, title)


def _turns(body: Floats) -> list[tuple[Text, Floats]]:
    """Turns (3, 3) about an artefact's own axes that its shape (n, 3) allows, in words."""
    extent = np.ptp(body, axis=0)
    if extent[0] == 0:
        return []
    ends: list[tuple[Text, Floats]] = [(say("ends exchanged"), _about(2, 2))]
    if extent[1] < _FLAT * extent[0]:
        return ends
    quarters: list[tuple[Text, Floats]] = [
        (say("turned by {angle:.0f}°", angle=90.0 * quarter), _about(2, quarter)) for quarter in (1, 2, 3)
    ]  # about the normal
    return [*quarters, (say("turned over"), _about(0, 2))]


def _about(axis: int, quarters: int) -> Floats:
    """Turn (3, 3) about an own axis by quarters."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    turn[u, u] = turn[v, v] = cosine
    turn[v, u], turn[u, v] = sine, -sine
    return turn


def _held(body: Floats, attitude: Floats, volume: Volume) -> bool:
    """Whether a fixture holds it so: a bar along its length, anything else by its normal."""
    thin = np.ptp(body, axis=0)[1] < _FLAT * np.ptp(body, axis=0)[0]
    return volume.allows(attitude[:, 0] if thin else attitude[:, 2])
