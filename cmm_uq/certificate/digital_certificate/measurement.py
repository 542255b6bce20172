"""How it was measured, in a digital certificate: methods, software, the artefact, conditions, metadata."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from cmm_uq.base.messages import Text, Verbatim, day, say
from cmm_uq.base.units import MICROMETRE, UNITS
from cmm_uq.certificate.certificate import TEMPERATURES
from cmm_uq.certificate.digital_certificate.administration import (
    NOT_STATED,
    Languages,
    english,
    one_line,
    serial_number,
    somebody,
)
from cmm_uq.certificate.digital_certificate.quantities import P_STANDARD
from cmm_uq.certificate.sections.results import SIGN, UNCERTAINTY
from cmm_uq.jobs.chain import holds_on, right
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.dcc.quantities import Expanded, Hybrid, Real
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.jobs.tables.artefact import CertificateFile, Traceability

NO_HASH = "none"  # procedure and value of the hash of a certificate that is not at hand as a file
_KELVIN = Decimal("273.15")


def methods(job: Job, results: Mapping[str, Any], texts: Languages) -> tuple[dcc.Method, ...]:
    """As the job states it, and how values and uncertainties follow."""
    standards = tuple(dict.fromkeys(one_line(entry["standard"]) for entry in results.get("conformity", ())))
    stated = job.facts.job.procedure
    return (
        dcc.Method(
            name=texts.words(say("Calibration of a coordinate measuring machine")),
            description=texts.rich(Verbatim(stated) if stated else NOT_STATED),
            norms=standards, ref_type=("basic_calibrationMethod",),
        ),
        dcc.Method(
            name=texts.words(say("Measurement uncertainty")), description=texts.rich(UNCERTAINTY, SIGN),
            references=("JCGM 100:2008", "JCGM 101:2008"), ref_type=("basic_methodMeasurementUncertainty",),
        ),
    )  # fmt: skip


def software(results: Mapping[str, Any], texts: Languages) -> tuple[dcc.Software, ...]:
    """The program, and other packages that took part."""
    used = results["software"]
    named = {used["name"]: used["version"], **used.get("plugins", {})}
    return tuple(
        dcc.Software(name=texts.words(Verbatim(name)), release=one_line(version), type="application" if not i else "library")
        for i, (name, version) in enumerate(named.items())
    )  # fmt: skip


def equipment(job: Job, results: Mapping[str, Any], texts: Languages) -> dcc.Equipments:
    """The artefact, the short gauge, and instruments of a recording that was taken live."""

    def reference(
        name: str, serial: str, chain: Traceability | None, *certified: dcc.PrimitiveQuantity
    ) -> dcc.Equipment:
        return dcc.Equipment(
            name=texts.words(Verbatim(name)), certificate=_certificate(job, chain, texts),
            identifications=_serial(serial, texts), quantities=certified, ref_type=("basic_normalUsed",),
        )  # fmt: skip

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
        dcc.Equipment(
            name=texts.words(Verbatim(each.name)), model=one_line(each.model or "") or None,
            manufacturer=somebody(Verbatim(each.maker), texts) if each.maker else None,
            certificate=_referral(one_line(each.certificate), texts) if each.certificate else None,
            identifications=_serial(each.serial or "", texts), ref_type=("cmm_instrument",),
        )
        for each in ([] if job.acquired is None else job.acquired.said.instruments)
    ]  # fmt: skip
    return dcc.Equipments(equipment=tuple(found))


def _serial(serial: str, texts: Languages) -> tuple[dcc.IdentificationNumber, ...]:
    return (serial_number(one_line(serial), texts),) if serial.strip() else ()


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
    return _referral(number, texts, digest, texts.rich(*described) if described else None, valid)


def _referral(
    number: str,
    texts: Languages,
    digest: str | None = None,
    described: dcc.Rich | None = None,
    valid: bool | None = None,
) -> dcc.Hash:
    return dcc.Hash(
        referral=texts.words(say("Calibration certificate")), referral_id=number, procedure="SHA-256" if digest else NO_HASH,
        value=digest or NO_HASH, description=described, in_validity_range=valid,
    )  # fmt: skip


def _certified(
    owner: str, length: float | None, u_um: float | None, cte: float, texts: Languages
) -> tuple[dcc.PrimitiveQuantity, ...]:
    u = Decimal(repr(float(u_um or 0.0))).scaleb(-3)
    stated = Expanded(uncertainty=u, factor=Decimal(1), probability=P_STANDARD, distribution="normal") if u else None
    known = (
        ("length", say("Certified length"), length, "mm", stated),
        ("cte", say("Coefficient of thermal expansion"), cte or None, "1/K", None),
    )
    return tuple(
        dcc.PrimitiveQuantity(
            id=f"{owner}_{key}", name=texts.words(name), ref_type=("basic_referenceValue",),
            value=Real(value=Decimal(repr(float(value))), unit=UNITS[unit].dsi, uncertainty=uncertainty),
        )
        for key, name, value, unit, uncertainty in known if value is not None
    )  # fmt: skip


def conditions(job: Job, texts: Languages) -> tuple[dcc.InfluenceCondition, ...]:
    """As the job states them, and the least and largest recorded temperatures, in K and in °C."""
    found = []
    if job.facts.job.conditions:
        data = dcc.Data(parts=(texts.rich(Verbatim(job.facts.job.conditions)),))
        name = texts.words(say("Conditions"))
        found.append(dcc.InfluenceCondition(name=name, data=data, ref_type=("cmm_conditions",)))
    for column, what in TEMPERATURES.items():
        if column in job.points.columns:
            values = job.points.columns[column]
            ends = (
                _temperature(f"{column}.min", say("Lowest temperature"), values.min(), "basic_temperatureMin", texts),
                _temperature(f"{column}.max", say("Highest temperature"), values.max(), "basic_temperatureMax", texts),
            )
            name = texts.words(say("Temperature: {what}", what=what))
            found.append(dcc.InfluenceCondition(name=name, data=dcc.Data(parts=ends), ref_type=("basic_temperature",)))
    return tuple(found)


def _temperature(id_: str, name: Text, celsius: float, ref_type: str, texts: Languages) -> dcc.DccQuantity:
    shown = Decimal(repr(float(celsius)))
    kelvin = Real(value=shown + _KELVIN, unit=UNITS["K"].dsi)
    both = Hybrid(values=(kelvin, Real(value=shown, unit=UNITS["°C"].dsi)))
    return dcc.DccQuantity(id=id_, name=texts.words(name), value=both, ref_type=(ref_type,))


def metadata(results: Mapping[str, Any], texts: Languages) -> tuple[dcc.StatementMetadata, ...]:
    """From which files it can be computed again, and what was odd in the recording."""
    again = [f"{name} SHA-256 {digest}" for name, digest in results["job"]["inputs_sha256"].items()]
    if (seed := results.get("sampling", {}).get("seed")) is not None:
        again.append(f"seed {seed}")
    inputs = dcc.StatementMetadata(
        name=texts.words(say("Inputs, from which every figure follows again")), ref_type=("cmm_inputs",),
        declaration=texts.rich(*map(Verbatim, again)),
    )  # fmt: skip
    odd = [flag["why"] for flag in results.get("screening", ())]
    if not odd:
        return (inputs,)
    name = texts.words(say("What is odd in the recording"))
    return inputs, dcc.StatementMetadata(name=name, declaration=english(odd), ref_type=("cmm_screening",))
