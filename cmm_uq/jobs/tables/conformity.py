"""``[[conformity]]``: a standard, a limit, the rule by which it is decided, and the circumstances of the test.

These are ``[test_uncertainty]``, ``[rated_conditions]`` and ``[probe]``, and a standard's clauses as a laboratory holds them
against its own copy: a form that it fills in, beside job.toml.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from cmm_uq.base.files import table as forms
from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import LARGEST_UM, JobTable, Limit, Positive, Uncertainty, at_least, key, required
from cmm_uq.base.messages import Text
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.tables.adoptions import nearest
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.identification import Capability, RequiredText
from cmm_uq.jobs.tables.length_formula import FLATTEST, Permissible
from cmm_uq.jobs.tables.machine import ProbeFacts
from cmm_uq.jobs.tables.plan import CompleteTest

if TYPE_CHECKING:
    from cmm_uq.jobs.recording.beside import ShortGauge


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
    orientation: Declared | None = key(None, "Measured angles of orientation.")
    turning: Declared | None = key(None, "What of measured angles of orientation changes between readings.")


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
    """Standard uncertainty of a range or difference of repeated readings, by what of the artefact changed between."""
    u_alignment_arcsec: Uncertainty = 0.0
    """Of angles of a rotary axis: standard uncertainty at each target by how polygon and autocollimator are aligned."""
    u_orientation_arcsec: Uncertainty = 0.0
    """Standard uncertainty of an angle of orientation by the reference instrument, alignment to the base included."""
    u_repeat_arcsec: Uncertainty = key(
        0.0, "Of angles of a rotary axis, or of orientation: what changes between readings."
    )
    negligible: NegligibleLines = NegligibleLines.left_out("Lines that are declared negligible, by whom and why.")
    machine: MachineLines = MachineLines.left_out("Lines that are declared the machine's own, by whom and why.")

    def problems(self) -> Iterator[str]:
        for line, stated in (*LINE_KEYS.items(), *ANGULAR_KEYS.items()):
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
ANGULAR_KEYS = {"alignment": "u_alignment_arcsec", "repeat": "u_repeat_arcsec"}  # of angles, in place of the others
LINE_KEYS = {
    "expansion": "u_cte_per_k", "temperature": "u_temperature_k", "alignment": "u_alignment_um",
    "fixturing": "u_fixturing_um", "form": "u_form_um", "repeat": "u_repeat_um",
    "orientation": "u_orientation_arcsec", "turning": "u_repeat_arcsec",
}  # fmt: skip
TEST_KEYS = tuple(LINE_KEYS.values())


def key_of_line(line: str, *, angular: bool) -> str:
    return (LINE_KEYS | ANGULAR_KEYS if angular else LINE_KEYS).get(line, line)


Limits = Annotated[list[forms.Temperature], Field(min_length=2, max_length=2), forms.RISING]
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
    lapsed: tuple[tuple[Text, str], ...] = ()  # what says that a calibration did not hold on the day, with its key


class GuardBand(JobTable):
    """A guard band of so many expanded uncertainties; between acceptance and rejection lies *undecided*."""

    guard_band: Annotated[float, Field(ge=0, le=100)] = required("Width of the guard band in expanded uncertainties.")


class FalseAccept(JobTable):
    """Accept only when the probability of not conforming is at most this."""

    max_false_accept: Annotated[float, Field(gt=0, lt=1), at_least(1e-12)]
    """Largest probability of not conforming at which a value is accepted."""


class UncertaintyRatio(JobTable):
    """Simple acceptance where the zone of the specification is so many times as wide as the uncertainty interval."""

    uncertainty_ratio: Annotated[float, Field(gt=0, le=1e6)]
    """Least width of the specification's zone over that of the uncertainty interval."""


class PosteriorProbability(JobTable):
    """Accept when the probability of conforming, with what the prior says, is at least this (JCGM 106:2012, 8.3)."""

    posterior_probability: Annotated[float, Field(gt=0.5, lt=1)]
    """Least probability of conforming, with what the prior says, at which a value is accepted."""


class UnconditionalRisk(JobTable):
    """Accept so that of all items tested at most this share is wrongly accepted (JCGM 106:2012, 9.5.3)."""

    max_unconditional_false_accept: Annotated[float, Field(gt=0, lt=1), at_least(1e-6)]
    """Largest share of all items tested that may be wrongly accepted."""


class Prior(JobTable):
    """``prior``: what is known of the tested errors beforehand, a normal distribution (JCGM 106:2012, 7.2)."""

    sd_um: Limit | None = key(None, "Standard deviation of the errors of such machines.")
    share_of_limit: Positive | None = key(None, "The same over the limit of each error.")
    mean_um: Annotated[float, Field(ge=-LARGEST_UM, le=LARGEST_UM)] = key(0.0, "Mean of the errors of such machines.")

    def problems(self) -> Iterator[str]:
        if (self.sd_um is None) == (self.share_of_limit is None):
            yield "give either sd_um or share_of_limit: how far errors of such machines scatter"


# rules by name, with or without their edition
RuleName = Literal[
    "simple", "ASME B89.7.3.1", "ASME B89.7.3.1-2001", "ISO 14253-1", "ISO 14253-1:2017",
    "ILAC-G8 binary", "ILAC-G8:09/2019 binary", "ILAC-G8 non-binary", "ILAC-G8:09/2019 non-binary",
    "JCGM 106", "JCGM 106:2012", "Z540.3", "ANSI/NCSL Z540.3", "ANSI/NCSL Z540.3-2006",
]  # fmt: skip
Rule = RuleName | GuardBand | FalseAccept | UncertaintyRatio | PosteriorProbability | UnconditionalRisk
_BY_PRIOR = ("JCGM 106", "JCGM 106:2012", "Z540.3", "ANSI/NCSL Z540.3", "ANSI/NCSL Z540.3-2006")


def needs_prior(rule: Rule) -> bool:
    """Whether a rule says nothing without a prior."""
    return isinstance(rule, (PosteriorProbability, UnconditionalRisk)) or rule in _BY_PRIOR


class ConformityFacts(JobTable):
    """One ``[[conformity]]``: a standard, a limit and a decision rule; ``prior`` for rules and risks that go by one."""

    standard: str = required("Standard by which it is decided, with its edition.")
    characteristic: str | None = None
    """Which of the standard's characteristics, where it has several: E0, R0, E150, P_FTU …, or a figure of the laboratory's
    own rule: span, error, flatness …; the first where it is left out."""
    limit_um: Limit | None = key(None, "Limit of the quantity.")
    limit_arcsec: Positive | None = key(None, "Limit of a figure that is an angle, decided as an arc over its length.")
    limit_deg: Positive | None = key(None, "The same in degrees: `0.05`, or 3 arcminutes.")
    mpe: Permissible | None = None
    """Maximum permissible error: `"3 + L/300"` (L in mm, the error in µm), or a table of `a_um`, `k`, `b_um`."""
    rule: Rule = key("ISO 14253-1", "Decision rule, by name or by its figure.")
    prior: Prior | None = None
    """What is known of such machines beforehand, for rules and risks that go by it (JCGM 106:2012, 7.2)."""
    complete: CompleteTest | None = key(None, "What a complete test has at least, for a laboratory's own rule.")
    clauses: str | None = None
    """Form of the standard's clauses, filled in beside the laboratory's own copy (`cmm-uq standards NAME --form FILE`)."""

    @field_validator("standard")
    @classmethod
    def _known(cls, name: str, info: ValidationInfo) -> str:
        standards = standards_in(info)
        if standards is not None and standards.named(name) is None:
            raise ValueError(f"no such standard is decided. {nearest(name, standards.names())}")
        return name

    @model_validator(mode="before")
    @classmethod
    def _k_of_one_meaning(cls, data: Any) -> Any:
        """A table has L/K; a K of K·L read so would let nearly any error pass."""
        given = data.get("mpe") if isinstance(data, dict) else None
        k = given.get("k") if isinstance(given, dict) else None
        if isinstance(k, (int, float)) and not isinstance(k, bool):
            guideline = str(data.get("standard", "")).startswith("VDI")
            if 1e-3 <= k < (FLATTEST if guideline else 1.0):
                raise ValueError(
                    f"mpe k = {k:g} means L/{k:g}, which is {1000 / k:.4g} µm in a metre; the K of A + K·L is meant "
                    f'otherwise: write mpe = "A + L/{k:g}", "A + {k:g}·L/1000" or "A + {k:g}·L", L in mm and the error in µm'
                )
        return data

    @property
    def angle_arcsec(self) -> float | None:
        """The limit of an angle, in whichever unit it is stated."""
        return self.limit_arcsec if self.limit_deg is None else 3600 * self.limit_deg

    def problems(self) -> Iterator[str]:
        if sum(limit is not None for limit in (self.limit_um, self.limit_arcsec, self.limit_deg, self.mpe)) != 1:
            yield (
                'give either limit_um, or mpe = "3 + L/300" with L in mm and the error in µm, or of an angle limit_arcsec or '
                "limit_deg"
            )
        if needs_prior(self.rule) and self.prior is None:
            yield (
                f"the rule {_key_of(self.rule)} goes by what is known of such machines beforehand: "
                "give prior = { sd_um = … } or { share_of_limit = … }"
            )

    @model_validator(mode="after")
    def _decided_here(self, info: ValidationInfo) -> Self:
        if asked := _asked(self, standards_in(info)):
            asked.characteristic(self.characteristic)
        return self


class StandardFacts(Protocol):
    """What the check of a job must know of a standard."""

    @property
    def sensing(self) -> str | None:
        """For which probes it is; ``None`` for any."""

    @property
    def clause_names(self) -> Sequence[str]:
        """Names of its clauses, as a form has them."""

    def characteristic(self, name: str | None) -> object:
        """One that it decides; ``ValueError`` for a name that it does not."""

    def uncertainty_missing(
        self, wish: ConformityFacts, artefact: ArtefactFacts, stated: TestUncertainty
    ) -> str | None:
        """The key whose uncertainty the rule needs and does not have; ``None`` when nothing is missing."""


@dataclass(frozen=True)
class Standards:
    """The standards that a job may name: what is asked of each, and their names."""

    named: Callable[[str], StandardFacts | None]
    names: Callable[[], Sequence[str]]


def standards_in(info: ValidationInfo) -> Standards | None:
    """The standards that a job is checked against; ``None`` for a table that is made by itself, without a job."""
    return info.context if isinstance(info.context, Standards) else None


def uncertainty_missing(
    wish: ConformityFacts, artefact: ArtefactFacts, stated: TestUncertainty, standards: Standards | None
) -> str | None:
    """See :meth:`StandardFacts.uncertainty_missing`; ``None`` where there is nothing to check against."""
    asked = _asked(wish, standards)
    return asked.uncertainty_missing(wish, artefact, stated) if asked else None


def _asked(wish: ConformityFacts, standards: Standards | None) -> StandardFacts | None:
    return None if standards is None else standards.named(wish.standard)


def probe_unfit(wish: ConformityFacts, sensing: str | None, standards: Standards | None) -> str | None:
    """That a standard is for other probes than that of the recording, and how to mend it; ``None`` where it is for it."""
    asked = _asked(wish, standards)
    if asked is None or None in (asked.sensing, sensing) or asked.sensing == sensing:
        return None
    return (
        f"the standard {wish.standard} is for {asked.sensing} probes, and the recording was made with one that is not. "
        f"State {'ISO 10360-8:2013' if sensing == 'optical' else 'another standard'}, or leave the statement out"
    )


def needed(key: str, wish: ConformityFacts) -> tuple[str, str]:
    """That a rule needs an uncertainty which the job does not state, and how to mend it."""
    table = "test_uncertainty" if key in TEST_KEYS else "artefact"
    return (
        f"the rule {_key_of(wish.rule)} needs the uncertainty of what {wish.standard} compares with, "
        f"and [{table}] states no {key} above 0",
        f'Give {key} in [{table}], or rule = "simple", which takes no account of it',
    )


def _key_of(rule: Rule) -> str:
    return rule if isinstance(rule, str) else next(iter(rule.model_dump()))
