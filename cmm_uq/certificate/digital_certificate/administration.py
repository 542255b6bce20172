"""Administrative data of a digital certificate: from the job; what it does not state says so.

A recording that nobody measured, a draft and an interim check are no certificates: their identifier begins with that, in
capitals, their laboratory is named as nobody, and no word of conformity is said.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from cmm_uq.base.languages.translation import ENGLISH, Code, translated
from cmm_uq.base.messages import Day, Number, Text, Verbatim, say
from cmm_uq.base.units import UNITS
from cmm_uq.certificate.clauses import DRAFT, NOT_OURS, STATEMENTS, certifies, draft, replaced_certificate
from cmm_uq.certificate.origin import BANNERS
from cmm_uq.certificate.results.reissue import Reissue
from cmm_uq.certificate.sections.traceability import claimed
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.dcc.quantities import RealList
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.origin import MEASURED

NOT_STATED = say("not stated")
UNKNOWN_COUNTRY = "ZZ"  # of no country: ISO 3166-1 leaves this code to users, and CLDR takes it for an unknown one
_INTERIM = say("INTERIM CHECK, not a calibration certificate")
_NOBODY = say("nobody: nothing is certified")


@dataclass(frozen=True)
class Languages:
    """What says texts in a language (ISO 639-1), and in English beside it."""

    code: Code

    @property
    def codes(self) -> tuple[Code, ...]:
        return (self.code,) if self.code == ENGLISH else (self.code, ENGLISH)

    def _contents(self, text: str) -> tuple[dcc.LanguageText, ...]:
        """In each language; without one where nobody may translate it."""
        if isinstance(text, Text) and not isinstance(text, Verbatim | Number | Day):
            return tuple(dcc.LanguageText(str.__str__(translated(text, code)), code) for code in self.codes)
        return (dcc.LanguageText(str.__str__(text)),)

    def words(self, text: str) -> dcc.Words:
        return dcc.Words(self._contents(text))

    def rich(self, *texts: str) -> dcc.Rich:
        """Paragraphs: all of one language, then all of the next."""
        contents = [part for text in texts for part in self._contents(text)]
        languages = dict.fromkeys(part.language for part in contents)
        return dcc.Rich(contents=tuple(part for code in languages for part in contents if part.language == code))


def english(texts: Iterable[str]) -> dcc.Rich:
    """Sentences of results.json, which is English in every language."""
    return dcc.Rich(contents=tuple(dcc.LanguageText(text, "en") for text in texts))


def one_line(text: str) -> str:
    """A text for an element that takes no spaces at its ends."""
    return " ".join(str.__str__(text).split())


@dataclass(frozen=True)
class Mark:
    """Why this is no certificate: a word that its identifier begins with, and what is said of it."""

    word: str
    banner: Text


def mark_of(job: Job) -> Mark | None:
    """Why what is made of a job is no certificate; None where it is one."""
    if job.origin != MEASURED:
        return Mark(f"{job.origin.upper()}-NOT-A-CERTIFICATE", BANNERS[job.origin])
    if not certifies(job):
        return Mark("INTERIM-NOT-A-CERTIFICATE", _INTERIM)
    return Mark("DRAFT", DRAFT) if draft(job) else None


def core_data(job: Job, texts: Languages) -> dcc.CoreData:
    facts, mark = job.facts.job, mark_of(job)
    number = one_line(facts.number or facts.id)
    known = [
        ("calibrationLaboratory", facts.id, say("Job"), "cmm_job"),
        ("customer", facts.order, say("Order"), "basic_orderNumber"),
    ]
    return dcc.CoreData(
        country=job.facts.laboratory.country or UNKNOWN_COUNTRY,
        languages=texts.codes,
        mandatory_languages=texts.codes[:1],
        identifier=number if mark is None else f"{mark.word}-{number}",
        identifications=tuple(
            dcc.IdentificationNumber(issuer=issuer, value=one_line(value), name=texts.words(name), ref_type=(ref_type,))
            for issuer, value, name, ref_type in known if value
        ),
        received=facts.received,
        begin=facts.date,
        end=facts.date,
        location=dcc.PerformanceLocation(place="other"),
        issued=facts.issued if certifies(job) else None,
        replaced=None if facts.replaces is None
        else dcc.ReplacedReport(change="substituted", identifier=one_line(facts.replaces.number)),
    )  # fmt: skip


def serial_number(serial: str, texts: Languages) -> dcc.IdentificationNumber:
    name = texts.words(say("Serial number"))
    return dcc.IdentificationNumber(issuer="manufacturer", value=serial, name=name, ref_type=("basic_serialNumber",))


def items(job: Job, texts: Languages) -> dcc.Items:
    machine, mark, travels = job.facts.machine, mark_of(job), []
    for axis in "xyz":
        if travel := getattr(machine.travel_mm, axis):
            name = texts.words(say("Measuring range of {axis}", axis=Verbatim(axis.upper())))
            values = tuple(Decimal(repr(float(end))) for end in travel)
            ends = RealList(labels=("lowest", "highest"), values=values, units=(UNITS["mm"].dsi,))
            ref_type = ("cmm_measuringRange",)
            travels.append(dcc.PrimitiveQuantity(id=f"travel_{axis}", name=name, value=ends, ref_type=ref_type))
    item = dcc.Item(
        id="machine",
        name=texts.words(Verbatim(machine.name)),
        description=None if mark is None else texts.rich(mark.banner),
        manufacturer=somebody(Verbatim(machine.manufacturer), texts) if machine.manufacturer else None,
        model=one_line(machine.model) or None,
        identifications=(serial_number(one_line(machine.serial) or str.__str__(NOT_STATED), texts),),
        quantities=tuple(travels),
    )
    return dcc.Items(owner=_contact(machine.owner, "", texts) if machine.owner else None, items=(item,))


def somebody(name: Text, texts: Languages) -> dcc.Somebody:
    return dcc.Somebody(name=texts.words(name))


def laboratory(job: Job, texts: Languages) -> dcc.CalibrationLaboratory:
    """Who answers for the certificate; nobody where nothing is certified."""
    facts = job.facts.laboratory
    if not certifies(job):
        return dcc.CalibrationLaboratory(contact=_contact(_NOBODY, "", texts))
    code = one_line(facts.accreditation) or None
    return dcc.CalibrationLaboratory(code=code, contact=_contact(facts.name, facts.address, texts))


def persons(job: Job, texts: Languages) -> tuple[dcc.Person, ...]:
    """Who authorises the certificate, and who measured."""
    facts, operator, found = job.facts.laboratory, job.facts.job.operator, []
    if not certifies(job):
        return (dcc.Person(person=somebody(_NOBODY, texts)),)
    if facts.signatory:
        signatory, role = somebody(Verbatim(facts.signatory), texts), one_line(facts.signatory_role) or None
        found.append(dcc.Person(person=signatory, role=role, main_signer=True))
    if operator:
        found.append(dcc.Person(person=somebody(Verbatim(operator), texts), role="operator", main_signer=False))
    return tuple(found) or (dcc.Person(person=somebody(NOT_STATED, texts)),)


def customer(job: Job, texts: Languages) -> dcc.Contact:
    return _contact(job.facts.job.customer, job.facts.job.address, texts)


def formal_statements(job: Job, results: Mapping[str, Any], texts: Languages) -> tuple[dcc.StatementMetadata, ...]:
    """What it is not, what the results relate to, how they are traceable, what it replaces, when the next is agreed."""
    facts, mark, found = job.facts.job, mark_of(job), list[dcc.StatementMetadata]()

    def state(name: Text, *paragraphs: Text, **more: Any) -> None:
        found.append(dcc.StatementMetadata(name=texts.words(name), declaration=texts.rich(*paragraphs), **more))

    if mark is not None:
        state(mark.banner, mark.banner, valid=False, ref_type=("cmm_notACertificate",))
    if certifies(job):
        chain = claimed(job)
        found += [dcc.StatementMetadata(declaration=texts.rich(text), ref_type=("cmm_general",)) for text in STATEMENTS]
        state(say("Traceability"), chain.statement, traceable=chain.claim == "traceable",
              ref_type=("basic_metrologicallyTraceableToSI",))  # fmt: skip
    if (replaces := facts.replaces) is not None:
        paragraphs: list[Text] = [replaced_certificate(replaces), Verbatim(replaces.reason), Verbatim(replaces.changed)]
        if (comparison := Reissue.of_results(results)) is not None:
            paragraphs += [comparison.sentence, *(difference.sentence for difference in comparison.differences)]
        state(say("Replaces certificate"), *paragraphs, ref_type=("basic_revision",))
    if facts.recalibration_agreed:
        name = texts.words(say("Next calibration, as agreed with the customer"))
        found.append(
            dcc.StatementMetadata(name=name, date=facts.recalibration_agreed, ref_type=("basic_recalibration",))
        )
    further = [
        (say("Place"), facts.place), (say("Deviations from the method"), facts.deviations),
        (say("Results of external providers"), facts.external), (say("Data from the customer"), facts.from_customer),
        (say("Remarks"), facts.remarks),
    ]  # fmt: skip
    for what, text in further:
        if text:
            state(what, Verbatim(text), *((NOT_OURS,) if text is facts.from_customer else ()))
    return tuple(found)


def ref_types(texts: Languages) -> tuple[dcc.RefTypeDefinition, ...]:
    path = say("What stands under a key of results.json has its path as id and its first key as refType.")
    return (
        dcc.RefTypeDefinition(
            name=texts.words(say("Good practice of the DCC: names that all fields of calibration share")),
            namespace="basic", link="https://digilab.ptb.de/dkd/refType/vocab/index.php",
        ),
        dcc.RefTypeDefinition(
            name=texts.words(say("Names of this program for coordinate measuring machines")),
            description=texts.rich(path), namespace="cmm", link="docs/dcc.md",
        ),
    )  # fmt: skip


def _contact(name: str, address: str, texts: Languages) -> dcc.Contact:
    lines: list[Text] = [Verbatim(line.strip()) for line in address.splitlines() if line.strip()]
    known = name if isinstance(name, Text) else Verbatim(name) if name else NOT_STATED
    return dcc.Contact(name=texts.words(known), location=dcc.Location(further=(texts.rich(*(lines or [NOT_STATED])),)))
