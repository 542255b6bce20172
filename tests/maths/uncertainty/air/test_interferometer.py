"""Interferometer lengths: each correction against its textbook size."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.uncertainty.air.interferometer import Interferometer, interferometer_model
from cmm_uq.maths.uncertainty.air.state import Air, refractive_index
from cmm_uq.maths.uncertainty.budget import budget_of
from cmm_uq.maths.uncertainty.distributions import constant, normal, rectangular
from cmm_uq.maths.uncertainty.evaluation import evaluate
from cmm_uq.maths.uncertainty.propagation import first_order

AIR = Air(normal(20.0, 0.1), normal(101325.0, 20.0), normal(50.0, 2.0), co2_ppm=normal(450.0, 50.0))
N = float(refractive_index(AIR)[0])
COUNT = normal(1000.0, 1e-5)


def length(setup: Interferometer, **options: str) -> float:
    return float(first_order(interferometer_model(setup, **options)).value[0])


def test_the_wavelength_is_that_in_air() -> None:
    assert length(Interferometer(COUNT, AIR)) == pytest.approx(1000.0 / N, rel=1e-14)


def test_one_kelvin_is_a_part_per_million() -> None:
    model = interferometer_model(Interferometer(COUNT, AIR))
    budget = budget_of(model, first_order(model))
    by_name = {line.name: line for line in budget.lines}
    assert by_name["temperature_c"].sensitivity == pytest.approx(0.955e-3, rel=1e-2)
    assert by_name["wavelength_nm"].contribution == pytest.approx(1000 * 1.5e-6, rel=1e-3)  # laser not calibrated


def test_dead_path_counts_the_change_of_air_since_zeroing() -> None:
    # the air thinned by 1·10⁻⁶ over a dead path of 500 mm: 0.5 µm
    setup = Interferometer(COUNT, AIR, constant(500.0), normal(N - 1 + 1e-6, 1e-8))
    assert length(setup) - 1000.0 / N == pytest.approx(0.5e-3, rel=1e-3)
    found = first_order(interferometer_model(setup))
    line = dict(zip(found.inputs, found.contribution[0], strict=True))
    assert line["zero_refractivity"] == pytest.approx(500 * 1e-8, rel=1e-3)


def test_a_misaligned_beam_measures_short() -> None:
    setup = Interferometer(COUNT, AIR, angle_rad=constant(1e-3))
    assert length(setup) - 1000.0 / N == pytest.approx(1000.0 * 0.5e-6, rel=1e-3)


def test_an_angle_of_about_zero_bends_the_model_and_is_not_lost() -> None:
    # first order sees nothing of an angle of 0 ± 2 mrad; the length it adds is u²/2 · L on average
    laser = Air(*(constant(x) for x in (20.0, 101325.0, 50.0)), None, constant(450.0), constant(633.0))
    setup = Interferometer(normal(1000.0, 1e-5), laser, angle_rad=normal(0.0, 2e-3))
    stated = evaluate(interferometer_model(setup)).stated["length"]
    assert stated.method == "monte_carlo"
    assert stated.value - length(setup) == pytest.approx(1000 * 0.5 * 4e-6, rel=0.05)


def test_the_workpiece_is_brought_to_20_degrees() -> None:
    steel = rectangular(10.5e-6, 12.5e-6)
    setup = Interferometer(COUNT, AIR, material_c=normal(22.0, 0.05), cte_per_k=steel)
    found = first_order(interferometer_model(setup))
    assert 1000.0 / N - float(found.value[0]) == pytest.approx(1000 * 11.5e-6 * 2, rel=5e-4)
    line = dict(zip(found.inputs, np.abs(found.contribution[0]), strict=True))
    assert line["cte_per_k"] == pytest.approx(1000 * 2 * 1e-6 / np.sqrt(3), rel=1e-3)
    assert line["material_c"] == pytest.approx(1000 * 11.5e-6 * 0.05, rel=1e-3)


def test_the_equation_can_be_chosen() -> None:
    setup = Interferometer(COUNT, AIR)
    assert length(setup, equation="edlen_1966") - length(setup) == pytest.approx(1000 * 7.7e-8, rel=0.05)
