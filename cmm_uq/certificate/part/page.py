"""A part's measurement in short: whether it conforms, where it is nearest to a limit, what its uncertainty comes from.

The machine that measured a part: its certificate, how it was verified, and how its errors are drawn.

The page of a part: its characteristics with their uncertainty, what the limits make of them, and where it comes from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cmm_uq.analysis.conformity.decision import Outcome
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, plural, say
from cmm_uq.certificate import certificate
from cmm_uq.certificate.clauses import Requirement, asked, not_stated, of_every_report
from cmm_uq.certificate.document import Document, Facts, Overview, Paragraph, Section, section
from cmm_uq.certificate.part import budget_section as causes, results_section as results
from cmm_uq.certificate.part.figures import CharacteristicFigures, critical, figures_of
from cmm_uq.certificate.part.measurement import CertificateStatus, PartMeasurement, Source
from cmm_uq.certificate.part.method import method_section, methods_section, not_covered_section, program_words
from cmm_uq.certificate.wording import probability
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.jobs.verdicts import gravest, standing_of


def overview_of(found: PartMeasurement) -> Overview:
    one = critical(found)
    rows = (
        (say("Part"), part_words(found)),
        (say("Decision rule"), found.judged_by if any(found.judged) else NOTHING),
        (say("Least margin") if found.nearest is not None else say("Tightest"), _least(one)),
        (say("Probability"), _together(found)),
        (say("Uncertainty"), causes.largest_words(one) if found.budget.causes and one.stated.u else NOTHING),
        (say("To reduce it"), causes.best_words(one) if len(found.ways) > 1 else NOTHING),
        (say("Not seen"), causes.unseen_words(found) if found.unseen else NOTHING),
        (say("Not covered"), _not_covered(found)),
    )
    return Overview(
        verdict_words(found.outcomes, measured=found.measured is not None),
        "unknown" if found.outcome is None else standing_of(found.outcome),
        tuple(row for row in rows if row[1]),
    )


def verdict_words(outcomes: Sequence[Outcome], *, measured: bool) -> Text:
    """Whether the part conforms.

    ``measured``: whether anything was.
    """
    outcome = gravest(outcomes)
    if not outcomes:
        return say("Measured: no limits to decide on") if measured else _UNMEASURED
    all_ = len(outcomes)
    if outcome == "pass":
        return plural(all_, one=say("Conforms: its one limited characteristic is within its limits"),
                      many=say("Conforms: all {count} limited characteristics are within limits", count=all_))  # fmt: skip
    if outcome in ("fail", "conditional fail"):
        out = sum(one in ("fail", "conditional fail") for one in outcomes)
        told = plural(out, one=say("one of {all} characteristics is not", all=all_),
                      many=say("{count} of {all} characteristics are not", count=out, all=all_))  # fmt: skip
        if outcome == "conditional fail":
            return say("Conditionally rejected: {told} within its limits with certainty", told=told)
        return say("Does not conform: {told} within the limits", told=told)
    if outcome == "conditional pass":
        return say("Conditionally accepted: all values are within their limits, not all with their uncertainty")
    open_ = sum(one == "undecided" for one in outcomes)
    return plural(
        open_, one=say("Undecided: one of {all} characteristics is too near to a limit", all=all_),
        many=say("Undecided: {count} of {all} characteristics are too near to a limit", count=open_, all=all_),
    )  # fmt: skip


_UNMEASURED = say("Uncertainty of a planned measurement: nothing was measured")


def part_words(found: PartMeasurement) -> Text:
    part = found.job.facts.part
    drawing = say("drawing {number}", number=Verbatim(part.drawing)) if part.drawing else NOTHING
    serial = say("serial number {number}", number=Verbatim(part.serial)) if part.serial else NOTHING
    return commas(text for text in (Verbatim(part.name), drawing, serial) if text)


def _least(one: CharacteristicFigures) -> Text:
    """The characteristic nearest to a limit, or that takes most of its tolerance, with its figures."""
    if not one.allowed:
        return NOTHING
    told = say("{what}: {result}; allowed {allowed}", what=one.titled, result=one.result, allowed=one.allowed)
    if one.found.nearest is not None:
        margin = float(one.found.margins[one.place])
        times = messages.number(abs(margin), ".1f")
        return (say("{told}, {times} u inside of the limit", told=told, times=times) if margin >= 0 else
                say("{told}, {times} u outside of the limit", told=told, times=times))  # fmt: skip
    share = messages.signed(200 * one.expanded / one.width, ".0f") if one.width > 0 else NOTHING
    return say("{told}; the 95 % interval takes {share} % of it", told=told, share=share) if share else told


def _together(found: PartMeasurement) -> Text:
    limited = sum(one is not None for one in found.judged)
    if found.together is None or limited < 2:
        return NOTHING
    return say("{chance} that all {count} limits are kept", chance=probability(found.together), count=limited)


def _not_covered(found: PartMeasurement) -> Text:
    left, free = found.job.facts.part.not_measured, [one.titled for one in figures_of(found) if one.judged is None]
    told = (
        (left, say("Not measured: {names}.", names=commas(messages.names(left)))),
        (0 < len(free) < len(found.judged), say("Without limits: {names}.", names=messages.semicolons(free))),
    )
    return messages.sentences([text for holds, text in told if holds])


_SOURCES: Mapping[Source, Text] = {
    "certificate": say("its certificate, with the recording of the calibration inside"),
    "results": say("the figures and draws of its certificate, without the recording of the calibration"),
    "job": say("the job of its calibration, analysed anew; no certificate is verified"),
}


def machine_section(found: PartMeasurement) -> Section:
    """What states the machine, and what of it was verified."""
    standing, celsius = found.standing, NOTHING
    if standing.temperature_c is not None:
        celsius = say("{value} °C", value=messages.number(standing.temperature_c, ".2f"))
    rows = (
        (say("Taken from"), _SOURCES[standing.source]),
        *certificate_rows(standing),
        (say("Files"), commas(messages.names(standing.files))),
        (say("Verified"), verified_words(standing)),
        (say("Signatures"), say("by trusted certificates") if standing.trusted else say("not asked for")),
        (
            say("Temperature of the scales at the calibration"),
            celsius,
        ),
        (say("Noise of a coordinate"), _noise(found)),
    )
    told = (Paragraph(text) for text in (standing.path, standing.drift) if text)
    return section(say("The machine and its certificate"), Facts(tuple(row for row in rows if row[1])), *told)


def certificate_rows(standing: CertificateStatus) -> tuple[tuple[Text, Text], ...]:
    """Machine, number, issuer, date with its age, validity of the certificate."""
    serial = say("serial number {serial}", serial=Verbatim(standing.serial)) if standing.serial else NOTHING
    number_of = (
        say("{number}, a draft", number=Verbatim(standing.number)) if standing.draft else Verbatim(standing.number)
    )
    return (
        (say("Machine"), commas(text for text in (Verbatim(standing.machine), serial) if text)),
        (say("Certificate of the machine"), number_of),
        (say("Issued by"), Verbatim(standing.laboratory)),
        (say("Calibrated on"), _calibrated(standing)),
        (say("Valid until"), messages.day(standing.valid_until) if standing.valid_until else NOTHING),
    )


def _calibrated(standing: CertificateStatus) -> Text:
    days, date = standing.age.days, messages.day(standing.date)
    age = plural(days, one=say("one day"), many=say("{count} days", count=days))
    return (
        say("{date}, {age} before", date=date, age=age)
        if days
        else say("{date}, the day of the measurement", date=date)
    )


def verified_words(standing: CertificateStatus) -> Text:
    """What was compared and what was not."""
    done = [one for one in standing.checked if one.count]
    if not done:
        return say("no: analysed anew") if standing.source == "job" else say("no")
    again = say("computed again from its inputs") if standing.again else say("not computed again")
    return say("{told}; {again}", again=again, told=say(
        "{count} comparisons of {sorts} sorts between its documents, figures, decisions and inputs, none of which failed",
        count=sum(one.count for one in done), sorts=len(done),
    ))  # fmt: skip


def _noise(found: PartMeasurement) -> Text:
    usual = found.given.machine.noise.usual_mm * 1e3
    if not usual.any():
        return NOTHING
    return say("{x}, {y}, {z} µm along x, y, z", x=messages.number(usual[0], ".2g"), y=messages.number(usual[1], ".2g"),
               z=messages.number(usual[2], ".2g"))  # fmt: skip


TITLE = say("Measurement report")
PLANNED = say("Measurement uncertainty")


def part_document(found: PartMeasurement) -> Document:
    facts, measured, lacking = found.job.facts, found.measured is not None, lacking_of(found)
    sections = (
        results.results_section(found), results.conformity_section(found), results.part_section(found),
        results.errors_section(found), causes.budget_section(found), causes.priors_section(found),
        causes.unseen_section(found),
        causes.ways_section(found), methods_section(found.methods), results.correlation_section(found),
        machine_section(found), method_section(found), not_covered_section(found),
    )  # fmt: skip
    date = messages.day(facts.job.date)
    came = say("measured on {date}", date=date) if measured else say("planned for {date}", date=date)
    return certificate.formal_document(
        facts.job, facts.laboratory, found.job.inputs, draft=bool(lacking), authorised=measured,
        title=TITLE if measured else PLANNED, subject=say("{part}, {came}", part=part_words(found), came=came),
        particulars=_particulars(found), warnings=(*found.warnings, *not_stated(lacking)),
        sections=tuple(section for section in sections if section.blocks),
        produced_by=say("{program}, seed {seed}", program=program_words(), seed=found.seed), end=say("End of report"),
        overview=overview_of(found),
    )  # fmt: skip


def lacking_of(found: PartMeasurement) -> tuple[Requirement, ...]:
    """What ISO/IEC 17025:2017, 7.8 asks of every report and the job does not state; nothing is asked where nobody measured."""
    facts = found.job.facts
    if found.measured is None or facts.job.origin != MEASURED:
        return ()
    item = asked("7.8.2.1 g", say("serial number of the part"), facts.part.serial, "[part] serial")
    every = (
        *of_every_report(facts.job, facts.laboratory, TITLE, item),
        asked("7.8.4.1 b", say("conditions"), facts.job.conditions, "[job] conditions"),
    )
    return tuple(one for one in every if one.status == "missing")


def _particulars(found: PartMeasurement) -> tuple[Facts, ...]:
    facts = found.job.facts
    job, part = facts.job, facts.part
    expansion = say("{cte:g} × 10⁻⁶ /K", cte=part.cte_per_k * 1e6) if part.cte_per_k else NOTHING
    if expansion and part.u_cte_per_k:
        expansion = say("{expansion}, u = {u:g} × 10⁻⁶ /K", expansion=expansion, u=part.u_cte_per_k * 1e6)
    return certificate.grouped(
        certificate.identified(job, facts.laboratory, job.origin, say("Report number")),
        ((say("Part"), part.name), (say("Drawing"), part.drawing), (say("Serial number"), part.serial),
         (say("Owner"), part.owner), (say("Material"), part.material), (say("Thermal expansion"), expansion),
         (say("Place"), job.place)),
        certificate_rows(found.standing),
        (*certificate.performed(job), (say("Conditions"), job.conditions)),
    )  # fmt: skip
