"""The drift model on machines that settle, follow the seasons, wear or step: ``python -m benchmarks.drift.kinds_study``.

``--seal``, ``--run``, ``--page`` and ``--development`` as of :mod:`benchmarks.drift.study`, with a seal, a seed and a result
of its own: ``kinds_seal.json``, ``kinds_result.json``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.drift.generator import LIMIT, YEAR, Machine, crossed
from benchmarks.drift.kinds import KINDS, machines
from benchmarks.drift.study import COVERED, held, history, members, position
from cmm_uq import __version__
from cmm_uq.laboratory.due.crossing import DAYS, Crossings, crossings
from cmm_uq.laboratory.due.drift import DriftPrior, default_prior, side_by_side
from cmm_uq.laboratory.due.drift_filter import filtered
from cmm_uq.laboratory.due.fleet import fit_fleet
from cmm_uq.laboratory.due.steps import DatedStep, dated_steps, followed

HERE = Path(__file__).parent
SEAL, RESULT = HERE / "kinds_seal.json", HERE / "kinds_result.json"
SEALED = ("generator.py", "kinds.py", "kinds_study.py")
MACHINES, DATED, OF_FLEET, DEVELOPMENT = 1000, 400, 100, 1
EPOCH = 730_000  # what the histories' days are shifted by


def hashes() -> dict[str, str]:
    return {name: hashlib.sha256((HERE / name).read_bytes()).hexdigest() for name in SEALED}


def seed_of(seal: dict[str, str]) -> int:
    return int(seal["kinds.py"][:8], 16)


def alone(made: Sequence[Machine], prior: DriftPrior) -> Crossings:
    """Without a fleet, with the prior of ``history`` and ``due``; fewer days and paths than of one machine."""
    parts = []
    for i in range(0, len(made), 50):
        arrays = side_by_side([history(machine) for machine in made[i : i + 50]])
        parts.append(crossings(arrays, prior, filtered(arrays, prior), LIMIT, paths=512))
    return Crossings.joined(parts)


def judged(found: Crossings, truth: np.ndarray, made: Sequence[Machine], seed: int) -> dict[str, object]:
    place = position(found, truth, seed)
    count = np.array([len(machine.certificates.day) for machine in made])
    dates = np.isfinite(found.quantile(COVERED[1])) & (found.quantile(COVERED[0]) > 0)
    parts = {
        "all": np.ones(len(place), dtype=bool),
        "2 or 3 certificates": count < 4,
        "4 to 6": (count > 3) & (count < 7),
    }
    parts |= {"7 and more": count > 6, "both ends are dates": dates}
    middle = np.minimum(found.quantile(0.5), DAYS[-1])
    wide = np.minimum(found.quantile(COVERED[1]), DAYS[-1]) - found.quantile(COVERED[0])
    return {
        "groups": {name: held(place[which]) for name, which in parts.items() if which.sum() > 20},
        "median_error_years": float(np.median(np.abs(middle - np.minimum(truth, DAYS[-1])))) / YEAR,
        "width_years": float(np.median(wide)) / YEAR, "histogram": np.histogram(place, 10, (0, 1))[0].tolist(),
    }  # fmt: skip


def dated(made: Sequence[Machine], prior: DriftPrior) -> dict[str, float]:
    """Steps that are named against those that were made, of each machine since its first certificate."""
    named = right = inside = expected = 0
    large, found_large = 0, 0
    for machine in made:
        steps = dated_steps(followed(history(machine), LIMIT, prior))
        named += len(steps)
        expected += sum(step.probability for step in steps)
        for step in steps:
            true = [size for day, size in machine.steps if step.after - EPOCH < day <= step.by - EPOCH]  # type: ignore[attr-defined]
            right += bool(true)
            inside += bool(true) and abs(sum(true) - step.size) <= 2 * step.u
        for day, size in machine.steps:  # type: ignore[attr-defined]
            if abs(size) >= 0.4 * LIMIT and day <= machine.certificates.day[-1]:
                large += 1
                found_large += any(_has(step, day) for step in steps)
    return {"named": named, "right": right, "expected": expected, "size_held": inside, "large": large,
            "large_found": found_large}  # fmt: skip


def _has(step: DatedStep, day: int) -> bool:
    return step.after - EPOCH < day <= step.by - EPOCH


def past_of(kind: str, seed: int, count: int) -> tuple[list[Machine], np.ndarray]:
    """Machines without their futures, and the days on which they cross their limit."""
    made, days = [], []
    for machine in machines(kind, seed, count):
        days.append(crossed(machine))
        machine.raw = machine.raw[:0]
        made.append(machine)
    return made, np.array(days)


def run(seed: int, count: int, dated_count: int) -> dict[str, Any]:
    kinds: dict[str, dict[str, Any]] = {}
    with_components, plain = default_prior(LIMIT), default_prior(LIMIT, plain=True)
    for kind in KINDS:
        made, truth = past_of(kind, seed, count)
        begun = time.process_time()
        found = judged(alone(made, with_components), truth, made, seed)
        kinds[kind] = {
            "alone": found, "cpu_s": time.process_time() - begun,
            "plain": judged(alone(made, plain), truth, made, seed),
            "steps": dated(made[:dated_count], with_components), "never": float(np.isinf(truth).mean()),
            "already": float((truth == 0).mean()), "median_years": float(np.median(truth) / YEAR),
        }  # fmt: skip
        print(kind, kinds[kind], flush=True)
    return {"version": __version__, "seed": seed, "machines": count, "dated": dated_count, "kinds": kinds}


def with_fleet(seed: int, count: int) -> dict[str, Any]:
    """The first machines of all kinds as one fleet."""
    each = [past_of(kind, seed, count) for kind in KINDS]
    learnt = fit_fleet(members([machine for made, _ in each for machine in made])).estimates.crossing
    assert learnt is not None
    found = {}
    for i, (kind, (made, truth)) in enumerate(zip(KINDS, each, strict=True)):
        own = slice(i * count, (i + 1) * count)
        part = Crossings(learnt.last[own], learnt.days, *(getattr(learnt, name)[own] for name in (
            "probability", "level", "u_level", "rate", "u_rate")))  # fmt: skip
        found[kind] = judged(part, truth, made, seed)
    return found


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    for name in ("--seal", "--run", "--page"):
        asked.add_argument(name, action="store_true")
    asked.add_argument("--development", type=int, default=0, metavar="MACHINES")
    options = asked.parse_args()
    if options.seal:
        SEAL.write_text(json.dumps(hashes(), indent=1) + "\n", encoding="utf-8")
    if options.development:
        print(json.dumps(run(DEVELOPMENT, options.development, options.development), indent=1))
    if options.run:
        seal = json.loads(SEAL.read_text(encoding="utf-8"))
        if seal != hashes():
            raise SystemExit("generator or judging changed after they were sealed")
        found = run(seed_of(seal), MACHINES, DATED) | {"seal": seal}
        RESULT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        found |= {"of_fleet": OF_FLEET, "fleet": with_fleet(seed_of(seal), OF_FLEET)}
        RESULT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if options.page:
        from benchmarks.drift.kinds_page import write

        write(json.loads(RESULT.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
