"""One case of the fourth study: hidden in recordings, by equations, forms and noise of its own; what an oracle may know of it
is told as the third study's oracles ask for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.concealed.generator import sizes_for
from benchmarks.concealed.physics import Error
from benchmarks.fourth import forms, readings
from benchmarks.fourth.machine import effects
from benchmarks.fourth.placings import DESIGNS
from benchmarks.second import noises
from benchmarks.second.artefacts import SIX, Placed
from benchmarks.second.cases import COLUMNS, RUNS, Seen, expanded
from benchmarks.third.cases import Hidden, composed, in_ratio, sized
from benchmarks.third.forms import Outside

MANY = {"nothing": 80, "dictionary": 105, "other": 60, "catalogue": 115, "squareness": 30, "ratio": 30, "real": 45}
"""Cases of each kind; they come in an order that is drawn, so that their numbers say nothing."""
PLACED = ("ballbar", "step gauge", "plate", "laser diagonals", "axis runs")
"""Recordings of what is outside the catalogue; the first four show squarenesses."""
FAMILIES = (
    "scale", "squareness", "straightness", "rotation", "periodic_scale", "hysteresis", "drift", "thermal_scale",
    "thermal_gradient", "thermal_artefact", "artefact_sag", "probe_radius", "probe_lobing", "scale_curvature", "scale_joint",
    "wear", "play", "twist", "ram_sag", "windup", "settling", "scale_drift", "scale_settling", "thermal_squareness", "bowl",
)  # fmt: skip
"""Of effects of the catalogue, each as often as any other."""
Causes = tuple[Mapping[str, Error], Mapping[str, float], Outside | None]


@cache
def _order(seed: int) -> tuple[tuple[str, int], ...]:
    """Kind of every case, and how many of it came before."""
    every = np.random.default_rng([seed, 4]).permutation([kind for kind, many in MANY.items() for _ in range(many)])
    return tuple((str(kind), int(np.sum(every[:i] == kind))) for i, kind in enumerate(every))


def case(seed: int, number: int) -> Hidden:
    """Case ``number``.

    Raises
    ------
    RuntimeError : nothing was found that could be hidden.
    """
    for attempt in range(600):
        found = _attempt(np.random.default_rng([seed, number, attempt, 4]), number, *_order(seed)[number])
        if found is not None:
            return found
    raise RuntimeError(f"nothing to hide in case {number}")


def _attempt(random: np.random.Generator, number: int, kind: str, rank: int) -> Hidden | None:
    able = noises.KINDS if kind == "nothing" else noises.KINDS[:-1]
    noise_kind = "real" if kind == "real" else able[(rank + rank // 12) % len(able)]
    among: Sequence[str] = PLACED[:4] if kind in ("squareness", "ratio") else PLACED
    if kind in ("nothing", "catalogue"):
        among = (*PLACED, "sphere")
    if noise_kind == "real":
        among = (("real bars", "real axis runs")[rank % 2 if kind == "real" else rank // len(able) % 2],)
    what = str(random.choice(among))
    placed = DESIGNS[what](random)
    placed.extra["about"] = 1e6 * expanded(placed, np.full(len(placed.true), 21.0))
    noise = noises.drawn(random, noise_kind, placed)
    if placed.residuals is not None:
        noise = replace(noise, sigma=float(np.std(placed.residuals) / np.linalg.norm(placed.D[0])))
    covariance = noises.of_observations(noises.of_coordinates(noise, placed), placed)
    gone = {name for names in COLUMNS if random.random() < 0.25 for name in names}
    gone -= {"time_s"} if noise_kind in noises.IN_TIME else set()
    gone -= {f"approach_{a}" for a in "xyz"} if placed.kind == RUNS else set()
    full = placed.recorded
    placed.recorded = {name: value for name, value in full.items() if name not in gone}
    alone = kind in ("squareness", "ratio")
    simulated = not alone and noise_kind != "real" and placed.kind != RUNS and bool(random.random() < 0.15)
    named = () if alone or simulated else _named(random, kind, placed)
    certified = placed.size is not None and bool(random.random() < 0.7)
    shape = {"period": float(np.exp(random.uniform(np.log(25), np.log(320)))), "phase": float(random.uniform(-3, 3))}
    shape |= {"at": float(random.uniform(0.2, 0.8)), "hours": float(np.exp(random.uniform(np.log(0.1), np.log(4))))}
    seen = Seen(placed, named, certified, covariance, placed.recorded | placed.extra | shape, noise.sigma)
    own = effects(placed.recorded | placed.extra)
    causes = _causes(random, kind, rank, seen, {name: error for name, error in own.items() if name not in named})
    return causes and composed(random, number, kind, what, seen, noise, full, causes, simulated=simulated, shape=shape,
                               effects=own, readings=readings.noise)  # fmt: skip


def _named(random: np.random.Generator, kind: str, placed: Placed) -> tuple[str, ...]:
    """Effects of the job: a scale less than these is more to be found."""
    if placed.kind in (RUNS, "sphere"):
        return (SIX[:3], SIX[:3], ())[int(random.integers(3))]
    some = (SIX,) if kind in ("dictionary", "other") else (SIX, SIX, SIX[:3], ())
    return some[int(random.integers(len(some)))]


def _causes(random: np.random.Generator, kind: str, rank: int, seen: Seen, own: Mapping[str, Error]) -> Causes | None:
    if kind == "nothing":
        return {}, {}, None
    if kind in ("dictionary", "other") or (kind == "real" and rank % 4 < 2):
        among = sorted(forms.OTHERS if kind == "other" else forms.DICTIONARY)
        form = among[rank % len(among)] if kind != "real" else str(random.choice(among))
        cause = forms.drawn(random, form, seen.design.true, seen.design.recorded)
        return cause and sized(random, cause, seen, 6.0, 40.0)
    six = kind in ("squareness", "ratio")
    names = _of_six(random, kind, rank) if six else _of_catalogue(random, kind, rank, sorted(own))
    if names is None:
        return None
    errors = {name: own[name] for name in names}
    if kind == "ratio" and rank % 3 == 0:
        return in_ratio(random, errors, seen)
    wanted = {name: float(random.uniform(4.5, 15.0)) for name in names}
    sizes = sizes_for(random, seen, errors, wanted, {name: seen.seen(error) for name, error in errors.items()})
    if sizes is None or (seen.design.residuals is not None and max(map(abs, sizes.values())) > 150):
        return None
    return errors, sizes, None


def _of_six(random: np.random.Generator, kind: str, rank: int) -> list[str]:
    """One, two or three squarenesses; two scales or two squarenesses; one, two or three of the six."""
    if kind == "squareness":
        return [str(name) for name in random.permutation(SIX[3:])[: 1 + rank % 3]]
    if rank % 3 == 0:
        return [str(name) for name in random.permutation(SIX[:3] if random.random() < 0.5 else SIX[3:])[:2]]
    return [str(name) for name in random.permutation(SIX)[: 1 + rank // 3 % 3]]


def _of_catalogue(random: np.random.Generator, kind: str, rank: int, able: Sequence[str]) -> list[str] | None:
    """One to three effects, of which the first is of the family whose turn it is."""
    family = FAMILIES[rank % len(FAMILIES)] if kind == "catalogue" else str(random.choice(FAMILIES))
    first = [name for name in able if name.startswith(f"{family}_") or name == family]
    first = [name for name in first if max((f for f in FAMILIES if name.startswith(f)), key=len) == family]
    count = (1, 1, 1, 2, 2, 3)[rank % 6] if kind == "catalogue" else 1
    if not first or len(able) < count:
        return None
    one = str(random.choice(first))
    rest = [str(name) for name in random.permutation([name for name in able if name != one])]
    return [one, *rest[: count - 1]]
