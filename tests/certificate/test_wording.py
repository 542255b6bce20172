"""How figures, noise and stated uncertainties are said and printed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.certificate.clauses import stated_uncertainty
from cmm_uq.certificate.document import DecisionBlock, Facts, Table
from cmm_uq.certificate.result import NoiseComponent, RecordingNoise
from cmm_uq.certificate.sections.conformity import conformity_section
from cmm_uq.certificate.sections.method import noise_found
from cmm_uq.certificate.wording import expanded, figure_row, measured, probability, title_of, with_uncertainty
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.machine.model.kind import BARS, LENGTHS
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import Quantity, nominal
from tests.analysis.conformity.recorded import gauge
from tests.artefacts.simulated import blocks


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
    def named(name: str) -> Any:
        return SimpleNamespace(name=name, what="")

    effects: Any = [
        SimpleNamespace(name="scale_x", title="Scale of X", reported=[named("ppm")], coefficients=()),
        SimpleNamespace(name="bow_x", title="Bow of X", reported=[named("um"), named("place")], coefficients=()),
    ]
    sizes = [SimpleNamespace(name="length_mm", title="Length of the bar"), SimpleNamespace(name="u", title="Other")]
    result: Any = SimpleNamespace(model=SimpleNamespace(effects=effects), artefact=SimpleNamespace(sizes=sizes))
    assert title_of(("scale_x", "ppm"), result) == "Scale of X"
    assert title_of(("bow_x", "place"), result) == "Bow of X, place"
    assert title_of((ARTEFACT, "u"), result) == "Other"
    assert title_of((ARTEFACT, "length_mm"), result) == "Length of the bar"


def size(value: float, probability: float = 1.0) -> NoiseComponent:
    return NoiseComponent(Quantity(value, 0.1, (value - 0.2, value + 0.2), unit("µm")), probability)


def noise(components: dict[str, NoiseComponent], *, apart: float = 0.2, wider: float = 1.0) -> RecordingNoise:
    return RecordingNoise(size(1.2).size, components, apart, wider, None, None)


def test_white_noise_is_said_to_be_nothing_else_and_what_could_not_show_is_named() -> None:
    assert noise_found(noise({}), heavy_tails=False) == (
        "independent readings, nothing else; not to be seen in this recording: "
        "set-up offsets (no repeats) and slow noise (no times)"
    )


def test_what_is_probably_there_is_named_with_its_size_and_what_it_does_to_the_uncertainties() -> None:
    components = {"placing": size(2.3, 0.97), "slow": size(0.4, 0.3), "x": size(1), "y": size(1), "z": size(3)}
    said = noise_found(noise(components, apart=0.99, wider=1.84), heavy_tails=False)
    assert "differs by axis (X 1, Y 1, Z 3 µm)" in said
    assert "an offset of 2.3 µm of each set-up, shared by its repeats (probability 0.97)" in said
    assert "slow noise" not in said
    assert "up to 1.84 times" in said


def test_with_times_too_it_says_which_drift_it_cannot_have_seen() -> None:
    """Under a walk that has gone most of its way at the beginning intervals hold too seldom: docs/coverage-study.md."""
    said = noise_found(noise({"placing": size(0.1, 0.1), "slow": size(0.1, 0.1)}), heavy_tails=False)
    assert said == (
        "independent readings, nothing else; not to be seen in this recording: what had drifted before the first reading"
    )


def test_the_steps_of_a_display_are_named() -> None:
    assert "and the steps of the display, 5 µm" in noise_found(replace(noise({}), display_um=5.0), heavy_tails=False)


def test_heavy_tails_are_named_as_what_the_estimate_does_not_reckon_with() -> None:
    said = noise_found(noise({"growth": size(0.9, 0.9)}), heavy_tails=True)
    assert said.startswith(
        "independent readings, and scatter that grows with length to 0.9 µm (probability 0.90) and heavier tails than those "
        "of the normal distribution that the estimate assumes; not to be seen"
    )


def recorded(**columns: Any) -> Points:
    one = np.ones(3, dtype=np.int64)
    return Points(np.zeros((3, 3)), one, np.arange(1, 4), one, Machine(), columns)


@pytest.mark.parametrize(
    ("stated", "printed"),
    [
        ({"U_um": "0.2 + 0.5·L/1000", "k": 2.0}, "U = 0.2 µm + 0.5·10⁻⁶·L, k = 2"),
        ({"U_um": "0,2 + L/2000", "k": 2.0}, "U = 0.2 µm + 0.5·10⁻⁶·L, k = 2"),
        ({"U_um": "Q[0.2; 0.5·L/1000]", "k": 2.0}, "U = Q[0.2 µm; 0.5·10⁻⁶·L], k = 2"),
        ({"U_um": "L/2000", "k": 2.05}, "U = 0.5·10⁻⁶·L, k = 2.05, taken as Student's t for 95 %"),
        ({"U_um": 0.4, "k": 2.25, "degrees_of_freedom": 10.0}, "U = 0.4 µm, k = 2.25, 10 degrees of freedom"),
        ({"U_um": 0.4, "degrees_of_freedom": 10.0}, "U = 0.4 µm, k = 2.23, 10 degrees of freedom"),
        ({"u_um": "0.1 + L/4000"}, "u = 0.1 µm + 0.25·10⁻⁶·L"),
        ({"u_um": 0.2}, ""),
        ({}, ""),
    ],
)
def test_as_it_was_issued(stated: dict[str, Any], printed: str) -> None:
    assert stated_uncertainty(artefact_facts(kind="step_gauge", **stated), recorded()) == printed


def test_of_each_point_its_range() -> None:
    facts = artefact_facts(kind="step_gauge")
    points = recorded(reference_u_um=np.array([0.0, 0.12, 0.3456]))
    assert stated_uncertainty(facts, points) == "of each point by itself, u from 0 to 0.346 µm"


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
