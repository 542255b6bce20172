"""The artefact, its certificate, and to what the results are traceable."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, day, names, say, semicolons, sentences
from cmm_uq.base.points import Points
from cmm_uq.base.units import MICROMETRE, Unit, unit
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section, section
from cmm_uq.certificate.wording import NO_FACTOR, expanded
from cmm_uq.jobs.chain import TraceabilityChain, chain_of
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.references import OF_POINTS
from cmm_uq.jobs.recording.short_gauge import ShortGaugeFacts
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts, Traceability
from cmm_uq.jobs.tables.length_formula import Growing, factor_of
from cmm_uq.jobs.tables.origin import MEASURED
from cmm_uq.machine.model.artefact import Size
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.uncertainty.quantity import Quantity, figure, nominal, significant

if TYPE_CHECKING:
    from cmm_uq.certificate.result import Result


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
    rows += [_certified(size) for size in certified]
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
    return [(say("Short gauge"), what), (say("Certificate of the short gauge"), sentences(chain) if chain else NOTHING)]


def _certified(size: Size) -> tuple[Text, Text]:
    shown = _with_u(nominal(size.nominal), size.unit, size.sd / MICROMETRE)
    return say("Certified {what} at 20 °C", what=size.what or say("{title:small}", title=size.title)), shown


def _with_u(value: Text, of: Unit, u_um: float) -> Text:
    if not u_um:
        return say("{value} {unit}, no uncertainty stated", value=value, unit=of)
    return say("{value} {unit}, U = {U} µm (k = 2)", value=value, unit=of, U=significant(2 * u_um))


def _fitted(size: Size, quantity: Quantity) -> tuple[Text, Text]:
    value, U, k = expanded(quantity)
    shown = say("{value} {unit}, U = {U} {unit}", value=value, unit=size.unit, U=U)
    shown = shown if k == NO_FACTOR else say("{figure} (k = {k})", figure=shown, k=k)
    return say("{size} after the fit", size=size.title), shown
