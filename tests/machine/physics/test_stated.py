"""Effects that a job states: the same as built-in ones written as formulas, and nothing that is no such formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.units import UNITS, unit_as_typed
from cmm_uq.jobs.tables.plan import EffectFacts, EffectParameter
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Nonparametric
from cmm_uq.machine.physics.stated import StatedEffect, factor_to_mm
from tests.recordings import TRAVEL, bars, with_columns

RANDOM = np.random.default_rng(8)
PLAIN = bars(RANDOM, 20, 300.0, Machine("m", "XYZ", TRAVEL, origin_mm=np.array([11.0, -7.0, 3.0])))
POINTS = with_columns(
    PLAIN, time_s=3.0e9 + np.linspace(0.0, 7200.0, 40), temp_x_c=20 + RANDOM.standard_normal(40),
    approach_x=np.where(RANDOM.random(40) < 0.5, -1.0, 1.0), gamma_deg=RANDOM.uniform(-90, 90, 40),
)  # fmt: skip
X, Y, Z = (POINTS.xyz + PLAIN.machine.origin_mm).T
COLUMNS = list(POINTS.columns)


def effect(formula: str | list[str], unit: str | None = "µm", prior: float | None = 5.0, **more: Any) -> StatedEffect:
    facts = {"name": "own", "formula": formula, "unit": unit, "prior": prior, **more}
    return StatedEffect(EffectFacts.model_validate(facts), "job.toml [[effect]] 1", COLUMNS)


def along(axis: str, component: Floats) -> Floats:
    """(n, 3, 1) mm."""
    return np.asarray(component[:, None, None] * np.eye(3)["xyz".index(axis)][None, :, None])


@pytest.mark.parametrize(("name", "formula", "unit"), [
    ("scale_y", "e_y = k*y", "ppm"),
    ("squareness_zx", "e_x = -k*z", "arcsec"),
    ("straightness_x_z", "e_z = k*(1 - (2*x/900 - 1)**2)", "um"),
    ("scale_curvature_y", "e_y = k*(1 - (2*y/550 - 1)**2)", "µm"),
    ("hysteresis_x", "e_x = 0.5*k*approach_x", "um"),
    ("windup_x", "e_x = 0.5*k*approach_x*(x - 450)", "um/m"),
    ("thermal_scale_x", "e_x = k*(temp_x_c - 20)*x", "1/K"),
    ("drift_z", "e_z = k*time_s", "um/h"),
    ("scale_drift_z", "e_z = k*time_s*z", "ppm/h"),
    ("thermal_squareness_xy", "e_x = -k*(temp_x_c - 20)*y", "arcsec/K"),
])  # fmt: skip
def test_a_built_in_effect_written_as_a_formula_is_the_same(name: str, formula: str, unit: str) -> None:
    """With its own unit: time is counted from the start, of a clock too, and readings are of the scales."""
    points = with_columns(POINTS, **{f"temp_{axis}_c": POINTS.columns["temp_x_c"] for axis in "yz"})
    np.testing.assert_allclose(effect(formula, unit).basis(points), EVERY[name].basis(points), rtol=4e-15, atol=1e-15)


def test_a_shape_is_given_in_its_unit() -> None:
    """A drift that settles: e = A(1 − exp(−t/τ)), τ in hours, t in seconds, A in micrometres."""
    table = {"a": {"unit": "um", "prior": 20}, "tau": {"unit": "h", "low": 0.2, "high": 20}}
    own = effect("e_x = a*(1 - exp(-time_s/tau))", None, None, parameters=table)
    for tau in (0.5, 3.0):
        np.testing.assert_allclose(own.basis(POINTS, (tau,)), EVERY["settling_x"].basis(POINTS, (tau,)), atol=1e-15)
    assert [p.name for p in own.reported] == ["a_um", "tau_h"]
    assert len(list(own.trials())) > 3


def test_several_components_and_parameters_are_columns_of_one_basis() -> None:
    table = {"a": {"unit": "um/m", "prior": 5}, "b": {"unit": "um/m2", "prior": 2}}
    own = effect(["e_x = a*y + b*x*y", "e_z = -2*b*y**2; e_y = (a + 0)/4*max(x, z)"], None, None, parameters=table)
    expected = np.stack([
        np.column_stack([1e-6 * Y, 1e-6 / 4 * np.maximum(X, Z), 0 * X]),
        np.column_stack([1e-9 * X * Y, 0 * X, -2e-9 * Y**2]),
    ], axis=2)  # fmt: skip
    np.testing.assert_allclose(own.basis(POINTS), expected, rtol=1e-14, atol=1e-18)
    assert own.columns == ()


def test_a_parameter_is_named_with_its_unit_and_gives_what_it_says() -> None:
    own = effect("e_x = k*x*(y - 500)/1000", "um/m")
    e = own.displacement(POINTS, {"k_um_per_m": 5.0})
    np.testing.assert_allclose(e[:, 0], 5e-6 * X * (Y - 500) / 1000, rtol=1e-14)
    assert own.prior_weight == 1.0
    assert str(own.words) == "Own: e_x = k*x*(y - 500)/1000, in mm; k about 0 ± 5 µm/m beforehand"


@pytest.mark.parametrize(("typed", "symbol", "factor"), [
    ("um", "µm", 1e-3), ("μm/m", "µm/m", 1e-6), ("um / m^2", "µm/m²", 1e-9), ("um/(m*K)", "µm/(m·K)", 1e-6),
    ("mm", "mm", 1.0), ("arcsec/m", "″/m", np.pi / 648e6), ("um/deg", "µm/°", 1e-3), ("ppm/K", "10⁻⁶/K", 1e-6),
    ("h", "h", 3600.0), ("1", "1", 1.0),
    ("um/K", "µm/K", 1e-3), ("um/mm", "µm/mm", 1e-3), ("ms", "ms", 1e-3), ("rad", "rad", 1.0),
])  # fmt: skip
def test_units_are_typed_by_keyboard_and_become_millimetres(typed: str, symbol: str, factor: float) -> None:
    """Per degree stays per degree, for columns of angles are in degrees."""
    assert unit_as_typed(typed) == UNITS[symbol]
    assert factor_to_mm(UNITS[symbol]) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(("formula", "imitation"), [
    ("e_x = k*sin(2*pi*x/40)", Nonparametric("x_mm", "x")),
    ("e_z = k*(gamma_deg/90)**2", Nonparametric("gamma_deg", "z")),
    ("e_x = k*x*time_s", Nonparametric("time_s", "x", scale=True)),
    ("e_x = k*x*y", Nonparametric("y_mm", "x", scale=True)),
    ("e_x = k*x**2*y", None),
    ("e_x = k*y*z", None),
    ("e_x = k*y; e_y = k*x", None),
])  # fmt: skip
def test_a_function_of_one_quantity_along_the_same_axis_could_pass_for_it(
    formula: str, imitation: Nonparametric | None
) -> None:
    assert effect(formula).imitated_by == (() if imitation is None else (imitation,))


PROPORTIONAL = "not proportional to k"


@pytest.mark.parametrize(("formula", "said"), [
    *((f"e_x = {text}", PROPORTIONAL) for text in (
        "x", "k*k*x", "x/k", "k**2*x", "sin(k*x)", "k*x + y", "abs(k)*x", "k*x - 1e-9", "x**k", "max(k*x, y)",
        "0*k*x + 1", "(k*x)**1", "1/(k/x)",
    )),
    ("e_x = k*w", "no input 'w'"), ("e_x = k*tim_s", "Did you mean 'time_s'"), ("e_x = k*x.real", "not arithmetic"),
    ("e_x = k*x.__class__.__bases__", "not arithmetic"), ("e_x = k*__import__('os')", "no function"),
    ("e_x = k*x if x else k", "not arithmetic"), ("e_x = [k for k in x]", "not arithmetic"),
    ("e_x = k*(lambda: x)()", "no function"), ("e_x = k*x == 1", "not arithmetic"),
    ("e_x = k*x ^ 2", "written \\*\\*"), ("e_x = k*x % 10", "not arithmetic"),
    ("e_x = k*" + "(" * 1500 + "x" + ")" * 1500, "nested too deeply|too many nested"), ("e_x = k*x*1j", "no real number"),
    ("e_x = " + "-" * 1500 + "k*x", "nested too deeply|too many nested"), ("e_x = k*" + "9" * 200, "too large"),
    ("e_w = k*x", "no component of e"), ("k*x", "no component of e"), ("e_x = k*x; e_x = k*y", "a component twice"),
    ("e_x = k*x = 3", "no arithmetic expression"), ("e_x = ", "no component of e"),
    ("e_x = k*temp_z_c", "needs the column temp_z_c"),
])  # fmt: skip
def test_what_is_no_such_formula_is_refused_with_its_key(formula: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said) as refused:
        effect(formula)
    assert refused.value.where == "job.toml [[effect]] 1 formula"
    assert "\n" not in str(refused.value)


def test_a_constant_times_k_is_a_shift_and_no_mistake() -> None:
    np.testing.assert_array_equal(effect("e_x = k").basis(POINTS), along("x", np.full(40, 1e-3)))


@pytest.mark.parametrize(("formula", "said"), [
    ("e_x = k/(x - x)", "gives no number"), ("e_x = k*log(-1 - x**2)", "gives no number"),
    ("e_x = k*9**9**9", "gives no number"), ("e_x = k*1e9*x", r"moves points by \d"),
    ("e_x = k*sqrt(z - 1000)", "gives no number"),
])  # fmt: skip
def test_what_is_no_number_at_a_point_is_refused_with_that_point(formula: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=rf"own with k of its prior {said}.* at x = .* mm.*divided by zero"):
        effect(formula).basis(POINTS)


@pytest.mark.parametrize(("more", "where", "said"), [
    ({"unit": "furlong"}, "unit", "no unit of a parameter. Known: 1, mm, µm"),
    ({"unit": "Pa"}, "unit", "no unit of a parameter"),
    ({"name": "scale_x"}, "", "there is a 'scale_x' already"),
    ({"name": "noise"}, "", "there is a 'noise' already"),
    ({"unit": None, "prior": None, "parameters": {"x": {"unit": "µm", "prior": 1.0}}}, "parameters", "'x' is the name of"),
    ({"unit": None, "prior": None, "parameters": {"exp": {"unit": "µm", "prior": 1.0}}}, "parameters", "is the name of"),
    ({"unit": None, "prior": None, "parameters": {"k": {"unit": "µm", "prior": 1.0}, "l": {"unit": "µm", "prior": 1.0}}},
     "formula", "the parameter l does not enter"),
])  # fmt: skip
def test_a_table_that_says_too_much_is_refused_with_its_key(more: dict[str, Any], where: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said) as refused:
        effect("e_x = k*x", **more)
    assert str(refused.value.where) == f"job.toml [[effect]] 1 {where}".strip()


@pytest.mark.parametrize(("given", "said"), [
    ({"unit": "µm"}, "a low below a high"), ({"unit": "µm", "low": 2.0, "high": 1.0}, "a low below a high"),
    ({"unit": "µm", "prior": 1.0, "low": 1.0}, "leave one of them out"), ({"unit": "µm", "prior": -1.0}, "greater than 0"),
])  # fmt: skip
def test_a_parameter_has_a_prior_or_two_ends(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        EffectParameter.model_validate(given)


def test_no_more_than_two_parameters_shape_an_effect() -> None:
    """All their values are tried with each other: seven, 49, 343 members of one explanation."""
    shaping = {"unit": "mm", "low": 1.0, "high": 2.0}
    table = {"k": {"unit": "µm", "prior": 1.0}, "a": shaping, "b": shaping}
    assert len(list(effect("e_x = k*a*b", None, None, parameters=table).trials())) == 49
    with pytest.raises(ValueError, match="more than 2 parameters have low and high"):
        effect("e_x = k*a*b*c", None, None, parameters={**table, "c": shaping})


@pytest.mark.parametrize("given", [
    {"unit": "µm"}, {"prior": 1.0}, {}, {"unit": "µm", "prior": 1.0, "parameters": {"k": {"unit": "µm", "prior": 1.0}}},
])  # fmt: skip
def test_an_effect_has_k_or_a_table_of_parameters(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="give unit and prior of k, or a table of parameters"):
        EffectFacts.model_validate({"name": "own", "formula": "e_x = k*x", **given})
