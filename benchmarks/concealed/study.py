"""Diagnose concealed ballbar cases and count: python benchmarks/concealed/study.py [cases of each kind]."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from generator import case, seal

from cmm_uq.analysis.diagnosing import Diagnosed, diagnose_job

KINDS = ("one", "two", "none", "noise stated wrongly", "set-up", "correlated", "tails", "outside")


def right(truth: dict, found: Diagnosed) -> bool:
    """Whether a verdict and its effects are what was hidden; an effect named in a group that holds it counts."""
    d, hidden = found.diagnosis, set(truth["hidden"])
    named = {item.effect for item in d.effects}
    if truth["kind"] in ("one", "two"):
        groups = [set(group) for group in d.indistinguishable]
        covered = all(name in named or any(name in g and g & named for g in groups) for name in hidden)
        surplus = [n for n in named - hidden if not any(n in g and g & hidden for g in groups)]
        return covered and not surplus
    return d.verdict == ("unexplained" if truth["kind"] == "outside" else "consistent")


def main(count: int) -> None:
    folder = Path(tempfile.mkdtemp(prefix="concealed-"))
    truths, jobs = [], []
    for k, kind in enumerate(KINDS):
        for i in range(count):
            job = folder / f"{k}-{i}"
            placings, repeats = ((20, 2), (40, 2), (40, 3))[i % 3] if kind not in ("set-up",) else (40, 3)
            truths.append(case(10_000 * k + i, kind, job, placings, repeats))
            jobs.append(job)
    print("truth sealed:", seal(truths), flush=True)
    good, verdicts, covered, seconds = Counter(), Counter(), [], []
    calibration = []
    for truth, job in zip(truths, jobs, strict=True):
        start = time.perf_counter()
        found = diagnose_job(job)
        seconds.append(time.perf_counter() - start)
        d, correct = found.diagnosis, right(truth, found)
        label = f"{truth['kind']}, {truth['placings']}" if truth["kind"] in ("one", "two") else truth["kind"]
        good[label, correct] += 1
        verdicts[truth["kind"], d.verdict] += 1
        for item in d.effects:
            calibration.append((item.probability, item.effect in truth["hidden"]))
            if item.effect in truth["hidden"] and len(item.parameters) == 1:
                (quantity,) = item.parameters.values()
                low, high = quantity.interval95
                wanted = truth["hidden"][item.effect] * (1e-6 if item.effect.startswith("thermal") else 1)
                covered.append(low <= wanted <= high)
        if not correct:
            print("  wrong:", truth["kind"], truth["placings"], json.dumps(truth["root_lambda"]), "->", d.verdict,
                  [(i.effect, round(i.probability, 3)) for i in d.effects], d.indistinguishable,
                  [p.what for p in d.where[:1]], f"p={d.p_value:.2g}", flush=True)  # fmt: skip
    for label in sorted({key for key, _ in good}):
        total = good[label, True] + good[label, False]
        print(f"{label:28s} right {good[label, True]:4d} of {total}")
    print("verdicts", dict(verdicts))
    print(f"coverage of 95 % intervals: {np.mean(covered):.3f} of {len(covered)}")
    p, y = np.array(calibration).T if calibration else (np.zeros(0), np.zeros(0))
    bins = np.digitize(p, [0.5, 0.8, 0.95, 0.99])
    for b in np.unique(bins):
        print(f"said {p[bins == b].mean():.3f}: right {y[bins == b].mean():.3f} of {np.sum(bins == b)}")
    print(f"seconds a case: median {np.median(seconds):.2f}, longest {np.max(seconds):.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 12)
