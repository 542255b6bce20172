"""The digital calibration certificate (DCC) of a result: all that results.json states, and what the job says of it.

It is made from results.json's data and the job alone, so that it can be made again and compared. docs/dcc.md explains each
choice. The schema knows pass, fail, conditionalPass, conditionalFail, noPass and noFail. Undecided, incomplete and remeasure
are all three ``noPass``: conformity is not stated. Which of them it is stands in the ``refType`` and in words; a program that
knows nothing but the schema cannot take one for a pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from math import sqrt
from types import MappingProxyType
from typing import Any

import scipy

from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import UNITS
from cmm_uq.certificate.clauses import certifies
from cmm_uq.certificate.digital_certificate import administration, figures as plain
from cmm_uq.certificate.digital_certificate.administration import Languages, english, mark_of, one_line
from cmm_uq.certificate.origin import as_json, file_name
from cmm_uq.certificate.wording import stated_row, stated_value
from cmm_uq.jobs.dcc import certificate as dcc
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import TOLERANCE_RULE, Verdict, Verdicts

# by the word of results.json
IN_THE_SCHEMA: Mapping[str, str] = MappingProxyType({
    "pass": "pass", "fail": "fail", "conditional pass": "conditionalPass", "conditional fail": "conditionalFail",
    "undecided": "noPass", "incomplete": "noPass", "remeasure": "noPass",
})  # fmt: skip
_WHY: Mapping[str, tuple[Text, ...]] = MappingProxyType({
    "undecided": (say("Neither conformity nor nonconformity is proved by the rule, so noPass: conformity is not stated."),),
    "incomplete": (say(
        "What was measured conforms, but the test lacks what is named as missing, so noPass: conformity is not stated."),),
    "remeasure": (say(
        "The standard asks for further readings before anything is decided, so noPass: conformity is not stated."),),
})  # fmt: skip

_MICROMETRE, _MILLIMETRE = UNITS["µm"].dsi, UNITS["mm"].dsi
_P_TWICE = Decimal("0.9545")  # probability of a normal distribution within two standard deviations


def _of_tolerance(verdict: Verdict, texts: Languages, *, certifies: bool) -> dcc.StatementMetadata:
    limit, unit = plain.decimal(verdict.limit or 0.0), plain.dsi_of(verdict.unit)
    bounds = ((say("Smallest permissible value"), -limit), (say("Largest permissible value"), limit))
    return texts(
        "StatementMetadata", name=say("Conformity with its tolerance"), references=(TOLERANCE_RULE,),
        description=english([f"Missing: {what}" for what in verdict.missing]) if verdict.missing else None,
        declaration=(Verbatim(verdict.outcome), *_WHY.get(verdict.outcome, ())),
        conformity=IN_THE_SCHEMA[verdict.outcome] if certifies else None,
        data=dcc.Data(parts=tuple(
            texts("DccQuantity", name=name, value=dcc.Real(value=bound, unit=unit), ref_type="cmm_toleranceLimit")
            for name, bound in bounds
        )),
        ref_type=_ref_type(verdict.outcome, certifies=certifies),
    )  # fmt: skip


def _ref_type(decision: str, *, certifies: bool) -> tuple[str, ...]:
    return ("basic_conformity", f"cmm_{decision.replace(' ', '')}") if certifies else ("cmm_notCertified",)


def statement(
    i: int, entry: Mapping[str, Any], figures: plain.DigitalFigures, *, certifies: bool
) -> dcc.StatementMetadata:
    texts, decision, path = figures.texts, entry["decision"], ("conformity", str(i))
    standard, characteristic = Verbatim(entry["standard"]), Verbatim(entry["characteristic"])
    named = say("{standard}, {characteristic}", standard=standard, characteristic=characteristic)
    remarks = [*entry["remarks"], *(f"Missing: {what}" for what in entry["missing"])]
    # as on the first page: of a size that may be zero its interval, beside which no U is stated
    value = stated_value(entry["value_um"], 2 * entry["u_um"], signed=entry.get("signed", True))
    quantity = say("{decision}: {quantity}", decision=Verbatim(decision), quantity=Verbatim(entry["quantity"]))
    row = stated_row(decision, value, UNITS["µm"], entry["limit_um"])
    return texts(
        "StatementMetadata", id=figures.id_of(path), name=named, description=english(remarks) if remarks else None,
        norms=(one_line(entry["standard"]),), references=(one_line(entry["rule"]),),
        declaration=(quantity, row, *_WHY.get(decision, ())), conformity=IN_THE_SCHEMA[decision] if certifies else None,
        data=dcc.Data(parts=tuple(_figures(path, entry, figures))), ref_type=_ref_type(decision, certifies=certifies),
    )  # fmt: skip


def _figures(path: tuple[str, ...], entry: Mapping[str, Any], figures: plain.DigitalFigures) -> Iterator[dcc.Element]:
    """The value with its uncertainty, its limit, the acceptance limit of the rule, and probabilities."""

    def quantity(
        keys: str, name: Text, value: Decimal, ref_type: str, unit: str = _MICROMETRE, stated: Any = None
    ) -> dcc.DccQuantity:
        real, id_ = dcc.Real(value=value, unit=unit, uncertainty=stated), figures.id_of((*path, *keys.split(".")))
        return figures.texts("DccQuantity", id=id_, name=name, value=real, ref_type=ref_type)

    u, limit, guard = plain.decimal(entry["u_um"]), plain.decimal(entry["limit_um"]), entry["guard_band_um"]
    twice = {"factor": Decimal(2), "probability": _P_TWICE, "distribution": "normal"}
    stated = dcc.Expanded(uncertainty=2 * u, **twice) if u > 0 else None
    named = say("Value that is least favourable")
    yield quantity("value_um", named, plain.decimal(entry["value_um"]), "basic_measuredValue", stated=stated)
    yield quantity("limit_um", say("Limit"), limit, "cmm_toleranceLimit")
    if guard is not None:
        yield quantity("guard_band_um", say("Guard band"), plain.decimal(guard), "cmm_guardBand")
        accepted = max(limit - plain.decimal(guard), Decimal(0))
        yield quantity("acceptance_limit_um", say("Acceptance limit"), accepted, "basic_acceptanceLimitUpper")
    for key, name in (
        ("probability_conforming", say("Probability that the value is within its limit")),
        ("probability_all_conform", say("Probability that all values are within their limits")),
    ):
        if entry[key] is not None:
            yield quantity(key, name, plain.decimal(entry[key]), "cmm_conformanceProbability", plain.ONE.dsi)
    units = {"a_um": _MICROMETRE, "k": plain.ratio(_MILLIMETRE, _MICROMETRE), "b_um": _MICROMETRE}
    for key, value in (entry["mpe"] or {}).items():
        if value is not None:
            letter = Verbatim(key.partition("_")[0].upper())
            name = say("{letter} of the maximum permissible error A + L/K, at most B", letter=letter)
            yield quantity(f"mpe.{key}", name, plain.decimal(value), "cmm_toleranceLimit", units[key])
    for key in ("prior", "global_risks", "largest_um", "largest_without_noise_um"):
        yield from figures.parts((*path, key), entry.get(key))


def evidence(
    decided: Sequence[Mapping[str, Any]], figures: plain.DigitalFigures, *, certifies: bool
) -> tuple[dcc.DccResult, ...]:
    """Every value that was decided, and the budget of the one that is named."""
    found = []
    for i, entry in enumerate(decided):
        path = ("conformity", str(i))
        parts = [_values(path, entry["errors"], figures, certifies=certifies)] if entry["errors"] else []
        parts += figures.parts((*path, "test_uncertainty"), entry["test_uncertainty"])
        if parts:
            name = say("All values decided by {standard}", standard=Verbatim(entry["standard"]))
            data = dcc.Data(parts=tuple(parts))
            found.append(figures.texts("DccResult", name=name, data=data, ref_type="cmm_conformity"))
    return tuple(found)


def _values(
    path: tuple[str, ...], errors: Sequence[Mapping[str, Any]], figures: plain.DigitalFigures, *, certifies: bool
) -> dcc.QuantityList:
    below, texts = (*path, "errors"), figures.texts
    uncertainty = dcc.ExpandedList(
        uncertainties=plain.decimals([error["U_um"] for error in errors]), factors=(Decimal(2),), probabilities=(_P_TWICE,),
        distributions=("normal",),
    )  # fmt: skip
    known = all(error["u_um"] > 0 for error in errors)
    values = plain.decimals([error["error_um"] for error in errors])
    column = texts(
        "DccQuantity", id=figures.id_of((*below, "error_um")), name=say("Value"), ref_type="basic_measurementError",
        value=dcc.RealList(values=values, units=(_MICROMETRE,), uncertainty=uncertainty if known else None),
    )  # fmt: skip
    others = [{key: error[key] for key in error if key not in ("error_um", "u_um", "U_um")} for error in errors]
    rest = [
        part for table in figures.parts(below, others) if isinstance(table, dcc.QuantityList) for part in table.parts
    ]
    words = tuple(IN_THE_SCHEMA[error["outcome"]] for error in errors)
    outcomes = (dcc.StatementMetadata(conformity_list=words, ref_type=("basic_conformity",)),) if certifies else ()
    name = say("Values in the order of the recording")
    return texts("QuantityList", name=name, parts=(column, *rest), metadata=outcomes, ref_type="cmm_table")


_TITLES: Mapping[str, Text] = MappingProxyType({
    "accuracy_uncertainty": say("Figures of performance"), "estimates": say("Error factors of the machine"),
    "performance_of_machine": say("Figures of performance of the machine, without noise"),
    "over_range": say("Error factors over the measuring range"),
    "differences": say("Differences that are determined"), "artefact": say("Sizes of the artefact after the fit"),
    "certified": say("Certified sizes of the artefact"), "tolerances": say("Parameters and tolerances"),
    "noise": say("Noise of a reading"), "least_squares": say("Least squares, for comparison"),
    "as_found": say("The machine as it was found, before it was adjusted"),
    "cmc": say("Calibration and measurement capability"),
})  # fmt: skip
"""Of parts of results.json that every kind has, in the order of the certificate; those of a kind have their key as title."""

# keys that are no results of the machine, or stand elsewhere in the certificate; the attached results.json has them
_NOT_STATED_THERE = (
    "schema", "software", "job", "import", "acquisition", "sampling", "identifiability", "diagnosis", "screening", "posterior",
    "accuracy", "conformity", "verdicts", "covariance", "iso17025", "traceability", "replaced", "records", "regions",
)  # fmt: skip
_MOST = 40  # estimates whose covariance is written out; of more, the attached results.json has it.


def digital_certificate(
    results: Mapping[str, Any], job: Job, *, html: bytes | None, file: bytes | None = None
) -> dcc.Certificate:
    """The certificate, in the language that results.json names, and in English."""
    texts = Languages(results["job"].get("language", ENGLISH))
    real, decided = certifies(job), results.get("conformity", ())
    # estimates that are in a combination that the recording does not determine, ``scale_x.ppm``
    undetermined = results.get("identifiability", {}).get("undetermined", ())
    free = frozenset(name for combination in undetermined for name in combination)
    # statements on parameters that have a tolerance, by their names (``scale_x.ppm``): each stands with its result
    limited = {
        one.name: _of_tolerance(one, texts, certifies=real) for one in Verdicts.of_results(results) if not one.by
    }
    figures = plain.DigitalFigures(texts, free, limited)
    stated = [statement(i, entry, figures, certifies=real) for i, entry in enumerate(decided)]
    # results.json itself: what D-SI has no place for stands there
    content = as_json(results) if file is None else file
    file_of_results = dcc.Attached(file_name="results.json", mime_type="application/json", data=content)
    everything = texts("DccResult", name=say("Every figure, for other programs"), ref_type="cmm_resultsFile",
                       data=dcc.Data(parts=(file_of_results,)))  # fmt: skip
    mark, machine = mark_of(job), Verbatim(job.facts.machine.name)
    title = say("Calibration of {machine}", machine=machine)
    if mark is not None:
        title = say("{banner}: {machine}", banner=mark.banner, machine=machine)
    return dcc.Certificate(
        administrative=dcc.Administrative(
            software=administration.software(results, texts), ref_types=administration.ref_types(texts),
            core=administration.core_data(job, texts), items=administration.items(job, texts),
            laboratory=administration.laboratory(job, texts), persons=administration.persons(job, texts),
            customer=administration.customer(job, texts),
            statements=(*administration.formal_statements(job, results, texts), *stated),
        ),
        measurements=(
            texts(
                "Measurement", name=title, methods=administration.methods(job, results, texts),
                software=administration.software(results, texts), equipment=administration.equipment(job, results, texts),
                conditions=administration.conditions(job, texts), metadata=administration.metadata(results, texts),
                results=(*_results(results, figures), *evidence(decided, figures, certifies=real), everything),
                ref_id=("machine",),
                ref_type=("cmm_calibration",) if real else (f"cmm_{job.origin}", "cmm_notACertificate"),
            ),
        ),
        document=html and texts("Attached", file_name=file_name("certificate.html", job.origin), mime_type="text/html",
                                data=html, name=say("The same certificate for reading")),
    )  # fmt: skip


def _results(results: Mapping[str, Any], figures: plain.DigitalFigures) -> list[dcc.DccResult]:
    found = []
    for key in dict.fromkeys((*_TITLES, *results)):
        if key not in results or key in _NOT_STATED_THERE:
            continue
        data = results[key]
        if isinstance(data, Mapping) and not plain.is_quantity(data) and "budget" not in data:
            parts = tuple(part for name, value in data.items() for part in figures.parts((key, name), value))
        else:
            parts = tuple(figures.parts((key,), data))
        if parts:
            title = _TITLES.get(key, Verbatim(plain.without_unit(key).capitalize()))
            data, ref_type = dcc.Data(parts=parts), plain.plain_name(f"cmm_{key}")
            found.append(figures.texts("DccResult", name=title, data=data, ref_type=ref_type))
    together = _together(results, figures)
    return found if together is None else [*found, together]


def _together(results: Mapping[str, Any], figures: plain.DigitalFigures) -> dcc.DccResult | None:
    """Estimates and their covariance as an ellipsoidal region; without what the recording does not determine."""
    data = results.get("covariance")
    if data is None:
        return None
    names, matrix = data["parameters"], data["matrix"]
    chosen = [i for i, name in enumerate(names) if name not in figures.free]
    found = []
    for i in chosen:  # estimates, and sizes of the artefact, by their names in the covariance
        owner, _, parameter = names[i].partition(".")
        place = results.get("artefact", {}) if owner == "artefact" else results["estimates"].get(owner, {})
        quantity = place.get(parameter)
        if isinstance(quantity, Mapping) and quantity.get("u") and quantity["k"] and quantity["k"] >= 1:
            found.append(quantity)
    if not 1 < len(chosen) <= _MOST or len(found) < len(chosen):
        return None
    units = [plain.dsi_of(data["units"][i]) for i in chosen]
    columns = tuple(
        dcc.CovarianceColumn(covariances=tuple(
            dcc.CovarianceElement(value=plain.decimal(matrix[row][column]), unit=plain.product(a, b))
            for row, a in zip(chosen, units, strict=True)
        ))
        for column, b in zip(chosen, units, strict=True)
    )  # fmt: skip
    factor = plain.decimal(float(f"{sqrt(scipy.special.chdtri(len(chosen), 0.05)):.6f}"))
    values, U, k = (plain.decimals([quantity[key] for quantity in found]) for key in ("value", "U", "k"))
    stated = dcc.RealList(
        labels=tuple(names[i] for i in chosen), values=values, units=tuple(units),
        uncertainty=dcc.ExpandedList(uncertainties=U, factors=k, probabilities=(plain.P95,)),
        region=dcc.EllipsoidalRegion(columns=columns, factor=factor, probability=plain.P95, distribution="normal"),
    )  # fmt: skip
    named = {"name": say("Estimates together, with their covariance"), "ref_type": "cmm_covariance"}
    quantity = figures.texts("DccQuantity", id=figures.id_of(("covariance",)), value=stated, **named)
    return figures.texts("DccResult", data=dcc.Data(parts=(quantity,)), **named)
