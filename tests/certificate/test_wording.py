"""Figures as a certificate states them, digit by digit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from cmm_uq.certificate.wording import expanded, measured, probability, title_of
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import Quantity


def test_the_expanded_uncertainty_is_the_larger_half_of_the_interval_with_its_factor() -> None:
    """4.5678 with u = 1.234 and −1.0 to 7.0 µm: U = 5.5678, k = 4.512."""
    assert expanded(Quantity(4.5678, 1.234, (-1.0, 7.0), "µm")) == ("4.6", "5.6", "4.51")
    assert expanded(Quantity(2.5, 0.0, (2.5, 2.5), "µm")) == ("2.5", "0", "–")


@pytest.mark.parametrize(
    ("p", "text"),
    [
        (0.0, "< 0.01 %"),
        (0.99e-4, "< 0.01 %"),
        (1e-4, "0.01 %"),
        (0.012345, "1.2 %"),
        (0.49949, "50 %"),
        (0.5, "50 %"),
        (0.50149, "50.1 %"),
        (0.67055, "67.1 %"),
        (0.99849, "99.8 %"),
        (0.999, "99.9 %"),
        (0.99937, "99.94 %"),
        (0.99989, "99.99 %"),
        (0.9999, "99.99 %"),
        (0.99991, "> 99.99 %"),
        (1.0, "> 99.99 %"),
    ],
)
def test_a_probability_never_claims_certainty(p: float, text: str) -> None:
    assert probability(p) == text.replace("< ", "<\u00a0").replace("> ", ">\u00a0").replace(" %", "\u00a0%")


@pytest.mark.parametrize(
    ("value", "u", "text"),
    [(4.98765, 0.40123, ("4.99", "0.80")), (4.98765, 0.0, ("4.988", "")), (1.5, 2.3, ("1.5", "4.6"))],
)
def test_the_named_error_has_the_digits_that_its_uncertainty_supports(
    value: float, u: float, text: tuple[str, str]
) -> None:
    statement: Any = SimpleNamespace(value_um=value, u_um=u)
    assert measured(statement) == text


def test_a_parameter_is_named_by_its_effect_and_where_there_are_several_by_itself() -> None:
    effects: Any = [
        SimpleNamespace(name="scale_x", title="Scale of X", reported=["ppm"]),
        SimpleNamespace(name="bow_x", title="Bow of X", reported=["um", "place"]),
    ]
    sizes = [SimpleNamespace(name="length_mm", title="Length of the bar"), SimpleNamespace(name="u", title="Other")]
    result: Any = SimpleNamespace(model=SimpleNamespace(effects=effects), artefact=SimpleNamespace(sizes=sizes))
    assert title_of(("scale_x", "ppm"), result) == "Scale of X"
    assert title_of(("bow_x", "place"), result) == "Bow of X, place"
    assert title_of((ARTEFACT, "u"), result) == "Other"
    assert title_of((ARTEFACT, "length_mm"), result) == "Length of the bar"
