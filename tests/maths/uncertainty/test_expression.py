"""Expressions: arithmetic is understood as Python understands it, and nothing else is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.measurement_model import derivatives
from cmm_uq.maths.uncertainty.models.expression import LONGEST, name_problem, parse


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("x + 2*y", 8.0),
        ("-x**2", -4.0),
        ("2**-x", 0.25),
        ("x - y - 1", -2.0),
        ("x / y / 2", 1 / 3),
        ("2**3**x", 512.0),
        ("+x * -(y - 1e1)", 14.0),
        ("sqrt(x*8) + exp(0) + log(exp(y)) + log10(100)", 4 + 1 + 3 + 2),
        ("sin(pi/2) + cos(0) + tan(0) + asin(1)/pi + acos(1) + atan(1)/pi + atan2(x, x)/pi", 3.0),
        ("abs(x - y)", 1.0),
        (" x\t", 2.0),
    ],
)
def test_arithmetic(text: str, value: float) -> None:
    assert parse(text, ["x", "y"])({"x": 2.0, "y": 3.0}) == pytest.approx(value, rel=1e-15)


def test_arrays_complex_numbers_and_jets_pass_through() -> None:
    expression = parse("sqrt(x)*exp(-y) + atan2(x, y)", {"x", "y"})
    x = np.array([1.0, 4.0])
    assert expression({"x": x, "y": 2.0}) == pytest.approx(np.sqrt(x) * math.exp(-2) + np.arctan2(x, 2.0))
    found = derivatives(lambda x, y: [expression({"x": x, "y": y})], [4.0, 2.0])
    assert found.jacobian[0] == pytest.approx([math.exp(-2) / 4 + 2 / 20, -2 * math.exp(-2) - 4 / 20])
    assert parse("x**2", {"x"})({"x": 1j}) == -1


def test_long_sums_and_towers_of_powers_end_in_a_number() -> None:
    assert parse("+".join(["x"] * 2000), {"x"})({"x": 1.0}) == 2000.0
    with np.errstate(over="ignore"):
        assert parse("9**9**9**9", [])({}) == np.inf


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("x3 + y", "no input 'x3'"),
        ("lenght", "Did you mean 'length'"),
        ("__import__('os').system('true')", "no function"),
        ("x.__class__", "is not arithmetic"),
        ("(lambda: 1)()", "no function"),
        ("[x for x in (1,)]", "is not arithmetic"),
        ("x if y else 1", "is not arithmetic"),
        ("x < y", "is not arithmetic"),
        ("x := 3", "no arithmetic expression"),
        ("x = 3", "no arithmetic expression"),
        ("x ^ 2", r"A power is written \*\*"),
        ("x // 2", "FloorDiv"),
        ("x @ y", "MatMult"),
        ("not x", "Not"),
        ("2x", "no arithmetic expression"),
        ("", "no arithmetic expression"),
        ("'x'", "no real number"),
        ("1j", "no real number"),
        ("True", "no real number"),
        ("sqrt", "needs brackets"),
        ("sqrt(x, y)", "takes 1 argument"),
        ("atan2(x)", "takes 2 arguments"),
        ("sqrt(x=2)", "takes 1 argument"),
        ("sqrt(*x)", "takes 1 argument"),
        ("cosh(x)", "Did you mean 'cos'"),
        ("x\x00", "no arithmetic expression"),
        ("1" + "0" * 400, "too large"),
        ("1" * 5000, "no arithmetic expression"),
        ("(" * 5000, "no arithmetic expression"),
        ("-" * 3000 + "x", "nested too deeply"),
        ("x" + ".a" * 3000, "is not arithmetic|nested too deeply"),
        ("**".join(["x"] * 400), "nested too deeply"),
        ("x" * (LONGEST + 1), "characters"),
    ],
)
def test_whatever_is_not_arithmetic_is_refused(text: str, problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem) as caught:
        parse(text, ["x", "y", "length"], "model.toml [model] outputs.y")
    assert caught.value.where == "model.toml [model] outputs.y"
    assert len(str(caught.value)) < 400


@given(st.text(max_size=60))
def test_any_text_is_an_expression_or_a_clear_error(text: str) -> None:
    try:
        expression = parse(text, ["x"])
    except CmmUqError:
        return
    with np.errstate(all="ignore"):
        expression({"x": 2.0})


@given(
    st.recursive(
        st.sampled_from(["x", "y", "two", "pi"]),
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
            inner.map(lambda t: f"-{t}"),
            inner.map(lambda t: f"atan({t})"),
        ),
        max_leaves=12,
    )
)
def test_values_agree_with_the_interpreter_s_own(text: str) -> None:
    values = {"x": np.float64(0.7), "y": np.float64(-1.3), "two": np.float64(2.0)}
    with np.errstate(all="ignore"):
        expected = eval(text, {"__builtins__": {}}, {**values, "pi": np.float64(np.pi), "atan": np.arctan})
        got = parse(text, values)(values)
    np.testing.assert_equal(np.float64(got), np.float64(expected))


@pytest.mark.parametrize(("name", "good"), [("x1", True), ("δα", True), ("1x", False), ("a-b", False), ("sin", False)])
def test_names(name: str, good: bool) -> None:
    assert (name_problem(name) is None) == good
