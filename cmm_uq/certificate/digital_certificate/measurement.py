"""How it was measured, in a digital certificate: methods, software, the artefact, conditions, metadata."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import Decimal
from typing import Any

from cmm_uq.base.messages import Text, Verbatim, day, say
from cmm_uq.base.units import MICROMETRE, UNITS, Unit
from cmm_uq.certificate.certificate import TEMPERATURES
from cmm_uq.certificate.digital_certificate.administration import (
    NOT_STATED,
    SayIn,
    english,
    one_line,
    rich_of,
    words_of,
)
from cmm_uq.certificate.digital_certificate.quantities import P_STANDARD
from cmm_uq.certificate.sections.results import SIGN, UNCERTAINTY
from cmm_uq.jobs.chain import holds_on, right
from cmm_uq.jobs.dcc.certificate import (
    Data,
    DccQuantity,
    Equipment,
    Equipments,
    Hash,
    IdentificationNumber,
    InfluenceCondition,
    Method,
    PrimitiveQuantity,
    Rich,
    Software,
    Somebody,
    StatementMetadata,
)
from cmm_uq.jobs.dcc.quantities import Expanded, Hybrid, Real
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.jobs.tables.artefact import CertificateFile, Traceability

NO_HASH = "none"
"""Procedure and value of the hash of a certificate that is not at hand as a file."""

_KELVIN = Decimal("273.15")


def methods(job: Job, results: Mapping[str, Any], say_in: SayIn) -> tuple[Method, ...]:
    """As the job states it, and how values and uncertainties follow."""
    standards = tuple(dict.fromkeys(one_line(one["standard"]) for one in results.get("conformity", ())))
    stated = job.facts.job.procedure
    return (
        Method(
            name=words_of(say("Calibration of a coordinate measuring machine"), say_in),
            description=rich_of((Verbatim(stated) if stated else NOT_STATED,), say_in),
            norms=standards, ref_type=("basic_calibrationMethod",),
        ),
        Method(
            name=words_of(say("Measurement uncertainty"), say_in), description=rich_of((UNCERTAINTY, SIGN), say_in),
            references=("JCGM 100:2008", "JCGM 101:2008"), ref_type=("basic_methodMeasurementUncertainty",),
        ),
    )  # fmt: skip


def software(results: Mapping[str, Any], say_in: SayIn) -> tuple[Software, ...]:
    """The program, and other packages that took part."""
    used = results["software"]
    named = {used["name"]: used["version"], **used.get("plugins", {})}
    return tuple(
        Software(name=words_of(Verbatim(name), say_in), release=one_line(version), type="application" if not i else "library")
        for i, (name, version) in enumerate(named.items())
    )  # fmt: skip


def equipment(job: Job, results: Mapping[str, Any], say_in: SayIn) -> Equipments:
    """The artefact, the short gauge, and instruments of a recording that was taken live."""
    facts, gauge = job.facts.artefact, job.facts.short_gauge
    u_um = float(facts.u_of(facts.length_mm or 0.0))
    if facts.u_um is None and "length_mm" in (certified := results.get("certified", {})):
        u_um = certified["length_mm"]["u"] / MICROMETRE  # of its points, by themselves
    found = [
        _reference(
            job, facts.name or facts.kind, facts.serial, facts.certificate, say_in,
            tuple(_certified("certified", say("Certified length"), facts.length_mm, u_um, facts.cte_per_k, say_in)),
        )
    ]  # fmt: skip
    if gauge is not None:
        quantities = _certified(
            "short_gauge", say("Certified length"), gauge.length_mm, gauge.u_um, gauge.cte_per_k, say_in
        )
        named = gauge.name or str.__str__(say("Short gauge"))
        found.append(_reference(job, named, gauge.serial, gauge.certificate, say_in, tuple(quantities)))
    found += [
        _reference(job, one.name or str.__str__(say("Thermometer")), one.serial, one.certificate, say_in, ())
        for one in job.facts.thermometer
    ]
    taken = [] if job.acquired is None else job.acquired.said.instruments
    found += [
        Equipment(
            name=words_of(Verbatim(one.name), say_in), model=one_line(one.model or "") or None,
            manufacturer=Somebody(name=words_of(Verbatim(one.maker), say_in)) if one.maker else None,
            certificate=_referral(one_line(one.certificate), say_in) if one.certificate else None,
            identifications=_serial(one.serial or "", say_in), ref_type=("cmm_instrument",),
        )
        for one in taken
    ]  # fmt: skip
    return Equipments(equipment=tuple(found))


def _reference(
    job: Job,
    name: str,
    serial: str,
    chain: Traceability | None,
    say_in: SayIn,
    quantities: tuple[PrimitiveQuantity, ...],
) -> Equipment:
    return Equipment(
        name=words_of(Verbatim(name), say_in), certificate=_certificate(job, chain, say_in),
        identifications=_serial(serial, say_in), quantities=quantities, ref_type=("basic_normalUsed",),
    )  # fmt: skip


def _serial(serial: str, say_in: SayIn) -> tuple[IdentificationNumber, ...]:
    if not serial.strip():
        return ()
    name = words_of(say("Serial number"), say_in)
    return (
        IdentificationNumber(
            issuer="manufacturer", value=one_line(serial), name=name, ref_type=("basic_serialNumber",)
        ),
    )


def _certificate(job: Job, chain: Traceability | None, say_in: SayIn) -> Hash | None:
    """Of the artefact: its number, who issued it and when; with the SHA-256 of its file where the job has one."""
    if chain is None:
        return None
    file = chain.file if isinstance(chain, CertificateFile) else None
    number = one_line(chain.number) or (file or str.__str__(NOT_STATED))
    told: list[Text] = [Verbatim(chain.laboratory)] if chain.laboratory else []
    told += [say("of {date}", date=day(chain.date))] if chain.date else []
    told += [say("due {date}", date=day(chain.until))] if chain.until else []
    told += [say("{right:capital}", right=right(chain))] if right(chain) else []
    digest = sha256(job.inputs)[file] if file is not None and file in job.inputs else None
    valid = None if chain.until is None else holds_on(chain, job.facts.job.date)
    return _referral(number, say_in, digest, rich_of(told, say_in) if told else None, valid)


def _referral(
    number: str, say_in: SayIn, digest: str | None = None, described: Rich | None = None, valid: bool | None = None
) -> Hash:
    return Hash(
        referral=words_of(say("Calibration certificate"), say_in), referral_id=number,
        procedure="SHA-256" if digest else NO_HASH, value=digest or NO_HASH, description=described,
        in_validity_range=valid,
    )  # fmt: skip


def _certified(
    owner: str, name: Text, length: float | None, u_um: float | None, cte: float, say_in: SayIn
) -> Iterator[PrimitiveQuantity]:
    if length is not None:
        u = Decimal(repr(float(u_um or 0.0))).scaleb(-3)
        stated = Expanded(uncertainty=u, factor=Decimal(1), probability=P_STANDARD, distribution="normal")
        yield _primitive(f"{owner}_length", name, length, UNITS["mm"], say_in, stated if u else None)
    if cte:
        yield _primitive(f"{owner}_cte", say("Coefficient of thermal expansion"), cte, UNITS["1/K"], say_in)


def _primitive(
    id_: str, name: Text, value: float, unit: Unit, say_in: SayIn, uncertainty: Expanded | None = None
) -> PrimitiveQuantity:
    real = Real(value=Decimal(repr(float(value))), unit=unit.dsi, uncertainty=uncertainty)
    return PrimitiveQuantity(id=id_, name=words_of(name, say_in), value=real, ref_type=("basic_referenceValue",))


def conditions(job: Job, say_in: SayIn) -> tuple[InfluenceCondition, ...]:
    """As the job states them, and the least and largest recorded temperatures, in K and in °C."""
    found = []
    if job.facts.job.conditions:
        told = Data(parts=(rich_of((Verbatim(job.facts.job.conditions),), say_in),))
        found.append(
            InfluenceCondition(name=words_of(say("Conditions"), say_in), data=told, ref_type=("cmm_conditions",))
        )
    for column, what in TEMPERATURES.items():
        if column in job.points.columns:
            values = job.points.columns[column]
            low, high = float(values.min()), float(values.max())
            ends = (
                _temperature(f"{column}.min", say("Lowest temperature"), low, "basic_temperatureMin", say_in),
                _temperature(f"{column}.max", say("Highest temperature"), high, "basic_temperatureMax", say_in),
            )
            name = words_of(say("Temperature: {what}", what=what), say_in)
            found.append(InfluenceCondition(name=name, data=Data(parts=ends), ref_type=("basic_temperature",)))
    return tuple(found)


def _temperature(id_: str, name: Text, celsius: float, ref_type: str, say_in: SayIn) -> DccQuantity:
    shown = Decimal(repr(celsius))
    kelvin = Real(value=shown + _KELVIN, unit=UNITS["K"].dsi)
    both = Hybrid(values=(kelvin, Real(value=shown, unit=UNITS["°C"].dsi)))
    return DccQuantity(id=id_, name=words_of(name, say_in), value=both, ref_type=(ref_type,))


def metadata(results: Mapping[str, Any], say_in: SayIn) -> tuple[StatementMetadata, ...]:
    """From which files it can be computed again, and what was odd in the recording."""
    hashes = [f"{name} SHA-256 {digest}" for name, digest in results["job"]["inputs_sha256"].items()]
    seed = results.get("sampling", {}).get("seed")
    again = [*hashes, *([] if seed is None else [f"seed {seed}"])]
    found = [
        StatementMetadata(
            name=words_of(say("Inputs, from which every figure follows again"), say_in), ref_type=("cmm_inputs",),
            declaration=rich_of([Verbatim(line) for line in again], say_in),
        )
    ]  # fmt: skip
    odd = [one["why"] for one in results.get("screening", ())]
    if odd:
        name = words_of(say("What is odd in the recording"), say_in)
        found.append(StatementMetadata(name=name, declaration=english(odd), ref_type=("cmm_screening",)))
    return tuple(found)
