"""Figures are printed to the digits that their U asks for, with one U and its k, and what has one side by its interval."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import DecisionBlock, Facts, Table
from cmm_uq.certificate.sections.conformity import conformity_section
from cmm_uq.certificate.wording import expanded, figure_row, with_uncertainty
from cmm_uq.jobs.tables.conformity import ConformityFacts, MaximumPermissibleError
from cmm_uq.machine.model.kind import BARS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity, nominal
from tests.analysis.conformity.recorded import gauge
from tests.artefacts.simulated import blocks

NEAR_ZERO = Quantity(0.041, 0.03, (0.0, 0.108), unit("mm"))
"""A position of 0.041 mm, 0 to 0.108 mm: U = 0.067 mm reaches to −0.026 mm, where no position is."""


def test_what_has_one_side_is_its_interval() -> None:
    assert with_uncertainty(NEAR_ZERO) == "0.000 to 0.108"
    assert figure_row("Position", NEAR_ZERO) == ("Position", "0.000 to 0.108 mm", "95 % interval")
    assert expanded(NEAR_ZERO)[1:] == ("–", "–")


@pytest.mark.parametrize("interval", [(-0.02, 0.108), (0.01, 0.09)])
def test_what_has_two_sides_has_its_u(interval: tuple[float, float]) -> None:
    """An error of either sign; and a size that lies so far from zero that ± U does not reach it."""
    quantity = replace(NEAR_ZERO, value=0.05, interval95=interval)
    assert " ± " in with_uncertainty(quantity)


def test_no_factor_is_no_remark() -> None:
    """Two peaks far apart: U/u = 1.1 says nothing of an interval."""
    assert figure_row("Scale", Quantity(3.0, 10.0, (-8.0, 14.0), unit("ppm")))[2] == ""


@pytest.mark.parametrize(("length", "text"), [
    (1080.0012, "1080.0012"), (404.2357, "404.2357"), (820.0, "820"), (25.0012, "25.0012"), (0.1 + 0.2, "0.3"),
])  # fmt: skip
def test_a_length_that_is_given_is_printed_in_full(length: float, text: str) -> None:
    assert nominal(length) == text


def decided(characteristics: tuple[str, ...] = ("E0",)) -> list[Table | DecisionBlock]:
    artefact = gauge(list(np.eye(3)[:2]), [[20.0, 1080.0012], [20.0, 400.0]], errors={(1, 2, 20.0): 2.4}, u_um=0.2)
    limits: dict[str, Any] = {
        "E0": {"mpe": MaximumPermissibleError(a_um=2.5, k=300.0)},
        "R0": {"limit_um": 9.0, "rule": "simple"},
    }
    found = [
        statement(ConformityFacts(standard="ISO 10360-2:2009", characteristic=name, **limits[name]), artefact, {},
                  "[[conformity]] 1", (BARS, LENGTHS)) for name in characteristics
    ]  # fmt: skip
    return [block for block in conformity_section(found).blocks if isinstance(block, Table | DecisionBlock)]


def test_a_decision_names_its_length_in_full_and_states_u_with_k() -> None:
    table = next(block for block in decided() if isinstance(block, Table))
    assert "1080.0012" in {row[1] for row in table.rows}
    decision = next(block for block in decided() if isinstance(block, DecisionBlock))
    assert " ± " in decision.measured
    assert decision.measured.endswith("µm (k = 2)")


def test_no_two_tables_of_a_certificate_have_one_title() -> None:
    """E0 and R0 of one standard."""
    titles = [block.caption for block in decided(("E0", "R0")) if isinstance(block, Table)]
    assert len(titles) > 1
    assert len(set(titles)) == len(titles)


def test_one_figure_has_one_u() -> None:
    """The range of this recording is decided on; the figure of performance is that of repeats, and is called so."""
    every = blocks("iota-1102-20C")
    (decision,) = [block for block in every if isinstance(block, DecisionBlock)]
    assert decision.measured == "340 ± 14 µm (k = 2)"
    performance = next(b for b in every if isinstance(b, Table) and b.caption == "Figures of performance")
    assert "Range of the lengths, on average over repeats" in {row[0] for row in performance.rows}
    assert any("another quantity" in note for note in performance.notes)


def test_certified_lengths_state_u_and_k() -> None:
    facts = dict(row for block in blocks("iota-1102-20C") if isinstance(block, Facts) for row in block.rows)
    assert facts["Certified length at 20 °C"] == "404.2357 mm, U = 10 µm (k = 2)"
