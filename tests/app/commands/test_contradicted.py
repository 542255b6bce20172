"""A scale that is an average over explanations is given only where the lines along its axis say the same."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.app.commands.report import evaluate_job as analyse_job, outcome_of
from cmm_uq.certificate.result import Result

WAYS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1),
        (1, 1, 0), (-1, 1, 0), (1, 0, 1), (-1, 0, 1))  # fmt: skip
EFFECTS = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


def gauge_that_seems_to_sag() -> pd.DataFrame:
    """Axes of 600 mm (Z 500) show no scale; on diagonals of 700 mm level parts of a line are up to 5 ppm too long.

    So would a gauge that sags by 21 µm on a machine whose X and Y are 35 ppm off, which is what the average mostly is made of.
    """
    random, sag, middle, rows = np.random.default_rng(3), 0.021, np.array([350.0, 350.0, -350.0]), []
    for number, way in enumerate(WAYS, 1):
        along = np.array(way) / np.linalg.norm(way)
        faces = np.linspace(0, 500.0 if number == 3 else 600.0 if number < 3 else 700.0, 6)
        shortened = 1 - sag / faces[-1] * (1 - along[2] ** 2)
        true = middle + 20 * random.uniform(-1, 1, 3) + (faces[:, None] - faces[-1] / 2) * along * shortened
        true = true + (true - middle) * np.array([sag / 600, sag / 600, 0])
        for repeat in (1, 2, 3):
            rows += [
                (number, repeat, point, *np.round(xyz, 5), reference)
                for point, (xyz, reference) in enumerate(
                    zip(true + 0.001 * random.standard_normal(true.shape), faces, strict=True), 1
                )
            ]
    names = ["measurement", "repeat", "point", "x_mm", "y_mm", "z_mm", "reference_mm"]
    return pd.DataFrame(rows, columns=names)


@pytest.fixture(scope="module")
def result() -> Result:
    job = cmm_uq.job(
        gauge_that_seems_to_sag(),
        machine={"name": "M", "chain": "XYZ", "travel_mm": {"x": [0, 1000], "y": [0, 1000], "z": [-1000, 0]}},
        artefact={"kind": "step_gauge", "u_um": 0.2, "cte_per_k": 11.5e-6}, effects=EFFECTS,
        model={"tolerances": {"scale_x": 60.0, "scale_z": 60.0}},
    )  # fmt: skip
    found = analyse_job(job)
    assert isinstance(found, Result)
    return found


def test_the_average_is_far_from_what_the_line_along_x_says(result: Result) -> None:
    assert result.averaged
    scale = result.parameters["scale_x"]["ppm"]
    line = next(one for one in result.contradictions if one.key == ("scale_x", "ppm"))
    assert line.measurement == 1
    assert abs(line.alone.value) < 3 < abs(scale.value) - scale.expanded + line.alone.expanded
    assert abs(scale.value - line.alone.value) > np.hypot(scale.expanded, line.alone.expanded)


def test_it_is_not_given_on_any_page_nor_to_programs_while_that_of_z_is(result: Result) -> None:
    outcome = outcome_of(result)
    assert any("the line of measurement 1 alone says" in text for text in outcome.summary.warnings)
    assert {one.key for one in result.contradictions} == {("scale_x", "ppm"), ("scale_y", "ppm")}
    undetermined = outcome.results["identifiability"]["undetermined"]
    assert undetermined == [{"scale_x.ppm": 1.0}, {"scale_y.ppm": 1.0}]
    assert outcome.results["contradicted"][0]["measurement"] == 1
    figures = {str(name): str(value) for name, value, _ in outcome.summary.figures}
    assert figures["Scale error of X"] == figures["Scale error of Y"] == "not determined"
    assert "±" in figures["Scale error of Z"]


def test_a_tolerance_of_it_is_not_decided(result: Result) -> None:
    outcomes = {verdict.name: verdict.outcome for verdict in result.verdicts}
    assert outcomes["scale_x.ppm"] == "undecided"
    assert outcomes["scale_z.ppm"] == "pass"
