"""One case of the third study: what is hidden in it is mostly what no catalogue has; made as those of the second study."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.concealed.generator import sizes_for
from benchmarks.concealed.physics import KNOWN, LARGEST, Error, kind_of
from benchmarks.second import artefacts, maps, noises
from benchmarks.second.artefacts import SIX, Placed
from benchmarks.second.cases import COLUMNS, RUNS, UNSEEN, Case, Seen, indicated, of_effects, visible
from benchmarks.third.forms import DICTIONARY, OTHERS, Outside, drawn

CYCLE = (
    "nothing", "dictionary", "other", "catalogue", "nothing", "dictionary", "squareness", "nothing", "other", "catalogue",
    "dictionary", "nothing", "real", "dictionary", "catalogue", "nothing", "other", "ratio", "dictionary", "nothing",
)  # fmt: skip
"""What case after case hides: two in five something outside the catalogue."""
KINDS = tuple(dict.fromkeys(CYCLE))
OUTSIDE = ("dictionary", "other")
EFFECTS = ("catalogue", "squareness", "ratio", "real")
NOISES = noises.KINDS[:-1]
PERIODIC = ("periodic_scale", "probe_lobing")
DESIGNS: Mapping[str, Callable[[np.random.Generator], Placed]] = {
    "ballbar": lambda r: artefacts.ballbar(r, int(r.integers(20, 41))),
    "step gauge": lambda r: artefacts.gauge(r, count=int(r.integers(7, 13))),
    "plate": lambda r: artefacts.plate(r, int(r.integers(1, 4))),
    "real bars": artefacts.real_bars,
}


@dataclass(frozen=True, eq=False)
class Hidden:
    """A case with what is hidden in it.

    Parameters
    ----------
    one : the case.
    seen : what effects look like in it.
    errors, sizes : of what is hidden.
    outside : what no catalogue has of it.
    """

    one: Case
    seen: Seen
    errors: dict[str, Error]
    sizes: dict[str, float]
    outside: Outside | None

    @property
    def signal(self) -> np.ndarray:
        """(m,) of all that is hidden, over the noise."""
        parts = [self.sizes[name] * self.seen.seen(error) for name, error in self.errors.items()]
        return np.asarray(sum(parts, np.zeros(len(self.seen.rest))))


def case(seed: int, number: int) -> Hidden:
    """Case ``number``.

    Raises
    ------
    RuntimeError : nothing was found that could be hidden.
    """
    for attempt in range(400):
        found = _attempt(np.random.default_rng([seed, number, attempt]), number)
        if found is not None:
            return found
    raise RuntimeError(f"nothing to hide in case {number}")


def _attempt(random: np.random.Generator, number: int) -> Hidden | None:
    kind, before = CYCLE[number % len(CYCLE)], Counter(CYCLE[i % len(CYCLE)] for i in range(number))
    noise_kind = NOISES[before[kind] % len(NOISES)]  # each kind of noise as often as any other
    what = str(random.choice(["ballbar", "step gauge", "plate"]))
    what = {"squareness": "step gauge", "real": "real bars"}.get(kind, what)
    placed = DESIGNS[what](random)
    noise_kind = "real" if kind == "real" else noise_kind
    noise = noises.drawn(random, noise_kind, placed)
    covariance = noises.of_observations(noises.of_coordinates(noise, placed), placed)
    timed = noise_kind in noises.IN_TIME
    gone = [names for names in COLUMNS if random.random() < 0.3 and not (timed and "time_s" in names)]
    full = placed.recorded
    placed.recorded = {name: v for name, v in full.items() if not any(name in names for names in gone)}
    alone = kind in ("squareness", "ratio")
    simulated = not alone and kind != "real" and bool(random.random() < 0.15)
    # a bend without its straight line is outside the catalogue, one with it is a scale and a bend
    some = (SIX,) if kind in OUTSIDE else (SIX, SIX, SIX[:3], ())
    named = () if alone or simulated else some[int(random.integers(len(some)))]
    certified = placed.size is not None and bool(random.random() < 0.7)
    shape = {"period": float(np.exp(random.uniform(np.log(30), np.log(300)))), "phase": float(random.uniform(-3, 3))}
    seen = Seen(placed, named, certified, covariance, placed.recorded | placed.extra | shape, noise.sigma)
    hidden = _hidden(random, kind, seen)
    if hidden is None:
        return None
    return composed(random, number, kind, what, seen, noise, full, hidden, simulated=simulated, shape=shape)


def composed(
    random: np.random.Generator, number: int, kind: str, what: str, seen: Seen, noise: noises.Noise, full: dict,
    hidden: tuple[Mapping[str, Error], Mapping[str, float], Outside | None], *, simulated: bool, shape: Mapping[str, float],
    effects: Mapping[str, Error] = KNOWN, readings: Callable[..., np.ndarray] = noises.readings,
) -> Hidden:  # fmt: skip
    """A case of a recording in which something is hidden.

    Parameters
    ----------
    full : columns of the recording, with those that are not written.
    hidden : errors and their sizes, and what no catalogue has of them.
    simulated : whether the model is a prediction.
    shape : of what effects have besides a size.
    effects : by name, of the job and of a prediction.
    readings : their noise, (n, 3) mm.
    """
    errors, sizes, outside = hidden
    placed, named = seen.design, seen.named
    base = {name: float(random.normal(0, LARGEST[kind_of(name)] / 6)) for name in (SIX if simulated else named)}
    machine = int(random.choice([0, *maps.SQUARENESS])) if simulated else 0
    known = of_effects({name: effects[name] for name in base}, base, seen.context)
    simulation = (lambda p: maps.error(p, machine)) if machine else known
    more = of_effects(errors, sizes, seen.context)
    runs = placed.kind == RUNS  # the carriages stand at their targets, and what is read is rounded
    p = placed.true - known(placed.true) - more(placed.true) if runs else indicated(
        placed.true, lambda q: simulation(q) + more(q))  # fmt: skip
    shown = p + readings(random, noise, Placed(**{**placed.__dict__, "recorded": full}))
    shown = shown if runs else noises.displayed(noise, shown)
    predicted = indicated(placed.true, simulation) if simulated else None
    told = random.random()
    stated = None if told < 0.5 or placed.residuals is not None else (
        1e3 * noise.sigma * (1.0 if told < 0.9 else random.choice([0.5, 2.0])))  # fmt: skip
    order = random.permutation(len(p)) if random.random() < 0.3 else np.arange(len(p))
    y = placed.D @ (shown - (placed.true if predicted is None else predicted)).ravel()
    truth = {
        "kind": kind, "design": what, "noise": asdict(noise), "named": named, "certified": seen.certified,
        "stated_um": stated, "machine": machine, "simulated": simulated, "hidden": dict(sizes),
        "outside": outside and asdict(outside), "recorded": sorted(placed.recorded), "observations": len(y), **shape,
    }  # fmt: skip
    one = Case(
        f"{number:04d}", placed, noise, named, seen.certified, stated and 1e-3 * stated, seen.context, shown,
        noises.displayed(noise, y) if runs else y, truth, predicted, order,
    )  # fmt: skip
    found = Hidden(one, seen, dict(errors), dict(sizes), outside)
    alone_seen = {name: float(np.linalg.norm(sizes[name] * seen.seen(error))) for name, error in errors.items()}
    truth |= {"root_lambda": float(np.linalg.norm(found.signal)), "root_lambda_of": alone_seen}
    return found


def _hidden(
    random: np.random.Generator, kind: str, seen: Seen
) -> tuple[dict[str, Error], dict[str, float], Outside | None] | None:
    if kind == "nothing":
        return {}, {}, None
    if kind in OUTSIDE or (kind == "real" and random.random() < 0.5):
        return _outside(random, OTHERS if kind == "other" else DICTIONARY, seen)
    if kind == "ratio":
        return _ratio(random, seen)
    among = {name: error for name, error in visible(seen.design).items() if name not in seen.named}
    count = 3 if kind == "squareness" else int(random.choice([1, 1, 2])) if kind == "catalogue" else 1
    if len(among) < count:
        return None
    names = (
        SIX[3:] if kind == "squareness" else [str(name) for name in random.choice(sorted(among), count, replace=False)]
    )
    errors = {name: among[name] for name in names}
    wanted = {name: float(random.uniform(4.5, 12.0)) for name in names}
    sizes = sizes_for(random, seen, errors, wanted, {name: seen.seen(error) for name, error in errors.items()})
    return None if sizes is None else (errors, sizes, None)


def _outside(random: np.random.Generator, forms: Mapping, seen: Seen) -> tuple[dict, dict, Outside] | None:
    outside = drawn(random, forms, seen.design.true, seen.context)
    return outside and sized(random, outside, seen, 3.5, 25.0)


def sized(
    random: np.random.Generator, outside: Outside, seen: Seen, low: float, high: float
) -> tuple[dict, dict, Outside] | None:
    """As large as a √λ between two says; nothing where that is absurd, or for all that is seen a known effect."""
    error = outside.error()
    signal, wanted = seen.seen(error), float(np.exp(random.uniform(np.log(low), np.log(high))))
    sizes = sizes_for(random, seen, {outside.name: error}, {outside.name: wanted}, {outside.name: signal})
    if sizes is None or (seen.design.residuals is not None and abs(sizes[outside.name]) > 150):
        return None
    # what a known effect is, for all that is seen, is no case outside the catalogue
    known = visible(seen.design)
    left = min(seen.left(sizes[outside.name] * signal, [v])
               for name in known if name not in seen.named for v in seen.versions(name, known))  # fmt: skip
    return ({outside.name: error}, sizes, outside) if left > max(UNSEEN, 0.5 * wanted) else None


def _ratio(random: np.random.Generator, seen: Seen) -> tuple[dict, dict, None] | None:
    """Two scales or two squarenesses as 1 : 2, and nothing else."""
    names = random.permutation(SIX[:3] if random.random() < 0.5 else SIX[3:])[:2]
    return in_ratio(random, {str(name): KNOWN[str(name)] for name in names}, seen)


def in_ratio(random: np.random.Generator, errors: dict[str, Error], seen: Seen) -> tuple[dict, dict, None] | None:
    """Two errors as 1 : 2."""
    first, second = errors
    unit = float(np.linalg.norm(seen.seen(errors[first]) + 2 * seen.seen(errors[second])))
    if unit < 1e-9:
        return None
    size = float(random.choice([-1, 1]) * random.uniform(6, 20)) / unit
    if max(abs(2 * size) / LARGEST[kind_of(name)] for name in errors) > 1:
        return None
    return errors, {first: size, second: 2 * size}, None
