"""The refractive index of air, and lengths by laser interferometer."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.air.state import (
    EQUATIONS,
    Air,
    Interferometer,
    air_model,
    birch_downs_1994,
    ciddor,
    edlen_1966,
    harris_2004,
    interferometer_model,
    refractive_index,
    relative_humidity,
    saturation_pressure,
    standard_pressure,
)
from cmm_uq.maths.uncertainty.budget import budget_of
from cmm_uq.maths.uncertainty.distributions import constant, normal, rectangular
from cmm_uq.maths.uncertainty.evaluation import evaluate
from cmm_uq.maths.uncertainty.measurement_model import complex_step, derivatives
from cmm_uq.maths.uncertainty.propagation import first_order, simulate

LABORATORY = (20.0, 101325.0, 50.0, 450.0, 633.0)


@pytest.mark.parametrize("name", list(EQUATIONS))
def test_derivatives_by_jets_are_those_by_complex_steps(name: str) -> None:
    equation = EQUATIONS[name].refractivity
    t = np.array([5.0, 20.0, 35.0])
    at = [t, 98e3, 40.0, 500.0, 632.99]
    jets = derivatives(lambda *x: [equation(*x)], at)
    steps = complex_step(lambda *x: [np.asarray(equation(*x))], at, [1.0, 1e3, 5.0, 50.0, 0.1])
    np.testing.assert_allclose(jets.jacobian, steps.jacobian, rtol=1e-9, atol=1e-25)


def test_the_equations_agree_as_their_sources_say() -> None:
    # Birch and Downs 1994 and Ciddor within 3·10⁻⁸ in laboratory air; Edlén 1966 is low in humid air by some 10⁻⁷
    assert birch_downs_1994(*LABORATORY) == pytest.approx(ciddor(*LABORATORY), abs=3e-9)
    difference = edlen_1966(*LABORATORY) - ciddor(*LABORATORY)
    assert -1.2e-7 < difference < -5e-8


def test_the_formula_of_harris_2004_is_edlen_s_of_1966_at_633_nm() -> None:
    dry = 20.0, 101325.0, 0.0, 0.0, 632.99
    assert harris_2004(*dry) == pytest.approx(edlen_1966(*dry), rel=3e-6)


def test_saturation_pressure_and_dew_point() -> None:
    # IAPWS-IF97 region 4, table 35: 3.536 589 41 kPa at 300 K; triple point 611.657 Pa from both sides
    assert saturation_pressure(300.0 - 273.15) == pytest.approx(3536.58941, rel=1e-8)
    assert saturation_pressure(np.array([0.0099999, 0.0100001])) == pytest.approx([611.657, 611.657], rel=2e-5)
    assert relative_humidity(20.0, 20.0) == pytest.approx(100.0)
    assert relative_humidity(20.0, 9.27) == pytest.approx(50.0, abs=0.1)  # psychrometric tables: dew point 9.3 °C


def test_the_equation_s_own_uncertainty_is_a_line_of_the_budget() -> None:
    air = Air(normal(20.0, 0.1), normal(101325.0, 20.0), normal(50.0, 2.0))
    model = air_model(air)
    budget = budget_of(model, first_order(model), labels=air.labels)
    lines = {line.name: line for line in budget.lines}
    assert lines["equation"].contribution == pytest.approx(1e-8)
    assert lines["co2_ppm"].origin == "judgement: not measured"
    assert lines["temperature_c"].origin == "measured"
    assert lines["temperature_c"].contribution == pytest.approx(9.55e-8, rel=1e-3)
    assert budget.u == pytest.approx(simulate(model, 20_000, seed=1).u[0], rel=0.03)


def test_what_was_not_measured_widens_the_result() -> None:
    measured = Air(normal(20.0, 0.1), normal(101325.0, 20.0), normal(50.0, 2.0), co2_ppm=normal(450.0, 10.0))
    n, u = refractive_index(measured)
    assert float(n) == pytest.approx(1.00027137, abs=2e-8)
    less = refractive_index(Air(normal(20.0, 0.1), humidity_pct=normal(50.0, 2.0)))
    assert float(less[1]) == pytest.approx(3e3 / np.sqrt(3) * 2.683e-9, rel=0.01)  # the weather alone
    assert float(less[1]) > 10 * float(u)
    assert set(Air(normal(20.0, 0.1)).assumed) == {"pressure_pa", "humidity_pct", "co2_ppm", "wavelength_nm"}


def test_dew_point_instead_of_humidity_and_many_states_at_once() -> None:
    t = np.array([18.0, 20.0, 22.0])
    n, _ = refractive_index(Air(normal(t, 0.1), normal(101325.0, 20.0), dew_point_c=normal(9.27, 0.2)))
    assert n.shape == (3,)
    humid, _ = refractive_index(Air(normal(20.0, 0.1), normal(101325.0, 20.0), normal(50.0, 1.0)))
    assert n[1] == pytest.approx(float(humid), abs=1e-9)


def test_altitude_lowers_the_pressure_that_is_assumed() -> None:
    assert standard_pressure(0.0) == pytest.approx(101325.0)
    assert standard_pressure(1000.0) == pytest.approx(89876.0, abs=3.0)  # ISO 2533


@pytest.mark.parametrize(
    ("air", "equation", "problem"),
    [
        (Air(normal(120.0, 1.0)), "ciddor", "temperature_c = 120 is out of the range -40 to 100"),
        (Air(normal(20.0, 1.0), normal(1013.0, 1.0)), "ciddor", "pressure_pa = 1013"),
        (Air(normal(20.0, 1.0), dew_point_c=normal(25.0, 1.0)), "ciddor", "humidity_pct = 135"),
        (Air(normal(20.0, 1.0), wavelength_nm=normal(0.633, 1e-6)), "ciddor", "wavelength_nm = 0.633"),
        (Air(normal(20.0, 1.0), wavelength_nm=normal(532.0, 1e-3)), "harris_2004", "632 to 634 of Harris"),
        (Air(normal(np.array([20.0, 50.0]), 1.0)), "birch_downs_1994", "temperature_c = 50"),
        (Air(normal(20.0, 1.0)), "cidor", "Did you mean 'ciddor'"),
    ],
)
def test_out_of_range_is_refused(air: Air, equation: str, problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        refractive_index(air, equation)


def test_humidity_and_dew_point_together_are_refused() -> None:
    with pytest.raises(CmmUqError, match="both"):
        Air(normal(20.0, 1.0), humidity_pct=normal(50.0, 1.0), dew_point_c=normal(9.0, 1.0))


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
