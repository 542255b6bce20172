"""The digital calibration certificate (DCC) of a result: all that results.json states, and what the job says of it.

It is made from results.json's data and the job alone, so that it can be made again and compared. docs/dcc.md explains each
choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType
from typing import Any

from scipy import special

from cmm_uq.base.languages.translation import ENGLISH
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.certificate.clauses import certifies
from cmm_uq.certificate.digital_certificate import administration, measurement
from cmm_uq.certificate.digital_certificate.administration import Languages, mark_of
from cmm_uq.certificate.digital_certificate.conformity import evidence, of_tolerances, statement
from cmm_uq.certificate.digital_certificate.figures import DigitalFigures
from cmm_uq.certificate.digital_certificate.quantities import (
    P95,
    decimal,
    decimals,
    dsi_of,
    is_quantity,
    plain_name,
    product,
    without_unit,
)
from cmm_uq.certificate.origin import file_name
from cmm_uq.certificate.results.plain import as_json
from cmm_uq.jobs.dcc.certificate import Administrative, Attached, Certificate, Data, DccQuantity, DccResult, Measurement
from cmm_uq.jobs.dcc.quantities import CovarianceColumn, CovarianceElement, EllipsoidalRegion, ExpandedList, RealList
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import Verdicts

_TITLES: Mapping[str, Text] = MappingProxyType({
    "accuracy_uncertainty": say("Figures of performance"), "estimates": say("Error factors of the machine"),
    "differences": say("Differences that are determined"), "artefact": say("Sizes of the artefact after the fit"),
    "certified": say("Certified sizes of the artefact"), "tolerances": say("Parameters and tolerances"),
    "noise": say("Noise of a reading"), "least_squares": say("Least squares, for comparison"),
    "as_found": say("The machine as it was found, before it was adjusted"),
    "cmc": say("Calibration and measurement capability"),
})  # fmt: skip
"""Of parts of results.json that every kind has, in the order of the certificate; those of a kind have their key as title."""

_NOT_STATED_THERE = (
    "schema", "software", "job", "import", "acquisition", "sampling", "identifiability", "diagnosis", "screening", "posterior",
    "accuracy", "conformity", "verdicts", "covariance", "iso17025", "traceability", "replaced",
)  # fmt: skip
"""Keys that are no results of the machine, or stand elsewhere in the certificate; the attached results.json has them."""

_MOST = 40  # estimates whose covariance is written out; of more, the attached results.json has it.


def digital_certificate(
    results: Mapping[str, Any], job: Job, *, html: bytes | None, file: bytes | None = None
) -> Certificate:
    """The certificate, in the language that results.json names, and in English."""
    texts = Languages(results["job"].get("language", ENGLISH))
    real, decided = certifies(job), results.get("conformity", ())
    # estimates that are in a combination that the recording does not determine, ``scale_x.ppm``
    undetermined = results.get("identifiability", {}).get("undetermined", ())
    free = frozenset(name for combination in undetermined for name in combination)
    figures = DigitalFigures(texts, free, of_tolerances(Verdicts.of_results(results), texts, certifies=real))
    stated = [statement(i, entry, figures, certifies=real) for i, entry in enumerate(decided)]
    # results.json itself: what D-SI has no place for stands there
    content = as_json(results) if file is None else file
    everything = DccResult(
        name=texts.words(say("Every figure, for other programs")), ref_type=("cmm_resultsFile",),
        data=Data(parts=(Attached(file_name="results.json", mime_type="application/json", data=content),)),
    )  # fmt: skip
    mark, title = mark_of(job), Verbatim(job.facts.machine.name)
    return Certificate(
        administrative=Administrative(
            software=measurement.software(results, texts),
            ref_types=administration.ref_types(texts),
            core=administration.core_data(job, texts),
            items=administration.items(job, texts),
            laboratory=administration.laboratory(job, texts),
            persons=administration.persons(job, texts),
            customer=administration.customer(job, texts),
            statements=(*administration.formal_statements(job, results, texts), *stated),
        ),
        measurements=(
            Measurement(
                name=texts.words(
                    say("Calibration of {machine}", machine=title) if mark is None
                    else say("{banner}: {machine}", banner=mark.banner, machine=title)
                ),
                methods=measurement.methods(job, results, texts),
                software=measurement.software(results, texts),
                equipment=measurement.equipment(job, results, texts),
                conditions=measurement.conditions(job, texts),
                results=(*_results(results, figures), *evidence(decided, figures, certifies=real), everything),
                metadata=measurement.metadata(results, texts),
                ref_id=("machine",),
                ref_type=("cmm_calibration",) if real else (f"cmm_{job.origin}", "cmm_notACertificate"),
            ),
        ),
        document=None if html is None else Attached(
            file_name=file_name("certificate.html", job.origin), mime_type="text/html", data=html,
            name=texts.words(say("The same certificate for reading")),
        ),
    )  # fmt: skip


def _results(results: Mapping[str, Any], figures: DigitalFigures) -> list[DccResult]:
    found = []
    for key in dict.fromkeys((*_TITLES, *results)):
        if key not in results or key in _NOT_STATED_THERE:
            continue
        data = results[key]
        if isinstance(data, Mapping) and not is_quantity(data) and "budget" not in data:
            parts = tuple(part for name, value in data.items() for part in figures.parts((key, name), value))
        else:
            parts = tuple(figures.parts((key,), data))
        if parts:
            title = figures.texts.words(_TITLES.get(key, Verbatim(without_unit(key).capitalize())))
            found.append(DccResult(name=title, data=Data(parts=parts), ref_type=(plain_name(f"cmm_{key}"),)))
    together = _together(results, figures)
    return found if together is None else [*found, together]


def _together(results: Mapping[str, Any], figures: DigitalFigures) -> DccResult | None:
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
    units = [dsi_of(data["units"][i]) for i in chosen]
    columns = tuple(
        CovarianceColumn(covariances=tuple(
            CovarianceElement(value=decimal(matrix[row][column]), unit=product(a, b))
            for row, a in zip(chosen, units, strict=True)
        ))
        for column, b in zip(chosen, units, strict=True)
    )  # fmt: skip
    factor = decimal(float(f"{sqrt(special.chdtri(len(chosen), 0.05)):.6f}"))
    values, U, k = (decimals([quantity[key] for quantity in found]) for key in ("value", "U", "k"))
    stated = RealList(
        labels=tuple(names[i] for i in chosen), values=values, units=tuple(units),
        uncertainty=ExpandedList(uncertainties=U, factors=k, probabilities=(P95,)),
        region=EllipsoidalRegion(columns=columns, factor=factor, probability=P95, distribution="normal"),
    )  # fmt: skip
    title = figures.texts.words(say("Estimates together, with their covariance"))
    ref_type = ("cmm_covariance",)
    quantity = DccQuantity(id=figures.id_of(("covariance",)), name=title, value=stated, ref_type=ref_type)
    return DccResult(name=title, data=Data(parts=(quantity,)), ref_type=ref_type)
