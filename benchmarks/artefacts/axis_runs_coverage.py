"""How often intervals hold of runs along axes: figures of ISO 230-2, named errors, and the map of curves of no known form.

    python -m benchmarks.artefacts.axis_runs_coverage figures|errors|single|map|references|circles|certified COUNT [NOISE]

The machine is simulated here, by its kinematics written out for the chain XYZ, and shares no code with the package.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.artefacts.weighed import intervals
from cmm_uq.analysis.conformity.positioning import uncertainty_of_figures
from cmm_uq.app.commands.jobs.compensate import write_new_map
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Machine as MachineFacts, Points
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.geometry.positioning import CircularTest

TRAVEL = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
MIDDLE, SECOND = TRAVEL.mean(axis=1), np.pi / 180 / 3600
OPTICS = np.array([20.0, -10.0, -120.0])
NAMES = [
    *(f"scale_{a}" for a in "xyz"), *(f"hysteresis_{a}" for a in "xyz"),
    *(f"straightness_{a}_{b}" for a in "xyz" for b in "xyz" if a != b), *(f"rotation_{a}_{b}" for a in "xyz" for b in "xyz"),
]  # fmt: skip
JOB = """[job]
id = "axis-runs"
date = 2026-01-01
[machine]
name = "of this study"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
[artefact]
kind = "axis_runs"
u_scale_um_per_m = {u}
optics_mm = [20, -10, -120]
[recording]
file = "recording.csv"
[test_uncertainty]
u_alignment_um = 0.3
u_repeat_um = 0.2
[model]
effects = [{names}]
"""


class Machine:
    """Displacement and rotation of each carriage as functions of its place, µm and ″: [carriage][axis]."""

    def __init__(self, random: np.random.Generator, *, smooth: bool) -> None:
        self.scale, self.gap = random.normal(0, 10, 3), random.normal(0, 2, 3)
        self.bow, self.turn = random.normal(0, 4, (3, 3)), random.normal(0, 6, (3, 3))
        # bumps of some width anywhere: amplitude, place, width in parts of the travel, of displacements and rotations
        shape = (3, 6, 6)
        self.bumps = (
            random.normal(0, 3, shape) * smooth,
            random.uniform(0, 1, shape),
            random.uniform(0.15, 0.6, shape),
        )

    def of(self, i: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        low, span = TRAVEL[i, 0], np.ptp(TRAVEL[i])
        part = (at - low) / span
        shift = self.bow[i] * (1 - (2 * part[:, None] - 1) ** 2)
        shift[:, i] = self.scale[i] * at / 1000
        turn = np.outer((at - low) / 1000, self.turn[i])
        height, place, width = (each[i] for each in self.bumps)
        bumps = np.sum(height * np.exp(-0.5 * ((part[:, None, None] - place) / width) ** 2), axis=2)
        return shift + bumps[:, :3], turn + bumps[:, 3:]

    def error(self, xyz: np.ndarray, tip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement of a tip and rotation of the ram, µm and ″: X carries Y and Z, Y carries Z."""
        moved, turned = np.zeros(xyz.shape), np.zeros(xyz.shape)
        for i in range(3):
            shift, turn = self.of(i, xyz[:, i])
            lever = tip + np.where(np.arange(3) > i, xyz, 0.0)
            moved += shift + 1000 * SECOND * np.cross(turn, lever)
            turned += turn
        return moved, turned


def recorded(
    machine: Machine, random: np.random.Generator, folder: Path, runs: list[tuple[int, int]], *, u: float = 0.4,
    sigma: float = 0.25, targets: int = 7, repeats: int = 3, names: list[str] | None = None, turning: float | None = None,
    kind: str | None = None,
) -> Path:  # fmt: skip
    """A job of runs, each an axis and what is read: 0 … 2 a displacement along it, 3 … 5 a rotation about it."""
    rows, wrong = ["measurement,point,repeat,x_mm,y_mm,z_mm,reading_um,reading_arcsec," + ",".join(
        f"{name}_{a}" for name in ("approach", "read", "turn") for a in "xyz"
    )], random.normal(0, u)  # fmt: skip
    for number, (axis, sense) in enumerate(runs, 1):
        low, high = TRAVEL[axis]
        there = np.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), targets)
        at, way = np.concatenate([there, there[::-1]]), np.repeat([1.0, -1.0], targets)
        xyz = np.tile(MIDDLE, (len(at), 1))
        xyz[:, axis] = at
        moved, turned = machine.error(xyz, OPTICS)
        moved[:, axis] += 0.5 * machine.gap[axis] * way
        zero, slope = random.normal(0, 20), random.normal(0, 5) if sense < 3 and sense != axis else 0.0
        off = noise_of(kind, random, (repeats, len(at)), sigma) if kind else None
        for repeat in range(1, repeats + 1):
            read = (moved[:, sense] if sense < 3 else turned[:, sense - 3]) + zero + slope * at / 1000
            read = (
                read
                + (wrong * at / 1000 if sense == axis else 0.0)
                + (
                    (sigma if turning is None or sense < 3 else turning) * random.normal(size=len(at))
                    if off is None
                    else off[repeat - 1]
                )
            )
            for k, value in enumerate(read):
                cells = [number, k + 1, repeat, *xyz[k], value if sense < 3 else 0.0, value if sense >= 3 else 0.0]
                unit = [way[k] * (i == axis) for i in range(3)], [1.0 * (sense == i) for i in range(6)]
                rows.append(",".join(f"{cell:.10g}" for cell in [*cells, *unit[0], *unit[1]]))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    quoted = ", ".join(f'"{name}"' for name in names or NAMES)
    (folder / "job.toml").write_text(JOB.format(u=u, names=quoted), encoding="utf-8")
    return folder


def artefact(folder: Path) -> tuple[Job, Artefact]:
    job = read_job(folder)
    return job, artefact_of(job.facts.artefact, job.points)


def figures(count: int, noises: tuple[str, ...] = ("white",)) -> None:
    """U = 2 u of what a perfect instrument would have found on the same runs, by how the instrument's readings change."""
    for kind in noises:
        held, half = Counter[str](), Counter[str]()
        for seed in range(count):
            random = np.random.default_rng([1, seed])
            machine = Machine(random, smooth=True)
            with tempfile.TemporaryDirectory() as name:
                folder = recorded(machine, random, Path(name), [(0, 0)], sigma=0.3, repeats=5, u=0.0)
                job, runs = artefact(folder)
                true = runs.positionings()[1]
                (folder / "job.toml").write_text(
                    (folder / "job.toml").read_text().replace("u_scale_um_per_m = 0.0", "u_scale_um_per_m = 0.4")
                )
                job, runs = artefact(folder)
            part = (true.targets - true.targets[0]) / np.ptp(true.targets)
            whole = random.normal(0, 0.4 * np.ptp(true.targets) / 1000) + random.normal(0, 0.3)
            _, targets, repeats = true.x.shape
            off = noise_of(kind, random, (repeats, 2 * targets), 0.2)  # forth, and back through the same targets
            there_and_back = np.stack([off[:, :targets].T, off[:, : targets - 1 : -1].T])
            x = true.x + whole * part[None, :, None] + there_and_back
            read = replace(runs.positionings()[1], x=x)
            spread, found, at = uncertainty_of_figures(read, job.circumstances), read.figures(), true.figures()
            for figure, u in spread.items():
                held[figure] += abs(found[figure] - at[figure]) <= 2 * u
                half[figure] += abs(found[figure] - at[figure]) <= u
        told = (f"{name} {100 * n / count:.1f} % (half {100 * half[name] / count:.1f})" for name, n in held.items())
        print(f"{kind}, {count}: " + "; ".join(told), flush=True)


def certified(count: int, noises: tuple[str, ...]) -> None:
    """95 % intervals of the certificate of eighteen runs, all errors named, by noise."""
    runs = [(axis, sense) for axis in range(3) for sense in range(6)]
    for kind in noises:
        held, narrow = np.zeros(len(NAMES)), np.zeros(len(NAMES))
        for seed in range(count):
            random = np.random.default_rng([6, seed])
            machine = Machine(random, smooth=False)
            with tempfile.TemporaryDirectory() as name:
                _, seen = artefact(recorded(machine, random, Path(name), runs, repeats=2, targets=6, kind=kind))
            low, high = intervals(RecordingModel(seen, effects(NAMES)), seed, len(NAMES))
            true = np.array([*machine.scale, *machine.gap, *machine.bow[~np.eye(3, dtype=bool)], *machine.turn.ravel()])
            off = np.abs(true - 0.5 * (low + high)) / (0.5 * (high - low))
            held, narrow = held + (off <= 1), narrow + (off <= 0.5)
            if seed + 1 == count or (seed + 1) % 100 == 0:
                told = []
                for what in ("scale", "hysteresis", "straightness", "rotation"):
                    own = [i for i, each in enumerate(NAMES) if each.startswith(what)]
                    rates = (100 * each[own].mean() / (seed + 1) for each in (held, narrow))
                    told.append("{} {:.1f} % (half {:.1f})".format(what, *rates))
                print(f"{kind}, {seed + 1}: " + ", ".join(told), flush=True)


def errors(count: int) -> None:
    """95 % intervals of least squares for the errors in the model's own forms, the instrument's scale wrong too."""
    runs = [(axis, sense) for axis in range(3) for sense in range(6)]
    held, kinds = dict.fromkeys(NAMES, 0), list(NAMES)
    for seed in range(count):
        random = np.random.default_rng([2, seed])
        machine = Machine(random, smooth=False)
        with tempfile.TemporaryDirectory() as name:
            _, seen = artefact(recorded(machine, random, Path(name), runs, repeats=2, targets=6))
        found = RecordingModel(seen, effects(NAMES)).estimate().least_squares
        factor = float(stats.t.ppf(0.975, found.degrees_of_freedom))
        true = [*machine.scale, *machine.gap, *(machine.bow[i, j] for i in range(3) for j in range(3) if i != j),
                *machine.turn.ravel()]  # fmt: skip
        for k, value in enumerate(true):
            held[kinds[k]] += abs(found.value[k] - value) <= factor * np.sqrt(found.covariance[k, k])
    for kind in ("scale", "hysteresis", "straightness", "rotation"):
        own = [times for name, times in held.items() if name.startswith(kind)]
        print(
            f"| {kind} | {100 * sum(own) / (count * len(own)):.1f} % of {count * len(own)} | {min(own)} … {max(own)} |"
        )


def single(count: int) -> None:
    """The same of runs that were not repeated, rotations read with their own noise, not that of the arm: 0.05″ or 2″."""
    runs = [(axis, sense) for axis in range(3) for sense in range(6)]
    for noise in (0.05, 2.0):
        held = dict.fromkeys(NAMES, 0)
        for seed in range(count):
            random = np.random.default_rng([7, seed])
            machine = Machine(random, smooth=False)
            with tempfile.TemporaryDirectory() as name:
                folder = recorded(machine, random, Path(name), runs, repeats=1, targets=9, turning=noise)
                _, seen = artefact(folder)
            found = RecordingModel(seen, effects(NAMES)).estimate().least_squares
            factor = float(stats.t.ppf(0.975, found.degrees_of_freedom))
            true = [*machine.scale, *machine.gap, *(machine.bow[i, j] for i in range(3) for j in range(3) if i != j),
                    *machine.turn.ravel()]  # fmt: skip
            for k, value in enumerate(true):
                held[NAMES[k]] += abs(found.value[k] - value) <= factor * np.sqrt(found.covariance[k, k])
        told = []
        for kind in ("scale", "hysteresis", "straightness", "rotation"):
            own = [times for name, times in held.items() if name.startswith(kind)]
            told.append(f"{kind} {100 * sum(own) / (count * len(own)):.1f} %")
        print(f"| {noise}″ | " + ", ".join(told) + " |")


def of_map(count: int) -> None:
    """Displacements between targets along X by the map, with its covariance, of curves of no known form."""
    held, total, before, after, u = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    places = np.linspace(0.1, 0.9, 9)
    for seed in range(count):
        random = np.random.default_rng([3, seed])
        machine = Machine(random, smooth=True)
        with tempfile.TemporaryDirectory() as name:
            runs = [(0, 0), (0, 1), (0, 2), (0, 4), (0, 5)]
            job = recorded(
                machine, random, Path(name) / "job", runs, targets=9, repeats=2, names=["scale_x", "hysteresis_x"]
            )
            _, made = write_new_map(job, Path(name) / "map")
        xyz = np.tile(MIDDLE, (len(places), 1))
        xyz[:, 0] = places * 900.0
        true, _ = machine.error(xyz, OPTICS)
        known, covariance = made.error_map, made.error_map.covariance
        root = covariance.root(known, xyz, tip=OPTICS)
        table = np.column_stack(
            [np.interp(xyz[:, 0], known.axes[0].positions, known.axes[0].errors[:, k]) for k in range(6)]
        )
        lever = OPTICS + np.where(np.arange(3) > 0, xyz, 0.0)
        by_map = table[:, :3] + np.cross(table[:, 3:], lever)
        free = np.column_stack([np.ones(len(places)), places])
        for k in range(3):  # of a straightness less a line, of a position less its mean
            out = np.eye(len(places)) - free[:, : 1 if k == 0 else 2] @ np.linalg.pinv(free[:, : 1 if k == 0 else 2])
            off, sd = out @ (true[:, k] / 1000 - by_map[:, k]), np.linalg.norm(out @ root[:, k], axis=1)
            held[k] += np.sum(np.abs(off) <= 1.96 * sd)
            total[k] += len(places)
            before[k] += np.sum((out @ true[:, k] / 1000) ** 2)
            after[k] += np.sum(off**2)
            u[k] += np.sum(sd**2)
        print(seed, (held / total).round(3), flush=True)
    for k, what in enumerate(("position of X", "straightness along Y", "straightness along Z")):
        rms = [1000 * float(np.sqrt(each[k] / total[k])) for each in (before, after, u)]
        print(
            f"| {what} | {100 * held[k] / total[k]:.1f} % of {total[k]:.0f} | {rms[0]:.2f} | {rms[1]:.2f} | {rms[2]:.2f} |"
        )


def against(key: str, rows: dict[str, np.ndarray], names: list[str], **facts: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles and half-widths of a certificate's 95 % intervals, of a recording of runs that stands in the memory."""
    xyz, numbers = rows.pop("xyz"), [rows.pop(name).astype(np.int64) for name in ("measurement", "point", "repeat")]
    points = Points(
        xyz, *numbers, MachineFacts("of this study", "XYZ", TRAVEL), {k: v.astype(float) for k, v in rows.items()}
    )
    seen = artefact_of(artefact_facts(kind="axis_runs", **{key: facts.pop(key), **facts}), points)
    model = RecordingModel(seen, effects(names))
    low, high = intervals(model, 1, len(names))
    return 0.5 * (low + high), 0.5 * (high - low)


def runs_of(
    axis: int, sense: int, read: np.ndarray, at: np.ndarray, number: int, repeats: int
) -> dict[str, np.ndarray]:
    """Rows of a run there and back; ``read`` (repeats, 2·t) µm."""
    both, way, n = np.concatenate([at, at[::-1]]), np.repeat([1.0, -1.0], len(at)), 2 * len(at) * repeats
    xyz = np.tile(MIDDLE, (n, 1))
    xyz[:, axis] = np.tile(both, repeats)
    rows = {"xyz": xyz, "measurement": np.full(n, number), "point": np.tile(np.arange(1, 2 * len(at) + 1), repeats),
            "repeat": np.repeat(np.arange(1, repeats + 1), 2 * len(at)), "reading_um": read.ravel()}  # fmt: skip
    for i, a in enumerate("xyz"):
        rows |= {f"approach_{a}": np.tile(way, repeats) * (i == axis), f"read_{a}": np.full(n, float(i == sense)),
                 f"turn_{a}": np.zeros(n)}  # fmt: skip
    return rows


def noise_of(kind: str, random: np.random.Generator, shape: tuple[int, int], sigma: float) -> np.ndarray:
    """White; or slow: half of it white, and a random walk that is as large over a repeat; with tails (t of 4); by set-up:
    half of it an offset of each repeat, of a circle of each sense."""
    white = random.standard_normal(shape)
    if kind == "set-up":
        return sigma * np.sqrt(0.5) * (white + random.standard_normal((shape[0], 1)))
    if kind == "tails":
        return sigma * random.standard_t(4, shape) / np.sqrt(2)
    if kind == "slow":
        walk = np.cumsum(random.standard_normal(shape), axis=1) / np.sqrt(shape[1])
        return sigma * np.sqrt(0.5) * (white + walk)
    return sigma * white


NOISES = ("white", "slow", "tails", "set-up")


def joined(parts: list[dict[str, np.ndarray]], **columns: list[float]) -> dict[str, np.ndarray]:
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    count = [len(part["xyz"]) for part in parts]
    return whole | {name: np.repeat(np.array(values), count) for name, values in columns.items()}


def references(count: int, noises: tuple[str, ...]) -> None:
    """Squareness by a square (its angle drawn of its u) and straightness by a straightedge turned over, by noise."""
    at = np.linspace(100.0, 800.0, 8)
    for kind in noises:
        held = np.zeros(2)
        for seed in range(count):
            random = np.random.default_rng([4, seed])
            s, angle, turn, bow = random.normal(0, [10, 0.5, 20, 4])
            off = [noise_of(kind, random, (2, 16), 0.3) for _ in range(4)]
            there = np.concatenate([at, at[::-1]])
            legs = [runs_of(0, 1, -1000 * SECOND * turn * there + off[0], at, 1, 2),
                    runs_of(1, 0, 1000 * SECOND * (angle + turn - s) * there + off[1], at, 2, 2)]  # fmt: skip
            value, half = against(
                "u_square_arcsec", joined(legs, square=[1.0, 1.0]), ["squareness_xy"], u_square_arcsec=0.5
            )
            held[0] += abs(value[0] - s) <= half[0]
            profile = random.normal(0, 1, 8)[[*range(8), *range(7, -1, -1)]]
            straight = bow * (1 - (2 * there / 900 - 1) ** 2)
            edges = []
            for i, sign in ((2, 1.0), (3, -1.0)):
                line = random.normal(0, 5) + random.normal(0, 5) * there / 1000
                edges.append(runs_of(0, 1, straight + sign * profile + line + off[i], at, i, 2))
            value, half = against("arm_mm", joined(edges, straightedge=[1.0, -1.0]), ["straightness_x_y"], arm_mm=100.0)
            held[1] += abs(value[0] - bow) <= half[0]
        print(
            f"| {kind} | {count} | squareness {100 * held[0] / count:.1f} % | straightness {100 * held[1] / count:.1f} % |"
        )


def circles(count: int, noises: tuple[str, ...]) -> None:
    """Squareness, scales and plays of two axes by a circle, and U of G, H, F and D against a perfect bar on the same path."""
    angle = np.radians(np.arange(0, 360, 5))
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    tangent = np.column_stack([-np.sin(angle), np.cos(angle)])
    names = ["squareness_xy", "scale_x", "scale_y", "hysteresis_x", "hysteresis_y"]
    for kind in noises:
        held, narrow, figures_held, half_held = np.zeros(5), np.zeros(5), Counter[str](), Counter[str]()
        for seed in range(count):
            random = np.random.default_rng([5, seed])
            true = random.normal(0, [10, 15, 15, 2, 2])
            bar, centre = random.normal(0, 0.4), random.normal(0, 5, 2)
            path = []
            for way in (1.0, -1.0):
                place = MIDDLE[:2] + 150 * outward
                error = np.column_stack([
                    true[1] * place[:, 0] / 1000 - 1000 * SECOND * true[0] * place[:, 1], true[2] * place[:, 1] / 1000,
                ]) + 0.5 * true[3:] * np.sign(np.round(way * tangent, 9))  # fmt: skip
                path.append(np.sum(outward * (error + centre), axis=1))
            actual = np.array(path)
            read = actual - bar + noise_of(kind, random, (2, 72), 0.3)
            rows = {"xyz": np.tile(np.column_stack([MIDDLE[:2] + 150 * outward, np.full(72, MIDDLE[2])]), (2, 1)),
                    "measurement": np.ones(144), "point": np.arange(1, 145), "repeat": np.ones(144),
                    "reading_um": read.ravel()}  # fmt: skip
            way = np.vstack([tangent, -tangent])
            for i, a in enumerate("xyz"):
                rows[f"approach_{a}"] = np.sign(np.round(way[:, i], 9)) if i < 2 else np.zeros(144)
                rows[f"read_{a}"] = np.tile(outward[:, i], 2) if i < 2 else np.zeros(144)
                rows[f"turn_{a}"] = np.zeros(144)
            value, half = against("u_bar_um", rows, names, u_bar_um=0.4)
            held, narrow = held + (np.abs(value - true) <= half), narrow + (np.abs(value - true) <= 0.5 * half)
            targets, ones = np.degrees(angle), np.ones(72)
            made = [CircularTest(targets, x[:, :, None], "↺↻", u_reference=0.4, growth=ones, length_mm=150.0, calibrated=True)
                    for x in (actual, read)]  # fmt: skip
            spread = uncertainty_of_figures(made[1], Circumstances(uncertainty=TestUncertainty(u_repeat_um=0.3)))
            exact, found = (one.figures() for one in made)
            for figure, u in spread.items():
                figures_held[figure] += abs(found[figure] - exact[figure]) <= 2 * u
                half_held[figure] += abs(found[figure] - exact[figure]) <= u
            if seed + 1 < count and (seed + 1) % 250:
                continue
            told = [f"{name} {100 * one / (seed + 1):.1f} (half {100 * other / (seed + 1):.1f})"
                    for name, one, other in zip(names, held, narrow, strict=True)]  # fmt: skip
            told += [f"{figure} {100 * times / (seed + 1):.1f} (half {100 * half_held[figure] / (seed + 1):.1f})"
                     for figure, times in figures_held.items()]  # fmt: skip
            print(f"| {kind} | {seed + 1} | " + ", ".join(told) + " |", flush=True)


if __name__ == "__main__":
    by_noise = {"figures": figures, "references": references, "circles": circles, "certified": certified}
    others = {"errors": errors, "single": single, "map": of_map}
    if sys.argv[1] in by_noise:
        by_noise[sys.argv[1]](int(sys.argv[2]), tuple(sys.argv[3:]) or NOISES)
    else:
        others[sys.argv[1]](int(sys.argv[2]))
