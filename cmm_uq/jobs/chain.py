"""To what the results are traceable, and on what that rests; what of a job's dates contradicts itself.

Two routes are claimed without more: a national metrology institute under the CIPM MRA, and a laboratory that a signatory of
the ILAC arrangement, or of one that ILAC recognises, accredits (ILAC-P10:07/2020, 1 and 2; ISO/IEC 17025:2017, A.3). By its
other routes (3a, 3b, in-house calibration, reference materials) a laboratory answers for the competence of the issuer itself,
and the statement says so with its evidence. Of every certificate number, issuer, date and the day until which it holds are
stated, and the measurement lies between both dates, the first and the last day among them.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Iterator, Mapping
from typing import Literal

from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, commas, day, say, semicolons, sentences
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.acquired import ARTEFACT
from cmm_uq.jobs.job import CIRCULAR, Job
from cmm_uq.jobs.reports import AS_FOUND
from cmm_uq.jobs.tables import artefact as artefacts
from cmm_uq.jobs.tables.artefact import ACCREDITED, CONSENSUS, MATERIAL, NATIONAL, OTHER, Traceability
from cmm_uq.jobs.tables.identification import MEASURED, NO_DATE

# what a statement of traceability says; the last where nothing that is certified enters
Claim = Literal["traceable", "by evidence", "not shown", "none needed"]
Lack = tuple[Text, str]  # what a claim lacks, in words without keys, and the key of job.toml that would mend it
NOT_MEASURED = say("Nobody measured this recording, and no result of it is traceable.")
OWN_MACHINE = say(
    "The artefact was certified on the machine that is calibrated here. It is no independent reference, so the results are "
    "not shown to be traceable to the International System of Units (SI)."
)
UNCALIBRATED = say(
    "No certified length enters. The size of lengths, and the scale that axes have in common, are not traceable to the metre "
    "by this measurement; what the artefact shows by comparison with itself in other places needs no certified length."
)
GAUGE_ALONE = say("No certified length of the artefact enters; the short gauge is the only length that does.")
CHANGES = say(
    "The results are changes since the earlier recording; they rest on it and on the artefact having stayed as it was."
)
_KELVIN = say(
    "The results are traceable to the metre and the kelvin of the International System of Units (SI) by what follows."
)
_HEADS: Mapping[Claim, Text] = {
    "traceable": say(
        "The results are traceable to the metre of the International System of Units (SI) by what follows."
    ),
    "by evidence": say(
        "The laboratory holds the results to be traceable to the International System of Units (SI). Not every calibration "
        "that they rest on is covered by an arrangement; for such a one it answers itself, by the evidence named."
    ),
    "not shown": say("The results are not shown to be traceable to the International System of Units (SI)."),
}


@dataclass(frozen=True)
class Link:
    """A certificate that results rest on: of what, stated in which table of job.toml, on the day of the measurement.

    ``kelvin``: whether temperatures rest on it, and no lengths; ``another``: serial number of the instrument that a live
    recording names in place of this one.
    """

    what: Text
    table: str
    chain: Traceability | None
    day: dt.date
    kelvin: bool = False
    another: str = ""

    @property
    def claim(self) -> Claim:
        if tuple(self.lacks()):
            return "not shown"
        return "traceable" if self.chain is not None and _covered(self.chain) else "by evidence"

    def lacks(self) -> Iterator[Lack]:
        """What is not stated, or contradicts itself."""
        chain = self.chain or Traceability()
        bare, accredited = chain.issuer not in (None, CONSENSUS) and not _covered(chain), chain.issuer == ACCREDITED
        found = (
            (not chain.number.strip(), "number", say("the number of the certificate is not stated")),
            (not chain.laboratory.strip(), "laboratory", say("who issued the certificate is not stated")),
            (chain.issuer is None, "issuer",
             say("whether its issuer is a national metrology institute or an accredited laboratory is not stated")),
            (chain.issuer == CONSENSUS, "issuer",
             say("a value by consensus is no route to the SI for lengths and temperatures")),
            (bare and not chain.evidence.strip(),
             "arrangement" if chain.issuer in (NATIONAL, ACCREDITED) else "evidence",
             say("no arrangement covers this calibration, and no evidence of the issuer's competence is named")),
            (accredited and not chain.accreditation.strip(), "accreditation",
             say("the number of the issuer's accreditation is not stated")),
            (accredited and not chain.accredited_by.strip(), "accredited_by", say("who accredited the issuer is not stated")),
            (chain.date is None, "date", say("the date of the certificate is not stated")),
            (chain.until is None, "due", say("until when the calibration holds is not stated")),
            (bool(self.another), "serial", say("the temperatures were read from {serial}", serial=Verbatim(self.another))),
        )  # fmt: skip
        yield from ((what, f"{self.table} {key}") for lacks, key, what in found if lacks)
        yield from chain.denials(self.day, self.table)

    @property
    def sentence(self) -> Text:
        """What was calibrated, by which certificate and by what right, or what of that is not shown."""
        if self.chain is None:
            return say("{what:capital}: no certificate is stated.", what=self.what)
        if lacks := [what for what, _ in self.lacks()]:
            return say("{what:capital}: {lacks}.", what=self.what, lacks=semicolons(lacks))
        certificate = commas((
            say("certificate {number} of {date}", number=Verbatim(self.chain.number), date=day(self.chain.date or self.day)),
            say("issued by {laboratory}", laboratory=Verbatim(self.chain.laboratory)), right(self.chain),
            say("valid until {date}", date=day(self.chain.until or self.day)),
        ))  # fmt: skip
        return say("{what:capital}: {certificate}.", what=self.what, certificate=certificate)


def _covered(chain: Traceability) -> bool:
    return chain.issuer in (NATIONAL, ACCREDITED) and chain.arrangement is not None


def right(chain: Traceability) -> Text:
    """By what right an issuer calibrates, with the route of ILAC-P10:07/2020; nothing where it is not stated."""
    held = say("; evidence held: {evidence}", evidence=Verbatim(chain.evidence)) if chain.evidence.strip() else NOTHING
    if chain.issuer == NATIONAL and chain.arrangement is not None:
        return say("a national metrology institute whose service the CIPM MRA covers (route 1 of ILAC-P10:07/2020)")
    if chain.issuer == ACCREDITED and chain.arrangement is not None:
        return say(
            "accredited by {body} ({number}), a signatory of the {arrangement} (route 2 of ILAC-P10:07/2020)",
            body=Verbatim(chain.accredited_by), number=Verbatim(chain.accreditation), arrangement=Verbatim(chain.arrangement),
        )  # fmt: skip
    if chain.issuer == NATIONAL:
        return say(
            "a national metrology institute, by a service that the CIPM MRA does not cover (route 3a of ILAC-P10:07/2020"
            "{held})", held=held,
        )  # fmt: skip
    if chain.issuer in (ACCREDITED, OTHER):
        return say("a laboratory that no arrangement covers (route 3b of ILAC-P10:07/2020{held})", held=held)
    if chain.issuer == artefacts.IN_HOUSE:
        return say("an in-house calibration (ILAC-P10:07/2020, 2{held})", held=held)
    if chain.issuer == MATERIAL:
        return say("a certified reference material (ILAC-P10:07/2020{held})", held=held)
    return say("by consensus") if chain.issuer == CONSENSUS else NOTHING


@dataclass(frozen=True)
class TraceabilityChain:
    """What results are traceable to, a statement that follows from no certificate or stands before it, the claim."""

    links: tuple[Link, ...]
    said: Text
    claim: Claim

    @property
    def statement(self) -> Text:
        """To what the results are traceable and by which certificates, or what of that is not shown."""
        if self.said and not self.links:
            return self.said
        head = _KELVIN if self.claim == "traceable" and any(link.kelvin for link in self.links) else _HEADS[self.claim]
        links = [link for link in self.links if self.claim != "not shown" or link.claim == "not shown"]
        return sentences([*([self.said] if self.said else []), head, *(link.sentence for link in links)])

    @property
    def lacks(self) -> tuple[Lack, ...]:
        """All that a claim of traceability lacks."""
        if self.said == OWN_MACHINE:
            return (CIRCULAR,)
        return tuple(
            (say("traceability ({what}: {lack})", what=link.what, lack=lack), key)
            for link in self.links for lack, key in link.lacks()
        )  # fmt: skip


def chain_of(job: Job, read: Collection[str] = ()) -> TraceabilityChain:
    """To what the results of a job are traceable."""
    facts = job.facts
    if job.origin != MEASURED:
        return TraceabilityChain((), NOT_MEASURED, "not shown")
    if facts.recording.earlier:
        return TraceabilityChain((), CHANGES, "none needed")
    certified = ((facts.artefact.traced and facts.artefact, say("artefact"), "artefact"),
                 (facts.short_gauge, say("short gauge"), "short_gauge"))  # fmt: skip
    links = [
        Link(what, f"[{table}.certificate]", of.certificate, facts.job.date) for of, what, table in certified if of
    ]
    if not links:
        return TraceabilityChain((), UNCALIBRATED, "none needed")
    links += _temperatures(job, read)
    if facts.artefact.traced and facts.certified_on_this_machine:
        return TraceabilityChain((), OWN_MACHINE, "not shown")
    claims = {link.claim for link in links}
    worst: Claim = "not shown" if "not shown" in claims else "by evidence" if "by evidence" in claims else "traceable"
    return TraceabilityChain(tuple(links), NOTHING if facts.artefact.traced else GAUGE_ALONE, worst)


def _temperatures(job: Job, read: Collection[str]) -> Iterator[Link]:
    """Of the thermometers of the artefact and of what the effects go by; columns without one are named."""
    gauge = () if job.short_gauge is None else job.short_gauge.points.columns
    recorded = {name for name in (*job.points.columns, *gauge) if name.startswith("temp_") and name.endswith("_c")}
    columns = recorded & {ARTEFACT, *read}
    facts, date = job.facts, job.facts.job.date
    instruments = [] if job.acquired is None else job.acquired.said.instruments  # that a live recording is from
    for number, one in enumerate(facts.thermometer, 1):
        if own := sorted(columns & {*one.columns}):
            taken = (each.serial for each in instruments if not {*each.columns.values()}.isdisjoint(own))
            another = next((serial for serial in taken if serial and serial != one.serial), "")
            yield Link(one.called(own), f"[[thermometer]] {number} certificate", one.certificate, date, True, another)
    known = {name for one in facts.thermometer for name in one.columns}
    for name in sorted(columns - known):
        yield Link(artefacts.nameless([name]), "[[thermometer]] certificate", None, date, True)


def holds_on(chain: Traceability, day: dt.date) -> bool:
    """Whether a calibration holds on a day."""
    return chain.until is not None and (chain.date or day) <= day <= chain.until


def dates_out_of_order(of: Job) -> tuple[Text, ...]:
    """Dates of which one must not be earlier than the other and is, among them certificates that did not hold on the day."""
    job = of.facts.job
    date = None if job.date == NO_DATE else job.date
    found = None if of.as_found is None else of.as_found.job.date
    ordered: tuple[tuple[dt.date | None, dt.date | None, Text, str], ...] = (
        (job.issued, date, say("issued before it was measured"), "[job] issued"),
        (date, job.received, say("it was measured before it was received"), "[job] received"),
        (job.issued, job.replaces.date if job.replaces else None, say("issued before the certificate that it replaces"),
         "[job.replaces] date"),
        (date, found, say("the machine was found as it was after it was left"), AS_FOUND),
        (job.recalibration_agreed, date, say("the next calibration is agreed for a day before this one"),
         "[job] recalibration_agreed"),
    )  # fmt: skip
    wrong = [
        (commas((what, say("{first} against {second}", first=day(first), second=day(second)))), at)
        for first, second, what, at in ordered if first and second and first < second
    ]  # fmt: skip
    denied = [(commas((what, lack)), at) for what, lack, at in (of.denials() if date else ())]
    return tuple(say("Dates out of order: {what}{key}.", what=what, key=at_key(at)) for what, at in (*denied, *wrong))
