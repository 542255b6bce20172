"""The drift model on machines whose future is known: ``python -m benchmarks.drift.study --seal | --run | --page``.

``--seal`` writes the hash of the generator and of the judging; the seed of the sealed fleet follows from the hash, so that
nobody chose it. ``--run`` refuses when either has changed since, and writes ``result.json``. ``--development`` runs another
seed and writes nothing.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from benchmarks.drift.generator import LIMIT, YEAR, YEARS_AHEAD, Machine, crossed, fleet
from benchmarks.drift.policies import (
    CUTS,
    FIXED,
    GROWTHS,
    LONGEST,
    YEARS,
    Case,
    Life,
    at_reliability,
    fixed,
    lived,
    staircase,
)
from cmm_uq import __version__
from cmm_uq.laboratory.due.crossing import DAYS, Crossings, crossings
from cmm_uq.laboratory.due.drift import DriftHistory as History, default_prior, side_by_side
from cmm_uq.laboratory.due.drift_filter import filtered
from cmm_uq.laboratory.due.fleet import Fleet, FleetMember as Member, belonging, fit_fleet

HERE = Path(__file__).parent
SEAL, RESULT = HERE / "seal.json", HERE / "result.json"
SEALED = ("generator.py", "policies.py", "study.py")
MACHINES, CALIBRATED, DEVELOPMENT = 10_000, 2_000, 1
TARGETS = (0.9, 0.95, 0.98)
"""Reliabilities asked of the drift model; the comparison that counts is at the middle one."""
PRIMARY = 0.95
COVERED = (0.05, 0.95)


def hashes() -> dict[str, str]:
    return {name: hashlib.sha256((HERE / name).read_bytes()).hexdigest() for name in SEALED}


def seed_of(seal: dict[str, str]) -> int:
    return int(seal["generator.py"][:8], 16)


def history(machine: Machine) -> History:
    """As the package takes it; its first day of the calendar is day one."""
    kept = machine.certificates
    day, since = np.array(kept.day, dtype=float) + 730_000, np.array(kept.adjusted_since) + 730_000
    return History(day, np.array(kept.value), np.array(kept.u), np.array(kept.u_artefact), tuple(kept.artefact), since)


def members(machines: Sequence[Machine]) -> list[Member]:
    return [Member(str(i), m.model, f"place {m.place}", history(m), LIMIT) for i, m in enumerate(machines)]


def position(found: Crossings, truth: np.ndarray, seed: int) -> np.ndarray:
    """Of each true day in its predicted distribution, uniform if the model is right; by lot within a part without a date."""
    lot = np.random.default_rng(seed).random(len(truth))
    already, by_end = found.probability[:, 0], found.probability[:, -1]
    never, inside = truth > DAYS[-1], found.by(np.minimum(truth, DAYS[-1]))
    return np.where(truth == 0, lot * already, np.where(never, by_end + lot * (1 - by_end), inside))


def held(position: np.ndarray) -> dict[str, float]:
    low, high = COVERED
    inside = (position > low) & (position < high)
    part = float(inside.mean())
    return {
        "machines": len(position), "held": part, "u": float(np.sqrt(part * (1 - part) / len(position))),
        "before": float((position <= low).mean()), "after": float((position >= high).mean()),
    }  # fmt: skip


def groups(machines: Sequence[Machine], found: Crossings, place: np.ndarray) -> dict[str, dict[str, float]]:
    """The whole, and parts of it that a reader would ask about."""
    count = np.array([len(m.certificates.day) for m in machines])
    adjusted = np.array([bool(np.isfinite(m.certificates.adjusted_since[-1])) for m in machines])
    median = found.quantile(0.5) / YEAR
    dated = np.isfinite(found.quantile(COVERED[1])) & (found.quantile(COVERED[0]) > 0)
    parts = {"all": np.ones(len(place), dtype=bool)}
    parts |= {f"{n} certificate{'s' * (n > 1)}": count == n for n in (1, 2, 3)}
    parts |= {"4 to 6": (count > 3) & (count < 7), "7 and more": count > 6}
    parts |= {"adjusted": adjusted, "never adjusted": ~adjusted, "both ends are dates": dated}
    parts |= {
        "median below 2 years": median < 2,
        "2 to 6 years": (median >= 2) & (median < 6),
        "6 years and more": median >= 6,
    }
    return {name: held(place[which]) for name, which in parts.items() if which.sum() > 20}


def rule_of(cases: list[Case], learnt: Fleet, reliability: float):
    """Calibrate when the error has crossed the limit with the probability that the target leaves."""

    def rule(which: Sequence[int]) -> np.ndarray:
        found = []
        for i in range(0, len(which), 250):
            machines = [cases[j][0] for j in which[i : i + 250]]
            arrays = side_by_side([history(machine) for machine in machines])
            prior, start = learnt.start(arrays, [m.model for m in machines], [f"place {m.place}" for m in machines])
            state = filtered(arrays, prior, start, kept=8)
            found.append(crossings(arrays, prior, state, LIMIT, paths=512, until=LONGEST).quantile(1 - reliability))
        return np.concatenate(found)

    return rule


def futures(seed: int, count: int) -> list[Case]:
    """The first machines again, with later measurements of their own."""
    cases = fleet(seed, MACHINES, int((YEARS + 0.1) * YEAR))
    return [(machine, around, np.random.default_rng([seed, i]))
            for i, (machine, around, _) in enumerate(islice(cases, count))]  # fmt: skip


def compared(seed: int, count: int, learnt: Fleet, targets: Sequence[float]) -> dict[str, object]:
    lives: dict[tuple[float, float], Life] = {}
    for growth in GROWTHS:
        for cut in CUTS:
            cases = futures(seed, count)
            lives[growth, cut] = lived(cases, staircase(cases, growth, cut))
    rows = []
    for target in targets:
        cases, begun = futures(seed, count), time.process_time()
        life = lived(cases, rule_of(cases, learnt, target))
        staircase_then = at_reliability(lives, life.reliability)
        less = None if staircase_then is None else 1 - life.cost / staircase_then[0]
        rows.append(told(life) | {"target": target, "staircase": staircase_then, "less": less,
                                  "cpu_s": time.process_time() - begun})  # fmt: skip
        print(rows[-1], flush=True)
    staircases = [told(life) | {"growth": growth, "cut": cut} for (growth, cut), life in lives.items()]
    same = [told(lived(futures(seed, count), fixed(days))) | {"days": days} for days in FIXED]
    return {"machines": count, "years": YEARS, "drift": rows, "staircases": staircases, "fixed": same}


def told(life: Life) -> dict[str, object]:
    return {
        "reliability": life.reliability, "cost": life.cost, "calibrations": life.calibrations / life.machine_years,
        "days_beyond": life.days_beyond / life.machine_years,
    }  # fmt: skip


def run(seed: int, machines: int, calibrated: int, targets: Sequence[float]) -> dict[str, object]:
    made, days = [], []
    for machine, _, _ in fleet(seed, machines):
        days.append(crossed(machine))
        machine.raw = machine.raw[:0]  # the future stays behind
        made.append(machine)
    truth = np.array(days)
    begun = time.process_time()
    learnt = fit_fleet(members(made))
    fitted = time.process_time() - begun
    found = learnt.estimates.crossing
    assert found is not None
    place = position(found, truth, seed)
    print("with the fleet", held(place), fitted, flush=True)
    begun, parts = time.process_time(), []
    prior = default_prior(LIMIT, 32)
    for i in range(0, len(made), 250):
        arrays = side_by_side([history(machine) for machine in made[i : i + 250]])
        parts.append(crossings(arrays, prior, filtered(arrays, prior), LIMIT, paths=512))
    alone = Crossings.joined(parts)
    print("alone", held(position(alone, truth, seed)), flush=True)
    return {
        "version": __version__, "seed": seed, "horizon_years": YEARS_AHEAD,
        "fleet": groups(made, found, place), "alone": groups(made, alone, position(alone, truth, seed)),
        "histogram": np.histogram(place, 20, (0, 1))[0].tolist(),
        "never": float(np.isinf(truth).mean()), "already": float((truth == 0).mean()),
        "median_years": float(np.median(truth) / YEAR),
        "rate_error": {
            "fleet": _rms(learnt.estimates.rate, made), "alone": _rms(alone.rate, made),
        },
        "not_belonging": int((~belonging(learnt.estimates.p)).sum()),
        "sampling": f"{learnt.draws} draws worth {learnt.worth:.0f} independent ones",
        "spreads": [[s.name, s.median, s.lower, s.upper] for s in learnt.spreads],
        "usual": [[u.kind, u.name, u.machines, u.rate, u.u] for u in learnt.usual],
        "cpu_s": {"fleet": fitted, "alone": time.process_time() - begun},
        "cost": compared(seed, calibrated, learnt, targets),
    }  # fmt: skip


def _rms(rate: np.ndarray, machines: Sequence[Machine]) -> float:
    return float(np.sqrt(np.mean((rate - np.array([machine.rate for machine in machines])) ** 2)))


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seal", action="store_true")
    asked.add_argument("--run", action="store_true")
    asked.add_argument("--page", action="store_true")
    asked.add_argument("--development", type=int, default=0, metavar="MACHINES")
    options = asked.parse_args()
    if options.seal:
        SEAL.write_text(json.dumps(hashes(), indent=1) + "\n", encoding="utf-8")
    if options.development:
        count = options.development
        print(json.dumps(run(DEVELOPMENT, count, count // 10, (PRIMARY,)), indent=1))
    if options.run:
        seal = json.loads(SEAL.read_text(encoding="utf-8"))
        if seal != hashes():
            raise SystemExit("generator or judging changed after they were sealed")
        found = run(seed_of(seal), MACHINES, CALIBRATED, TARGETS)
        RESULT.write_text(json.dumps(found | {"seal": seal}, indent=1) + "\n", encoding="utf-8")
    if options.page:
        from benchmarks.drift.page import write

        write(json.loads(RESULT.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
