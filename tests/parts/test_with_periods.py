"""Errors of a recording beside waves of given periods, against generalised least squares."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.parts.conditional import given_recording
from cmm_uq.parts.drawn_periods import shown
from cmm_uq.parts.machine import MachineState
from cmm_uq.parts.together import Together
from cmm_uq.parts.with_periods import Conditioned, Noises
from cmm_uq.physics.catalogue import effects
from tests.parts.test_conditional import BARS, MODELLED, calibration, left_out

PERIODS = np.array([37.0, 410.0])
SIGMA = 5e-3


def test_all_errors_are_normal_given_their_periods() -> None:
    """(XᵀX/σ² + P)⁻¹ of the calibration's unknowns, a roll and two waves at the recorded readings, filled in by hand."""
    model, further = calibration(), left_out("rotation_x_x")
    whole, periodic = Together.of(model, further), left_out("periodic_scale_x", "periodic_scale_z")
    conditioned = Conditioned(model, whole.linear, SIGMA, periodic)
    # columns are taken where scales stood, not where the model's six errors say
    read = [BARS.readings[axis] for axis in "xz"]
    waves = []
    for one, x, period in zip(periodic, read, PERIODS, strict=True):
        angle = 2 * np.pi * x / period
        waves.append(shown(model, one.effect) @ np.column_stack([np.sin(angle), np.cos(angle)]))
    X = np.hstack([whole.linear.reduced.design, *(whole.linear.reduce(each) for each in waves)]) / SIGMA
    y = whole.linear.reduced.observed / SIGMA
    rows, given = whole.linear.priors
    k = X.shape[1] - 4
    P = np.zeros((len(X.T), len(X.T)))
    P[:k, :k] = rows.T @ rows
    P[k:, k:] = np.eye(4) / 0.01**2
    right = X.T @ y
    right[:k] += rows.T @ given
    length = np.sqrt(np.diagonal(X.T @ X + P))
    covariance = np.linalg.inv((X.T @ X + P) / np.outer(length, length)) / np.outer(length, length)
    mean = covariance @ right
    own, parameters = conditioned.drawn(np.tile(1 / PERIODS, (40_000, 1)), np.random.default_rng(0))
    drawn = np.hstack([parameters, own])
    scale = np.sqrt(np.diagonal(covariance))
    np.testing.assert_allclose((drawn.mean(axis=0) - mean) / scale, 0.0, atol=0.03)
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=0.03)


def test_noises_alike_leave_every_draw_and_are_each_taken_as_often() -> None:
    model = calibration()
    whole, periodic = Together.of(model, ()), left_out("periodic_scale_x")
    conditioned = Conditioned(model, whole.linear, SIGMA, periodic)
    random = np.random.default_rng(1)
    found = conditioned.combinations(500, random)
    which, frequency, effective = Noises(conditioned, [conditioned] * 5).drawn(found, random)
    np.testing.assert_array_equal(np.bincount(which), 100)
    np.testing.assert_allclose(np.sort(frequency, axis=0), np.sort(found.frequency, axis=0))
    assert effective == pytest.approx(found.effective)


def test_one_period_a_draw_is_asked_for() -> None:
    state = MachineState(BARS.machine, effects(MODELLED), np.zeros((2, 6)), unmodelled=left_out("periodic_scale_y"))
    alone = given_recording(state, calibration(), SIGMA, 300, one_period=True)
    assert [one.effect.name for one in alone.periodic] == ["periodic_scale_y"]
    assert alone.draws.shape == (300, 6)
    assert not alone.unmodelled
    together = given_recording(state, calibration(), SIGMA, 300)
    assert not together.periodic
    assert together.prior_share["periodic_scale_y"] > 0
