"""What the standards compare."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.conformity.standards import Statement, statement
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts, ConformityFacts, MaximumPermissibleError, Standard
from cmm_uq.kinds.ballbar.kind import KIND
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.points import Machine, Points
from cmm_uq.uncertainty.quantity import Quantity
from tests.recordings import bar_facts


def bar_of(lengths: list[float], facts: ArtefactFacts) -> Ballbar:
    n = len(lengths)
    xyz = np.zeros((2 * n, 3))
    xyz[1::2, 0] = lengths
    xyz[:, 1] = np.repeat(np.arange(n), 2) * 10.0
    number = np.repeat(np.arange(n), 2)
    return Ballbar(facts, Points(xyz, number, np.tile([1, 2], n), np.ones_like(number), Machine()))


def judged(standard: Standard, facts: ArtefactFacts | None = None, **limit: object) -> Statement:
    bar = bar_of([400.001, 399.997, 400.002], facts or bar_facts(400.0, 0.4))
    span = Quantity(5.0, 0.5, (4.0, 6.0), "µm")
    wish = ConformityFacts(standard=standard, **limit)
    return statement(wish, bar, {"b89_range_um": span}, "[[conformity]] 1", KIND.standards)


def test_b89_compares_the_range_of_the_lengths() -> None:
    found = judged("ASME B89.4.1-1997", limit_um=6.0)
    assert (found.value_um, found.u_um, found.decision.outcome) == (5.0, 0.5, "pass")
    assert "at least 20 positions; 3 lengths" in found.remarks[0]


def test_iso_10360_2_compares_the_largest_error_with_a_plus_l_over_k() -> None:
    found = judged("ISO 10360-2:2009", mpe=MaximumPermissibleError(a_um=2.0, k=250.0))
    assert found.value_um == pytest.approx(3.0, abs=1e-6)
    assert found.limit_um == pytest.approx(2.0 + 400 / 250)
    assert found.u_um == pytest.approx(0.4)
    assert found.decision.outcome == "undecided"
    assert any("105" in remark for remark in found.remarks)


def test_iso_10360_2_needs_a_calibrated_length() -> None:
    with pytest.raises(CmmUqError, match=r"\[\[conformity\]\] 1.*calibrated lengths.*length_mm"):
        judged("ISO 10360-2:2009", bar_facts(None), limit_um=3.0)


def test_a_probing_standard_is_not_decided_on_a_bar() -> None:
    with pytest.raises(CmmUqError, match="ISO 10360-5:2010 is not decided on a ballbar"):
        judged("ISO 10360-5:2010", limit_um=3.0)
