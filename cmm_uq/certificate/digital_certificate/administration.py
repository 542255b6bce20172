"""What a digital certificate says of the job: administrative data, and how it was measured; what is not stated says so.

A recording that nobody measured, a draft and an interim check are no certificates: their identifier begins with that, in
capitals, their laboratory is named as nobody, and no word of conformity is said.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from decimal import Decimal
from typing import Any

from cmm_uq.base.languages.translation import ENGLISH, Code, translated
from cmm_uq.base.messages import Day, Number, Text, Verbatim, day, say
from cmm_uq.base.units import MICROMETRE, UNITS
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.clauses import DRAFT, NOT_OURS, STATEMENTS, certifies, claimed, draft, replaced_certificate
from cmm_uq.certificate.origin import BANNERS, made_after
from cmm_uq.certificate.results.provenance import Reissue
from cmm_uq.certificate.wording import SIGN, TEMPERATURES, UNCERTAINTY
from cmm_uq.jobs.chain import holds_on, right
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.artefact import CertificateFile, Traceability
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.laboratory.records.facts import KEY, ChainHead

NOT_STATED = say("not stated")
P_STANDARD = Decimal("0.6827")  # probability of a normal distribution within one standard deviation
UNKNOWN_COUNTRY = "ZZ"  # of no country: ISO 3166-1 leaves this code to users, and CLDR takes it for an unknown one
_INTERIM = say("INTERIM CHECK, not a calibration certificate")
_NOBODY = say("nobody: nothing is certified")


@dataclass(frozen=True)
class Languages:
    """Makes elements with texts in a language (ISO 639-1), and in English beside it."""

    code: Code

    @property
    def codes(self) -> tuple[Code, ...]:
        return (self.code,) if self.code == ENGLISH else (self.code, ENGLISH)

    def __call__(self, kind: str, **fields: Any) -> Any:
        """An element: words of a text, paragraphs of one or several, a single refType; what is empty is left out."""
        cls = dcc.CLASSES[kind]
        return cls(**{name: self._of_field(cls.FIELDS[name], value) for name, value in fields.items()})

    def _of_field(self, field: dcc.Field, value: Any) -> Any:
        kinds = tuple(field.tags.values())
        if isinstance(value, str):
            if kinds == ("Words",):
                return self.words(value)
            if field.name == "ref_type":
                return (value,)
            if not field.repeated and field.kind == "element" and kinds == ("",):
                return one_line(value) or (value if field.required else None)
        if kinds == ("Rich",) and value is not None and not isinstance(value, dcc.Rich) and not field.repeated:
            return self.rich(*([value] if isinstance(value, str) else value)) if value else None
        return value

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
    known = (
        ("calibrationLaboratory", facts.id, say("Job"), "cmm_job"),
        ("customer", facts.order, say("Order"), "basic_orderNumber"),
    )
    replaces = facts.replaces
    return texts(
        "CoreData", country=job.facts.laboratory.country or UNKNOWN_COUNTRY, languages=texts.codes,
        mandatory_languages=texts.codes[:1], identifier=number if mark is None else f"{mark.word}-{number}",
        identifications=tuple(
            texts("IdentificationNumber", issuer=issuer, value=value, name=name, ref_type=ref_type)
            for issuer, value, name, ref_type in known if value
        ),
        received=facts.received, begin=facts.date, end=facts.date, location=dcc.PerformanceLocation(place="other"),
        issued=facts.issued if certifies(job) else None,
        replaced=replaces and texts("ReplacedReport", change="substituted", identifier=replaces.number),
    )  # fmt: skip


def _serial(serial: str, texts: Languages) -> tuple[dcc.IdentificationNumber, ...]:
    """A serial number; nothing where it is not stated."""
    named = {"name": say("Serial number"), "ref_type": "basic_serialNumber"}
    return (texts("IdentificationNumber", issuer="manufacturer", value=serial, **named),) if serial.strip() else ()


def items(job: Job, texts: Languages) -> dcc.Items:
    machine, mark, travels = job.facts.machine, mark_of(job), []
    for axis in "xyz":
        if travel := getattr(machine.travel_mm, axis):
            values = tuple(Decimal(repr(float(end))) for end in travel)
            ends = dcc.RealList(labels=("lowest", "highest"), values=values, units=(UNITS["mm"].dsi,))
            name = say("Measuring range of {axis}", axis=Verbatim(axis.upper()))
            named = {"id": f"travel_{axis}", "name": name, "ref_type": "cmm_measuringRange"}
            travels.append(texts("PrimitiveQuantity", value=ends, **named))
    item = texts(
        "Item", id="machine", name=Verbatim(machine.name), description=mark and mark.banner,
        manufacturer=somebody(machine.manufacturer, texts), model=machine.model, quantities=tuple(travels),
        identifications=_serial(machine.serial if machine.serial.strip() else str.__str__(NOT_STATED), texts),
    )  # fmt: skip
    return dcc.Items(owner=_contact(machine.owner, "", texts) if machine.owner else None, items=(item,))


def somebody(name: str | None, texts: Languages) -> dcc.Somebody | None:
    return texts("Somebody", name=name if isinstance(name, Text) else Verbatim(name)) if name else None


def laboratory(job: Job, texts: Languages) -> dcc.CalibrationLaboratory:
    """Who answers for the certificate; nobody where nothing is certified."""
    facts = job.facts.laboratory
    if not certifies(job):
        return dcc.CalibrationLaboratory(contact=_contact(_NOBODY, "", texts))
    return texts("CalibrationLaboratory", code=facts.accreditation, contact=_contact(facts.name, facts.address, texts))


def persons(job: Job, texts: Languages) -> tuple[dcc.Person, ...]:
    facts, operator = job.facts.laboratory, job.facts.job.operator
    if not certifies(job):
        return (dcc.Person(person=somebody(_NOBODY, texts)),)
    known = ((facts.signatory, facts.signatory_role, True), (operator, "operator", False))
    return tuple(
        texts("Person", person=somebody(name, texts), role=role, main_signer=signs) for name, role, signs in known if name
    ) or (dcc.Person(person=somebody(NOT_STATED, texts)),)  # fmt: skip


def customer(job: Job, texts: Languages) -> dcc.Contact:
    return _contact(job.facts.job.customer, job.facts.job.address, texts)


def formal_statements(job: Job, results: Mapping[str, Any], texts: Languages) -> tuple[dcc.StatementMetadata, ...]:
    """What it is not, what the results relate to, how they are traceable, what it replaces, when the next is agreed."""
    facts, mark, found = job.facts.job, mark_of(job), list[dcc.StatementMetadata]()

    def state(name: Text | None, *paragraphs: Text, **more: Any) -> None:
        found.append(texts("StatementMetadata", name=name, declaration=paragraphs, **more))

    if mark is not None:
        state(mark.banner, mark.banner, valid=False, ref_type="cmm_notACertificate")
    if certifies(job):
        for general in STATEMENTS:
            state(None, general, ref_type="cmm_general")
        chain, ref_type = claimed(job), "basic_metrologicallyTraceableToSI"
        state(say("Traceability"), chain.statement, traceable=chain.claim == "traceable", ref_type=ref_type)
    if (replaces := facts.replaces) is not None:
        paragraphs: list[Text] = [replaced_certificate(replaces), Verbatim(replaces.reason), Verbatim(replaces.changed)]
        if (comparison := Reissue.of_results(results)) is not None:
            paragraphs += [comparison.sentence, *(difference.sentence for difference in comparison.differences)]
        state(say("Replaces certificate"), *paragraphs, ref_type="basic_revision")
    if facts.recalibration_agreed:
        agreed = say("Next calibration, as agreed with the customer")
        state(agreed, date=facts.recalibration_agreed, ref_type="basic_recalibration")
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
    known = (
        (say("Good practice of the DCC: names that all fields of calibration share"), None, "basic",
         "https://digilab.ptb.de/dkd/refType/vocab/index.php"),
        (say("Names of this program for coordinate measuring machines"), path, "cmm", "docs/dcc.md"),
    )  # fmt: skip
    names = ("name", "description", "namespace", "link")
    return tuple(texts("RefTypeDefinition", **dict(zip(names, row, strict=True))) for row in known)


def _contact(name: str, address: str, texts: Languages) -> dcc.Contact:
    lines: list[Text] = [Verbatim(line.strip()) for line in address.splitlines() if line.strip()]
    known = name if isinstance(name, Text) else Verbatim(name) if name else NOT_STATED
    return texts("Contact", name=known, location=dcc.Location(further=(texts.rich(*(lines or [NOT_STATED])),)))


NO_HASH = "none"  # procedure and value of the hash of a certificate that is not at hand as a file
_KELVIN = Decimal("273.15")


def methods(job: Job, results: Mapping[str, Any], texts: Languages) -> tuple[dcc.Method, ...]:
    """As the job states it, and how values and uncertainties follow."""
    standards = tuple(dict.fromkeys(one_line(entry["standard"]) for entry in results.get("conformity", ())))
    stated = job.facts.job.procedure
    name, of_uncertainty = say("Calibration of a coordinate measuring machine"), "basic_methodMeasurementUncertainty"
    return (
        texts("Method", name=name, description=Verbatim(stated) if stated else NOT_STATED, norms=standards,
              ref_type="basic_calibrationMethod"),
        texts("Method", name=say("Measurement uncertainty"), description=(UNCERTAINTY, SIGN), ref_type=of_uncertainty,
              references=("JCGM 100:2008", "JCGM 101:2008")),
    )  # fmt: skip


def software(results: Mapping[str, Any], texts: Languages) -> tuple[dcc.Software, ...]:
    used = results["software"]
    named = {used["name"]: used["version"], **used.get("plugins", {})}
    return tuple(
        texts("Software", name=Verbatim(name), release=version, type="application" if not i else "library")
        for i, (name, version) in enumerate(named.items())
    )


def equipment(job: Job, results: Mapping[str, Any], texts: Languages) -> dcc.Equipments:
    """The artefact, the short gauge, and instruments of a recording that was taken live."""

    def reference(
        name: str, serial: str, chain: Traceability | None, *certified: dcc.PrimitiveQuantity
    ) -> dcc.Equipment:
        return texts("Equipment", name=Verbatim(name), certificate=_certificate(job, chain, texts), quantities=certified,
                     identifications=_serial(serial, texts), ref_type="basic_normalUsed")  # fmt: skip

    facts, gauge = job.facts.artefact, job.facts.short_gauge
    u_um = float(facts.u_of(facts.length_mm or 0.0))
    if facts.u_um is None and "length_mm" in (certified := results.get("certified", {})):
        u_um = certified["length_mm"]["u"] / MICROMETRE  # of its points, by themselves
    quantities = _certified("certified", facts.length_mm, u_um, facts.cte_per_k, texts)
    found = [reference(facts.name or facts.kind, facts.serial, facts.certificate, *quantities)]
    if gauge is not None:
        quantities = _certified("short_gauge", gauge.length_mm, gauge.u_um, gauge.cte_per_k, texts)
        name = gauge.name or str.__str__(say("Short gauge"))
        found.append(reference(name, gauge.serial, gauge.certificate, *quantities))
    found += [
        reference(each.name or str.__str__(say("Thermometer")), each.serial, each.certificate)
        for each in job.facts.thermometer
    ]
    found += [
        texts("Equipment", name=Verbatim(each.name), model=each.model, manufacturer=somebody(each.maker, texts),
              certificate=_referral(each.certificate, texts) if each.certificate else None,
              identifications=_serial(each.serial or "", texts), ref_type="cmm_instrument")
        for each in ([] if job.acquired is None else job.acquired.said.instruments)
    ]  # fmt: skip
    return dcc.Equipments(equipment=tuple(found))


def _certificate(job: Job, chain: Traceability | None, texts: Languages) -> dcc.Hash | None:
    """Of the artefact: its number, who issued it and when; with the SHA-256 of its file where the job has one."""
    if chain is None:
        return None
    file = chain.file if isinstance(chain, CertificateFile) else None
    number = one_line(chain.number) or (file or str.__str__(NOT_STATED))
    described: list[Text] = [Verbatim(chain.laboratory)] if chain.laboratory else []
    described += [say("of {date}", date=day(chain.date))] if chain.date else []
    described += [say("due {date}", date=day(chain.until))] if chain.until else []
    described += [say("{right:capital}", right=right(chain))] if right(chain) else []
    digest = sha256(job.inputs)[file] if file is not None and file in job.inputs else None
    valid = None if chain.until is None else holds_on(chain, job.facts.job.date)
    return _referral(number, texts, digest, description=described, in_validity_range=valid)


def _referral(number: str, texts: Languages, digest: str | None = None, **more: Any) -> dcc.Hash:
    return texts("Hash", referral=say("Calibration certificate"), referral_id=number, value=digest or NO_HASH,
                 procedure="SHA-256" if digest else NO_HASH, **more)  # fmt: skip


def _certified(
    owner: str, length: float | None, u_um: float | None, cte: float, texts: Languages
) -> tuple[dcc.PrimitiveQuantity, ...]:
    u = Decimal(repr(float(u_um or 0.0))).scaleb(-3)
    spread = {"factor": Decimal(1), "probability": P_STANDARD, "distribution": "normal"}
    stated = dcc.Expanded(uncertainty=u, **spread) if u else None
    known = (
        ("length", say("Certified length"), length, "mm", stated),
        ("cte", say("Coefficient of thermal expansion"), cte or None, "1/K", None),
    )
    return tuple(
        texts("PrimitiveQuantity", id=f"{owner}_{key}", name=name, ref_type="basic_referenceValue",
              value=dcc.Real(value=Decimal(repr(float(value))), unit=UNITS[unit].dsi, uncertainty=uncertainty))
        for key, name, value, unit, uncertainty in known if value is not None
    )  # fmt: skip


def conditions(job: Job, texts: Languages) -> tuple[dcc.InfluenceCondition, ...]:
    """As the job states them, and the least and largest recorded temperatures, in K and in °C."""
    found: list[tuple[Text, tuple[Any, ...], str]] = []
    if job.facts.job.conditions:
        parts = (texts.rich(Verbatim(job.facts.job.conditions)),)
        found.append((say("Conditions"), parts, "cmm_conditions"))
    for column, what in TEMPERATURES.items():
        if column in job.points.columns:
            values = job.points.columns[column]
            ends = (
                _temperature(f"{column}.min", say("Lowest temperature"), values.min(), "basic_temperatureMin", texts),
                _temperature(f"{column}.max", say("Highest temperature"), values.max(), "basic_temperatureMax", texts),
            )
            found.append((say("Temperature: {what}", what=what), ends, "basic_temperature"))
    return tuple(
        texts("InfluenceCondition", name=name, data=dcc.Data(parts=parts), ref_type=ref_type)
        for name, parts, ref_type in found
    )


def _temperature(id_: str, name: Text, celsius: float, ref_type: str, texts: Languages) -> dcc.DccQuantity:
    shown = Decimal(repr(float(celsius)))
    kelvin = dcc.Real(value=shown + _KELVIN, unit=UNITS["K"].dsi)
    both = dcc.Hybrid(values=(kelvin, dcc.Real(value=shown, unit=UNITS["°C"].dsi)))
    return texts("DccQuantity", id=id_, name=name, value=both, ref_type=ref_type)


def metadata(results: Mapping[str, Any], texts: Languages) -> tuple[dcc.StatementMetadata, ...]:
    """From which files it can be computed again, how the records stood, and what was odd in the recording."""
    again = [f"{name} SHA-256 {digest}" for name, digest in results["job"]["inputs_sha256"].items()]
    if (seed := results.get("sampling", {}).get("seed")) is not None:
        again.append(f"seed {seed}")
    name = say("Inputs, from which every figure follows again")
    stated = [texts("StatementMetadata", name=name, declaration=[*map(Verbatim, again)], ref_type="cmm_inputs")]
    if KEY in results:
        name, made = say("Records of the laboratory"), made_after(ChainHead.of_results(results))
        stated.append(texts("StatementMetadata", name=name, declaration=made, ref_type="cmm_records"))
    if odd := [each["why"] for each in results.get("screening", ())]:
        name = say("What is odd in the recording")
        stated.append(texts("StatementMetadata", name=name, declaration=english(odd), ref_type="cmm_screening"))
    return tuple(stated)
