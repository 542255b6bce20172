"""Errors with one period a draw: what they are at a reading, in a recording and on a part."""

from __future__ import annotations

import numpy as np

from cmm_uq.parts.drawn_periods import DrawnPeriod, drawable, shown
from cmm_uq.parts.machine import MachineState, StatedNoise
from cmm_uq.parts.placing import Pose
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.virtual import AtPose, Circumstances
from cmm_uq.physics.catalogue import effects
from tests.parts.test_conditional import BARS, calibration
from tests.parts_drawn import MACHINE, spot

(PERIODIC, SCALE) = effects(["periodic_scale_y", "scale_x"])


def test_values_are_those_of_the_effect_with_its_period() -> None:
    drawn = DrawnPeriod(PERIODIC, np.array([1 / 37.0, 1 / 0.7]), 1e-3 * np.array([[3.0, 4.0], [-1.0, 2.0]]))
    for i, (period, sizes) in enumerate(((37.0, [3.0, 4.0]), (0.7, [-1.0, 2.0]))):
        e = (PERIODIC.basis(BARS, (period,)) @ np.array(sizes))[:, 1]
        np.testing.assert_allclose(drawn.at(BARS.readings["y"])[i], e, atol=1e-12)
    assert drawable(PERIODIC)
    assert not drawable(SCALE)


def test_a_recording_shows_the_sum_of_what_it_shows_of_each_point() -> None:
    """Along the motion of Y, which leans by 170″ at most on this machine: by so much of itself the sum differs."""
    model = calibration()
    about = model.estimate().about
    e = PERIODIC.basis(BARS, (37.0,)) @ np.array([3.0, 4.0])
    expected = model.seen(e[:, :, None], about)[:, 0]
    np.testing.assert_allclose(shown(model, PERIODIC) @ e[:, 1], expected, atol=2 * 170 / 206265 * np.abs(e).max())


def test_a_part_errs_by_the_wave_of_each_draw_as_by_an_effect_of_that_period() -> None:
    """A distance along y, of two draws with a period each, beside machines that have just that error; what is left of a wave
    is its mean over the draws, which is no error of a draw but of the place."""
    plan = Plan(
        (spot("one", [0, 10, 0]), spot("other", [0, 73, 0])), (Characteristic("", "distance", ("one", "other")),)
    )
    drawn = DrawnPeriod(PERIODIC, np.array([1 / 37.0, 1 / 90.0]), 1e-3 * np.array([[3.0, 4.0], [-1.0, 2.0]]))
    pose, quiet = Pose(np.eye(3), np.array([100.0, 200.0, -300.0])), StatedNoise(np.zeros(3))
    state = MachineState(MACHINE, (), np.zeros((2, 0)), quiet, periodic=(drawn,))
    at = AtPose(plan, Circumstances(state), pose)
    found = at.errors([cause.draw(np.random.default_rng(0), 50) for cause in at.causes])[:, 0]
    expected = []
    for f, sizes in zip(drawn.frequency, drawn.coefficients, strict=True):
        y = 2 * np.pi * f * (200.0 + np.array([10.0, 73.0]))
        e = sizes[0] * np.sin(y) + sizes[1] * np.cos(y)
        expected.append(e[0] - e[1])  # true = indicated + e
    np.testing.assert_allclose(np.unique(np.round(found, 9)), np.sort(expected), atol=1e-8)
