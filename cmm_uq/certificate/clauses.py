"""To what results are traceable, what ISO/IEC 17025:2017, 7.8 asks of a certificate, and what a job does not state of it.

One table for the warning of a certificate, the mark of a draft, ``results.json`` and ``cmm-uq check``. A certificate is a
draft until nothing that the standard asks of every certificate is missing; what it asks for where there is any makes none.
A recording that nobody measured has no certificate, so nothing is asked of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from cmm_uq.analysis.conformity.decision import rule_name
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, foreign, names, say, semicolons, sentences
from cmm_uq.base.points import Points
from cmm_uq.base.units import MICROMETRE, Unit, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section, section
from cmm_uq.certificate.origin import CERTIFICATE
from cmm_uq.certificate.wording import NO_FACTOR, expanded
from cmm_uq.jobs.chain import TraceabilityChain, chain_of, dates_out_of_order
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.recording.beside import ShortGaugeFacts
from cmm_uq.jobs.recording.compared import OF_POINTS
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts, Traceability
from cmm_uq.jobs.tables.identification import MEASURED, Identification, Laboratory, ReplacedCertificate
from cmm_uq.jobs.tables.length_formula import Growing, factor_of, students
from cmm_uq.jobs.verdicts import TOLERANCE_RULE
from cmm_uq.machine.model.artefact import Size
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.uncertainty.quantity import Quantity, figure, nominal, significant

if TYPE_CHECKING:
    from cmm_uq.certificate.result import Result
    from cmm_uq.jobs.part.tables import PartFile


def traceability_section(job: Job, rows: tuple[tuple[Text, Text], ...], *further: Block) -> Section:
    """The artefact, what temperatures were read from, and by what a recording was taken live, each with its certificate."""
    facts, taken = job.facts, job.acquired
    every_row = [
        *rows,
        *((say("Thermometer"), sentences((*names(filter(None, (one.name, one.serial))), *_listed(one.certificate))))
          for one in facts.thermometer),
        *((say("Imported file"), recognised.sentence) for recognised in job.imported),
    ]  # fmt: skip
    if taken is not None:
        every_row += [
            (say("Recording"), taken.sentence), (say("Instruments"), semicolons(taken.instruments)),
            (say("Joined by time"), semicolons(taken.joins)), (say("Gaps"), semicolons(taken.gaps)),
        ]  # fmt: skip
    said = Paragraph(claimed(job).statement) if job.origin == MEASURED else None
    return section(say("Artefact and traceability"), Facts(tuple(row for row in every_row if row[1])), said, *further)


def artefact_rows(job: Job, otherwise: Text) -> list[tuple[Text, Text]]:
    artefact = job.facts.artefact
    return [
        (say("Artefact"), Verbatim(artefact.name) if artefact.name else otherwise),
        (say("Serial number"), Verbatim(artefact.serial)),
    ]


def certificate_rows(chain: Traceability | None) -> list[tuple[Text, Text]]:
    """The artefact's own certificate, if it has one."""
    if chain is None:
        return []
    issued = [say("of {date}", date=day(chain.date))] if chain.date else []
    issued += [say("due {date}", date=day(chain.until))] if chain.until else []
    return [
        (say("Its certificate"), sentences((*names(filter(None, (chain.number,))), *issued))),
        (say("Issued by"), Verbatim(chain.laboratory)),
    ]


def _listed(chain: Traceability | None) -> list[Text]:
    return [text for _, text in certificate_rows(chain) if text]


def claimed(job: Job) -> TraceabilityChain:
    """To what the results of a job are traceable, and what of that is not shown: every output reads it here."""
    known = every()
    return chain_of(
        job, {column for name in job.facts.model.effects if name in known for column in known[name].columns}
    )


def traceability(result: Result) -> Section:
    """The artefact, what of it is certified, and what the fit makes of that."""
    artefact = result.job.facts.artefact
    rows = artefact_rows(result.job, result.artefact.title)
    compared = result.job.facts.recording.earlier
    dimensions = [size for size in result.artefact.sizes if size.role == "dimension"]
    certified = [] if compared else [size for size in dimensions if size.certified]
    rows += [
        (size.title if size.what == size.title else  # of an instrument, which is read and not certified
         say("Certified {what} at 20 °C", what=size.what or say("{title:small}", title=size.title)),
         _with_u(nominal(round(size.nominal, 5)), size.unit, size.sd / MICROMETRE))
        for size in certified
    ]  # fmt: skip
    if certified:
        rows.append((say("Uncertainty by its certificate"), stated_uncertainty(artefact, result.job.points)))
    if compared:
        rows.append((say("References"), say("the earlier recording {file}", file=Verbatim(compared))))
    elif dimensions and not certified:
        rows.append((say("Certified length"), say("none: uncalibrated artefact (auto-calibration)")))
    if artefact.cte_per_k:
        cte = say("{cte} × 10⁻⁶ /K", cte=figure(artefact.cte_per_k * 1e6, 10))
        rows.append((say("Coefficient of thermal expansion"), cte))
    rows += certificate_rows(artefact.certificate)
    rows += _short_gauge(result.job.facts.short_gauge)
    rows += [_fitted(size, result.sizes[size.name]) for size in certified]
    return traceability_section(result.job, tuple(rows))


def stated_uncertainty(facts: ArtefactFacts, points: Points) -> Text:
    """U as the certificate states it; nothing of a plain standard uncertainty, which stands beside the length."""
    factor = NOTHING
    if facts.k is not None:
        factor = say("k = {k}", k=figure(facts.k, 10))
        if facts.degrees_of_freedom is None and students(facts.k):
            factor = say("{factor}, taken as Student's t for 95 %", factor=factor)
    elif facts.degrees_of_freedom is not None and facts.U_um is not None:
        factor = say("k = {k}", k=figure(factor_of(None, facts.degrees_of_freedom) or 0.0, 3))
    if facts.degrees_of_freedom is not None:
        count = say("{count} degrees of freedom", count=figure(facts.degrees_of_freedom, 10))
        factor = commas((*filter(None, (factor,)), count))
    told: list[Text] = []
    if facts.U_um is not None:
        told.append(commas((say("U = {formula}", formula=_formula(facts.U_um)), factor)))
    elif isinstance(facts.u_um, Growing) or (facts.u_um is not None and factor):
        told.append(commas((say("u = {formula}", formula=_formula(facts.u_um)), *filter(None, (factor,)))))
    columns = [points.columns[name] for name in OF_POINTS if name in points.columns]
    if columns:
        least, most = (figure(pick(pick(column) for column in columns), 3) for pick in (min, max))
        told.append(say("of each point by itself, u from {least} to {most} µm", least=least, most=most))
        if isinstance(facts, ReferencedFacts) and facts.covariances_at(points.point)[1]:
            told.append(say("with covariances"))
    return semicolons(told) if told else NOTHING


def _formula(stated: Growing | float) -> Text:
    """As certificates print it: 0.2 µm + 0.5·10⁻⁶·L."""
    if not isinstance(stated, Growing):
        return say("{number} µm", number=figure(stated, 10))
    fixed, slope = figure(stated.fixed_um, 10), figure(stated.per_mm * 1000, 10)
    if not stated.fixed_um:
        return say("{slope}·10⁻⁶·L", slope=slope)
    if stated.squares:
        return say("Q[{fixed} µm; {slope}·10⁻⁶·L]", fixed=fixed, slope=slope)
    return say("{fixed} µm + {slope}·10⁻⁶·L", fixed=fixed, slope=slope)


def _short_gauge(gauge: ShortGaugeFacts | None) -> list[tuple[Text, Text]]:
    """The short gauge beside the artefact, with its own certificate."""
    if gauge is None:
        return []
    shown = say("{length} at 20 °C", length=_with_u(nominal(gauge.length_mm), unit("mm"), gauge.u_um))
    what = commas((*names(filter(None, (gauge.name, gauge.serial))), shown))
    chain = _listed(gauge.certificate)
    certificate = sentences(chain) if chain else NOTHING
    return [(say("Short gauge"), what), (say("Certificate of the short gauge"), certificate)]


def _with_u(value: Text, of: Unit, u_um: float) -> Text:
    if not u_um:
        return say("{value} {unit}, no uncertainty stated", value=value, unit=of)
    return say("{value} {unit}, U = {U} µm (k = 2)", value=value, unit=of, U=significant(2 * u_um))


def _fitted(size: Size, quantity: Quantity) -> tuple[Text, Text]:
    value, U, k = expanded(quantity)
    U, of = (significant(quantity.expanded / MICROMETRE), unit("µm")) if size.unit == "mm" else (U, size.unit)
    shown = say("{value} {unit}, U = {U} {of}", value=value, unit=size.unit, U=U, of=of)
    shown = shown if k == NO_FACTOR else say("{figure} (k = {k})", figure=shown, k=k)
    return say("{size} after the fit", size=size.title), shown


Status = Literal["stated", "missing", "not applicable", "laboratory"]
"""The last of what the laboratory does, and no certificate shows."""

STATEMENTS = (
    say("The results relate only to the item named above, in its condition and place at the time of the measurement."),
    say(
        "This certificate shall not be reproduced except in full without the written approval of the issuing laboratory."
    ),
)
"""ISO/IEC 17025:2017, 7.8.2.1 l) and the note to 7.8.2.1."""

NOT_OURS = say(
    "The data named as the customer's were not measured by the laboratory, which does not answer for them; results that "
    "rest on them are valid as far as they are."
)
"""7.8.2.2, where there are such data."""

# on every page of a certificate that lacks what each must state
DRAFT = say("DRAFT, not complete by ISO/IEC 17025:2017, 7.8")


@dataclass(frozen=True)
class Requirement:
    """What a clause asks for, and whether the certificate has it."""

    clause: str  # its number, with the letter where it has one
    asks: str  # a text that can be said in other languages where a certificate may have to name it
    status: Status
    stated: str  # what satisfies it; empty where nothing does
    key: str  # of job.toml, that states it or would; empty where the form of the certificate does

    @property
    def data(self) -> dict[str, Any]:
        return {
            "clause": self.clause, "asks": str.__str__(self.asks), "status": self.status,
            "stated": self.stated or None, "key": self.key or None,
        }  # fmt: skip


def clauses(job: Job) -> tuple[Requirement, ...]:
    """Every clause of 7.8 that speaks of calibration certificates, in the standard's order."""
    facts, machine, replaced = job.facts, job.facts.machine, job.facts.job.replaces
    named = (machine.manufacturer, machine.model, machine.name)
    item = f"{_lines(named)}, serial number {machine.serial}" if machine.serial else ""
    serial = asked("7.8.2.1 g", say("serial number of the machine"), item, "[machine] serial")
    return (
        _done("7.8.1.1", "results reviewed and authorised before release", "[laboratory] four_eyes"),
        asked("7.8.1.2", "results and all that their interpretation needs, in a report", facts.job.number or facts.job.id),
        _done("7.8.1.3", "a simplified report only as agreed with the customer"),
        *of_every_report(facts.job, facts.laboratory, CERTIFICATE, serial),
        *_of_a_calibration(job), *_statements(facts),
        _where("7.8.8.1", "what was changed, and why", replaced and f"{replaced.changed} ({replaced.reason})",
               "[job.replaces] changed"),
        _where("7.8.8.2", "amendments as a further document that says so", ""),
        _where("7.8.8.3", "a number of its own, and which certificate it replaces",
               replaced and replaced_certificate(replaced), "[job.replaces] number"),
    )  # fmt: skip


def missing(job: Job) -> tuple[Requirement, ...]:
    return tuple(one for one in clauses(job) if one.status == "missing")


def certifies(job: Job) -> bool:
    """Whether what is made of a job is a calibration certificate: somebody measured, and between no two calibrations."""
    return job.origin == MEASURED and not job.facts.job.interim


def clauses_data(job: Job) -> dict[str, Any]:
    """For results.json, of what is to be a certificate."""
    if not certifies(job):
        return {}
    chain = claimed(job)
    said = {"claim": chain.claim, "statement": str.__str__(chain.statement)}
    return {"iso17025": [one.data for one in clauses(job)], "traceability": said}


def draft(job: Job) -> bool:
    return certifies(job) and bool(missing(job))


def replaced_certificate(replaced: ReplacedCertificate) -> Text:
    return say("{number} of {date}", number=Verbatim(replaced.number), date=day(replaced.date))


def asked(clause: str, asks: str, stated: object, key: str = "", otherwise: Status = "missing") -> Requirement:
    text = str.__str__(stated) if isinstance(stated, str) else "" if stated is None else str(stated)
    return Requirement(clause, asks, "stated" if stated else otherwise, text, key)


_where = partial(asked, otherwise="not applicable")  # what is asked for where there is any


def _done(clause: str, asks: str, key: str = "") -> Requirement:
    return Requirement(clause, asks, "laboratory", "", key)


def _lines(parts: Iterable[str]) -> str:
    return ", ".join(line for part in parts for line in part.splitlines() if line)


def of_every_report(
    job: Identification, laboratory: Laboratory, title: str, item: Requirement
) -> tuple[Requirement, ...]:
    """7.8.2.1 of any report; ``item``: what names the item (7.8.2.1 g)."""
    return (
        asked("7.8.2.1 a", "title", title),
        asked("7.8.2.1 b", say("name of the laboratory"), laboratory.name, "[laboratory] name"),
        asked("7.8.2.1 b", say("address of the laboratory"), _lines([laboratory.address]), "[laboratory] address"),
        asked("7.8.2.1 c", say("place of the measurement"), job.place, "[job] place"),
        asked("7.8.2.1 d", "every part known as part of one report, and its end",
               f"number {job.number or job.id} and page of pages on every page; mark of the end", "[job] number"),
        asked("7.8.2.1 e", say("customer"), job.customer, "[job] customer"),
        asked("7.8.2.1 e", say("how to reach the customer"), _lines([job.address]), "[job] address"),
        asked("7.8.2.1 f", say("method"), job.procedure, "[job] procedure"),
        item,
        _where("7.8.2.1 h", "date of receipt, where it matters", job.received, "[job] received"),
        asked("7.8.2.1 i", "date of the measurement", job.date, "[job] date"),
        asked("7.8.2.1 j", say("date of issue"), job.issued, "[job] issued"),
        _where("7.8.2.1 k", "sampling plan, where anything is sampled", ""),
        asked("7.8.2.1 l", "that the results relate to the item alone", STATEMENTS[0]),
        asked("7.8.2.1 m", "results with their units", "the unit with every figure"),
        _where("7.8.2.1 n", "additions to, deviations from and exclusions from the method", job.deviations,
               "[job] deviations"),
        asked("7.8.2.1 o", say("who authorises it"), _lines([laboratory.signatory, laboratory.signatory_role])
               if laboratory.signatory else "", "[laboratory] signatory"),
        _where("7.8.2.1 p", "results from external providers", job.external, "[job] external"),
        _where("7.8.2.2", "data from the customer, and that the laboratory does not answer for them", job.from_customer,
               "[job] from_customer"),
    )  # fmt: skip


PART_TITLE = say("Measurement report")


def of_a_part(facts: PartFile, measured: object | None) -> tuple[Requirement, ...]:
    """What is asked of the report of a part; nothing of one that was planned or simulated, or is an example's."""
    if facts.job.origin != MEASURED or measured is None:
        return ()
    item = asked("7.8.2.1 g", say("serial number of the part"), facts.part.serial, "[part] serial")
    conditions = asked("7.8.4.1 b", say("conditions"), facts.job.conditions, "[job] conditions")
    return (*of_every_report(facts.job, facts.laboratory, PART_TITLE, item), conditions)


def _of_a_calibration(of: Job) -> tuple[Requirement, ...]:
    facts, job, chain = of.facts, of.facts.job, claimed(of)
    # where it is not shown how results are traceable, all that each certificate which they rest on lacks
    traceable: tuple[Requirement, ...] = (asked("7.8.4.1 c", "how the results are traceable", chain.statement),)
    if chain.claim == "not shown":
        traceable = tuple(Requirement("7.8.4.1 c", what, "missing", "", key) for what, key in chain.lacks)
    return (
        asked("7.8.4.1 a", "measurement uncertainty in the unit of the result",
               "U, k and 95 % with every result", "[laboratory] cmc"),
        asked("7.8.4.1 b", say("conditions"), job.conditions, "[job] conditions"),
        *traceable,
        _where("7.8.4.1 d", "results before and after an adjustment", job.as_found, "[job] as_found"),
        _where("7.8.4.1 e", "statement of conformity", _standards(facts), "[[conformity]]"),
        _where("7.8.4.1 f", "opinions and interpretations", "annex of opinions and interpretations",
               "[job] diagnosis_on_certificate"),
        _where("7.8.4.2", "sampling by the laboratory", ""),
        asked("7.8.4.3", "no calibration interval that was not agreed with the customer",
               f"next calibration as agreed: {job.recalibration_agreed}" if job.recalibration_agreed else "none is printed",
               "[job] recalibration_agreed"),
    )  # fmt: skip


def _statements(facts: JobFile) -> tuple[Requirement, ...]:
    decided = bool(facts.conformity or facts.model.tolerances)
    tolerances = [TOLERANCE_RULE] if facts.model.tolerances else []
    rules = "; ".join(dict.fromkeys([*(rule_name(wish.rule) for wish in facts.conformity), *tolerances]))
    stated = "value, measurement and length named with each statement" if decided else ""
    return (
        _where("7.8.6.1", "a decision rule, with the risk that it takes",
               f"{rules}: guard band and probability with each statement" if decided else "", "[[conformity]] rule"),
        _where("7.8.6.2 a", "to which results a statement of conformity applies", stated, "[[conformity]]"),
        _where("7.8.6.2 b", "which specifications are met or not met", _standards(facts), "[[conformity]] standard"),
        _where("7.8.6.2 c", "the decision rule applied", rules, "[[conformity]] rule"),
        _done("7.8.7.1", "opinions by authorised people, on a documented basis"),
        _where("7.8.7.2", "opinions rest on the results and are marked as such", "in the annex, under its own heading"),
        _done("7.8.7.3", "what was said of them to the customer is recorded"),
    )  # fmt: skip


def _standards(facts: JobFile) -> str:
    held = ("tolerances of the job",) if facts.model.tolerances else ()
    return "; ".join(dict.fromkeys((*(wish.standard for wish in facts.conformity), *held)))


_INTERIM = say(
    "An interim check{key}: no calibration certificate, whatever the title says.", key=messages.at_key("[job] interim")
)


def formal_warnings(job: Job) -> tuple[Text, ...]:
    """What an assessor would hold against a certificate of this job, whatever was measured."""
    if job.origin != MEASURED:
        return ()
    if job.facts.job.interim:
        return (_INTERIM, *contradictions(job))
    return (*contradictions(job), *not_stated(missing(job)))


def contradictions(job: Job) -> tuple[Text, ...]:
    """Dates out of their order, and an artefact that was certified on the machine which it tests."""
    circular = say(
        "The artefact was certified on the machine that it now tests{key}: errors that both "
        "measurements have in common are not seen here.",
        key=messages.at_key("[artefact.certificate] machine"),
    )
    return (*((circular,) if job.facts.certified_on_this_machine else ()), *dates_out_of_order(job))


def not_stated(lacking: Iterable[Requirement]) -> list[Text]:
    """That a certificate is not complete, and by which keys it would be; nothing of one that is."""
    wanted = [
        say("{what} ({clause}){key}", what=foreign(what), clause=Verbatim(clause), key=messages.Key(f": {key}"))
        for what, clause, key in ((one.asks, one.clause, one.key) for one in lacking)
    ]
    told = say("Not complete by ISO/IEC 17025:2017; the job does not state: {missing}.", missing=semicolons(wanted))
    return [told] if wanted else []
