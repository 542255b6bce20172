"""Decisions whose right answer was worked by hand, each through reading, screening and deciding as ``report`` does it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from cmm_uq.base.errors import CmmUqError
from tests.analysis.conformity.by_hand.deciding import decided, reported
from tests.analysis.conformity.by_hand.tables import Case, cases

CASES = cases()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_decision(case: Case) -> None:
    if case.right.outcome == "refused":
        with pytest.raises(CmmUqError) as refusal:
            decided(case.files())
        assert all(word in str(refusal.value) for word in case.right.lacks), case.why
        return
    found = decided(case.files())
    missing = [str(text) for text in found.missing]
    assert (found.outcome, bool(missing)) == (case.right.outcome, bool(case.right.lacks)), (missing, case.why)
    for word in case.right.lacks:
        assert any(word in text for text in missing), (word, missing)
    if case.figures:
        assert (found.value_um, found.u_um, found.limit_um) == pytest.approx(case.figures, abs=2e-4), case.why


QUICK = ("step gauge, diagonals of Y-Z", "step gauge, space diagonals", "step gauge, face diagonals")


def whole(case: Case) -> bool:
    """Cases whose machine is estimated in a second or two, among them some rules on all seven lines."""
    if case.right.outcome == "refused":
        return False
    some = case.name.startswith("Rules ") and CASES.index(case) % 5 == 0
    return case.base[0] in QUICK or ("scatter" in case.recording and "blocks" not in case.base[0]) or some


@pytest.mark.usefixtures("no_diagnosis")
@pytest.mark.long(but="E150")
@pytest.mark.parametrize("case", [*filter(whole, CASES)], ids=lambda case: case.name)
def test_the_whole_analysis_states_the_same(case: Case) -> None:
    found, alone = reported(case.files()), decided(case.files())
    assert found.outcome == case.right.outcome, case.why
    assert (found.errors, found.missing) == (alone.errors, alone.missing)


def test_lengths_of_another_test_are_counted_beside_those_decided() -> None:
    """Of seven lines U1 decides three, 5 lengths thrice; the 60 lengths of the space diagonals are none of it."""
    case = next(case for case in CASES if case.base[0] == "step gauge, seven lines")
    job = 'conformity.standard = "VDI/VDE 2617-2.1"; conformity.characteristic = "U1"'
    found = decided(replace(case, recording="", job=job).files())
    assert (found.outcome, len(found.errors)) == ("pass", 45)
    assert any(str(text).startswith("60 lengths recorded beside them") for text in found.remarks)


def test_thirty_are_taken_through_the_whole_analysis() -> None:
    assert sum(map(whole, CASES)) >= 30


def test_at_least_sixty_pass_and_sixty_fail() -> None:
    counts = Counter(case.right.outcome for case in CASES)
    assert len(CASES) >= 200
    assert counts["pass"] >= 60
    assert counts["fail"] >= 60
