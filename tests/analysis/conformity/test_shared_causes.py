"""Test uncertainty of lengths by hand, and the probability that all conform against drawn errors and exact integrals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.conformity.uncertainty import Causes, causes_of_lengths, length_budget, probability_of_all
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from tests.analysis.conformity.recorded import gauge
from tests.recordings import with_columns

STATED = TestUncertainty(u_cte_per_k=0.6e-6, u_temperature_k=0.05, u_alignment_um=0.1, u_fixturing_um=0.2)
STEEL = Circumstances(STATED, cte_per_k=11.5e-6)


def test_one_length_has_five_causes() -> None:
    """800 mm at 21.5 °C: 0.4 calibration, 800·1.5·0.6e-3 = 0.72 expansion, 800·11.5e-3·0.05 = 0.46 temperature, 0.1, 0.2."""
    found = length_budget(800.0, 0.4e-3, 21.5, STEEL)
    assert [line.contribution * 1e3 for line in found.lines] == pytest.approx([0.4, 0.72, 0.46, 0.1, 0.2])
    assert found.u * 1e3 == pytest.approx(np.sqrt(0.4**2 + 0.72**2 + 0.46**2 + 0.1**2 + 0.2**2))


def test_every_length_has_its_own_uncertainty_and_the_sign_of_its_expansion() -> None:
    """Two thirds of a degree above and below 20 °C."""
    artefact = gauge([np.eye(3)[0], np.eye(3)[1]], [[20.0, 800.0], [20.0, 400.0]], repeats=1)
    degrees = np.where(artefact.points.measurement == 1, 20.5, 19.0)
    points = with_columns(artefact.points, temp_artefact_c=degrees)
    found = artefact.indications()
    assert found is not None
    artefact.points = points
    causes = causes_of_lengths(found, artefact, STEEL)
    longest = int(np.argmax(found.lengths))
    assert causes.shared[longest] == pytest.approx([0.4, 800 * 0.5 * 0.6e-3, 800 * 11.5e-3 * 0.05])
    shorter = int(np.flatnonzero(found.lengths == 400.0)[0])
    assert causes.shared[shorter] == pytest.approx([0.2, -400 * 1.0 * 0.6e-3, 400 * 11.5e-3 * 0.05])
    assert causes.own == pytest.approx(np.full(4, np.hypot(0.1, 0.2)))
    assert causes.u == pytest.approx(np.sqrt((causes.shared**2).sum(axis=1) + causes.own**2))


def test_without_further_causes_u_is_that_of_the_calibration() -> None:
    artefact = gauge([np.eye(3)[0]], [[20.0, 800.0]], repeats=1)
    found = artefact.indications()
    assert found is not None
    assert causes_of_lengths(found, artefact, Circumstances()).u == pytest.approx(found.u * 1e3)


# --- all together ----------------------------------------------------------------------------------------------------


def causes(shared: list[list[float]], own: list[float], set_up: list[int]) -> Causes:
    return Causes(np.array(shared, dtype=float).reshape(len(own), -1), np.array(own), np.array(set_up))


def test_what_is_wholly_shared_is_one_interval() -> None:
    """Errors 1 and −1.5 with slopes 0.5 and 1 of one cause, limits 2: −2 to 1 … z from −0.5 to 2."""
    found = probability_of_all([1.0, -1.5], [2.0, 2.0], causes([[0.5], [1.0]], [0.0, 0.0], [1, 2]), signed=True)
    assert found == pytest.approx(stats.norm.cdf(2.0) - stats.norm.cdf(-0.5), abs=1e-12)


def test_what_is_not_shared_multiplies() -> None:
    """Two set-ups 1 u and 2 u inside one of their limits, 20 u from the other."""
    found = probability_of_all([9.0, 8.0], [10.0, 10.0], causes([[], []], [1.0, 1.0], [1, 2]), signed=True)
    assert found == pytest.approx(stats.norm.cdf(1.0) * stats.norm.cdf(2.0), abs=1e-9)
    same = probability_of_all([9.0, 8.0], [10.0, 10.0], causes([[], []], [1.0, 1.0], [1, 1]), signed=True)
    assert same == pytest.approx(stats.norm.cdf(1.0), abs=1e-9)


def test_opposite_slopes_of_one_cause_leave_less() -> None:
    """Both 1 u inside: alike Φ(1) = 84 %, opposite 2Φ(1) − 1 = 68 %."""
    for slope, expected in ((1.0, stats.norm.cdf(1.0)), (-1.0, 2 * stats.norm.cdf(1.0) - 1)):
        found = probability_of_all([9.0, 9.0], [10.0, 10.0], causes([[1.0], [slope]], [0.0, 0.0], [1, 1]), signed=True)
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_form_has_no_lower_limit() -> None:
    found = probability_of_all([0.1, 9.0], [10.0, 10.0], causes([[1.0], [1.0]], [0.0, 0.0], [1, 2]), signed=False)
    assert found == pytest.approx(stats.norm.cdf(1.0), abs=1e-12)


@pytest.mark.parametrize("own", [0.0, 0.4])
def test_a_hundred_and_five_lengths_are_those_of_drawn_errors(own: float) -> None:
    """Three causes that all share, one of each of seven set-ups; 0.004 is over three standard deviations of 200 000 draws."""
    random = np.random.default_rng(0)
    length = np.tile([20.0, 100.0, 300.0, 500.0, 800.0], 21)
    error, limit, set_up = random.normal(0, 1.2, 105), 2.5 + length / 300, np.repeat(np.arange(7), 15)
    part = length / 800
    shared = np.column_stack([0.6 * part, 0.5 * part * np.where(set_up < 3, -1, 1), 0.3 * part])
    found = probability_of_all(error, limit, Causes(shared, np.full(105, own), set_up), signed=True)
    common, apart = random.standard_normal((200_000, 3)), random.standard_normal((200_000, 7))
    inside = np.ones(200_000, dtype=bool)
    for i in range(105):
        inside &= np.abs(error[i] + common @ shared[i] + own * apart[:, set_up[i]]) <= limit[i]
    assert found == pytest.approx(inside.mean(), abs=0.004)


def test_without_an_uncertainty_there_is_no_probability() -> None:
    assert probability_of_all([1.0], [2.0], causes([[0.0]], [0.0], [1]), signed=True) is None
