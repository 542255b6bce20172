"""Refractive index of air: what the reference cases, which hold the printed tables, do not say."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.air.refractivity import (
    birch_downs_1994,
    ciddor,
    edlen_1966,
    harris_2004,
    relative_humidity,
    saturation_pressure,
)
from cmm_uq.maths.uncertainty.air.state import EQUATIONS, Air, air_model, refractive_index, standard_pressure
from cmm_uq.maths.uncertainty.budget import budget_of
from cmm_uq.maths.uncertainty.distributions import normal
from cmm_uq.maths.uncertainty.measurement_model import complex_step, derivatives
from cmm_uq.maths.uncertainty.monte_carlo import simulate
from cmm_uq.maths.uncertainty.propagation import first_order

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
