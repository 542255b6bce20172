"""How far the closed form of a recording's power is from recordings drawn and tested one by one.

For artefacts in their ready plans, noise stated or not, white or with set-up offsets: the visible length found with 90 % by
``cmm_uq.analysis.diagnosis.smallest`` over that of ``cmm_uq.analysis.diagnosis.power`` (40 draws a size).

    python -m benchmarks.planning.unseen
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, model_comparison
from cmm_uq.analysis.diagnosis.power import DrawnNoise, powers, without_fault
from cmm_uq.analysis.diagnosis.smallest import POWER, smallest_effects
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.analysis.planning.setting import PlannedNoise
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, GAUGE, setting

ALPHA, DRAWS, SIGMA = 0.01, 40, 1e-3


@dataclass(frozen=True)
class Case:
    """A design and its noise; ``effects`` of it at most."""

    name: str
    facts: ArtefactFacts
    wishes: dict[str, Any]
    stated: bool
    placing: float
    most: int = 8


CASES = (
    Case("ballbar, stated", BALLBAR, {"repeats": 1}, stated=True, placing=0.0),
    Case("ballbar", BALLBAR, {"repeats": 1}, stated=False, placing=0.0),
    Case("ballbar × 3, set-ups 2 σ", BALLBAR, {"repeats": 3}, stated=False, placing=2.0),
    Case("step gauge", GAUGE, {"repeats": 1, "length_mm": 820.0}, stated=False, placing=0.0),
    Case("step gauge, stated", GAUGE, {"repeats": 1, "length_mm": 820.0}, stated=True, placing=0.0),
    Case("plate", EVERY_KIND["plate"][0], {"repeats": 1, "pitch_mm": 90.0}, stated=False, placing=0.0),
)


def compared(case: Case) -> Iterator[tuple[str, float, float]]:
    """Each visible effect, with the closed form over the drawn amplitude, detected and named; nan where neither is."""
    chosen = setting(case.facts, **case.wishes)
    model = chosen.model(join(ready_plan(chosen)[1]))
    noise = PlannedNoise((SIGMA,) * 3, placing=case.placing * SIGMA)
    quiet = without_fault(chosen.observed, model, noise.drawn, 1)
    stated = SIGMA if case.stated else None
    first = model_comparison(quiet, stated, 0)
    found = SearchResult(first, first.comparison, None, frozenset(), (), quiet, 0.0)
    began = time.process_time()
    rows = {row.effect: row for row in smallest_effects(found, ALPHA, quiet) if row.shown and row.periods is None}
    took = time.process_time() - began
    print(
        f"{case.name}: p = {first.p_value:.2f}, {len(first.comparison.observed)} observations, closed form {took:.2f} s"
    )
    names = tuple(sorted(rows)[:: max(1, len(rows) // case.most)])
    sigma = SIGMA * _found(found)
    values = np.array([unknown.prior_mean for unknown in quiet.unknowns])
    scaled = noise.times(sigma / SIGMA)
    drawn = DrawnNoise(scaled.components(quiet, values), scaled.typical, quiet.artefact.noise_scale)
    coloured = drawn if case.placing else None
    for power in powers(
        quiet, effects(names), stated=stated, sigma=sigma, alpha=ALPHA, seed=1, draws=DRAWS, noise=coloured
    ):
        row = rows[power.effect]
        exact = [
            float(np.quantile(at, POWER, method="higher")) / power.per_unit if power.per_unit else np.inf
            for at in (power.detected_at, power.named_at)
        ]
        ratios = [
            closed / one if closed is not None and np.isfinite(one) else np.nan
            for closed, one in zip((row.detected, row.named), exact, strict=True)
        ]
        agree = (row.named is not None) == bool(np.isfinite(exact[1]))
        print(f"  {power.effect:20s} {ratios[0]:5.2f} {ratios[1]:5.2f} {'' if agree else 'named by one only'}")
        yield power.effect, ratios[0], ratios[1]


def _found(found: SearchResult) -> float:
    """Noise that the recording shows, over what it has: the drawn recordings get the same."""
    both = found.first.comparison.noise_posterior()
    return float(np.sqrt(both.sum(axis=0) @ found.first.comparison.sigma**2)) / SIGMA


def main() -> None:
    """Print every ratio and their quantiles."""
    every = [ratios for case in CASES for _, *ratios in compared(case)]
    for column, what in enumerate(("detected", "named")):
        values = np.array([ratios[column] for ratios in every])
        values = values[np.isfinite(values)]
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        print(f"{what}: {len(values)} effects, median {middle:.2f}, 90 % within {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main()
