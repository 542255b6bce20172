"""Runs the reference cases: evidence that the software computes what its documents say (ISO/IEC 17025:2017 7.11.2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from cmm_uq.maths.uncertainty.quantity import MINUS
from cmm_uq.maths.uncertainty.reference import coordinate_metrology, jcgm_100, jcgm_101, jcgm_102, refractive_index
from cmm_uq.maths.uncertainty.reference.case import ReferenceCase

REFERENCE_CASES: Sequence[ReferenceCase] = (
    *jcgm_100.CASES,
    *jcgm_101.CASES,
    *jcgm_102.CASES,
    *refractive_index.CASES,
    *coordinate_metrology.CASES,
)

_ROUNDING = 1e-12


@dataclass(frozen=True)
class SelfTestResult:
    """One figure of a reference case."""

    case: str  # title and figure
    # expected, tolerance: what must come out, and how near
    expected: float
    tolerance: float
    got: float  # what came out
    source: str  # where the expected figure is from
    passed: bool  # whether it is near enough


def run(cases: Iterable[ReferenceCase] = REFERENCE_CASES) -> list[SelfTestResult]:
    """Compute every figure of the reference cases and compare it."""
    return [outcome for case in cases for outcome in _outcomes(case)]


def _outcomes(case: ReferenceCase) -> list[SelfTestResult]:
    figures = case.compute()
    found = []
    for name, (expected, tolerance) in case.expected.items():
        got = figures[name]
        allowed = tolerance + _ROUNDING * abs(expected)
        passed = abs(got - expected) <= allowed  # false for a figure that is not a number
        found.append(SelfTestResult(f"{case.title}: {name}", expected, tolerance, got, case.source, passed))
    return found


HEADINGS = ("Case", "Expected", "Tolerance", "Got", "Source", "Result")


def as_text(outcomes: Sequence[SelfTestResult]) -> list[tuple[str, ...]]:
    """Rows of text under :data:`HEADINGS`; what came out has two digits more than the tolerance."""
    return [
        (
            outcome.case,
            _plain(f"{outcome.expected:.10g}"),
            _plain(f"{outcome.tolerance:.2g}"),
            _plain(f"{outcome.got:.10g}" if outcome.tolerance < 1e-9 else _beyond(outcome.got, outcome.tolerance)),
            outcome.source,
            "pass" if outcome.passed else "FAIL",
        )
        for outcome in outcomes
    ]


def _beyond(number: float, tolerance: float) -> str:
    decimals = 1 - int(f"{tolerance:.0e}".split("e")[1])
    return f"{number:.{max(0, decimals)}f}" if decimals < 9 else f"{number:.6g}"


def _plain(text: str) -> str:
    return text.replace("-", MINUS)
