"""What is true of a case: what it hides, how large, in which noise.

Kinds of cases follow each other in a fixed cycle: of every ten three hide nothing, three one effect, two two effects, one a
function that no effect has, one a fault of the artefact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE
from cmm_uq.laboratory.proving.foreign import Form
from cmm_uq.machine.model import Noise

NOTHING, ONE, TWO, OUTSIDE, ARTEFACT = "nothing", "one effect", "two effects", "outside", "artefact"
KINDS = (NOTHING, ONE, TWO, OUTSIDE, ARTEFACT)
CYCLE = (NOTHING, ONE, TWO, NOTHING, OUTSIDE, ONE, NOTHING, ONE, ARTEFACT, TWO)
"""What each case of ten hides."""

OWN, WHITE, SET_UP, AXIS, GROWING, SLOWLY, WALKING, TAILS, RESOLUTION = (
    "own", "white", "set-up", "axis", "growing", "slow", "walk", "tails", "resolution",
)  # fmt: skip

WEAKEST, STRONGEST = 3.0, 15.0
"""√λ between which hidden causes are drawn."""


@dataclass(frozen=True)
class Hidden:
    """An effect of the catalogue that acts and that the job does not name.

    Parameters
    ----------
    effect, parameters : its name, and its reported parameters.
    strength : √λ, with the other one that is hidden projected out too.
    """

    effect: str
    parameters: Mapping[str, float]
    strength: float


@dataclass(frozen=True)
class Stranger:
    """A cause that no catalogue has.

    Parameters
    ----------
    what : a function, or a fault of the artefact.
    size_um : its size.
    strength, left : √λ of it, and of what the nearest effect of the catalogue leaves of it.
    like : that effect; empty where none takes anything.
    form : of a function.
    errors : of the nodes of the artefact, on the scale of ``size_um``.
    """

    what: str
    size_um: float
    strength: float
    left: float
    like: str
    form: Form | None = None
    errors: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class Case:
    """What is true of one case.

    Parameters
    ----------
    number, kind : which case, and what it hides, one of :data:`KINDS`.
    noise_kind, noise : of its recording.
    sizes : true sizes of the artefact, of its certificate's distribution.
    hidden : effects.
    stranger : what else acts.
    """

    number: int
    kind: str
    noise_kind: str
    noise: Noise
    sizes: tuple[float, ...]
    hidden: tuple[Hidden, ...] = ()
    stranger: Stranger | None = None

    def as_data(self) -> dict[str, Any]:
        """For the sealed file."""
        return {**asdict(self), "noise": micrometres(self.noise)}


def _told(forgets_s: float) -> float | str:
    """As truth.toml has it."""
    return forgets_s if isfinite(forgets_s) else "never"


def micrometres(noise: Noise) -> dict[str, Any]:
    """A noise for results.json."""
    x, y, z = (float(each) / MICROMETRE for each in np.broadcast_to(np.asarray(noise.coordinate), 3))
    return {
        **dict(zip((f"{axis}_um" for axis in AXES), (x, y, z), strict=True)),
        "placing_um": noise.placing / MICROMETRE, "growth_um": noise.growth / MICROMETRE,
        "slow_um": noise.slow / MICROMETRE, "slow_time_s": _told(noise.slow_time_s) if noise.slow else None,
        "tails_dof": noise.tails or None, "resolution_um": noise.resolution / MICROMETRE,
    }  # fmt: skip
