"""When a machine made a step: dates, sizes and probabilities against dense matrices and made histories."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due import drift_filter
from cmm_uq.laboratory.due.drift import YEAR, DriftPrior
from cmm_uq.laboratory.due.steps import FollowedHistory, dated_steps, followed
from tests.laboratory.due.histories import ALL, FIRST, machine, one_node

YEARS = [0, 1, 2, 3, 4, 5, 6]


def dates(of: FollowedHistory) -> list[tuple[float, float]]:
    return [((one.after - FIRST) / YEAR, (one.by - FIRST) / YEAR) for one in dated_steps(of)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("at", [2, 4])
def test_a_step_of_a_made_history_is_dated_with_its_size(at: int, sign: float) -> None:
    values = np.array([0.1, 0.4, 0.2, 0.5, 0.3, 0.6, 0.2]) + 6.0 * (np.arange(7) >= at)
    (step,) = dated_steps(followed(machine(YEARS, list(sign * values), 0.4, 0.2), 10.0))
    assert ((step.after - FIRST) / YEAR, (step.by - FIRST) / YEAR) == pytest.approx((at - 1, at), abs=0.01)
    assert step.probability > 0.9
    assert abs(step.size - 6.0 * sign) < 2 * step.u
    assert 0.3 < step.u < 1.5


def test_a_line_a_wave_and_a_settling_are_no_steps() -> None:
    for values in (0.7 * np.arange(7.0), 3 * np.sin(np.arange(7.0)), 4 * (1 - np.exp(-np.arange(7.0)))):
        assert dates(followed(machine(YEARS, list(values), 0.4, 0.2), 10.0)) == []


def test_one_that_the_certificates_cannot_date_has_the_days_of_both() -> None:
    """A certificate half way, with an uncertainty that tells nothing, may be of before the step or of after it."""
    of = machine([0, 1, 2, 2.5, 3, 4, 5], [0.0, 0.1, 0.2, 3.0, 6.0, 6.1, 6.0], [0.3, 0.3, 0.3, 6.0, 0.3, 0.3, 0.3])
    assert dates(followed(of, 10.0)) == [pytest.approx((2.0, 3.0), abs=0.01)]


def test_probability_and_size_are_those_of_dense_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step before the third of four or none, no certificate wrong: two normal distributions of four values."""
    t, often = np.array([0.0, 1.0, 2.5, 3.0]), 0.7
    of, prior = machine(list(t), [0.2, 0.5, 4.9, 5.6], 0.5, 0.3), one_node(**ALL)
    monkeypatch.setattr(drift_filter, "_ODDS", np.array([0.0, -np.inf]))

    def log_steps(years: Floats, prior: DriftPrior) -> tuple[Floats, Floats]:
        here = often * (years[0] > 1.2)
        with np.errstate(divide="ignore"):
            return np.log(np.full((1, 1), 1 - here)), np.log(np.full((1, 1), here))

    monkeypatch.setattr(drift_filter, "_log_steps", log_steps)
    (step,) = dated_steps(followed(of, 10.0, prior))
    season = 2 * np.pi * of.day / YEAR
    columns = np.stack([t + 0.15 * t**2, 1 - np.exp(-t / 0.8), np.cos(season) - np.cos(season[0]),
                        np.sin(season) - np.sin(season[0])])  # fmt: skip
    S = 9.0 + 0.49 * np.minimum(t[:, None], t) + 0.16 * np.eye(4) + 0.09
    S = S + sum(sd**2 * np.outer(column, column) for sd, column in zip((1.0, 2.0, 1.5, 1.5), columns, strict=True))
    jump = np.array([0.0, 0.0, 1.0, 1.0])
    with_step = S + 2.5**2 * np.outer(jump, jump)
    odds = [np.log(p) + multivariate_normal(np.zeros(4), cov).logpdf(of.value)
            for p, cov in ((1 - often, S), (often, with_step))]  # fmt: skip
    gain = 2.5**2 * np.linalg.solve(with_step, jump)
    assert step.probability == pytest.approx(1 / (1 + np.exp(odds[0] - odds[1])), rel=1e-9)
    assert step.size == pytest.approx(gain @ of.value, rel=1e-9)
    assert step.u == pytest.approx(np.sqrt(2.5**2 - 2.5**2 * gain @ jump), rel=1e-9)
