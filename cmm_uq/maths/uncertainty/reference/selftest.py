"""Runs the reference cases: evidence that the software computes what its documents say (ISO/IEC 17025:2017 7.11.2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from cmm_uq.maths.uncertainty.quantity import MINUS
from cmm_uq.maths.uncertainty.reference import jcgm_100, jcgm_101, measurements
from cmm_uq.maths.uncertainty.reference.case import ReferenceCase

REFERENCE_CASES = (*jcgm_100.CASES, *jcgm_101.CASES, *measurements.CASES)
HEADINGS = ("Case", "Expected", "Tolerance", "Got", "Source", "Result")
_ROUNDING = 1e-12


@dataclass(frozen=True)
class SelfTestResult:
    case: str  # title and figure
    expected: float
    tolerance: float
    got: float
    source: str

    @property
    def passed(self) -> bool:
        """Whether the figure is near enough; not one that is no number."""
        return abs(self.got - self.expected) <= self.tolerance + _ROUNDING * abs(self.expected)


def run(cases: Iterable[ReferenceCase] = REFERENCE_CASES) -> list[SelfTestResult]:
    """Compute every figure of the reference cases and compare it."""
    return [
        SelfTestResult(f"{case.title}: {name}", expected, tolerance, float(got), case.source)
        for case in cases
        for (name, (expected, tolerance)), got in zip(case.expected.items(), case.compute(), strict=True)
    ]


def as_text(outcomes: Sequence[SelfTestResult]) -> list[tuple[str, ...]]:
    """Rows of text under :data:`HEADINGS`; what came out has two digits more than the tolerance."""
    rows = []
    for outcome in outcomes:
        decimals = 1 - int(f"{outcome.tolerance:.0e}".split("e")[1])
        digits = ".10g" if outcome.tolerance < 1e-9 else f".{max(0, decimals)}f" if decimals < 9 else ".6g"
        numbers = f"{outcome.expected:.10g}", f"{outcome.tolerance:.2g}", f"{outcome.got:{digits}}"
        written = (number.replace("-", MINUS) for number in numbers)
        rows.append((outcome.case, *written, outcome.source, "pass" if outcome.passed else "FAIL"))
    return rows
