"""Administrative data of a digital certificate: from the job; what it does not state says so.

A recording that nobody measured, a draft and an interim check are no certificates: their identifier begins with that, in
capitals, their laboratory is named as nobody, and no word of conformity is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from cmm_uq.base.languages.translation import ENGLISH, Code, translated as said_in
from cmm_uq.base.messages import Day, Number, Text, Verbatim, say
from cmm_uq.base.units import UNITS
from cmm_uq.certificate.clauses import DRAFT, NOT_OURS, STATEMENTS, certifies, draft, replaced_certificate
from cmm_uq.certificate.origin import BANNERS
from cmm_uq.certificate.results.reissue import Reissue
from cmm_uq.certificate.sections.traceability import claimed
from cmm_uq.jobs.dcc.certificate import (
    CalibrationLaboratory,
    Contact,
    CoreData,
    IdentificationNumber,
    Item,
    Items,
    LanguageText,
    Location,
    PerformanceLocation,
    Person,
    PrimitiveQuantity,
    RefTypeDefinition,
    ReplacedReport,
    Rich,
    Somebody,
    StatementMetadata,
    Words,
)
from cmm_uq.jobs.dcc.quantities import RealList
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.origin import MEASURED

SayIn = Callable[[Text], Mapping[str, str]]
"""A text by language, ISO 639-1."""

NOT_STATED = say("not stated")


def speaking(code: Code) -> SayIn:
    """What says a text in a language, and in English beside it."""

    def say_in(text: Text) -> Mapping[str, str]:
        codes = (code,) if code == ENGLISH else (code, ENGLISH)
        return {one: str.__str__(said_in(text, one)) for one in codes}

    return say_in


def said(text: str, say_in: SayIn) -> tuple[LanguageText, ...]:
    """In each language; without one where nobody may translate it."""
    if isinstance(text, Text) and not isinstance(text, Verbatim | Number | Day):
        return tuple(LanguageText(spoken, language) for language, spoken in say_in(text).items())
    return (LanguageText(str.__str__(text)),)


def words_of(text: str, say_in: SayIn) -> Words:
    return Words(said(text, say_in))


def rich_of(texts: Iterable[str], say_in: SayIn) -> Rich:
    """Paragraphs: all of one language, then all of the next."""
    found: dict[str | None, list[LanguageText]] = {}
    for text in texts:
        for one in said(text, say_in):
            found.setdefault(one.language, []).append(one)
    return Rich(contents=tuple(one for spoken in found.values() for one in spoken))


def english(texts: Iterable[str]) -> Rich:
    """Sentences of results.json, which is English in every language."""
    return Rich(contents=tuple(LanguageText(text, "en") for text in texts))


def one_line(text: str) -> str:
    """A text for an element that takes no spaces at its ends."""
    return " ".join(str.__str__(text).split())


UNKNOWN_COUNTRY = "ZZ"
"""Of no country: ISO 3166-1 leaves this code to users, and CLDR takes it for an unknown one."""

_INTERIM = say("INTERIM CHECK, not a calibration certificate")
_NOBODY = say("nobody: nothing is certified")


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


def core_data(job: Job, languages: Sequence[str], say_in: SayIn) -> CoreData:
    facts = job.facts.job
    number, mark = one_line(facts.number or facts.id), mark_of(job)
    known = [
        ("calibrationLaboratory", facts.id, say("Job"), "cmm_job"),
        ("customer", facts.order, say("Order"), "basic_orderNumber"),
    ]
    return CoreData(
        country=job.facts.laboratory.country or UNKNOWN_COUNTRY,
        languages=tuple(languages),
        mandatory_languages=tuple(languages)[:1],
        identifier=number if mark is None else f"{mark.word}-{number}",
        identifications=tuple(
            IdentificationNumber(issuer=issuer, value=one_line(value), name=words_of(name, say_in), ref_type=(ref_type,))
            for issuer, value, name, ref_type in known if value
        ),
        received=facts.received,
        begin=facts.date,
        end=facts.date,
        location=PerformanceLocation(place="other"),
        issued=facts.issued if certifies(job) else None,
        replaced=None if facts.replaces is None
        else ReplacedReport(change="substituted", identifier=one_line(facts.replaces.number)),
    )  # fmt: skip


def items(job: Job, say_in: SayIn) -> Items:
    machine = job.facts.machine
    serial = IdentificationNumber(
        issuer="manufacturer",
        value=one_line(machine.serial) or str.__str__(NOT_STATED),
        name=words_of(say("Serial number"), say_in),
        ref_type=("basic_serialNumber",),
    )
    item = Item(
        id="machine",
        name=words_of(Verbatim(machine.name), say_in),
        description=None if (mark := mark_of(job)) is None else rich_of((mark.banner,), say_in),
        manufacturer=Somebody(name=words_of(Verbatim(machine.manufacturer), say_in)) if machine.manufacturer else None,
        model=one_line(machine.model) or None,
        identifications=(serial,),
        quantities=tuple(_travel(job, say_in)),
    )
    owner = _contact(machine.owner, "", say_in) if machine.owner else None
    return Items(owner=owner, items=(item,))


def _travel(job: Job, say_in: SayIn) -> Iterator[PrimitiveQuantity]:
    for axis in "xyz":
        if travel := getattr(job.facts.machine.travel_mm, axis):
            name = words_of(say("Measuring range of {axis}", axis=Verbatim(axis.upper())), say_in)
            values = tuple(Decimal(repr(float(end))) for end in travel)
            ends = RealList(labels=("lowest", "highest"), values=values, units=(UNITS["mm"].dsi,))
            yield PrimitiveQuantity(id=f"travel_{axis}", name=name, value=ends, ref_type=("cmm_measuringRange",))


def laboratory(job: Job, say_in: SayIn) -> CalibrationLaboratory:
    """Who answers for the certificate; nobody where nothing is certified."""
    facts = job.facts.laboratory
    if not certifies(job):
        return CalibrationLaboratory(contact=Contact(name=words_of(_NOBODY, say_in), location=_location("", say_in)))
    code = one_line(facts.accreditation) or None
    return CalibrationLaboratory(code=code, contact=_contact(facts.name, facts.address, say_in))


def persons(job: Job, say_in: SayIn) -> tuple[Person, ...]:
    """Who authorises the certificate, and who measured."""
    facts, found = job.facts.laboratory, []
    if not certifies(job):
        return (Person(person=Somebody(name=words_of(_NOBODY, say_in))),)
    if facts.signatory:
        found.append(
            Person(person=Somebody(name=words_of(Verbatim(facts.signatory), say_in)),
                   role=one_line(facts.signatory_role) or None, main_signer=True)
        )  # fmt: skip
    if job.facts.job.operator:
        who = Somebody(name=words_of(Verbatim(job.facts.job.operator), say_in))
        found.append(Person(person=who, role="operator", main_signer=False))
    return tuple(found) or (Person(person=Somebody(name=words_of(NOT_STATED, say_in))),)


def customer(job: Job, say_in: SayIn) -> Contact:
    return _contact(job.facts.job.customer, job.facts.job.address, say_in)


def formal_statements(job: Job, results: Mapping[str, Any], say_in: SayIn) -> tuple[StatementMetadata, ...]:
    """What it is not, what the results relate to, how they are traceable, what it replaces, when the next is agreed."""

    def stated(name: Text, texts: Iterable[Text], **more: Any) -> StatementMetadata:
        return StatementMetadata(name=words_of(name, say_in), declaration=rich_of(texts, say_in), **more)

    facts, mark, found = job.facts.job, mark_of(job), []
    if mark is not None:
        found.append(stated(mark.banner, (mark.banner,), valid=False, ref_type=("cmm_notACertificate",)))
    if certifies(job):
        chain = claimed(job)
        found += [
            StatementMetadata(declaration=rich_of((text,), say_in), ref_type=("cmm_general",)) for text in STATEMENTS
        ]
        found.append(stated(say("Traceability"), (chain.statement,), traceable=chain.claim == "traceable",
                            ref_type=("basic_metrologicallyTraceableToSI",)))  # fmt: skip
    if (replaces := facts.replaces) is not None:
        told: list[Text] = [replaced_certificate(replaces), Verbatim(replaces.reason), Verbatim(replaces.changed)]
        if (comparison := Reissue.of_results(results)) is not None:
            told += [comparison.sentence, *(one.sentence for one in comparison.differences)]
        found.append(stated(say("Replaces certificate"), told, ref_type=("basic_revision",)))
    if facts.recalibration_agreed:
        name = words_of(say("Next calibration, as agreed with the customer"), say_in)
        found.append(StatementMetadata(name=name, date=facts.recalibration_agreed, ref_type=("basic_recalibration",)))
    further = [
        (say("Place"), facts.place), (say("Deviations from the method"), facts.deviations),
        (say("Results of external providers"), facts.external), (say("Data from the customer"), facts.from_customer),
        (say("Remarks"), facts.remarks),
    ]  # fmt: skip
    for what, text in further:
        if text:
            found.append(stated(what, (Verbatim(text), *((NOT_OURS,) if text is facts.from_customer else ()))))
    return tuple(found)


def ref_types(say_in: SayIn) -> tuple[RefTypeDefinition, ...]:
    return (
        RefTypeDefinition(
            name=words_of(say("Good practice of the DCC: names that all fields of calibration share"), say_in),
            namespace="basic", link="https://digilab.ptb.de/dkd/refType/vocab/index.php",
        ),
        RefTypeDefinition(
            name=words_of(say("Names of this program for coordinate measuring machines"), say_in),
            description=rich_of(
                (say("What stands under a key of results.json has its path as id and its first key as refType."),), say_in
            ),
            namespace="cmm", link="docs/dcc.md",
        ),
    )  # fmt: skip


def _contact(name: str, address: str, say_in: SayIn) -> Contact:
    named = Verbatim(name) if name else NOT_STATED
    return Contact(name=words_of(named, say_in), location=_location(address, say_in))


def _location(address: str, say_in: SayIn) -> Location:
    lines = [Verbatim(line.strip()) for line in address.splitlines() if line.strip()]
    return Location(further=(rich_of(lines or (NOT_STATED,), say_in),))
