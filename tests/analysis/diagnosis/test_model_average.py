"""What each explanation that remains makes of a job, and the averages: held to the joint posterior and to moments by hand."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.accuracy import figures
from cmm_uq.analysis.diagnosis.diagnosis import REMAINS, SETTLED
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate as analyse_observations, outcome_of
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Machine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.diagnosis.sections import costs_section
from cmm_uq.certificate.document import Table
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.result import JobDiagnosis, Outcome, Result
from cmm_uq.certificate.results.contents import costs_data
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import EVERY, effects
from tests.artefacts.reading import tables
from tests.artefacts.test_certificate_figures import disagreeing, two_uncertainties
from tests.recordings import TRAVEL, bar_facts, bars

TRUTH = {"scale_x": 40.0, "scale_y": -30.0, "scale_z": 25.0}
JOB = """
[job]
id = "twenty-bars"
date = 2026-01-01
origin = "simulated"

[machine]
name = "m"
travel_mm = { x = [0, 900], y = [0, 550], z = [-500, 0] }

[artefact]
kind = "ballbar"
length_mm = 400.0
u_um = 0.5
cte_per_k = 1.15e-05

[recording]
file = "recording.csv"
u_coordinate_um = 1.5

[model]
effects = ["squareness_xy", "squareness_yz", "squareness_zx"]
tolerances = { squareness_xy = 7 }

[[conformity]]
standard = "ASME B89.4.1-1997"
limit_um = 14.0
rule = "ISO 14253-1"
"""


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Twenty bars of a machine whose three scales are wrong, and that is taken for one with wrong squarenesses."""
    random = np.random.default_rng(1)
    points = bars(random, 20, 400.0, Machine("m", "XYZ", TRAVEL))
    model = RecordingModel(Ballbar(bar_facts(), points), effects(tuple(TRUTH)))
    xyz = model.simulate(np.array(list(TRUTH.values())), np.array([400.0]), Noise(1.5e-3), random)
    rows = "".join(
        f"{m},{p},1,{x:.5f},{y:.5f},{z:.5f}\n"
        for m, p, (x, y, z) in zip(points.measurement, points.point, xyz, strict=True)
    )
    job: Path = tmp_path_factory.mktemp("rivals") / "twenty-bars"
    job.mkdir()
    (job / "recording.csv").write_text("measurement,point,repeat,x_mm,y_mm,z_mm\n" + rows, encoding="utf-8")
    (job / "job.toml").write_text(JOB, encoding="utf-8")
    return analyse_observations(read_job(job))


@pytest.fixture(scope="module")
def found(certified: Result) -> JobDiagnosis:
    return certified.diagnosed


@pytest.fixture(scope="module")
def outcome(certified: Result) -> Outcome:
    return outcome_of(certified)


@pytest.fixture(scope="module")
def results(outcome: Outcome) -> dict[str, Any]:
    return dict(json.loads(as_json(outcome.results)))


@pytest.mark.long
def test_several_explanations_remain_and_the_true_one_is_among_them(found: JobDiagnosis) -> None:
    remaining = found.diagnosis.remaining
    assert set(TRUTH) in [set(rival.effects) for rival in remaining.rivals]
    assert sorted(remaining.weights, reverse=True) == remaining.weights
    assert min(remaining.weights) > REMAINS
    assert remaining.weights[0] < SETTLED


@pytest.mark.long
def test_under_the_explanation_that_is_asserted_it_is_the_joint_posterior(found: JobDiagnosis) -> None:
    """Sampled by emcee under the same noise: means within a third of u, u within a third."""
    asserted = {item.effect: item for item in found.diagnosis.effects}
    rival = next(one for one in found.diagnosis.remaining.rivals if set(one.effects) == set(asserted))
    for name, item in asserted.items():
        for parameter, quantity in item.parameters.items():
            own = rival.added[name][parameter]
            assert own.value == pytest.approx(quantity.value, abs=quantity.u / 3)
            assert own.u == pytest.approx(quantity.u, rel=1 / 3)


def test_the_average_has_the_moments_of_the_mixture(certified: Result) -> None:
    """Mean of the means; Σ w (C + (m − m̄)(m − m̄)ᵀ): each within five standard errors of as many draws."""
    remaining = certified.diagnosed.diagnosis.remaining
    p = np.array(remaining.weights) / sum(remaining.weights)
    each = []
    for rival in remaining.rivals:
        keys = [unknown.key for unknown in rival.model.unknowns]
        each.append(rival.draws[:, [keys.index(unknown.key) for unknown in certified.model.unknowns]])
    means = np.array([draws.mean(axis=0) for draws in each])
    mean = p @ means
    off = means - mean
    covariance = np.einsum("r,rij->ij", p, [np.cov(draws, rowvar=False) for draws in each]) + (p * off.T) @ off
    draws = remaining.draws
    assert draws is not None
    few = np.sqrt(len(draws))
    assert np.all(np.abs(draws.mean(axis=0) - mean) < 5 * draws.std(axis=0) / few)
    products = (draws - mean)[:, :, None] * (draws - mean)[:, None, :]
    assert np.all(np.abs(np.array(certified.covariance.matrix) - covariance) < 5 * products.std(axis=0) / few)


@pytest.mark.long
def test_a_certificate_states_the_average_wherever_it_states_an_estimate(
    results: dict[str, Any], outcome: Outcome
) -> None:
    """Estimates, covariance and file of draws are one distribution; no table or record has another U of a parameter."""
    assert results["estimates"] == results["diagnosis"]["averaged"]["estimates"]
    stated = {f"{owner}.{name}": one for owner, found in results["estimates"].items() for name, one in found.items()}
    stated["artefact.length_mm"] = results["artefact"]["length_mm"]
    assert results["covariance"]["parameters"] == list(stated)
    with np.load(BytesIO(outcome.files[results["posterior"]["file"]])) as file:
        draws = (file["centre"] + file["draws"]).reshape(-1, len(file["names"]))
    for i, (name, one) in enumerate(stated.items()):
        assert results["covariance"]["matrix"][i][i] == pytest.approx(one["u"] ** 2, rel=1e-8)
        assert results["posterior"]["parameters"][i] == name
        assert draws[:, i].mean() == pytest.approx(one["value"], rel=1e-8)
        assert draws[:, i].std(ddof=1) == pytest.approx(one["u"], rel=1e-6)
    # under each explanation it is another, which is what the average is made of
    assert {path.rsplit(".", 2)[0] for path in disagreeing(results)} == {"diagnosis.remaining.estimates"}
    assert two_uncertainties(outcome.document) == []


def test_a_guide_is_turned_back_by_the_averaged_angle(results: dict[str, Any]) -> None:
    (turn,) = (one["angle_arcsec"] for one in results["adjustments"] if one["effect"] == "squareness_xy")
    angle = results["estimates"]["squareness_xy"]["angle_arcsec"]
    assert (turn["value"], turn["u"]) == pytest.approx((-angle["value"], angle["u"]), rel=1e-3)


def test_a_tolerance_is_kept_by_the_averaged_interval(certified: Result, results: dict[str, Any]) -> None:
    """In, though the named model, for which the scales are noise, leaves it open."""
    assert results["tolerances"]["squareness_xy"]["verdict"] == "in"
    low, high = np.quantile(certified.posterior.draws[:, 0], [0.025, 0.975])
    assert low < -7 or high > 7


def test_the_draws_of_the_average_agree_between_chains_and_keep_the_noise_of_the_named_model(
    certified: Result, results: dict[str, Any]
) -> None:
    assert results["posterior"]["rhat_max"] < 1.01
    noise = certified.draws["noise.coordinate_um"].ravel()
    assert set(noise) <= set(certified.posterior.sizes.coordinate / MICROMETRE)
    assert abs(noise.mean() - certified.noise.coordinate.value) < certified.noise.coordinate.u / 5


def test_the_reader_is_told_what_is_averaged_and_what_is_not(certified: Result, outcome: Outcome) -> None:
    count = len(certified.diagnosed.diagnosis.remaining.rivals)
    assert any(f"averaged over {count} explanations that remain" in warning for warning in outcome.warnings)
    columns = tables(outcome.document)["Error factors of the machine"].columns
    assert "Least squares, named model" in [column.heading for column in columns]


def test_figures_under_an_explanation_are_those_of_the_lengths_corrected_for_it(found: JobDiagnosis) -> None:
    """Without effects they are those recorded; with the three scales they are of the bar's own 400 mm again, but for noise."""
    costs, rivals = found.costs, found.diagnosis.remaining.rivals
    assert costs is not None
    lengths = found.diagnosis.before.artefact.lengths()
    assert lengths is not None
    recorded = figures(lengths)
    for rival, cost in zip(rivals, costs.each, strict=True):
        assert cost.probability == rival.probability
        assert cost.figures["b89_range_um"].value < 0.7 * float(recorded["b89_range_um"]) or not rival.effects
        if set(rival.effects) == set(TRUTH):
            assert cost.figures["rms_accuracy_error_um"].value == pytest.approx(1.5 * np.sqrt(2), rel=0.5)
    p = np.array([cost.probability for cost in costs.each])
    for name, quantity in costs.figures.items():
        assert quantity.value == pytest.approx(p @ [cost.figures[name].value for cost in costs.each] / p.sum())


def test_decisions_are_counted_by_the_probabilities_of_the_explanations(found: JobDiagnosis) -> None:
    costs = found.costs
    assert costs is not None
    (decided,) = costs.decisions
    assert sum(decided.values()) == pytest.approx(1.0)
    whole = sum(cost.probability for cost in costs.each)
    for outcome, p in decided.items():
        own = [cost.probability for cost in costs.each if cost.statements[0].outcome == outcome]
        assert p == pytest.approx(sum(own) / whole)


def test_page_and_results_have_a_column_for_each(found: JobDiagnosis) -> None:
    (table,) = costs_section(found).blocks
    assert isinstance(table, Table)
    assert table.columns[0].heading == "Quantity"
    added = [EVERY[name].title for name in found.diagnosis.remaining.rivals[0].effects]
    assert table.columns[1].heading.startswith(", ".join(added))
    titles = [row[0] for row in table.rows]
    assert titles[0] == "Squareness X–Y"
    assert any("B89" in title for title in titles)
    data = costs_data(found)
    assert [one["effects"] for one in data["remaining"]] == [list(r.effects) for r in found.diagnosis.remaining.rivals]
    assert set(data["averaged"]["estimates"]) == {"squareness_xy", "squareness_yz", "squareness_zx"}
