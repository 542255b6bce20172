"""What is true of a case: what it hides, how large, in which noise; written down and hashed before it is diagnosed.

Kinds of cases follow each other in a fixed cycle: of every ten three hide nothing, three one effect, two two effects, one a
function that no effect has, one a fault of the artefact.

The file is JSON in one canonical form, so that its SHA-256 is that of what it says: ``sha256sum truth.json`` gives it
again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE
from cmm_uq.laboratory.proving.unknown_causes import FunctionForm
from cmm_uq.machine.model import Noise

NOTHING, ONE, TWO, OUTSIDE, ARTEFACT = "nothing", "one effect", "two effects", "outside", "artefact"
KINDS = (NOTHING, ONE, TWO, OUTSIDE, ARTEFACT)
CYCLE = (NOTHING, ONE, TWO, NOTHING, OUTSIDE, ONE, NOTHING, ONE, ARTEFACT, TWO)  # what each case of ten hides

OWN, WHITE, SET_UP, AXIS, GROWING, SLOWLY, WALKING, TAILS, RESOLUTION = (
    "own", "white", "set-up", "axis", "growing", "slow", "walk", "tails", "resolution",
)  # fmt: skip

WEAKEST, STRONGEST = 3.0, 15.0  # √λ between which hidden causes are drawn


@dataclass(frozen=True)
class HiddenEffect:
    """An effect of the catalogue that acts and that the job does not name."""

    effect: str  # effect, parameters: its name, and its reported parameters
    parameters: Mapping[str, float]
    strength: float  # √λ, with the other one that is hidden projected out too


@dataclass(frozen=True)
class UnknownCause:
    """A cause that no catalogue has."""

    what: str  # a function, or a fault of the artefact
    size_um: float
    strength: float  # strength, left: √λ of it, and of what the nearest effect of the catalogue leaves of it
    left: float
    like: str  # that effect; empty where none takes anything
    form: FunctionForm | None = None
    errors: tuple[tuple[float, ...], ...] = ()  # of the nodes of the artefact, on the scale of size_um


@dataclass(frozen=True)
class Case:
    """What is true of one case."""

    number: int  # number, kind: which case, and what it hides, one of KINDS
    kind: str
    noise_kind: str  # noise_kind, noise: of its recording
    noise: Noise
    sizes: tuple[float, ...]  # true sizes of the artefact, of its certificate's distribution
    hidden: tuple[HiddenEffect, ...] = ()
    stranger: UnknownCause | None = None  # what else acts

    def as_data(self) -> dict[str, Any]:
        return {**asdict(self), "noise": micrometres(self.noise)}


def micrometres(noise: Noise) -> dict[str, Any]:
    """A noise for results.json."""
    coordinate = np.broadcast_to(np.asarray(noise.coordinate), 3)
    forgets_s = noise.slow_time_s if isfinite(noise.slow_time_s) else "never"
    return {
        **{f"{axis}_um": float(each) / MICROMETRE for axis, each in zip(AXES, coordinate, strict=True)},
        "placing_um": noise.placing / MICROMETRE, "growth_um": noise.growth / MICROMETRE,
        "slow_um": noise.slow / MICROMETRE, "slow_time_s": forgets_s if noise.slow else None,
        "tails_dof": noise.tails or None, "resolution_um": noise.resolution / MICROMETRE,
    }  # fmt: skip


SCHEMA = "cmm-uq/prove-truth/1"


def truth_file(cases: Sequence[Case], common: Mapping[str, Any]) -> bytes:
    return canonical_json({"schema": SCHEMA, **common, "cases": [case.as_data() for case in cases]})


def canonical_json(data: Any) -> bytes:
    """JSON with sorted keys, a line feed at its end and nowhere else, of finite numbers."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def sha256_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
