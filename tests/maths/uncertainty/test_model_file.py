"""A measurement model in a file: what it may say, its units, and what is refused with file and key."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.budget_results import comparison_rows, results_of, statement, summary_rows
from cmm_uq.maths.uncertainty.models.expression import parse
from cmm_uq.maths.uncertainty.models.input_keys import contradiction, derived_unit, number_in, unit_of
from cmm_uq.maths.uncertainty.models.model_file import ModelFile, read_model_file

Read = Callable[[str], ModelFile]

LOSS = """
[model]
outputs = { y = "x1**2 + x2**2" }
coverage = 0.95
method = "auto"
digits = 2
seed = 1
[inputs.x1]
distribution = "normal"
value = 0.05
u = 0.005
unit = "1"
source = "certificate 123"
[inputs.x2]
distribution = "normal"
value = 0.0
u = 0.005
[correlation]
"x1,x2" = 0.9
"""

BRIDGE = """
[model]
outputs = { R = "V/I*cos(phi)", X = "V/I*sin(phi)", Z = "V/I" }
units = { Z = "ohm" }
[inputs.V]
samples = [5.007, 4.994, 5.005, 4.990, 4.999]
unit = "V"
simultaneous = "bridge"
[inputs.I]
samples = [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3]
unit = "A"
simultaneous = "bridge"
[inputs.phi]
samples = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433]
unit = "rad"
simultaneous = "bridge"
"""


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def read(text: str) -> ModelFile:
        path = tmp_path / "model.toml"
        path.write_text(text, encoding="utf-8")
        return read_model_file(path)

    return read


def test_results_have_the_fields_of_the_contract(read: Read) -> None:
    results = results_of(read(LOSS).evaluate())
    assert results["schema"] == "cmm-uq/budget/1"
    y = results["outputs"]["y"]
    keys = {
        "value",
        "u",
        "dof",
        "interval",
        "coverage_factor",
        "method",
        "reason",
        "first",
        "second",
        "monte_carlo",
        "budget",
    }
    assert keys <= set(y)
    assert set(y["first"]) == set(y["second"]) == {"value", "u", "dof", "interval"}
    assert {"value", "u", "interval", "symmetric_interval", "trials"} <= set(y["monte_carlo"])
    assert all({"input", "sensitivity", "contribution", "share"} <= set(line) for line in y["budget"])
    assert sum(line["share"] for line in y["budget"]) == pytest.approx(1)
    assert results["output_correlation"] == [[1.0]]
    json.dumps(results, allow_nan=False)


def test_the_seed_makes_the_bytes(read: Read) -> None:
    model = read(LOSS)
    first, again, other = (json.dumps(results_of(model.evaluate(seed))) for seed in (None, 1, 2))
    assert first == again
    assert first != other


def test_the_correlated_power_loss(read: Read) -> None:
    # zᵀz for z normal with mean m and covariance V: mean mᵀm + tr V, variance 4 mᵀVm + 2 tr V²
    y = results_of(read(LOSS).evaluate())["outputs"]["y"]
    exact = np.sqrt((0.1 * 0.005) ** 2 + 4 * 0.005**4 * (1 + 0.9**2))
    assert y["second"]["value"] == pytest.approx(2550e-6)
    assert y["second"]["u"] == pytest.approx(exact, rel=1e-9)
    assert y["monte_carlo"]["u"] == pytest.approx(exact, rel=5e-3)
    assert y["method"] == "monte_carlo"


def test_simultaneous_readings_bring_correlation_and_degrees_of_freedom(read: Read) -> None:
    model = read(BRIDGE)
    evaluation = model.evaluate()
    results = results_of(evaluation)
    outputs = results["outputs"]
    assert {name: y["method"] for name, y in outputs.items()} == {"R": "first", "X": "first", "Z": "first"}
    half = {name: (y["interval"][1] - y["interval"][0]) / 2 for name, y in outputs.items()}
    assert half == pytest.approx({"R": 0.197, "X": 0.821, "Z": 0.656}, abs=5e-4)
    assert results["output_correlation"][0] == pytest.approx([1, -0.588, -0.485], abs=5e-4)
    assert [outputs[name]["unit"] for name in outputs] == ["V/A", "V/A", "ohm"]
    assert outputs["R"]["budget"][0]["source"] == "repeats"
    assert statement(evaluation, "Z") == (
        "Z = 254.26 ohm ± 0.66 ohm, the expanded uncertainty U = k u with u = 0.24 ohm and k = 2.78 for ν = 4, "
        "coverage probability 95 %."
    )
    assert summary_rows(evaluation)[0] == (
        "R", "127.732", "0.071", "V/A", "[127.535, 127.929]", "2.78", "4", "first order",
    )  # fmt: skip
    assert [row[0] for row in comparison_rows(evaluation, "R")] == ["First order", "Second order", "Monte Carlo"]


def test_the_statement_of_a_monte_carlo_result_gives_the_interval(read: Read) -> None:
    assert statement(read(LOSS).evaluate(), "y").startswith(
        "y = 0.00255 with standard uncertainty 0.00050; the shortest"
    )


@pytest.mark.parametrize(
    ("keys", "value", "u", "dof"),
    [
        ('distribution = "normal"\nvalue = 1\nu = 0.5', 1, 0.5, np.inf),
        ('distribution = "normal"\nvalue = 1\nexpanded = 1\ncoverage_factor = 2', 1, 0.5, np.inf),
        ('distribution = "normal"\nvalue = 1\nu = "5 µm"\nunit = "mm"', 1, 0.005, np.inf),
        ('distribution = "normal"\nsamples = [1, 2, 3]', 2, 1 / np.sqrt(3), 2),
        ('distribution = "t"\nvalue = 1\nu = 0.5\ndof = 7', 1, 0.5, 7),
        ("samples = [1, 2, 3]", 2, 1 / np.sqrt(3), 2),
        ('distribution = "rectangular"\nlow = -1\nhigh = 3', 1, 2 / np.sqrt(3), np.inf),
        ('distribution = "rectangular"\nvalue = 1\nhalf_width = 2', 1, 2 / np.sqrt(3), np.inf),
        ('distribution = "rectangular"\nvalue = 1\nu = 2', 1, 2, np.inf),
        ('distribution = "rectangular"\nvalue = 0\nhalf_width = 0.05\ndof = 2', 0, 0.05 / np.sqrt(3), 2),
        ('distribution = "rectangular_uncertain"\nlow = -1\nhigh = 1\nhalf_width = 0.1', 0, 1 / np.sqrt(3), 50),
        ('distribution = "rectangular_uncertain"\nlow = -1\nhigh = 1\nlimit = 0.1', 0, 1 / np.sqrt(3), 50),
        ('distribution = "rectangular_uncertain"\nvalue = 0\nhalf_width = 1\nbeta = 0.1', 0, 1 / np.sqrt(3), 50),
        ('distribution = "rectangular_uncertain"\nvalue = 0\nhalf_width = 1\ndof = 50', 0, 1 / np.sqrt(3), 50),
        ('distribution = "trapezoidal"\nlow = 0\nhigh = 6\nbeta = 0.5', 3, 6 * np.sqrt(1.25 / 24), np.inf),
        ('distribution = "trapezoidal"\nvalue = 3\nu = 2\nbeta = 0.5', 3, 2, np.inf),
        ('distribution = "triangular"\nlow = 0\nhigh = 6', 3, 6 / np.sqrt(24), np.inf),
        ('distribution = "arcsine"\nvalue = 0\nhalf_width = 0.5', 0, 0.5 / np.sqrt(2), np.inf),
        ('distribution = "exponential"\nvalue = 0.7', 0.7, 0.7, np.inf),
        ('distribution = "gamma"\nvalue = 4', 5, np.sqrt(5), np.inf),
        ('distribution = "gamma"\nsamples = [2, 3, 4]', 10 / 3, np.sqrt(10) / 3, np.inf),
        ('distribution = "sampled"\nsamples = [1, 2, 3]', 2, 1, np.inf),
        ('distribution = "constant"\nvalue = 3', 3, 0, np.inf),
    ],
)
def test_every_distribution_can_be_written(read: Read, keys: str, value: float, u: float, dof: float) -> None:
    given = read(f'[model]\noutputs = {{ y = "x" }}\n[inputs.x]\n{keys}').model.inputs["x"]
    assert (given.mean, given.u, given.dof) == pytest.approx((value, u, dof))


X = '[model]\noutputs = { y = "x" }\n[inputs.x]\n'
NORMAL = 'distribution = "normal"\nvalue = 1\nu = 0.5'


@pytest.mark.parametrize(
    ("text", "where", "problem"),
    [
        ("[model", "", "is not valid TOML"),
        ("[inputs.x]\n" + NORMAL, "[model]", "is missing"),
        ('[model]\noutputs = { y = "x" }', "[inputs]", "is missing"),
        ('[model]\noutputs = { y = "x" }\n[inputs]', "", "no inputs"),
        ('[model]\noutputs = {}\n[inputs.x]\n' + NORMAL, "[model]", "no outputs"),
        ('[model]\noutputs = { y = "x" }\n[input.x]\n' + NORMAL, "[inputs]", "is missing"),
        ('[model]\noutputs = { y = "z" }\n[inputs.x]\n' + NORMAL, "[model] outputs.y", "no input 'z'"),
        ('[model]\noutputs = { y = 3 }\n[inputs.x]\n' + NORMAL, "[model] outputs.y", "valid string"),
        ('[model]\noutputs = { x = "x" }\n[inputs.x]\n' + NORMAL, "[model] outputs.x", "also an input"),
        ('[model]\noutputs = { y = "x" }\nmethd = "auto"\n[inputs.x]\n' + NORMAL, "[model]", "Did you mean 'method'"),
        ('[model]\noutputs = { y = "x" }\nmethod = "best"\n[inputs.x]\n' + NORMAL, "[model] method", "says 'best'"),
        ('[model]\noutputs = { y = "x" }\ncoverage = 95\n[inputs.x]\n' + NORMAL, "[model] coverage", "less than 1"),
        ('[model]\noutputs = { y = "x" }\ndigits = 1.5\n[inputs.x]\n' + NORMAL, "[model] digits", "valid integer"),
        ('[model]\noutputs = { y = "x" }\nseed = true\n[inputs.x]\n' + NORMAL, "[model] seed", "valid integer"),
        (X + 'value = 1', "[inputs.x]", "'distribution' is missing"),
        (X + 'distribution = "normal"\nvalue = 1', "[inputs.x]", "'u' is missing"),
        (X + NORMAL.replace("0.5", "nan"), "[inputs] x.u", "finite number"),
        (X + NORMAL.replace("0.5", "-0.5"), "[inputs.x]", "u is -0.5"),
        (X + NORMAL.replace("0.5", '"a"'), "[inputs.x] u", "no number"),
        (X + NORMAL + "\nlow = 0", "[inputs.x]", "does not belong"),
        (X + NORMAL + "\nuu = 0", "[inputs] x.uu", "unknown key. Did you mean 'u'"),
        (X + NORMAL + '\nunit = "foo"', "[inputs.x] unit", "no known unit"),
        (X + NORMAL + "\nunit = 3", "[inputs] x.unit", "valid string"),
        (X + NORMAL.replace("normal", "nromal"), "[inputs] x.distribution", "Did you mean 'normal'"),
        ('[model]\noutputs = { y = "x" }\n[inputs."a-b"]\n' + NORMAL, "[inputs.a-b]", "is no name"),
        ('[model]\noutputs = { y = "x" }\n[inputs]\nx = 3', "[inputs] x", "must be a table"),
        (X + 'distribution = "t"\nvalue = 1\nu = 1\ndof = 0.5', "[inputs.x]", "0.5 degrees"),
        (X + 'samples = [1, 2]\nvalue = 3', "[inputs.x]", "contradict"),
        (X + 'samples = [1, 2]\ndof = 3', "[inputs.x]", "number of readings"),
        (X + 'samples = 3', "[inputs] x.samples", "valid list"),
        (X + 'samples = [1, "2"]', "[inputs.x] samples", "'2' is no number"),
        (X + 'distribution = "rectangular"\nlow = 0\nhigh = 1\nvalue = 0.4', "[inputs.x]", "middle"),
        (X + 'distribution = "rectangular"\nlow = 0', "[inputs.x]", "'high' is missing"),
        (X + NORMAL + '\n[correlation]\n"x" = 0.5', "[correlation]", "not a pair"),
        (X + NORMAL + '\n[correlation]\n"x,z" = 0.5', "correlation x,z", "no input 'z'"),
        (BRIDGE + '[correlation]\n"I,V" = 0.5', "[correlation]", "simultaneous readings"),
        (LOSS.replace("= 0.9\n", "= 1.9\n"), "correlation x1,x2", "coefficient of 1.9"),
    ],
)  # fmt: skip
def test_mistakes_name_file_and_key(read: Read, text: str, where: str, problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem) as caught:
        read(text)
    assert caught.value.where is not None
    assert "model.toml" in caught.value.where
    assert where in caught.value.where


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match=r"none\.toml: no such file"):
        read_model_file(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b'title = "\xe4"')
    with pytest.raises(CmmUqError, match="not UTF-8"):
        read_model_file(tmp_path / "latin.toml")


def test_a_model_that_fails_for_some_trials_says_how_many(read: Read) -> None:
    model = read('[model]\noutputs = { y = "log(x)" }\n[inputs.x]\ndistribution = "normal"\nvalue = 1\nu = 0.4')
    with pytest.raises(CmmUqError, match=r"no finite y in \d+ of \d+ trials"):
        model.evaluate()


def test_a_joint_sample_is_drawn_row_by_row(read: Read) -> None:
    draws = ", ".join(str(i) for i in range(40))
    text = (
        '[model]\noutputs = { y = "a - b" }\n[inputs.a]\ndistribution = "sampled"\nsimultaneous = "chain"\n'
        f'samples = [{draws}]\n[inputs.b]\ndistribution = "sampled"\nsimultaneous = "chain"\nsamples = [{draws}]'
    )
    model = read(text).model
    assert model.correlation_matrix[0, 1] == pytest.approx(1.0)
    from cmm_uq.maths.uncertainty.propagation import simulate

    assert simulate(model, 1000).u[0] == 0


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a = " + "[" * 3000, "line 1: is nested too deeply"),
        (LOSS.replace("0.05\n", "9" * 400 + "\n", 1), "has 400 characters"),
        (LOSS.replace("x1**2", "x1**2 + " + "9" * 5000), "a number is too large, or a name too long"),
        (LOSS.replace("x1**2", "x1 * 10**400.0"), "finite|range of numbers"),
        (LOSS.replace("x1**2", "tan(x1 * 1e300)"), "inf cannot be stated"),
        (LOSS + "".join(f'[inputs.z{i}]\nvalue = 1\ndistribution = "constant"\n' for i in range(500)), "502 entries"),
    ],
    ids=["depth", "digits", "expression", "overflow", "tangent", "inputs"],
)
def test_hostile_models_end_in_a_result_or_one_line(read: Read, text: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=says) as caught:
        read(text).evaluate()
    assert len(str(caught.value).splitlines()) == 1


def test_fourth_powers_of_large_inputs_do_not_overflow_the_degrees_of_freedom(read: Read) -> None:
    """The same model in other units has the same degrees of freedom (JCGM 100 G.4.1 is a ratio)."""
    text = '[model]\noutputs = {{ y = "a + b" }}\nmethod = "first"\n' + "".join(
        f'[inputs.{name}]\ndistribution = "t"\nvalue = {{scale}}\nu = {{scale}}\ndof = {dof}\n'
        for name, dof in (("a", 4), ("b", 9))
    )
    plain, large = (read(text.format(scale=scale)).evaluate().stated["y"].dof for scale in ("1.0", "1e69"))
    assert plain == pytest.approx(4 / (1 / 4 + 1 / 9))
    assert large == pytest.approx(plain, rel=1e-12)


UNITS = {"L": "mm", "M": "mm", "d": "nm", "a": "1/K", "t": "degC", "V": "V", "I": "A", "phi": "rad", "n": "1", "q": ""}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("L + M", "mm"),
        ("L - 20", "mm"),
        ("L*(1 + a*(t - 20))", "mm"),
        ("V/I*cos(phi)", "V/A"),
        ("sqrt(L**2 + M**2)", "mm"),
        ("L**2", "mm²"),
        ("atan2(L, M)", "rad"),
        ("abs(-L)", "mm"),
        ("exp(n) * 2", "1"),
        ("2**n", "1"),
        ("L/M", "1"),
        ("3 + 4", "1"),
        ("L + d", None),  # numbers of different units are added: whoever wrote it must say what comes out
        ("exp(L)", None),
        ("L + q", None),
        ("n**L", None),
        ("atan2(L, d)", None),
    ],
)
def test_derived_units(text: str, unit: str | None) -> None:
    assert derived_unit(parse(text, UNITS), UNITS) == unit


@pytest.mark.parametrize(
    ("text", "stated", "wrong"),
    [
        ("L + d", "mm", "adds mm and nm as they stand"),
        ("L - d", "", "adds mm and nm as they stand"),
        ("L + M", "µm", "gives mm, and its unit is stated as µm"),
        ("V/I", "kohm", "gives V/A, and its unit is stated as kohm"),
        ("L/M", "percent", "gives 1, and its unit is stated as percent"),
        ("L*a", "mm", "gives mm/K, and its unit is stated as mm"),
        ("V/I", "ohm", None),
        ("L*a", "mm/delta_degC", None),
        ("t", "degC", None),
        ("atan2(L, M)", "1", None),
        ("sqrt(L**2 + M**2)", "mm", None),
        ("L + 1e-6*d", "mm", None),  # a number may convert
        ("1000*L", "µm", None),
        ("L + q", "mm", None),
        ("L + V", "mm", None),
    ],
)
def test_units_that_contradict_each_other(text: str, stated: str, wrong: str | None) -> None:
    assert contradiction(parse(text, UNITS), UNITS, stated) == wrong


def test_a_sum_of_micrometres_and_millimetres_is_refused(tmp_path: Path) -> None:
    one, other = (f'[inputs.{name}]\ndistribution = "normal"\nvalue = 1\nu = 0.1\nunit = "{unit}"\n' for name, unit in
                  (("x", "µm"), ("z", "mm")))  # fmt: skip
    path = tmp_path / "model.toml"
    path.write_text(f'[model]\noutputs = {{ y = "x + z" }}\nunits = {{ y = "mm" }}\n{one}{other}', encoding="utf-8")
    with pytest.raises(CmmUqError, match="y adds µm and mm as they stand"):
        read_model_file(path)


@pytest.mark.parametrize(
    ("text", "unit", "difference", "number"),
    [
        ("25 nm", "mm", True, 25e-6),
        ("1.5e-3 mm", "µm", True, 1.5),
        ("-0.2", "1", False, -0.2),
        ("0.2 K", "degC", True, 0.2),
        ("0.2 °C", "K", True, 0.2),
        ("293.15 K", "degC", False, 20.0),
        ("5 percent", "1", True, 0.05),
    ],
)
def test_quantities_written_with_a_unit(text: str, unit: str, difference: bool, number: float) -> None:
    assert number_in(text, unit, difference=difference) == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(
    "text", ["mm", "1", "µm/m", "kg/m^3", "kg m**-3", "1/K", "mm²", "V·s", "(m/s)**2", "percent", "%"]
)
def test_units_as_they_are_written(text: str) -> None:
    unit_of(text)


@pytest.mark.parametrize(
    "text",
    [
        "foo", "mm mmm", "10 mm", "__import__('os')", "'", "(" * 50, "m" * 100, "mm\n;x", "mm/0",
        "mm**9**9**9", "9**9**9**9 mm", "mm**(9**9**9)", "mm^999999999", "mm⁹⁹⁹⁹⁹⁹",  # would be computed for hours
    ],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text: str) -> None:
    with pytest.raises(CmmUqError, match="no known unit"):
        unit_of(text, "model.toml")


@pytest.mark.parametrize(("text", "unit"), [("five mm", "mm"), ("25 nm", ""), ("25 kg", "mm"), ("", "mm")])
def test_what_is_no_quantity_is_refused(text: str, unit: str) -> None:
    with pytest.raises(CmmUqError):
        number_in(text, unit, difference=True)
