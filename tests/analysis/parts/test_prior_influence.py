"""What other priors of the machine's errors would change of a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.machine.performance import ALL
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, Unmodelled
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartPose, Plan
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual, prior_influence
from cmm_uq.machine.physics.catalogue import effects
from tests.parts_drawn import MACHINE, spot

PLAN = Plan(
    (spot("one", [0, 0, 0]), spot("other", [200, 0, 0])), (PartCharacteristic("d", "distance", ("one", "other")),)
)
POSE = PartPose(np.eye(3), np.array([300.0, 200.0, -200.0]))
(SCALE,) = effects(["scale_x"])
BOW, YAW = effects(["scale_curvature_x", "rotation_x_z"])


def virtual(state: MachineState) -> Virtual:
    return Virtual(PLAN, MeasurementConditions(state, (POSE,)))


LEVER = 8 / 81 * 1e-3
"""By hand, mm of a length from x = 300 to 500 mm for 1 µm of the bow 1 − (2x/900 − 1)²: 80/81 − 72/81."""


def test_draws_of_a_machine_are_weighed_by_the_ratio_of_the_priors() -> None:
    """A bow c ~ N(0, s²), s half-normal of width 1: with a width of t its variance is t², so u is t times as large.
    Half the width is weighed (4000 of 20 000 draws, of kurtosis 9); twice has weights without a variance, and is scaled."""
    random = np.random.default_rng(4)
    sizes = np.abs(random.standard_normal(20_000))
    draws = (sizes * random.standard_normal(20_000))[:, None]
    state = MachineState(MACHINE, (BOW,), draws, StatedNoise(), scales={"position": sizes})
    half, twice = prior_influence(virtual(state), state, LEVER * draws.std(axis=0), 1)
    assert (half.family, half.times, twice.times) == ("position", 0.5, 2.0)
    assert half.u == pytest.approx([0.5], rel=0.1)
    assert twice.u == pytest.approx([2.0], rel=0.05)
    assert abs(float(half.shift[0])) < 0.1


def test_a_size_that_a_recording_shows_hardly_moves_with_its_prior() -> None:
    """Of s in (0.1, 0.2) p′/p is between exp(−1.5·0.2²) and 1 for half the width: mean and variance by sums."""
    random = np.random.default_rng(14)
    sizes = random.uniform(0.1, 0.2, 4000)
    draws = (sizes * random.standard_normal(4000))[:, None]
    state = MachineState(MACHINE, (BOW,), draws, StatedNoise(), scales={"position": sizes})
    for found, times in zip(
        prior_influence(virtual(state), state, LEVER * draws.std(axis=0), 1), (0.5, 2.0), strict=True
    ):
        weight = np.exp(0.5 * sizes**2 * (1 - times**-2))
        weight /= weight.sum()
        mean = weight @ draws[:, 0]
        assert found.u == pytest.approx(np.sqrt(weight @ (draws[:, 0] - mean) ** 2) / draws.std(), rel=1e-6)
        assert found.shift == pytest.approx([(mean - draws.mean()) / draws.std()], rel=1e-3)


def test_a_value_that_follows_from_the_prior_moves_with_it() -> None:
    """Draws of c = s: with half the width their mean is half as large; half-normal means are √(2/π) of the width."""
    sizes = np.abs(np.random.default_rng(5).standard_normal(20_000))
    state = MachineState(MACHINE, (BOW,), sizes[:, None], StatedNoise(), scales={"position": sizes})
    u = np.array([LEVER * sizes.std()])
    half, twice = prior_influence(virtual(state), state, u, 1)
    # true = indicated + e: the length is indicated too short by LEVER·c, so that the value, which has the mean error taken
    # off, gets smaller with c
    expected = LEVER * np.sqrt(2 / np.pi) / u[0]
    assert half.shift == pytest.approx([-0.5 * expected], rel=0.1)
    assert twice.shift == pytest.approx([expected], rel=0.05)


def test_what_no_recording_shows_scales_with_its_prior() -> None:
    """u² = a² + b², b of the error that nobody saw: with twice its prior a² + 4·b². 4000 draws."""
    bow = Unmodelled(BOW, np.array([10.0]))
    state = MachineState(MACHINE, (SCALE,), np.array([[-1.0], [1.0]]), StatedNoise(), unmodelled=(bow,))
    place = virtual(state)
    error = place.errors(np.random.default_rng(1), 40_000)
    u = error.std(axis=0)
    a = 200e-6
    half, twice = prior_influence(place, state, u, 1)
    b2 = float(u[0]) ** 2 - a**2
    assert half.family == "position"
    assert half.u == pytest.approx([np.sqrt(a**2 + b2 / 4) / u[0]], rel=0.03)
    assert twice.u == pytest.approx([np.sqrt(a**2 + 4 * b2) / u[0]], rel=0.03)
    assert not half.shift.any()


def test_where_too_few_draws_are_of_that_sort_errors_are_scaled_with_their_prior() -> None:
    sizes = np.full(1000, 4.0)
    sizes[:10] = 0.01
    draws = np.random.default_rng(6).standard_normal((1000, 1))
    state = MachineState(MACHINE, (BOW,), draws, StatedNoise(), scales={"position": sizes})
    half, _ = prior_influence(virtual(state), state, LEVER * draws.std(axis=0), 1)
    assert half.u == pytest.approx([0.5], rel=1e-6)


def test_of_all_together_only_what_is_hardly_shown_is_scaled() -> None:
    """Bows of a size that is known to a hundredth, a yaw of any that the prior has: twice the priors give b² + 4·p²."""
    random = np.random.default_rng(9)
    known, free = random.uniform(0.1, 0.101, 20_000), np.abs(random.standard_normal(20_000))
    draws = np.column_stack([known, free]) * random.standard_normal((20_000, 2)) * [30.0, 3.0]
    state = MachineState(MACHINE, (BOW, YAW), draws, StatedNoise(), scales={"position": known, "rotation": free})
    place = virtual(state)
    parts = [place.places[0].measured([draws * one]) - place.places[0].measured([None]) for one in np.eye(2)]
    b2, p2 = (part.var(axis=0) for part in parts)
    *_, twice = prior_influence(place, state, np.sqrt(b2 + p2), 1)
    assert (twice.family, twice.times) == (ALL, 2.0)
    assert twice.u == pytest.approx(np.sqrt((b2 + 4 * p2) / (b2 + p2)), rel=0.05)


def test_several_families_are_changed_together_too() -> None:
    sizes = np.abs(np.random.default_rng(7).standard_normal((2, 5000)))
    draws = (sizes * np.random.default_rng(8).standard_normal((2, 5000))).T
    state = MachineState(MACHINE, (SCALE, BOW), draws, StatedNoise(), scales={"play": sizes[0], "periodic": sizes[1]})
    found = prior_influence(virtual(state), state, np.array([3e-4]), 1)
    assert [one.family for one in found] == ["play", "play", "periodic", "periodic", ALL, ALL]
    without = replace(state, scales={})
    assert prior_influence(virtual(without), without, np.array([3e-4]), 1) == ()
