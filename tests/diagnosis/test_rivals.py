"""What each explanation that remains makes of a job, and the averages: held to the joint posterior and to moments by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.commands.diagnosing import diagnose_job
from cmm_uq.conformity.accuracy import figures
from cmm_uq.diagnosis.rivals import REMAINS, SETTLED
from cmm_uq.documents.diagnosis_costs import costs_data, costs_section
from cmm_uq.documents.document import Table
from cmm_uq.documents.result import Diagnosed
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.model import MeasurementModel, Noise
from cmm_uq.physics.catalogue import EVERY, effects
from cmm_uq.points import Machine
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

[[conformity]]
standard = "ASME B89.4.1-1997"
limit_um = 14.0
rule = "ISO 14253-1"
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    """Twenty bars of a machine whose three scales are wrong, and that is taken for one with wrong squarenesses."""
    random = np.random.default_rng(1)
    points = bars(random, 20, 400.0, Machine("m", "XYZ", TRAVEL))
    model = MeasurementModel(Ballbar(bar_facts(), points), effects(tuple(TRUTH)))
    xyz = model.simulate(np.array(list(TRUTH.values())), np.array([400.0]), Noise(1.5e-3), random)
    rows = "".join(
        f"{m},{p},1,{x:.5f},{y:.5f},{z:.5f}\n"
        for m, p, (x, y, z) in zip(points.measurement, points.point, xyz, strict=True)
    )
    job: Path = tmp_path_factory.mktemp("rivals") / "twenty-bars"
    job.mkdir()
    (job / "recording.csv").write_text("measurement,point,repeat,x_mm,y_mm,z_mm\n" + rows, encoding="utf-8")
    (job / "job.toml").write_text(JOB, encoding="utf-8")
    return diagnose_job(job)


def test_several_explanations_remain_and_the_true_one_is_among_them(found: Diagnosed) -> None:
    remaining = found.diagnosis.remaining
    assert set(TRUTH) in [set(rival.effects) for rival in remaining.rivals]
    assert sorted(remaining.weights, reverse=True) == remaining.weights
    assert min(remaining.weights) > REMAINS
    assert remaining.weights[0] < SETTLED


def test_under_the_explanation_that_is_asserted_it_is_the_joint_posterior(found: Diagnosed) -> None:
    """Sampled by emcee under the same noise: means within a third of u, u within a third."""
    asserted = {item.effect: item for item in found.diagnosis.effects}
    rival = next(one for one in found.diagnosis.remaining.rivals if set(one.effects) == set(asserted))
    for name, item in asserted.items():
        for parameter, quantity in item.parameters.items():
            own = rival.added[name][parameter]
            assert own.value == pytest.approx(quantity.value, abs=quantity.u / 3)
            assert own.u == pytest.approx(quantity.u, rel=1 / 3)


def test_the_average_has_the_moments_of_the_mixture(found: Diagnosed) -> None:
    """Mean of the means; mean of the variances and variance of the means (law of total variance)."""
    remaining = found.diagnosis.remaining
    p = np.array(remaining.weights) / sum(remaining.weights)
    for effect, parameters in remaining.averaged.items():
        for name, quantity in parameters.items():
            each = [rival.named[effect][name] for rival in remaining.rivals]
            values, us = np.array([q.value for q in each]), np.array([q.u for q in each])
            assert quantity.value == pytest.approx(p @ values)
            assert quantity.u == pytest.approx(np.sqrt(p @ (us**2 + values**2) - (p @ values) ** 2))
            assert quantity.u > min(us)


def test_figures_under_an_explanation_are_those_of_the_lengths_corrected_for_it(found: Diagnosed) -> None:
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


def test_decisions_are_counted_by_the_probabilities_of_the_explanations(found: Diagnosed) -> None:
    costs = found.costs
    assert costs is not None
    (decided,) = costs.decisions
    assert sum(decided.values()) == pytest.approx(1.0)
    whole = sum(cost.probability for cost in costs.each)
    for outcome, p in decided.items():
        own = [cost.probability for cost in costs.each if cost.statements[0].outcome == outcome]
        assert p == pytest.approx(sum(own) / whole)


def test_page_and_results_have_a_column_for_each(found: Diagnosed) -> None:
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
