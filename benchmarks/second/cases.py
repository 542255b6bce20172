"""One concealed case: a job folder as a user writes it, and the truth beside it; shares no code with the package.

True points t are where the artefact stands, with its own faults; the machine indicates p with p + e(p) = t, and noise is
added. What is hidden gets its size by √λ: the length of its signal over the noise as it really is, what the job names and
the other hidden effects projected out.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.concealed.generator import sizes_for
from benchmarks.concealed.physics import (
    BAR,
    DRIVE,
    ELSEWHERE,
    IN_TIME,
    KNOWN,
    LARGEST,
    PLACE,
    PROBE,
    TABLE,
    TIME,
    WARM,
    Error,
    kind_of,
)
from benchmarks.second import artefacts, faults, maps, noises, twins
from benchmarks.second.artefacts import SIX, Placed

NOTHING = tuple(f"nothing, {kind}" for kind in noises.KINDS)
FAULTS = tuple(f"artefact, {kind}" for kind in faults.KINDS)
EFFECTS = ("one", "two", "real one", "simulation", "shuffled")
CAUSES = (*EFFECTS, "unresolved period", *FAULTS, "outside", "maps")
KINDS = NOTHING + CAUSES
STANDS_IN = 4.0
"""√λ that every known effect must leave of what is outside the catalogue: else it is a known effect, for all that is seen."""
UNSEEN = 2.0
"""√λ that is left when a rival stands in an effect's place: below it nobody could tell."""
RUNS = "axis_runs"
"""Kind of a recording that has no artefact: light along lines."""
U_SIZE = 0.2
"""Standard uncertainty of a certified length, µm."""
DESIGNS: Mapping[str, Callable[[np.random.Generator], Placed]] = {
    "ballbar": artefacts.ballbar, "step gauge": artefacts.gauge, "plate": artefacts.plate, "sphere": artefacts.sphere,
    "real bars": artefacts.real_bars, "equal steps": lambda random: artefacts.gauge(random, equal=True),
    "plate, one way": lambda random: artefacts.plate(random, 1), "plate, two ways": lambda random: artefacts.plate(random, 2),
}  # fmt: skip
ORDINARY = ("ballbar", "step gauge", "plate", "sphere")
COLUMNS = (("time_s",), ("approach_x", "approach_y", "approach_z"), ("temp_x_c", "temp_y_c", "temp_z_c"),
            ("temp_artefact_c",), ("temp_table_top_c", "temp_table_bottom_c"), ("load_kg",))  # fmt: skip
"""Columns that are recorded or not."""


@dataclass(frozen=True, eq=False)
class Case:
    """A case with all that an oracle may know.

    Parameters
    ----------
    name : of its folder.
    placed, noise : as they are.
    named : effects of the job; in the model of who looks for more (with a simulation: none).
    certified : whether the artefact's size is.
    stated : standard uncertainty of a coordinate that the job states, mm.
    context : columns and shapes that effects go by.
    shown : (n, 3) coordinates, scale readings, mm.
    y : (m,) observations less their nominal values, with what is simulated taken off, mm.
    truth : what is written down.
    predicted : (n, 3) by a simulation.
    order : (n,) in which the rows are written.
    """

    name: str
    placed: Placed
    noise: noises.Noise
    named: tuple[str, ...]
    certified: bool
    stated: float | None
    context: dict
    shown: np.ndarray
    y: np.ndarray
    truth: dict
    predicted: np.ndarray | None
    order: np.ndarray


@dataclass(eq=False)
class Seen:
    """What effects look like in one recording: noise white, what is modelled projected out."""

    design: Placed
    named: tuple[str, ...]
    certified: bool
    covariance: np.ndarray
    context: dict
    sigma: float
    rest: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        white = np.linalg.inv(np.linalg.cholesky(self.covariance))
        B = white @ baseline(self)
        length = np.linalg.norm(B, axis=0)
        U, s, _ = np.linalg.svd(B / np.where(length > 0, length, 1.0), full_matrices=False)
        U = U[:, s > 1e-10 * s[:1].sum()] if len(s) else U
        self.rest = white - U @ (U.T @ white)

    def column(self, error: Error) -> np.ndarray:
        """Observations (m,) per unit of an effect."""
        return -self.design.D @ error(self.design.true, self.context).ravel()

    def seen(self, error: Error) -> np.ndarray:
        return np.asarray(self.rest @ self.column(error))

    def of_fault(self, moved: np.ndarray) -> np.ndarray:
        """As :meth:`seen`, of points of the artefact that lie elsewhere by ``moved`` (n, 3)."""
        return np.asarray(self.rest @ (self.design.D @ moved.ravel()))

    def versions(self, name: str, among: Mapping[str, Error]) -> list[np.ndarray]:
        """Columns (m, c) of an effect; of a periodic one sine and cosine at many periods."""
        if kind_of(name) not in ("periodic_scale", "probe_lobing"):
            return [self.seen(among[name])[:, None]]
        periods = [self.context["period"]]
        if kind_of(name) == "periodic_scale":
            periods = [*np.geomspace(20, 700, 120), *periods]
        before, found = self.context, []
        for period in periods:
            turned = []
            for phase in (0.0, np.pi / 2):
                self.context = before | {"period": period, "phase": phase}
                turned.append(self.seen(among[name]))
            found.append(np.column_stack(turned))
        self.context = before
        return found

    def left(self, signal: np.ndarray, others: list[np.ndarray]) -> float:
        """Length of a signal once other columns have taken what they can."""
        if not others:
            return float(np.linalg.norm(signal))
        A = np.column_stack(others)
        return float(np.linalg.norm(signal - A @ np.linalg.lstsq(A, signal, rcond=None)[0]))


def baseline(seen: Seen) -> np.ndarray:
    """Columns (m, q) that a model without anything missing has."""
    columns = [seen.design.free, *(seen.column(KNOWN[name])[:, None] for name in seen.named)]
    if seen.design.size is not None and not seen.certified:
        columns.append(seen.design.size)
    return np.hstack([np.zeros((len(seen.design.D), 0)), *columns])


def visible(placed: Placed) -> dict[str, Error]:
    """Effects of the catalogue that could act on a recording, by the columns that it has."""
    has, found = placed.recorded, dict(PLACE)
    for column, more in (("approach_x", DRIVE), ("temp_x_c", WARM), ("time_s", TIME), ("temp_table_top_c", TABLE)):
        if column in has:
            found |= more
    if placed.kind == "ballbar":
        found["artefact_sag"] = BAR["artefact_sag"]
    if "temp_artefact_c" in has and placed.kind != "sphere":
        found["thermal_artefact"] = lambda p, c: -expanded(placed, c["temp_artefact_c"])
    return found | PROBE if placed.kind == "sphere" else found


def expanded(placed: Placed, temperature: np.ndarray) -> np.ndarray:
    """How an artefact's points move about their middle, (n, 3) mm, at 1 µm/(m K) and temperatures (n,)."""
    own, series = placed.own.copy(), 1000 * placed.measurement + placed.repeat
    for each in np.unique(series):
        own[series == each] -= own[series == each].mean(axis=0)
    return np.asarray(1e-6 * (temperature - 20)[:, None] * np.einsum("ni,nij->nj", own, placed.axes))


def outside(placed: Placed) -> dict[str, Error]:
    """Functions that no effect of the catalogue has."""
    found = dict(ELSEWHERE)
    if "time_s" in placed.recorded:
        found["jump in time"] = IN_TIME["jump in time"]
    if "load_kg" in placed.recorded:
        found["a load nobody modelled"] = IN_TIME["a load nobody modelled"]
    return found


def case(seed: int, kind: str, number: int) -> Case:
    """Case ``number`` of a kind; sets of error maps are made by :func:`maps.concealed`.

    Raises
    ------
    RuntimeError : nothing was found that could be hidden.
    """
    for attempt in range(300):
        found = _attempt(np.random.default_rng([seed, KINDS.index(kind), number, attempt]), kind, number)
        if found is not None:
            return found
    raise RuntimeError(f"nothing to hide for {kind!r}, {number}")


def name_of(kind: str, number: int) -> str:
    """Of the folder of a case."""
    return f"{KINDS.index(kind):02d}-{number}"


def _design(kind: str, noise: str, number: int) -> str:
    if noise == "real":
        return "real bars"
    if kind == "unresolved period":
        return "equal steps"
    if kind in FAULTS:
        plates = ("plate", "plate, one way", "plate, two ways")
        able = (*plates, *{"pattern": ("step gauge", "sphere"), "geometry": ("step gauge",),
                           "temperature": ("step gauge", "ballbar")}[kind.split(", ")[1]])  # fmt: skip
        return able[number % len(able)]
    able = ORDINARY[:3] if kind == "outside" else ORDINARY  # lobes of any number are the form of a sphere, and so known
    return able[number % len(able)]


def _attempt(random: np.random.Generator, kind: str, number: int) -> Case | None:
    noise_kind = kind.split(", ")[1] if kind in NOTHING else str(random.choice(noises.KINDS[:-1]))
    noise_kind = "real" if kind == "real one" else noise_kind
    what = _design(kind, noise_kind, number)
    placed = DESIGNS[what](random)
    noise = noises.drawn(random, noise_kind, placed)
    timed = noise_kind in noises.IN_TIME
    gone = [columns for columns in COLUMNS if random.random() < 0.35 and not (timed and "time_s" in columns)]
    before = placed.recorded
    covariance = noises.of_observations(noises.of_coordinates(noise, placed), placed)
    placed.recorded = {k: v for k, v in before.items() if not any(k in columns for columns in gone)}
    simulated = what != "real bars" and (kind == "simulation" or random.random() < 0.15)
    named = () if simulated else _named(random, placed)
    certified = placed.size is not None and bool(random.random() < 0.7)
    shape = {"period": float(np.exp(random.uniform(np.log(30), np.log(300)))), "phase": float(random.uniform(-3, 3))}
    seen = Seen(placed, named, certified, covariance, placed.recorded | placed.extra | shape, noise.sigma)
    hidden = _hidden(random, kind, seen)
    if hidden is None:
        return None
    truth = {"design": what, "kind": kind, "noise": noise.__dict__, "named": named, "certified": certified} | shape
    truth |= {key: value for key, value in hidden.items() if key not in ("errors", "moved")}

    base = {
        name: float(random.normal(0, LARGEST[kind_of(name)] / 6)) for name in (named or SIX if simulated else named)
    }
    machine = int(random.choice([0, *maps.SQUARENESS])) if simulated else 0
    known = of_effects({name: KNOWN[name] for name in base}, base, seen.context)
    simulation = (lambda p: maps.error(p, machine)) if machine else known
    more = of_effects(hidden["errors"], hidden["sizes"], seen.context)
    moved = placed.true + hidden["moved"]
    p = indicated(moved, lambda q: simulation(q) + more(q))
    full = Placed(**{**placed.__dict__, "recorded": before})
    shown = noises.displayed(noise, p + noises.readings(random, noise, full))
    predicted = indicated(placed.true, simulation) if simulated else None
    states = random.random()
    stated = None if states < 0.5 or noise_kind == "real" else 1e3 * noise.sigma * (
        1.0 if states < 0.85 else float(random.choice([0.5, 2.0])))  # fmt: skip
    order = random.permutation(len(p)) if random.random() < 0.5 or kind == "shuffled" else np.arange(len(p))
    truth |= {"stated_um": stated, "stated_right": stated is None or states < 0.85, "machine": machine, "simulated": simulated,
              "in order": bool(np.all(np.diff(order) > 0)), "observations": len(covariance)}  # fmt: skip
    away = shown - (placed.true if predicted is None else predicted)
    return Case(
        name_of(kind, number), placed, noise, named, certified, stated and 1e-3 * stated, seen.context, shown,
        placed.D @ away.ravel(), truth, predicted, order,
    )  # fmt: skip


def _named(random: np.random.Generator, placed: Placed) -> tuple[str, ...]:
    if placed.kind == "sphere":
        return ((), ("probe_radius",), SIX[:3])[int(random.integers(3))]
    if placed.residuals is not None:
        return (SIX, SIX, SIX[:3])[int(random.integers(3))]
    return (SIX, SIX, SIX, SIX[:3], ())[int(random.integers(5))]


def _hidden(random: np.random.Generator, kind: str, seen: Seen) -> dict | None:
    """What is hidden and how large, or nothing where this recording cannot hide it."""
    nothing = {
        "errors": {},
        "sizes": {},
        "hidden": {},
        "wanted": {},
        "rivals": {},
        "moved": np.zeros_like(seen.design.true),
    }
    if kind in NOTHING:
        return nothing
    if kind in FAULTS:
        return _fault(random, kind.split(", ")[1], seen, nothing)
    among = _among(random, kind, seen)
    free = {name: error for name, error in among.items() if name not in seen.named}
    count = 2 if kind == "two" else 1
    if len(free) < count:
        return None
    names = [str(name) for name in random.choice(sorted(free), count, replace=False)]
    errors = {name: free[name] for name in names}
    weak = 9.0 if kind == "outside" else 4.5
    wanted = {name: float(random.uniform(weak, 15.0 if kind == "outside" else 10.0)) for name in names}
    signals = {name: seen.seen(error) for name, error in errors.items()}
    sizes = sizes_for(random, seen, errors, wanted, signals)
    if sizes is None or (seen.design.residuals is not None and max(map(abs, sizes.values())) > 150):
        return None
    found = nothing | {"errors": errors, "sizes": sizes, "hidden": sizes, "wanted": wanted}
    rivals = visible(seen.design)
    if kind == "outside":
        left = {name: min(seen.left(sizes[names[0]] * signals[names[0]], [v]) for v in seen.versions(name, rivals))
                for name in rivals if name not in seen.named}  # fmt: skip
        return found | {"stands_in": min(left.values())} if min(left.values()) > STANDS_IN else None
    return found | {"rivals": {name: rivals_of(seen, name, sizes, signals, rivals) for name in names}}


def _among(random: np.random.Generator, kind: str, seen: Seen) -> dict[str, Error]:
    if kind == "outside":
        return outside(seen.design)
    if kind == "unresolved period":
        return {name: error for name, error in PLACE.items() if kind_of(name) == "periodic_scale"}
    return visible(seen.design)


def rivals_of(seen: Seen, name: str, sizes: dict, signals: dict, among: Mapping[str, Error]) -> list[str]:
    """Effects that could stand in the place of a hidden one without anyone noticing."""
    others = [signal for key, signal in signals.items() if key != name]
    return [
        rival for rival in among if rival not in seen.named and rival not in sizes
        and min(seen.left(sizes[name] * signals[name], [*others, v]) for v in seen.versions(rival, among)) < UNSEEN
    ]  # fmt: skip


def _fault(random: np.random.Generator, kind: str, seen: Seen, nothing: dict) -> dict | None:
    found = faults.fault(random, kind, seen.design)
    if found is None:
        return None
    words, moved = found
    alone, wanted = float(np.linalg.norm(seen.of_fault(moved))), float(random.uniform(6, 15))
    size = wanted / max(alone, 1e-300)
    if size * np.abs(moved).max() > 0.05:
        return None
    sign = float(random.choice([-1, 1]))
    return nothing | {"fault": words, "wanted": {kind: wanted}, "moved": sign * size * moved,
                      "largest_um": 1e3 * size * float(np.abs(moved).max()),
                      **_alike(seen, kind, words, size * moved)}  # fmt: skip


def _alike(seen: Seen, kind: str, words: str, moved: np.ndarray) -> dict[str, list[str]]:
    """Effects that a fault is, and those, of the artefact or of the machine, that nobody could tell from it."""
    found, signal, among = twins.right(seen, kind, words, moved, UNSEEN), seen.of_fault(moved), visible(seen.design)
    machine = [
        name for name in among if name not in seen.named
        and min(seen.left(signal, [v]) for v in seen.versions(name, among)) < UNSEEN
    ]  # fmt: skip
    return {**found, "alike": sorted({*found["alike"], *machine})}


def of_effects(
    errors: Mapping[str, Error], sizes: Mapping[str, float], context: dict
) -> Callable[[np.ndarray], np.ndarray]:
    def e(p: np.ndarray) -> np.ndarray:
        return np.asarray(sum((sizes[name] * errors[name](p, context) for name in sizes), np.zeros_like(p)))

    return e


def indicated(true: np.ndarray, e: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Readings without noise: p + e(p) = t."""
    p = true.copy()
    for _ in range(30):
        p = true - e(p)
    return p


def seal(truths: list[dict]) -> str:
    """SHA-256 of the truth, to be written down before any case is diagnosed."""
    return hashlib.sha256(json.dumps(truths, sort_keys=True).encode()).hexdigest()


def write(one: Case, folder: Path) -> None:
    """The job folder; of a shuffled case beside it the same with its rows in order."""
    job(one, folder / one.name, one.order)
    if one.truth["kind"] == "shuffled":
        job(one, folder / f"{one.name}-in-order", np.arange(len(one.shown)))


def job(one: Case, folder: Path, order: np.ndarray, decimals: int = 6) -> None:
    """One job folder, its rows in an order, its numbers with so many decimals."""
    folder.mkdir(parents=True, exist_ok=True)
    placed = one.placed
    runs = placed.kind == RUNS  # of which targets are written, and what is read less their way
    xyz = (placed.true if runs else one.shown) - placed.origin
    numbers = {"measurement": placed.measurement, "point": placed.point, "repeat": placed.repeat}
    columns = {**numbers, **{f"{a}_mm": xyz[:, i] for i, a in enumerate("xyz")}, **placed.recorded}
    columns |= {"reading_um": -1e3 * one.y} if runs else {}
    if placed.repeat.max() == 1:
        del columns["repeat"]
    _table(folder / "recording.csv", columns, order, lambda v: f"{v:.{decimals}f}".rstrip("0").rstrip("."), ",")
    simulation = ""
    if one.predicted is not None:
        predicted = one.predicted - placed.origin
        names = {f"{a.upper()} [mm]": predicted[:, i] for i, a in enumerate("xyz")}
        _table(
            folder / "predicted.csv", numbers | names, np.arange(len(xyz)), lambda v: f"{v:.9E}".replace(".", ","), ";"
        )
        simulation = ('[simulation]\nfile = "predicted.csv"\nprogram = "a script"\n'
                      'columns = { x_mm = "X [mm]", y_mm = "Y [mm]", z_mm = "Z [mm]" }\n')  # fmt: skip
    certified = f"length_mm = {placed.length!r}\nu_um = {U_SIZE}\n" if one.certified else ""
    certified += "u_scale_um_per_m = 0.05\n" if runs else ""
    stated = f"u_coordinate_um = {1e3 * one.stated:.4f}\n" if one.stated else ""
    (folder / "job.toml").write_text(
        f'[job]\nid = "concealed"\ndate = 2026-01-01\norigin = "simulated"\n[machine]\nname = "simulated"\nchain = "XYZ"\n'
        f"travel_mm = {{ x = [0, 900], y = [0, 600], z = [-500, 0] }}\norigin_mm = {placed.origin.tolist()}\n"
        f'[artefact]\nkind = "{placed.kind}"\n{certified}[recording]\nfile = "recording.csv"\n{stated}{simulation}'
        f"[model]\neffects = {json.dumps(list(one.named))}\n",
        encoding="utf-8",
    )


def _table(file: Path, columns: dict, order: np.ndarray, written: Callable[[float], str], between: str) -> None:
    lines = [between.join(columns)]
    for i in order:
        cells = [written(float(v[i])) if np.issubdtype(v.dtype, np.floating) else str(v[i]) for v in columns.values()]
        lines.append(between.join(cells))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
