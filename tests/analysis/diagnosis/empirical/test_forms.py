"""Each form is what its formula says, and finds itself."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.empirical.functions import ClosedForm, forms_of

RANDOM = np.random.default_rng(20261129)
COVARIATE = np.sort(RANDOM.uniform(-40.0, 860.0, 60))
NAMES = {name: getattr(np, name) for name in ("exp", "sign", "tanh", "cos", "sin", "tan", "abs", "pi")}
NAMES |= {"atan": np.arctan, "max": np.maximum}


def every() -> list[ClosedForm]:
    return [*forms_of(COVARIATE), *(form for form in forms_of(COVARIATE, time=True) if form.name == "exponential")]


@pytest.mark.parametrize("form", every(), ids=lambda form: form.name)
def test_values_are_those_of_the_formula(form: ClosedForm) -> None:
    """Evaluated as text, by NumPy alone."""
    values = form.values(COVARIATE, form.shapes)
    assert values.shape[:2] == (60, len(form.shapes))
    for k in RANDOM.integers(0, len(form.shapes), 5):
        shape = dict(zip(form.parameters, form.shapes[k], strict=True))
        for column, part in enumerate(form.formula.split(";")):
            told = eval(part, {**NAMES, **shape, "c": COVARIATE})
            assert values[:, k, column] == pytest.approx(told, abs=1e-9)


@pytest.mark.parametrize("form", every(), ids=lambda form: form.name)
def test_sizes_are_about_one(form: ClosedForm) -> None:
    """So that a prior of its size means the same for all of them."""
    values = form.values(COVARIATE, form.shapes)
    assert 0.3 < np.ptp(values, axis=0).max() <= 2.0 + 1e-9


def test_nodes_lie_as_far_apart_as_said() -> None:
    for form in forms_of(COVARIATE):
        for k, _ in enumerate(form.parameters):
            nodes, index = np.unique(form.shapes[:, k], return_index=True)
            if len(nodes) > 2 and form.name not in ("step", "sawtooth"):
                assert form.apart[index, k] == pytest.approx(np.abs(np.gradient(nodes)), rel=1e-9)


def test_a_sawtooth_has_two_periods_and_a_sine_one() -> None:
    """Less of them is a step, or a curve."""
    periods = {form.name: form.shapes[:, 0].max() for form in forms_of(COVARIATE) if form.name in ("sine", "sawtooth")}
    span = np.ptp(COVARIATE)
    assert periods["sine"] == pytest.approx(span)
    assert periods["sawtooth"] == pytest.approx(span / 2)


def test_what_settles_is_called_after_what_it_is_of() -> None:
    names, timed = ({form.name for form in forms_of(COVARIATE, time=time)} for time in (False, True))
    assert "exponential" in timed - names
    assert not any(re.search(r"[A-Z ]", name) for name in names | timed)


@pytest.mark.parametrize("count", range(3, 30))
def test_however_few_values_a_covariate_has_its_forms_are_there(count: int) -> None:
    """With nine values a saw had one period, which is next to no other."""
    for form in forms_of(np.arange(float(count))):
        assert len(form.shapes) >= 1


def test_places_read_again_with_noise_show_no_shorter_period() -> None:
    """Seven places 5 mm apart, each ten times to a micrometre: two places a period."""
    read = np.repeat(5.0 * np.arange(7), 10) + 1e-3 * np.random.default_rng(1).standard_normal(70)
    periods = [form.shapes[:, 0] for form in forms_of(read) if form.name in ("sine", "sawtooth")]
    assert min(float(each.min()) for each in periods) > 2 * 30.0 / 7
