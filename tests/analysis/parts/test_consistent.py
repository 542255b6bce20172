"""What is stated of a characteristic does not contradict itself: value, interval, U, probability, decision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.analysis.conformity.limits import RARE, SCARCE, LimitDecision, Limits, judge
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan
from cmm_uq.analysis.parts.result import StatedCharacteristic, conforming, middle, stated
from cmm_uq.app.commands.parts.part import _together
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.propagation import Source, simulate
from tests.parts_drawn import circle

N = 20_000
DRAWN: dict[str, Callable[[np.random.Generator], Floats]] = {
    "normal": lambda random: random.standard_normal(N),
    "to the right": lambda random: random.lognormal(sigma=0.6, size=N),
    "to the left": lambda random: -random.exponential(size=N),
    "flat": lambda random: random.uniform(-2.0, 2.0, N),
    "of two": lambda random: random.choice([-1.5, 1.5], N) + 0.2 * random.standard_normal(N),
    "with tails": lambda random: random.standard_t(4.0, N),
}
PROVED = 0.05  # of ISO 14253-1: the probability of the contrary that a pass or a fail leaves
DRAW_ERROR = 4 * np.sqrt(0.05 / N)  # four standard deviations of a share of one in twenty
errors_of = st.sampled_from(sorted(DRAWN))
numbers = st.floats(-3.0, 6.0).map(lambda number: round(number, 3))
limits_of = st.one_of(st.none(), numbers)


def all_of(
    errors: Floats, measured: Floats, plan: Plan
) -> tuple[tuple[StatedCharacteristic, ...], Floats, float, list[LimitDecision]]:
    names = [one.name for one in plan.characteristics]
    simulated = simulate(Source(names, lambda random, n: errors.T.copy()), N)
    each, together = conforming(plan, errors, measured)
    decided = []
    for i, one in enumerate(plan.characteristics):
        zone = one.what == "roundness"
        mean = middle(errors[:, i]) if zone else float(errors[:, i].mean())
        decided.append(
            judge(Limits(one.lower, one.upper, errors[:, i] - mean, zone), "ISO 14253-1", float(measured[i] - mean))
        )
    return stated(simulated, measured, plan, errors), each, together, decided


@pytest.mark.long
@given(
    kinds=st.lists(st.tuples(st.booleans(), errors_of, numbers, limits_of, numbers), min_size=1, max_size=4),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=60, deadline=None)
def test_what_is_stated_does_not_contradict_itself(
    kinds: list[tuple[bool, str, float, float | None, float]], seed: int
) -> None:
    random = np.random.default_rng(seed)
    errors = np.column_stack([DRAWN[name](random) for _, name, *_ in kinds])
    made = []
    for i, (zone, _, _, lower, upper) in enumerate(kinds):
        low = None if zone or lower is None else min(lower, upper)
        high = max(upper, 0.05) if zone else max(upper, upper if lower is None else lower + 1e-3)
        made.append(PartCharacteristic(str(i), "roundness" if zone else "size", ("hole",), lower=low, upper=high))
    measured = np.array([max(value, 0.0) if zone else value for zone, _, value, *_ in kinds])
    plan = Plan((circle("hole", [0, 0, 0], 20.0, 8),), tuple(made))
    found, each, together, decided = all_of(errors, measured, plan)
    for one, asked, probability, judged, draws in zip(found, made, each, decided, (measured - errors).T, strict=True):
        low, high = one.interval
        zone = asked.what == "roundness"
        rare = 2.01 * RARE / N / (SCARCE if zone else 1.0)  # tails of fewer draws than these are judged apart
        assert one.value is not None
        assert judged.probability is not None
        # the same probability by both ways, and the rest of it
        assert judged.probability == pytest.approx(probability, abs=rare), "two probabilities"
        assert judged.probability + (judged.beyond or 0.0) == pytest.approx(1, abs=rare)
        # value, interval and U
        assert low <= high
        assert 0.5 * (high - low) * (1 - 1e-9) <= one.U, "U shorter than its interval"
        if zone:
            assert low <= one.value <= high, "a value outside of its interval"
            assert low >= 0
            if low == 0:
                assert one.value + one.U >= high * (1 - 1e-9), "U ends before the interval"
        _agrees_with_its_decision(one, asked, judged, draws)
    # Fréchet
    told = np.array([judged.probability for judged in decided])
    for every, least in ((together, each), (_together(together, decided), told)):
        assert every is not None
        assert max(0.0, 1 - np.sum(1 - least)) - 1e-12 <= every <= least.min() + 1e-12


def _agrees_with_its_decision(
    one: StatedCharacteristic, asked: PartCharacteristic, judged: LimitDecision, draws: Floats
) -> None:
    (low, high), upper, probability = one.interval, float(asked.upper or 0.0), float(judged.probability or 0.0)
    assert one.value is not None
    # decision and probability
    if judged.outcome == "pass":
        assert 1 - probability <= PROVED + 1e-9, "a pass that is not proved"
        assert one.value <= upper
    if judged.outcome == "fail":
        assert probability <= PROVED + 1e-9, "a fail that is not proved"
    # decision and interval
    inside = (asked.lower is None or low >= asked.lower) and high <= upper
    outside = low > upper or (asked.lower is not None and high < asked.lower)
    if inside:
        assert probability >= 0.95 - DRAW_ERROR, "an interval inside of limits that are not kept"
        assert judged.outcome != "fail"
    if outside:
        assert probability <= 0.05 + DRAW_ERROR, "an interval outside of limits that are kept"
        assert judged.outcome != "pass"
    if asked.what == "roundness" and np.mean(draws >= 0) >= SCARCE and high > upper:
        assert 1 - probability >= 0.025 - DRAW_ERROR, "an interval beyond a limit that is kept for sure"
