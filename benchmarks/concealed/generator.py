"""Concealed cases: jobs with hidden effects, from physics written a second time (``physics.py``, ``designs.py``).

Indicated points solve p + e(p) = t. The oracle knows every true column: it sets each hidden effect's size by its
noncentrality √λ, the length of its signal over the noise after projecting out what the job names and the other hidden
effects, and it says which rival could stand in an effect's place without anyone noticing.
"""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path

import numpy as np

from benchmarks.concealed.designs import Design, ballbar, plate, sphere, step_gauge
from benchmarks.concealed.physics import (
    AROUND,
    BAR,
    DRIVE,
    ELSEWHERE,
    IN_TIME,
    KNOWN,
    LARGEST,
    PLACE,
    PROBE,
    ROUGHLY,
    TABLE,
    TIME,
    WARM,
    Error,
    kind_of,
)

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
SIGNALS = ("one", "two", "three", "roughly", "outside", "inseparable")
NOTHING = ("none", "noise stated wrongly", "set-up", "correlated", "tails")
DESIGNS = {
    "ballbar 20": lambda random: ballbar(random, 20, int(random.choice([2, 3]))),
    "ballbar 40": lambda random: ballbar(random, 40, int(random.choice([2, 3]))),
    "step gauge": step_gauge,
    "plate": plate,
    "sphere": sphere,
}
Choice = tuple[dict[str, Error], dict[str, list[str]]]
_UNSEEN = 2.0
"""√λ that is left when a rival stands in an effect's place: below it nobody could tell."""


class Oracle:
    """What all effects look like in one recording, the job's model projected out, over the noise."""

    def __init__(self, design: Design, named: list[str], certified: bool, sigma: float, shape: dict) -> None:
        self.design, self.sigma = design, sigma
        self.context = design.recorded | design.extra | shape
        baseline = [design.free, *(self.column(KNOWN[name])[:, None] for name in named)]
        if design.size is not None and not certified:
            baseline.append(design.size)
        B = np.hstack(baseline)
        length = np.linalg.norm(B, axis=0)
        U, s, _ = np.linalg.svd(B / np.where(length > 0, length, 1.0), full_matrices=True)
        rank = int(np.sum(s > 1e-10 * s[0])) if len(s) else 0
        self.rest = U[:, rank:]

    def column(self, error: Error) -> np.ndarray:
        return -self.design.D @ error(self.design.true, self.context).ravel()

    def seen(self, error: Error) -> np.ndarray:
        return self.rest.T @ self.column(error) / (self.sigma * self.design.noise)

    def rivals_of(self, name: str) -> list[np.ndarray]:
        """Columns of a rival; of a periodic one the sine and the cosine at many periods."""
        if kind_of(name) == "probe_lobing":
            return [self._turned(name, {})]
        if kind_of(name) != "periodic_scale":
            return [self.seen(KNOWN[name])[:, None]]
        return [self._turned(name, {"period": period}) for period in np.geomspace(20, 700, 120)]

    def _turned(self, name: str, shape: dict) -> np.ndarray:
        before, found = self.context, []
        for phase in (0.0, np.pi / 2):
            self.context = before | shape | {"phase": phase}
            found.append(self.seen(KNOWN[name]))
        self.context = before
        return np.column_stack(found)

    def left(self, signal: np.ndarray, others: list[np.ndarray]) -> float:
        """Length of a signal once other columns have taken what they can."""
        if not others:
            return float(np.linalg.norm(signal))
        A = np.column_stack(others)
        return float(np.linalg.norm(signal - A @ np.linalg.lstsq(A, signal, rcond=None)[0]))


def visible(design: Design) -> dict[str, Error]:
    """Effects that could act on this recording."""
    found = PLACE | WARM | TIME | TABLE
    if "approach_x" in design.recorded:
        found = found | DRIVE
    if design.kind == "ballbar":
        found = found | BAR
    return found | PROBE if design.kind == "sphere" else found


def outside(design: Design) -> dict[str, Error]:
    return AROUND if design.kind == "sphere" else ELSEWHERE | IN_TIME


def case(seed: int, what: str, kind: str, folder: Path) -> dict:
    """Write one job and return its truth."""
    for attempt in range(100):
        truth = _attempt(np.random.default_rng([seed, attempt]), what, kind, folder)
        if truth:
            return {"design": what, "kind": kind, **truth}
    raise RuntimeError(f"nothing to hide for {kind} in {what}")


def _attempt(random: np.random.Generator, what: str, kind: str, folder: Path) -> dict | None:
    design, sigma = DESIGNS[what](random), float(random.uniform(0.7, 2.0)) * 1e-3
    named = list(SIX) if (draw := random.random()) < 0.6 else list(SIX[:3]) if draw < 0.8 else []
    if design.kind == "sphere":
        named = [["probe_radius"], [], list(SIX[:3])][int(random.integers(3))]
    certified = design.size is not None and bool(random.random() < 0.7)
    shape = {"period": float(np.exp(random.uniform(np.log(30), np.log(300)))), "phase": float(random.uniform(-3, 3))}
    oracle = Oracle(design, named, certified, sigma, shape)
    chosen = hide(random, kind, design, oracle, named)
    if chosen is None:
        return None
    hidden, rivals = chosen
    weak = what == "ballbar 20"
    wanted = {name: float(random.uniform(4.5, 7) if weak else random.uniform(6, 15)) for name in hidden}
    signals = {name: oracle.seen(error) for name, error in hidden.items()}
    sizes = sizes_for(random, oracle, hidden, wanted, signals)
    if sizes is None:
        return None
    if kind in ("one", "two", "three", "roughly"):
        rivals = _inseparable(oracle, design, named, hidden, sizes, signals)
    stands_in = _stands_in(oracle, design, named, sizes, signals) if kind == "outside" else None
    base = {name: random.normal(0, LARGEST[kind_of(name)] / 6) for name in named}

    p = indicated(oracle, base, hidden, sizes) + _noise(random, kind, sigma, design)
    stated = sigma * 1e3 * (random.choice([0.5, 2.0]) if kind == "noise stated wrongly" else 1.0)
    says = kind == "noise stated wrongly" or random.random() < 0.7
    write(folder, p, design, named, design.length if certified else None, stated if says else None)
    return {
        "named": named, "hidden": sizes, "root_lambda": wanted, "sigma_um": sigma * 1e3, "stated": says,
        "certified": certified, "rivals": rivals, "stands_in": stands_in,
        **shape, "observations": len(oracle.column(KNOWN["scale_x"])),
    }  # fmt: skip


def indicated(oracle: Oracle, base: dict[str, float], hidden: dict[str, Error], sizes: dict[str, float]) -> np.ndarray:
    """Readings without noise: p + e(p) = t."""

    def e(p: np.ndarray) -> np.ndarray:
        total = np.zeros_like(p)
        for name, size in base.items():
            total += size * KNOWN[name](p, oracle.context)
        for name, size in sizes.items():
            total += size * hidden[name](p, oracle.context)
        return total

    p = oracle.design.true.copy()
    for _ in range(30):
        p = oracle.design.true - e(p)
    return p


def sizes_for(
    random: np.random.Generator, oracle: Oracle, hidden: dict[str, Error], wanted: dict[str, float], signals: dict
) -> dict[str, float] | None:
    """Sizes that give the wanted noncentralities, or nothing when they would be absurd."""
    sizes = {}
    for name, signal in signals.items():
        alone = oracle.left(signal, [other for key, other in signals.items() if key != name])
        if alone <= 1e-9 * np.linalg.norm(oracle.column(hidden[name]) / oracle.sigma):
            return None
        sizes[name] = wanted[name] / alone * float(random.choice([-1, 1]))
        if abs(sizes[name]) > (LARGEST[kind_of(name)] if name in KNOWN else 200):
            return None
    return sizes


def hide(random: np.random.Generator, kind: str, design: Design, oracle: Oracle, named: list[str]) -> Choice | None:
    if kind in NOTHING:
        return {}, {}
    if kind == "outside":
        among = outside(design)
        name = str(random.choice(sorted(among)))
        return {name: among[name]}, {}
    free = {name: error for name, error in visible(design).items() if name not in named}
    if kind == "roughly":
        among = {name: ROUGHLY[name] for name in free if name in ROUGHLY}
        if design.kind == "sphere" or not among:
            return None
        name = str(random.choice(sorted(among)))
        return {name: among[name]}, {}
    if kind == "inseparable":
        seen = {name: oracle.seen(error) for name, error in free.items() if kind_of(name) not in ("periodic_scale",)}
        pairs = [
            (a, b) for a in seen for b in seen
            if a < b and min(np.linalg.norm(seen[a]), np.linalg.norm(seen[b])) > 1e-6
            and abs(seen[a] @ seen[b]) > 0.995 * np.linalg.norm(seen[a]) * np.linalg.norm(seen[b])
        ]  # fmt: skip
        if not pairs:
            return None
        a, b = pairs[int(random.integers(len(pairs)))]
        return {a: free[a]}, {a: [b]}
    count = {"one": 1, "two": 2, "three": 3}[kind]
    if count > 1 and design.kind == "sphere" and random.random() < 0.5:
        count = 2
    names = random.choice(sorted(free), min(count, len(free)), replace=False)
    return {str(name): free[str(name)] for name in names}, {}


def _inseparable(oracle: Oracle, design: Design, named: list[str], hidden: dict, sizes: dict, signals: dict) -> dict:
    """For each hidden effect, the rivals that could stand in its place without anyone noticing."""
    found = {}
    for name in hidden:
        others = [signal for key, signal in signals.items() if key != name]
        found[name] = [
            rival
            for rival in visible(design)
            if rival not in named and rival not in hidden
            and min(oracle.left(sizes[name] * signals[name], [*others, columns]) for columns in oracle.rivals_of(rival))
            < _UNSEEN
        ]  # fmt: skip
    return found


def _stands_in(oracle: Oracle, design: Design, named: list[str], sizes: dict, signals: dict) -> tuple[str, float]:
    """The known effect that comes nearest to what is hidden, and the √λ that it leaves."""
    ((name, signal),) = signals.items()
    return min(
        (
            (rival, min(oracle.left(sizes[name] * signal, [columns]) for columns in oracle.rivals_of(rival)))
            for rival in visible(design)
            if rival not in named
        ),
        key=lambda pair: pair[1],
    )


def _noise(random: np.random.Generator, kind: str, sigma: float, design: Design) -> np.ndarray:
    n = len(design.true)
    if kind == "correlated":
        e = np.zeros((n, 3))
        e[0] = random.standard_normal(3)
        phi = float(random.choice([0.5, 0.8]))
        for i in range(1, n):
            e[i] = phi * e[i - 1] + np.sqrt(1 - phi**2) * random.standard_normal(3)
        return sigma * e
    if kind == "tails":
        dof = float(random.choice([3.0, 4.0]))
        return sigma * random.standard_t(dof, (n, 3)) / np.sqrt(dof / (dof - 2))
    e = sigma * random.standard_normal((n, 3))
    if kind == "set-up":
        key = np.column_stack([design.measurement, design.point])
        _, which = np.unique(key, axis=0, return_inverse=True)
        e += float(random.choice([0.5, 1.0])) * sigma * random.standard_normal((which.max() + 1, 3))[which.ravel()]
    return e


def write(
    folder: Path, p: np.ndarray, design: Design, named: list[str], length: float | None, stated_um: float | None
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    recorded = design.recorded
    with (folder / "recording.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *recorded])
        for i in range(len(p)):
            writer.writerow([
                design.measurement[i], design.point[i], design.repeat[i], *(f"{v:.6f}" for v in p[i]),
                *(f"{v[i]:.6f}".rstrip("0").rstrip(".") for v in recorded.values()),
            ])  # fmt: skip
    certified = f"length_mm = {length!r}\nu_um = 0.2\n" if length else ""
    stated = f"u_coordinate_um = {stated_um:.4f}\n" if stated_um else ""
    (folder / "job.toml").write_text(
        f'[job]\nid = "concealed"\ndate = 2026-01-01\n[machine]\nname = "simulated"\nchain = "XYZ"\n'
        f"travel_mm = {{ x = [0, 900], y = [0, 600], z = [-500, 0] }}\n"
        f'[artefact]\nkind = "{design.kind}"\n{certified}[recording]\nfile = "recording.csv"\n{stated}'
        f"[model]\neffects = {json.dumps(named)}\n",
        encoding="utf-8",
    )


def seal(truths: list[dict]) -> str:
    """SHA-256 of the truth, to be written down before any case is diagnosed."""
    return hashlib.sha256(json.dumps(truths, sort_keys=True).encode()).hexdigest()
