"""The reference cases come out, and the self-test would notice if they did not."""

from __future__ import annotations

import pytest

from cmm_uq.maths.uncertainty.reference.jcgm import ReferenceCase
from cmm_uq.maths.uncertainty.reference.selftest import HEADINGS, REFERENCE_CASES, as_text, run


@pytest.mark.parametrize("case", REFERENCE_CASES, ids=lambda case: case.title)
def test_the_published_figures_come_out(case: ReferenceCase) -> None:
    failed = [outcome for outcome in run([case]) if not outcome.passed]
    assert failed == []


def test_a_wrong_figure_or_none_is_noticed() -> None:
    case = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1), "b": (2.0, 0.1), "c": (2.0, 0.1)}, wrong)
    assert [outcome.passed for outcome in run([case])] == [True, False, False]


def wrong() -> list[float]:
    return [2.05, 2.2, float("nan")]


def test_every_row_has_its_source() -> None:
    case = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1), "b": (-2.0, 1e-12)}, lambda: [2.05, -2.0])
    rows = as_text(run([case]))
    assert rows == [
        ("sum: a", "2", "0.1", "2.05", "arithmetic", "pass"),
        ("sum: b", "−2", "1e−12", "−2", "arithmetic", "pass"),
    ]
    assert all(len(row) == len(HEADINGS) for row in rows)
