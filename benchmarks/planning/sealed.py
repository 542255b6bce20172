"""Sealed causes before and after one placing more: ``python benchmarks/planning/sealed.py [--of 40] [--out FILE.json]``.

A step gauge on the seven lines of ISO 10360-2 leaves some causes identical. The plan is given one placing more, the one that
parts them best. Of every cause that the diagnosis should then name in 80 of 100 recordings, recordings are simulated point by
point in both plans, under a truth that is sealed by a hash before any is diagnosed, and searched as ``cmm-uq diagnose``
searches them. *Detected*: the lack-of-fit test rejects at 1 %. *Named*: that cause and no other is asserted, and none is said
to be as possible. Both rates stand beside what was predicted for each plan.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from settings import SETTINGS

from cmm_uq.analysis.diagnosis.asserted import indistinguishable
from cmm_uq.analysis.diagnosis.comparison.search import search
from cmm_uq.analysis.diagnosis.power import powers, without_fault
from cmm_uq.analysis.planning.candidates import candidates, ready_plan, recording_information, set_up_information
from cmm_uq.analysis.planning.exchange import choose, score_of
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import CATALOGUE

ALPHA = 0.01


def plans(setting):
    """Rivals; the seven lines, and the same with the placing that parts rivals best."""
    _, lines = ready_plan(setting)
    setting = setting.sized(join(lines))
    rivals = setting.rivals(join(lines))
    possible = candidates(setting)
    known = set_up_information(setting, possible, rivals)
    start = known.prior + recording_information(setting, join(lines), rivals)
    score = score_of("separation", known, known.where(rivals))
    began = time.perf_counter()
    chosen = choose(known, start, score, 1)
    print(f"{len(possible)} candidates, {len(rivals)} rivals: search {time.perf_counter() - began:.2f} s, "
          f"separation {chosen.before:.2f} → {chosen.after:.2f}: {possible[chosen.indices[0]].title}")  # fmt: skip
    return rivals, {"seven lines": lines, "one placing more": (*lines, possible[chosen.indices[0]])}


def predicted(setting, placings, rivals):
    model = without_fault(setting.observed, setting.model(join(placings)), Noise(setting.sigma), 0)
    found = powers(
        model, rivals, stated=setting.sigma, sigma=setting.sigma, alpha=ALPHA, seed=0, draws=96, quantile=0.0
    )
    return {power.effect: power for power in found}


def searched(setting, points, effect, amplitude, seed):
    """Whether the test rejects, whether the effect alone is asserted, and whether what was found could be fitted."""
    random = np.random.default_rng(seed)
    acting = RecordingModel(artefact_of(setting.artefact, points), (effect,))
    sizes = np.array([
        s.nominal + (s.sd if np.isfinite(s.sd) else 0.0) * random.standard_normal() for s in acting.artefact.sizes
    ])  # fmt: skip
    coefficients = np.zeros(len(effect.coefficients))
    coefficients[0] = amplitude
    xyz = acting.simulate(coefficients, sizes, Noise(setting.sigma), random)
    try:
        found = search(replace(setting.model(points.at(xyz)), sigma=setting.sigma), setting.sigma, alpha=ALPHA, seed=0)
    except CmmUqError:  # what was found cannot be fitted: an alarm without a name
        return True, False, False
    named = found.effects == (effect.name,) and not any(effect.name in group for group in indistinguishable(found))
    return found.first.p_value < ALPHA, named, True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--of", type=int, default=40, help="recordings of each cause and plan")
    parser.add_argument("--setting", default="step gauge, seven lines", choices=list(SETTINGS))
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    setting = SETTINGS[chosen.setting]()
    rivals, both = plans(setting)
    expected = {name: predicted(setting, placings, rivals) for name, placings in both.items()}
    better = expected["one placing more"]
    amplitudes = {name: power.identifiable for name, power in better.items() if power.identifiable is not None}
    truth = [
        (name, amplitude, [20260104, i, j])
        for i, (name, amplitude) in enumerate(amplitudes.items())
        for j in range(chosen.of)
    ]
    order = np.random.default_rng(20260103).permutation(len(truth))
    seal = hashlib.sha256(json.dumps([truth[i] for i in order]).encode()).hexdigest()
    print(f"{len(amplitudes)} causes, {len(truth)} recordings in each plan, truth sealed: {seal[:16]}", flush=True)
    rows = []
    for count, i in enumerate(order, 1):
        name, amplitude, seed = truth[i]
        for plan, placings in both.items():
            points = join(placings)
            detected, named, fitted = searched(setting, points, CATALOGUE[name], amplitude, seed)
            power = expected[plan][name]
            rows.append({
                "plan": plan, "effect": name, "amplitude": amplitude, "detected": bool(detected), "named": bool(named),
                "fitted": fitted, "predicted": [power.detected(amplitude), power.named(amplitude)],
            })  # fmt: skip
        if count % 20 == 0 or count == len(order):
            report(rows, count)
            if chosen.out:
                chosen.out.write_text(json.dumps(rows), encoding="utf-8")
    for name in amplitudes:
        report([row for row in rows if row["effect"] == name], chosen.of, f"  {name}")


def report(rows, count, title=""):
    parts = []
    for plan in dict.fromkeys(row["plan"] for row in rows):
        mine = [row for row in rows if row["plan"] == plan]
        for k, what in enumerate(("detected", "named")):
            rate = np.mean([row[what] for row in mine])
            wanted = np.mean([row["predicted"][k] for row in mine])
            parts.append(f"{plan}, {what}: predicted {100 * wanted:.1f} %, found {100 * rate:.1f} %")
        if lost := sum(not row["fitted"] for row in mine):
            parts.append(f"{lost} could not be fitted")
    print(f"{title} {count}: " + "; ".join(parts), flush=True)


if __name__ == "__main__":
    main()
