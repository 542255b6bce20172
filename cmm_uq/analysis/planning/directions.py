"""Directions in which artefacts are set up, and their names."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.placing import along
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats

_NEGLIGIBLE = 0.02


def words(direction: Floats) -> Text:
    """A direction as an operator says it, either way along it: ``along X``, ``along +X −Z, inclined 45°``."""
    u = direction / np.linalg.norm(direction)
    taken = [i for i in range(3) if abs(u[i]) > _NEGLIGIBLE]
    if len(taken) == 1:
        return say("along {axes}", axes=Verbatim(AXES[taken[0]].upper()))
    turned = u * np.sign(u[taken[0]])
    axes = Verbatim(" ".join(f"{'+' if turned[i] > 0 else '−'}{AXES[i].upper()}" for i in taken))
    if 2 not in taken:
        return say("along {axes}", axes=axes)
    return say("along {axes}, inclined {angle:.0f}°", axes=axes, angle=np.degrees(np.arcsin(abs(u[2]))))


def cube() -> list[Floats]:
    """Thirteen directions: edges, face diagonals and space diagonals of a cube."""
    signs = [(x, y, z) for x in (0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
    return [np.array(s) / np.linalg.norm(s) for s in signs]


def lines(size: Floats) -> list[Floats]:
    """Directions for a bar or gauge: those of a cube, and the diagonals of a volume of this size (3,)."""
    found = cube()
    for direction in cube():
        stretched = direction * size
        unit = stretched / np.linalg.norm(stretched)
        if all(abs(unit @ other) < np.cos(np.radians(5.0)) for other in found):
            found.append(unit)
    return found


def _plane(first: tuple[float, float, float], second: tuple[float, float, float]) -> Floats:
    u, v = np.array(first), np.array(second)
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    return np.column_stack([u, v, np.cross(u, v)])


PRINCIPAL_PLANES: tuple[tuple[Text, Floats], ...] = (
    (say("flat"), _plane((1, 0, 0), (0, 1, 0))),
    (say("upright along X"), _plane((1, 0, 0), (0, 0, 1))),
    (say("upright along Y"), _plane((0, 1, 0), (0, 0, 1))),
)
"""Attitudes of a plate."""

PLANES: tuple[tuple[Text, Floats], ...] = (
    *PRINCIPAL_PLANES,
    (say("flat, turned by 45°"), _plane((1, 1, 0), (-1, 1, 0))),
    (say("upright along X, turned by 45°"), _plane((1, 0, 1), (-1, 0, 1))),
    (say("upright along Y, turned by 45°"), _plane((0, 1, 1), (0, -1, 1))),
    (say("upright along +X +Y"), _plane((1, 1, 0), (0, 0, 1))),
    (say("upright along +X −Y"), _plane((1, -1, 0), (0, 0, 1))),
    (say("tilted about X"), _plane((1, 0, 0), (0, 1, 1))),
    (say("tilted about Y"), _plane((0, 1, 0), (1, 0, 1))),
)
"""More attitudes of a plate."""


def attitudes_of_lines(size: Floats) -> list[tuple[Text, Floats]]:
    """Attitudes of a bar or gauge, by their words."""
    return [(words(direction), along(direction)) for direction in lines(size)]
