"""The linear part of a fleet against one dense normal distribution of all its certificates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due import drift as drift_prior, drift_filter, fleet_model
from cmm_uq.laboratory.due.drift import MEDIANS, NAMES, USUAL_RATE_SD, YEAR, learnt_prior, side_by_side
from cmm_uq.laboratory.due.fleet_model import messages, others, shared_by, together
from tests.laboratory.due.histories import machine, over_tales

UNIT = 10.0
MACHINES = [
    machine([0, 1, 2], [0.5, 2.0, 2.6], 0.5, 0.4, "AAB"),
    machine([0.3, 1.4], [-1.0, 1.0], 0.6, 0.5, "BB"),
    machine([0.1], [1.0], 0.6, 0.3, "A"),
    machine([0, 2, 3], [0.2, 3.5, 0.3], 0.4, 0.2, "BCA", [np.nan, np.nan, 2.2]),
]
MODELS, PLACES = ["M", "N", "M", "N"], ["p", "p", "q", "q"]
THETA = np.log(MEDIANS) + np.array([[0.0] * 8, [0.3, -0.2, 0.5, 0.1, 0.2, -0.3, 0.0, 0.4]])


@pytest.fixture(autouse=True)
def _gaussian(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drift_filter, "_ODDS", np.array([0.0, -np.inf]))
    monkeypatch.setattr(drift_filter, "_log_steps", lambda years, prior: (
        np.zeros((len(years), len(prior))), np.full((len(years), len(prior)), -np.inf)))  # fmt: skip
    monkeypatch.setattr(drift_prior, "WALKS_DIFFER", 0.0)


def dense(theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    of = {
        name: np.exp(value) * (1 if name == "steps_per_year" else UNIT)
        for name, value in zip(NAMES, theta, strict=True)
    }
    rows = [(i, k) for i, each in enumerate(MACHINES) for k in range(len(each.day))]
    rates = np.array([[(USUAL_RATE_SD * UNIT) ** 2 + of["model_sd"] ** 2 * (MODELS[i] == MODELS[j])
                       + of["place_sd"] ** 2 * (PLACES[i] == PLACES[j]) + of["rate_sd"] ** 2 * (i == j)
                       for j in range(4)] for i in range(4)])  # fmt: skip

    def begun(i: int, k: int) -> tuple[float, float]:
        since = MACHINES[i].adjusted_since[k]
        return (MACHINES[i].day[0], of["first_sd"]) if np.isnan(since) else (float(since), of["as_left_sd"])

    def years(i: int, k: int) -> float:
        return float(MACHINES[i].day[k] - begun(i, k)[0]) / YEAR

    S, cross = np.zeros((len(rows), len(rows))), np.zeros((4, len(rows)))
    for a, (i, k) in enumerate(rows):
        cross[:, a] = rates[:, i] * years(i, k)
        for b, (j, m) in enumerate(rows):
            S[a, b] = rates[i, j] * years(i, k) * years(j, m)
            if i == j and begun(i, k) == begun(j, m):
                S[a, b] += begun(i, k)[1] ** 2 + of["walk"] ** 2 * min(years(i, k), years(j, m))
            one, other = MACHINES[i], MACHINES[j]
            if one.artefact[k] == other.artefact[m]:
                S[a, b] += one.u_artefact[k] * other.u_artefact[m]
            if a == b:
                S[a, b] += one.u[k] ** 2 - one.u_artefact[k] ** 2
    return np.concatenate([each.value for each in MACHINES]), S, rates, cross


def test_the_evidence_of_a_fleet_is_that_of_one_normal_distribution() -> None:
    arrays = side_by_side(MACHINES)
    shared = shared_by(arrays, MODELS, PLACES)
    found = together(messages(arrays, shared, THETA, UNIT), shared, THETA, UNIT).log_evidence
    exact = [multivariate_normal(np.zeros(len(y)), S).logpdf(y) for y, S, _, _ in map(dense, THETA)]
    assert found == pytest.approx(exact, rel=1e-9)


def test_what_the_others_say_of_a_machine_is_the_conditional_of_one_normal_distribution() -> None:
    """Its rate given all certificates but its own; and with its own filtered after them, given all."""
    arrays = side_by_side(MACHINES)
    shared = shared_by(arrays, MODELS, PLACES)
    said = messages(arrays, shared, THETA, UNIT)
    start = others(said, together(said, shared, THETA, UNIT), shared, THETA, UNIT)
    prior = learnt_prior(THETA, np.zeros(2), np.ones(2), UNIT)
    some = drift_filter.DriftStart(start.mean[..., prior.group], start.covariance[..., prior.group])
    mean, covariance = over_tales(drift_filter.filtered(arrays, prior, some))
    of = np.concatenate([[i] * len(each.day) for i, each in enumerate(MACHINES)])
    for w, theta in enumerate(THETA):
        y, S, rates, cross = dense(theta)
        for i in range(4):
            for rest, got, variance in (
                (of != i, start.mean[0, i, w], start.covariance[0, 0, i, w]),
                (of >= 0, mean[1, i, 3 * w], covariance[1, 1, i, 3 * w]),
            ):
                gain = np.linalg.solve(S[np.ix_(rest, rest)], cross[i, rest])
                assert got == pytest.approx(gain @ y[rest], rel=1e-8, abs=1e-10)
                assert variance == pytest.approx(rates[i, i] - gain @ cross[i, rest], rel=1e-8)


def test_an_artefact_of_one_machine_only_is_its_own() -> None:
    shared = shared_by(side_by_side(MACHINES), MODELS, PLACES)
    assert (shared.models, shared.places, shared.artefacts) == (("M", "N"), ("p", "q"), ("A", "B"))
    assert shared.design[:, 0].sum(axis=1).tolist() == [3, 3, 3, 3]


def test_of_very_many_artefacts_those_of_most_machines_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_model, "MOST_ARTEFACTS", 1)
    every = [*MACHINES, machine([0], [0.0], 0.6, 0.3, "B")]
    assert shared_by(side_by_side(every), [*MODELS, "M"], [*PLACES, "p"]).artefacts == ("B",)
