"""Refractive index of air against printed tables and derivatives from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.errors import CmmUqError
from cmm_uq.uncertainty.air.ciddor import ciddor
from cmm_uq.uncertainty.air.edlen import birch_downs_1994, edlen_1966, harris_2004, modified_edlen
from cmm_uq.uncertainty.air.state import EQUATIONS, Air, air_model, refractive_index, standard_pressure
from cmm_uq.uncertainty.air.water_vapour import relative_humidity, saturation_pressure
from cmm_uq.uncertainty.budget import budget_of
from cmm_uq.uncertainty.derivatives import complex_step, derivatives
from cmm_uq.uncertainty.distributions import normal
from cmm_uq.uncertainty.monte_carlo import simulate
from cmm_uq.uncertainty.propagation import first_order

# NIST Engineering Metrology Toolbox, table 1: °C, %RH, kPa, nm, (n − 1)·10⁹ by Ciddor and by the modified Edlén equation
TOOLBOX = [
    (20, 0, 101.325, 633, 271800, 271799),
    (20, 0, 60, 633, 160924, 160920),
    (20, 0, 120, 633, 321916, 321918),
    (50, 0, 100, 633, 243285, 243270),
    (5, 0, 100, 633, 282756, 282750),
    (-40, 0, 100, 633, 337580, 337471),
    (50, 100, 120, 633, 287924, 287864),
    (40, 75, 120, 633, 299418, 299406),
    (20, 100, 100, 633, 267394, 267394),
    (40, 100, 110, 1700, 270247, 270237),
    (20, 0, 101.325, 1700, 268479, 268483),
    (40, 100, 110, 300, 289000, 288922),
    (20, 0, 101.325, 300, 286581, 286579),
    (-40, 0, 120, 300, 427233, 427072),
]
LABORATORY = (20.0, 101325.0, 50.0, 450.0, 633.0)


@pytest.mark.parametrize(("t", "h", "kpa", "nm", "by_ciddor", "by_edlen"), TOOLBOX)
def test_the_table_of_the_nist_toolbox(
    t: float, h: float, kpa: float, nm: float, by_ciddor: float, by_edlen: float
) -> None:
    assert ciddor(t, 1e3 * kpa, h, 450.0, nm) * 1e9 == pytest.approx(by_ciddor, abs=0.6)
    assert modified_edlen(t, 1e3 * kpa, h, 450.0, nm) * 1e9 == pytest.approx(by_edlen, abs=0.6)


@pytest.mark.parametrize(
    ("t", "kpa", "printed"),
    [(20, 80, 21458.0), (20, 100, 26824.4), (20, 120, 32191.6), (10, 100, 27774.7), (30, 100, 25937.2)],
)
def test_table_1_of_ciddor_1996(t: float, kpa: float, printed: float) -> None:
    assert ciddor(t, 1e3 * kpa, 0.0, 450.0, 633.0) * 1e8 == pytest.approx(printed, abs=0.05)


def test_ciddor_in_the_laboratory_and_its_sensitivities() -> None:
    # recomputed with forty digits
    assert ciddor(*LABORATORY) * 1e8 == pytest.approx(27137.275, abs=5e-4)
    found = derivatives(lambda t, p, h, c: [ciddor(t, p, h, c, 633.0)], LABORATORY[:4])
    assert found.jacobian[0] == pytest.approx([-9.548e-7, 2.683e-9, -8.50e-9, 1.435e-10], rel=1e-3)


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


def test_birch_and_downs_constant_of_water_vapour() -> None:
    # −(3.7345 − 0.0401 σ²)·10⁻¹⁰ of refractivity per pascal of vapour pressure, σ in µm⁻¹
    vapour = saturation_pressure(20.0)
    wet, dry = birch_downs_1994(20.0, 1e5, 100.0, 0, 633.0), birch_downs_1994(20.0, 1e5, 0.0, 0, 633.0)
    assert (dry - wet) / vapour * 1e10 == pytest.approx(3.7345 - 0.0401 / 0.633**2, rel=1e-9)


def test_the_formula_of_harris_2004_with_the_exponent_mended() -> None:
    # N = 271.307; −0.958 /K, +0.358 /mm Hg, −0.0096 /% (printed: 0.97, 0.38, 0.01)
    found = derivatives(lambda t, p, h: [harris_2004(t, p * 101325 / 760, h, 0.0, 633.0)], [20.0, 760.0, 50.0])
    assert found.value[0] * 1e6 == pytest.approx(271.307, abs=5e-4)
    assert found.jacobian[0] * 1e6 == pytest.approx([-0.958, 0.358, -0.0096], abs=5e-4)
    assert harris_2004(20.0, 101325.0, 0.0, 0.0, 633.0) == pytest.approx(
        edlen_1966(20.0, 101325.0, 0.0, 0.0, 632.99), rel=3e-6
    )


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
