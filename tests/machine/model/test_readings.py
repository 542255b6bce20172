"""How axes are read: figures of the published tables, and what they say of waves."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
from scipy.special import sici

from cmm_uq.jobs.tables.machine import AxisFacts, Reading
from cmm_uq.machine.model.field import GivenPeriod, allowed, as_read, covariance, family_of
from cmm_uq.machine.model.readings import HYSTERESIS_UM, PUBLISHED, SCREWS, AxisReading, largest_amplitude
from cmm_uq.machine.physics.effects.drives import HYSTERESIS, PeriodicScale

MOST = 24.47747  # µm, of an amplitude of normal sine and cosine of 10 µm: 95 of 100 are smaller


def reading(by: str, **facts: Any) -> AxisReading:
    return AxisReading(AxisFacts(names=["x"], reading=by, source="data sheet", **facts), MOST)  # type: ignore[arg-type]


def test_every_reading_that_a_job_may_state_has_its_published_figures() -> None:
    assert set(PUBLISHED) == set(get_args(Reading)) - {"unknown"}
    for by, one in PUBLISHED.items():
        assert bool(one.source) == (by not in ("rack and rotary encoder", "ball screw and rotary encoder"))


@pytest.mark.parametrize(("period_um", "um"), [(2, 0.02), (4, 0.04), (20, 0.2), (200, 2.0)])
def test_an_exposed_encoder_errs_by_what_its_makers_table_has(period_um: float, um: float) -> None:
    """HEIDENHAIN, Exposed Linear Encoders, position error u within one signal period: LIP 4x1, LIF, LIDA 4xx, LIDA 2xx."""
    _, most = reading("exposed optical grating", period_mm=1e-3 * period_um).interpolation or (0, 0)
    assert most == pytest.approx(um)


@pytest.mark.parametrize(("period_um", "um"), [(4, 0.08), (40, 0.8)])
def test_a_sealed_encoder_errs_by_what_its_makers_table_has(period_um: float, um: float) -> None:
    """HEIDENHAIN, Längenmessgeräte, Definition der Abweichungen: LF, LB."""
    _, most = reading("sealed optical grating", period_mm=1e-3 * period_um).interpolation or (0, 0)
    assert most == pytest.approx(um)


def test_a_screw_errs_by_half_of_what_iso_3408_3_permits() -> None:
    assert SCREWS == {1: (6.0, 4.0), 3: (12.0, 6.0), 5: (23.0, 8.0), 7: (52.0, None)}
    screw = reading("ball screw and rotary encoder", period_mm=10.0, grade=3)
    assert (screw.within, screw.interpolation, screw.play_um) == (((300.0, 6.0),), (10.0, 3.0), None)
    assert "tolerance grade 3" in screw.source
    assert reading("ball screw and rotary encoder").within == ((300.0, 26.0),)


def test_a_scale_on_the_axis_has_its_own_hysteresis_and_a_drive_its_play() -> None:
    scales = (
        "exposed optical grating",
        "sealed optical grating",
        "laser interferometer",
        "inductive scale",
        "magnetic scale",
    )
    assert [reading(by).play_um for by in scales] == [HYSTERESIS_UM] * 5 == [2.0] * 5
    assert reading("rack and rotary encoder").play_um is None
    assert reading("rack and rotary encoder", play_um=15.0).play_um == 15.0


@pytest.mark.parametrize("period", [7.0, 20.0, 55.0, 400.0, 1000.0])
def test_a_wave_of_the_largest_amplitude_just_keeps_every_section(period: float) -> None:
    """By trying all places of a section: half of the range of the wave within it is its deviation to either side."""
    within = ((1000.0, 3.0), (10.0, 0.3))
    amplitude, reached = largest_amplitude(period, within), []
    for mm, um in within:
        starts = np.linspace(0, period, 400)[:, None] + np.linspace(0, mm, 400)
        wave = amplitude * np.sin(2 * np.pi * starts / period)
        reached.append(0.5 * float(np.ptp(wave, axis=1).max()) / um)
    assert max(reached) == pytest.approx(1.0, rel=2e-3)


def test_nothing_is_taken_for_larger_than_of_an_axis_of_which_nothing_is_stated() -> None:
    (bands,) = reading("rack and rotary encoder").errors
    assert {most for *_, most in bands} == {MOST}
    assert max(most for *_, most in reading("magnetic scale").errors[0]) == MOST
    assert reading("exposed optical grating", deviation=[[1000.0, 3.0]]).largest_um < 4


def stated() -> PeriodicScale:
    one = reading(
        "exposed optical grating", period_mm=4.0, interpolation_um=1.5, deviation=[[1000.0, 3.0], [10.0, 0.3]]
    )
    effect = as_read(PeriodicScale("x"), one.largest_um, one.errors)
    assert isinstance(effect, PeriodicScale)
    return effect


def test_draws_of_what_is_stated_have_its_covariance_and_ninety_five_of_a_hundred_its_amplitude() -> None:
    """What they have between places is the mean over their trial periods, at each place that over all periods."""
    effect, places = stated(), np.array([0.0, 1.3, 9.0, 40.0, 220.0])
    every = GivenPeriod(effect, np.zeros(0), np.zeros((0, 0)))
    sd = np.array([one.prior_sd for one in every.coefficients])
    drawn = every.beforehand(np.random.default_rng(3), 60_000) * sd
    errors = drawn @ every.at(places).T
    apart, expected = np.abs(np.subtract.outer(places, places)), np.zeros((5, 5))
    for bands in effect.errors:
        trials = [(at, own) for low, high, own in bands for at in low * (high / low) ** ((np.arange(4) + 0.5) / 4)]
        expected += sum((1e-3 * own) ** 2 * np.cos(2 * np.pi * apart / at) for at, own in trials) / len(trials)
    np.testing.assert_allclose(errors.T @ errors / len(errors), expected, atol=0.03 * expected[0, 0])
    np.testing.assert_allclose(np.diag(expected), np.diag(covariance(effect, places, places)), rtol=1e-9)
    within = drawn.reshape(len(drawn), -1, 2)[:, -16:]  # of the signal's period, 2 to 4 mm: one trial of 16
    amplitude = np.sqrt((within**2).sum(axis=2)).max(axis=1)
    assert np.mean(amplitude > 1.5) == pytest.approx(0.05, abs=0.004)


@pytest.mark.parametrize("effect", [PeriodicScale("x"), stated()], ids=["as physics allows", "as stated"])
def test_errors_at_many_readings_are_those_at_each(effect: PeriodicScale) -> None:
    """By polynomials in cells of the axis; at readings of the recording and in cells asked for later as well."""
    random = np.random.default_rng(5)
    recorded, many = random.uniform(-300.0, 500.0, 40), np.sort(random.uniform(-300.0, 500.0, 30_000))
    into = random.standard_normal((40, 6))
    one, other = GivenPeriod(effect, recorded, into), GivenPeriod(effect, recorded, into)
    many[::1000] = recorded[:30]
    largest = np.abs(other.at(recorded)).max(axis=0)
    for readings in (many, random.uniform(400.0, 700.0, 1500)):
        at = one.at(readings)
        np.testing.assert_allclose(at[::50] / largest, other.at(readings[::50]) / largest, atol=2e-12)


def test_the_covariance_is_the_sum_of_the_means_over_all_periods() -> None:
    """By numerical integration over the logarithm of the period."""
    effect, apart = stated(), np.array([0.0, 0.4, 3.0, 17.0, 300.0])
    expected = np.zeros(len(apart))
    for bands in effect.errors:
        for low, high, sd in bands:
            periods = np.geomspace(low, high, 20_001)
            mean = np.trapezoid(np.cos(2 * np.pi * apart[:, None] / periods), np.log(periods), axis=1)
            expected += (1e-3 * sd) ** 2 * mean / np.log(bands[-1][1] / bands[0][0])
    np.testing.assert_allclose(covariance(effect, np.zeros(1), apart)[0], expected, rtol=1e-4, atol=1e-9)


def test_of_what_nothing_is_stated_everything_is_as_it_was() -> None:
    apart = np.array([0.3, 25.0])
    ends = [sici(2 * np.pi * apart / period)[1] for period in (0.5, 1000.0)]
    expected = 1e-4 * (ends[0] - ends[1]) / np.log(2000)
    np.testing.assert_allclose(covariance(PeriodicScale("x"), np.zeros(1), apart)[0], expected, rtol=1e-12)


def test_stated_errors_are_families_of_their_own_whose_size_is_over_what_is_stated() -> None:
    assert family_of(stated()) == "periodic as stated"
    assert family_of(GivenPeriod(stated(), np.zeros(0), np.zeros((0, 0)))) == "periodic as stated"
    assert family_of(as_read(HYSTERESIS.of("x"), 2.0)) == "play as stated"
    assert as_read(HYSTERESIS.of("x"), 2.0).coefficients[0].prior_sd == pytest.approx(2.0 / 1.959964)
    assert allowed("play as stated") == (1.0, "1")
    assert family_of(PeriodicScale("x")) == "periodic"
