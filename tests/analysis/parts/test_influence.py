"""What other priors of the machine's errors would change of a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.parts.influence import ALL, prior_influence
from cmm_uq.analysis.parts.machine.state import MachineState, StatedNoise, Unmodelled
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartPose, Plan
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.machine.physics.catalogue import effects
from tests.parts_drawn import MACHINE, spot

PLAN = Plan(
    (spot("one", [0, 0, 0]), spot("other", [200, 0, 0])), (PartCharacteristic("d", "distance", ("one", "other")),)
)
POSE = PartPose(np.eye(3), np.array([300.0, 200.0, -200.0]))
(SCALE,) = effects(["scale_x"])
(BOW,) = effects(["scale_curvature_x"])


def virtual(state: MachineState) -> Virtual:
    return Virtual(PLAN, MeasurementConditions(state, (POSE,)))


def test_draws_of_a_machine_are_weighed_by_the_ratio_of_the_priors() -> None:
    """A scale c ~ N(0, s²), s half-normal of width 1: with a width of t its variance is t², so u of a length is t times as
    large; 20 000 draws, of which 4000 are weighed, say it to a few per cent."""
    random = np.random.default_rng(4)
    sizes = np.abs(random.standard_normal(20_000))
    draws = (sizes * random.standard_normal(20_000))[:, None]
    state = MachineState(MACHINE, (SCALE,), draws, StatedNoise(), scales={"position long": sizes})
    u = 200e-6 * draws.std(axis=0)
    half, twice = prior_influence(virtual(state), state, u, 1)
    assert (half.family, half.times, twice.times) == ("position long", 0.5, 2.0)
    assert half.u == pytest.approx([0.5], rel=0.1)
    assert twice.u == pytest.approx([2.0], rel=0.35)  # the wider prior lies where few draws are
    assert abs(float(half.shift[0])) < 0.1


def test_a_value_that_follows_from_the_prior_moves_with_it() -> None:
    """Draws of c = s: with half the width their mean is half as large; half-normal means are √(2/π) of the width."""
    sizes = np.abs(np.random.default_rng(5).standard_normal(20_000))
    state = MachineState(MACHINE, (SCALE,), sizes[:, None], StatedNoise(), scales={"play": sizes})
    u = np.array([200e-6 * sizes.std()])
    half, _ = prior_influence(virtual(state), state, u, 1)
    # a larger scale indicates lengths too short: the value moves by what the error lessens
    expected = -200e-6 * 0.5 * np.sqrt(2 / np.pi) / u[0]
    assert abs(float(half.shift[0])) == pytest.approx(abs(expected), rel=0.1)


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


def test_nothing_is_said_where_too_few_draws_are_of_that_sort() -> None:
    sizes = np.full(1000, 4.0)
    sizes[:10] = 0.01
    draws = np.random.default_rng(6).standard_normal((1000, 1))
    state = MachineState(MACHINE, (SCALE,), draws, StatedNoise(), scales={"play": sizes})
    half, twice = prior_influence(virtual(state), state, np.array([1e-4]), 1)
    assert np.isnan(half.u).all()
    assert np.isfinite(twice.u).all()


def test_several_families_are_changed_together_too() -> None:
    sizes = np.abs(np.random.default_rng(7).standard_normal((2, 5000)))
    draws = (sizes * np.random.default_rng(8).standard_normal((2, 5000))).T
    state = MachineState(MACHINE, (SCALE, BOW), draws, StatedNoise(), scales={"play": sizes[0], "periodic": sizes[1]})
    found = prior_influence(virtual(state), state, np.array([3e-4]), 1)
    assert [one.family for one in found] == ["play", "play", "periodic", "periodic", ALL, ALL]
    without = replace(state, scales={})
    assert prior_influence(virtual(without), without, np.array([3e-4]), 1) == ()
