"""``[test_uncertainty]``, ``[rated_conditions]`` and ``[probe]``: the circumstances of a standard's test.

A standard's clauses as a laboratory holds them against its own copy are among them: a form that it fills in, beside job.toml.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, Field

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Temperature, Uncertainty, key, required
from cmm_uq.jobs.tables.identification import Capability, RequiredText

if TYPE_CHECKING:
    from cmm_uq.jobs.recording.short_gauge import ShortGauge


class HeldClause(JobTable):
    """One clause: what the program does of it, and whether that agrees with the laboratory's copy."""

    does: str
    """What the program does, as it wrote the form; a clause of which it does something else by now is not checked."""
    source: str = key("", "Where that comes from.")
    agrees: bool | None = key(None, "Whether it agrees with the copy; left out, nobody has looked.")
    differs: str = key("", "How it differs.")
    stricter: bool = False
    """Whether the program asks for more than the copy where it differs, so that a pass stays one."""
    clause: str = key("", "Number of the clause in the copy.")
    checked_by: RequiredText | None = key(None, "Who held this clause against the copy, where another than the form's.")
    on: dt.date | None = key(None, "When, where another day than the form's.")
    edition: RequiredText | None = key(None, "Of which edition, where another than the form's.")

    def problems(self) -> Iterator[str]:
        if (self.agrees is False) != bool(self.differs.strip()):
            yield "give agrees = true, or agrees = false with differs = how it does"
        if self.stricter and self.agrees is not False:
            yield "stricter belongs to agrees = false"


class ClausesForm(JobTable):
    """The form of a standard, filled in: ``cmm-uq standards NAME --form FILE`` writes it."""

    standard: str = required("The standard, by its name in `[[conformity]]`.")
    checked_by: RequiredText = required("Who held the clauses against the laboratory's copy.")
    on: dt.date = required("When.")
    edition: RequiredText = required("Edition of the copy, as its title page has it.")
    clauses: Annotated[dict[str, HeldClause], Field(max_length=LISTED.most)]
    """Each clause, by the name that the form has for it."""


def _says_something(text: str) -> str:
    if not text.strip():
        raise ValueError("must not be empty: the certificate prints it")
    return text


Words = Annotated[str, AfterValidator(_says_something)]


class Declared(JobTable):
    """What somebody answers for in place of a figure; the certificate prints both."""

    by: Words = required("Who declares it.")
    reason: Words = required("Why.")


class MachineLines(JobTable):
    """``[test_uncertainty.machine]``: lines of the test uncertainty that are the machine's own, and so what is tested."""

    expansion: Declared | None = None
    """The machine measures and corrects the artefact's expansion, its coefficient included."""
    temperature: Declared | None = key(None, "The machine measures and corrects the artefact's temperature.")
    alignment: Declared | None = key(None, "The machine aligns the artefact.")
    fixturing: Declared | None = key(None, "The artefact's mounting belongs to the machine.")
    repeat: Declared | None = key(None, "What changes between repeated readings is the machine's.")


class NegligibleLines(JobTable):
    """``[test_uncertainty.negligible]``: lines of the test uncertainty that contribute nothing worth counting."""

    calibration: Declared | None = key(None, "Calibration of the artefact.")
    expansion: Declared | None = key(None, "The artefact's coefficient of expansion.")
    temperature: Declared | None = key(None, "The artefact's temperature.")
    alignment: Declared | None = key(None, "Alignment of the artefact.")
    fixturing: Declared | None = key(None, "Fixturing of the artefact.")
    form: Declared | None = key(None, "Calibration of the form deviation of a test sphere.")
    repeat: Declared | None = key(None, "What of the artefact changes between repeated readings.")


class TestUncertainty(JobTable):
    """``[test_uncertainty]``: what a test value is uncertain by beside the calibration of the artefact (ISO/TS 23165)."""

    __test__ = False  # no test of pytest's

    u_cte_per_k: Annotated[float, Field(ge=0, le=1e-3)] = 0.0
    """Standard uncertainty of the artefact's coefficient of expansion, 1/K."""
    u_temperature_k: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Standard uncertainty of the artefact's temperature."""
    u_alignment_um: Uncertainty = key(0.0, "Standard uncertainty of a length by misalignment of the artefact.")
    u_fixturing_um: Uncertainty = key(0.0, "Standard uncertainty of a length by what the clamping does to it.")
    u_form_um: Uncertainty = key(0.0, "Standard uncertainty of the calibrated form deviation of a test sphere.")
    u_repeat_um: Uncertainty = 0.0
    """Standard uncertainty of a range or difference of repeated readings, by what of the artefact changed between
    them."""
    negligible: NegligibleLines = key(NegligibleLines(), "Lines that are declared negligible, by whom and why.")
    machine: MachineLines = key(MachineLines(), "Lines that are declared the machine's own, by whom and why.")

    def problems(self) -> Iterator[str]:
        for line, stated in LINE_KEYS.items():
            declared = sum(bool(getattr(table, line, None)) for table in (self.negligible, self.machine))
            if declared > 1 or (declared and getattr(self, stated)):
                yield f"{line} is stated more than once: give {stated}, or declare it in one table"

    def declared(self, line: str) -> Declared | None:
        """By whom and why a line is declared negligible or the machine's own."""
        declaration: Declared | None = getattr(self.negligible, line, None) or getattr(self.machine, line, None)
        return declaration

    @property
    def of_artefact(self) -> bool:
        """Whether anything is stated of the artefact's temperature, expansion, alignment or fixturing."""
        return any((self.u_cte_per_k, self.u_temperature_k, self.u_alignment_um, self.u_fixturing_um))


# key of each line of the test uncertainty but the calibration, which ``[artefact]`` states
LINE_KEYS = {
    "expansion": "u_cte_per_k", "temperature": "u_temperature_k", "alignment": "u_alignment_um",
    "fixturing": "u_fixturing_um", "form": "u_form_um", "repeat": "u_repeat_um",
}  # fmt: skip
TEST_KEYS = tuple(LINE_KEYS.values())
Limits = Annotated[list[Temperature], Field(min_length=2, max_length=2)]
Kelvins = Annotated[float, Field(gt=0, le=1000)]


class RatedConditions(JobTable):
    """``[rated_conditions]``: under which the limits of the machine hold, by its data sheet."""

    temperature_c: Limits | None = key(None, "Lowest and highest temperature.")
    change_k_per_h: Kelvins | None = key(None, "Largest change of temperature in an hour.")
    difference_k: Kelvins | None = key(None, "Largest difference of temperature between places at one time.")
    probe: str | None = key(None, "Probe for which the limits hold, as `[probe]` names it.")
    stylus: str | None = key(None, "Stylus for which the limits hold, as `[probe]` names it.")
    declared: Declared | None = None
    """By whom and why the test counts as one under rated conditions, where no rated temperature is stated."""

    def problems(self) -> Iterator[str]:
        if self.temperature_c is not None and not self.temperature_c[0] < self.temperature_c[1]:
            yield f"temperature_c = {self.temperature_c}: the first number must be the lower one"


class ProbeFacts(JobTable):
    """``[probe]``: with what the recording was made; ``sensing`` says whether it touches."""

    sensing: Literal["contacting", "optical"] | None = None
    """Whether the probe touches; standards are for one or the other."""
    name: str = key("", "Name of the probe.")
    stylus: str = key("", "Name of the stylus.")


@dataclass(frozen=True)
class Circumstances:
    """What a test must know of the job beside its recording; ``cte_per_k``: of the artefact, 1/K, where it is stated.

    ``clauses``: forms of standards' clauses, by their file; ``set_aside``: reason by measurement that estimates leave out.
    """

    uncertainty: TestUncertainty = field(default_factory=TestUncertainty)
    rated: RatedConditions = field(default_factory=RatedConditions)
    probe: ProbeFacts = field(default_factory=ProbeFacts)
    cte_per_k: float | None = None
    short_gauge: ShortGauge | None = None
    cmc: Capability | None = None
    clauses: Mapping[str, ClausesForm] = field(default_factory=dict)
    set_aside: Mapping[int, str] = field(default_factory=dict)
    calibration_dof: float = inf
