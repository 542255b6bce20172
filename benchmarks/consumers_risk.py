"""How often a machine whose error lies at its limit passes: what each decision rule promises, and what it keeps.

Run:  python benchmarks/consumers_risk.py

Each rule decides 100 000 measurements (u = 1) of a true error at its limit of 10, and, of rules with a prior, of errors drawn
from it. Standard deviation of a share of 5 %: 0.07 points. Last, probabilities of conforming as stated and as found, for
machines that are mostly well inside their limit, and for such that are near it.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.conformity.decision import PriorKnowledge, decide
from cmm_uq.jobs.tables.conformity import FalseAccept, GuardBand, PosteriorProbability, Rule, UnconditionalRisk

DRAWS = 100_000
LIMIT, U = 10.0, 1.0
PRIOR, NEAR = PriorKnowledge(0.0, 5.0), PriorKnowledge(10.0, 2.0)

AT_LIMIT: list[tuple[str, Rule, float]] = [
    ("simple", "simple", 50.0),
    ("ASME B89.7.3.1 (4 : 1)", "ASME B89.7.3.1", 50.0),
    ("ISO 14253-1", "ISO 14253-1", 5.0),
    ("guard_band = 1", GuardBand(guard_band=1.0), 2.275),
    ("ILAC-G8 binary", "ILAC-G8 binary", 2.275),
    ("ILAC-G8 non-binary, pass", "ILAC-G8 non-binary", 2.275),
    ("max_false_accept = 0.02", FalseAccept(max_false_accept=0.02), 2.0),
]
"""Rule and promise in per cent, for an item at its limit."""

OF_ALL: list[tuple[str, Rule]] = [
    ("Z540.3", "Z540.3"),
    ("max_unconditional_false_accept = 0.002", UnconditionalRisk(max_unconditional_false_accept=0.002)),
    ("JCGM 106", "JCGM 106"),
    ("posterior_probability = 0.98", PosteriorProbability(posterior_probability=0.98)),
]
"""Rules that go by what all items are like."""


def passed(values: np.ndarray, rule: Rule, prior: PriorKnowledge | None = None) -> np.ndarray:
    """Whether each of some measured values passes."""
    decided = (decide(float(value), U, LIMIT, rule, signed=True, prior=prior).outcome for value in values)
    return np.array([outcome == "pass" for outcome in decided])


def main() -> None:
    """Print a table."""
    random = np.random.default_rng(0)
    measured = LIMIT + U * random.standard_normal(DRAWS)
    print("rule | promised / % | kept / %")
    for name, rule, promised in AT_LIMIT:
        print(f"{name} | {promised:.3g} | {100 * passed(measured, rule).mean():.2f}")
    items = random.normal(PRIOR.mean, PRIOR.sd, DRAWS)
    measured = items + U * random.standard_normal(DRAWS)
    print("rule | wrongly accepted of all / % | of those accepted nearest to their limit, not conforming / %")
    for name, rule in OF_ALL:
        accepted = passed(measured, rule, PRIOR)
        wrong = accepted & (np.abs(items) > LIMIT)
        edge = accepted & (np.abs(measured) > np.abs(measured[accepted]).max() - 0.2)
        print(f"{name} | {100 * wrong.mean():.3f} | {100 * (np.abs(items[edge]) > LIMIT).mean():.1f} ({edge.sum()})")
    for prior in (PRIOR, NEAR):
        stated_and_found(prior, random)


def stated_and_found(prior: PriorKnowledge, random: np.random.Generator) -> None:
    """Print probabilities of conforming by the measurement alone and with the prior, and the share that does conform."""
    items = random.normal(prior.mean, prior.sd, DRAWS)
    measured = items + U * random.standard_normal(DRAWS)
    chosen = np.abs(np.abs(measured) - LIMIT) < 3 * U
    items, measured = items[chosen], measured[chosen]
    said, known = (
        np.array([decide(float(v), U, LIMIT, "simple", signed=True, prior=p).probability_conforming for v in measured])
        for p in (None, prior)
    )
    conforming = np.abs(items) <= LIMIT
    print(f"errors of {prior.mean:g} ± {prior.sd:g}: alone | with the prior | found")
    for low, high in ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 0.99), (0.99, 1.01)):
        rows = (said >= low) & (said < high)
        told = (said[rows].mean(), known[rows].mean(), conforming[rows].mean())
        print(" | ".join(f"{100 * share:.1f} %" for share in told), f"| {rows.sum()}")


if __name__ == "__main__":
    main()
