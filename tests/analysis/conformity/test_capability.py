"""No test value is decided with less than half the laboratory's calibration and measurement capability (k = 2)."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standard import RAISED
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.analysis.conformity.uncertainty import Causes
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, TestUncertainty
from cmm_uq.jobs.tables.identification import Capability, LengthCapability
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity.recorded import bars, gauge, sphere

CMC = Capability(length=LengthCapability(a_um=1.0, k=1000.0))
"""1.02 µm at 20 mm, 1.8 µm at 800 mm: u = 0.51 and 0.9 µm."""


def judged(
    artefact: Artefact, cmc: Capability | None = CMC, standard: str = "ISO 10360-2:2009", **wish: object
) -> Statement:
    facts = ConformityFacts(standard=standard, **({"limit_um": 5.0} | wish))  # type: ignore[arg-type]
    span = {"b89_range_um": Quantity(3.0, 0.5, (2.0, 4.0), "µm")}
    under = Circumstances(TestUncertainty(u_repeat_um=0.01), cmc=cmc)
    return statement(facts, artefact, span, "[[conformity]] 1", (LENGTHS, BARS, FORMS), None, under)


def line(u_um: float | str | None = "L/2000") -> Artefact:
    return gauge([np.eye(3)[0]], [[20.0, 800.0]], errors={(1, 1, 800.0): 4.0}, u_um=u_um)


def test_each_length_has_at_least_the_capability_s_uncertainty_at_its_own_length() -> None:
    """0.01 and 0.4 µm by the certificate alone."""
    found, plain = judged(line()), judged(line(), None)
    assert sorted({round(item.u_um, 9) for item in plain.errors}) == pytest.approx([0.010, 0.4])
    assert sorted({round(item.u_um, 9) for item in found.errors}) == pytest.approx([0.51, 0.9])
    assert RAISED in found.remarks
    assert RAISED not in plain.remarks


def test_it_decides() -> None:
    """4.0 of 5 µm: with u = 0.4 µm up to 4.342 µm is accepted, with 0.9 µm up to 3.520 µm."""
    found = {cmc: next(item for item in judged(line(), cmc).errors if item.error_um > 3.9) for cmc in (CMC, None)}
    assert found[None].decision.outcome == "pass"
    assert found[CMC].decision.outcome == "undecided"


def test_the_budget_has_a_line_for_what_was_raised() -> None:
    """√(0.9² − 0.4²) = 0.806 µm."""
    budget = judged(line()).budget
    assert budget is not None
    assert budget.u * 1e3 == pytest.approx(0.9)
    more = next(one for one in budget.lines if one.name == "raised to the laboratory's capability")
    assert more.contribution * 1e3 == pytest.approx(0.80623, abs=1e-5)


def test_a_larger_uncertainty_stays() -> None:
    found = judged(line(2.0))
    long = next(item for item in found.errors if (item.length_mm or 0) > 700)
    assert long.u_um == pytest.approx(2.0)
    assert judged(line(), Capability(scale_ppm=50.0)).errors == judged(line(), None).errors


def test_without_an_uncertainty_none_is_made_up() -> None:
    assert {item.u_um for item in judged(line(None), rule="simple").errors} == {0.0}


@pytest.mark.parametrize(("made", "standard", "characteristic", "u"), [
    (sphere(), "ISO 10360-5:2020", "P_Form", 0.5125), (sphere(), "ISO 10360-5:2020", "P_Size", 0.5125),
    (bars(lengths=[300.0] * 20), "ASME B89.4.1-1997", "volumetric performance", 0.65),
    (line(), "ISO 10360-2:2009", "R0", 0.51),
])  # fmt: skip
def test_so_have_forms_sizes_and_ranges(made: Artefact, standard: str, characteristic: str, u: float) -> None:
    """1 µm and 25, 300 or 20 mm / 1000, halved."""
    found = judged(made, standard=standard, characteristic=characteristic)
    assert min(item.u_um for item in found.errors) == pytest.approx(u)
    assert RAISED in found.remarks


def test_what_was_raised_is_shared() -> None:
    """Two values of u = 3 µm raised to 5 µm, and one of 6 µm that stays: 4 µm that both have in common."""
    causes = Causes(np.zeros((3, 0)), np.array([3.0, 3.0, 6.0]), np.arange(3)).at_least(np.array([5.0, 5.0, 5.0]))
    assert causes.u == pytest.approx([5.0, 5.0, 6.0])
    assert causes.shared[:, 0] == pytest.approx([4.0, 4.0, 0.0])
