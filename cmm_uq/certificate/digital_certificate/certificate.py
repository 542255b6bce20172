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
from cmm_uq.certificate.digital_certificate.administration import (
    NOT_STATED,
    SayIn,
    core_data,
    customer,
    formal_statements,
    items,
    laboratory,
    mark_of,
    persons,
    ref_types,
    speaking,
    words_of,
)
from cmm_uq.certificate.digital_certificate.conformity import evidence, of_tolerances, statements
from cmm_uq.certificate.digital_certificate.figures import DigitalFigures
from cmm_uq.certificate.digital_certificate.measurement import conditions, equipment, metadata, methods, software
from cmm_uq.certificate.digital_certificate.quantities import (
    P95,
    decimal,
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

_MOST = 40
"""Estimates whose covariance is written out; of more, the attached results.json has it."""


def digital_certificate(
    results: Mapping[str, Any], job: Job, *, html: bytes | None, file: bytes | None = None
) -> Certificate:
    """The certificate, in the language that results.json names, and in English."""
    say_in = speaking(results["job"].get("language", ENGLISH))
    real, decided = certifies(job), results.get("conformity", ())
    figures = DigitalFigures(say_in, free(results), of_tolerances(Verdicts.of_results(results), say_in, certifies=real))
    stated = statements(decided, say_in, figures, certifies=real)
    return Certificate(
        administrative=Administrative(
            software=software(results, say_in),
            ref_types=ref_types(say_in),
            core=core_data(job, tuple(say_in(NOT_STATED)), say_in),
            items=items(job, say_in),
            laboratory=laboratory(job, say_in),
            persons=persons(job, say_in),
            customer=customer(job, say_in),
            statements=(*formal_statements(job, results, say_in), *stated),
        ),
        measurements=(
            Measurement(
                name=words_of(_title(job), say_in),
                methods=methods(job, results, say_in),
                software=software(results, say_in),
                equipment=equipment(job, results, say_in),
                conditions=conditions(job, say_in),
                results=(
                    *_results(results, say_in, figures),
                    *evidence(decided, say_in, figures, certifies=real),
                    _everything(as_json(results) if file is None else file, say_in),
                ),
                metadata=metadata(results, say_in),
                ref_id=("machine",),
                ref_type=("cmm_calibration",) if real else (f"cmm_{job.origin}", "cmm_notACertificate"),
            ),
        ),
        document=None if html is None else Attached(
            file_name=file_name("certificate.html", job.origin), mime_type="text/html", data=html,
            name=words_of(say("The same certificate for reading"), say_in),
        ),
    )  # fmt: skip


def _title(job: Job) -> Text:
    mark, machine = mark_of(job), Verbatim(job.facts.machine.name)
    if mark is None:
        return say("Calibration of {machine}", machine=machine)
    return say("{banner}: {machine}", banner=mark.banner, machine=machine)


def free(results: Mapping[str, Any]) -> frozenset[str]:
    """Estimates that are in a combination that the recording does not determine, ``scale_x.ppm``."""
    known = results.get("identifiability", {})
    return frozenset(name for combination in known.get("undetermined", ()) for name in combination)


def _results(results: Mapping[str, Any], say_in: SayIn, figures: DigitalFigures) -> list[DccResult]:
    keys = [key for key in (*_TITLES, *results) if key in results and key not in _NOT_STATED_THERE]
    found = []
    for key in dict.fromkeys(keys):
        data = results[key]
        parts = (
            tuple(part for name, value in data.items() for part in figures.parts((key, name), value))
            if isinstance(data, Mapping) and not is_quantity(data) and "budget" not in data
            else tuple(figures.parts((key,), data))
        )
        if parts:
            title = words_of(_TITLES.get(key, Verbatim(without_unit(key).capitalize())), say_in)
            found.append(DccResult(name=title, data=Data(parts=parts), ref_type=(plain_name(f"cmm_{key}"),)))
    together = _together(results, say_in, figures)
    return found if together is None else [*found, together]


def _together(results: Mapping[str, Any], say_in: SayIn, figures: DigitalFigures) -> DccResult | None:
    """Estimates and their covariance as an ellipsoidal region; without what the recording does not determine."""
    data = results.get("covariance")
    if data is None:
        return None
    names = data["parameters"]
    chosen = [i for i, name in enumerate(names) if name not in figures.free]
    found = [one for i in chosen if (one := _of(results, names[i])) and one["u"] and one["k"] and one["k"] >= 1]
    if not 1 < len(chosen) <= _MOST or len(found) < len(chosen):
        return None
    units = [dsi_of(data["units"][i]) for i in chosen]
    region = EllipsoidalRegion(
        columns=tuple(
            CovarianceColumn(covariances=tuple(
                CovarianceElement(value=decimal(data["matrix"][row][column]), unit=product(units[a], units[b]))
                for a, row in enumerate(chosen)
            ))
            for b, column in enumerate(chosen)
        ),
        factor=decimal(float(f"{sqrt(special.chdtri(len(chosen), 0.05)):.6f}")), probability=P95, distribution="normal",
    )  # fmt: skip
    stated = RealList(
        labels=tuple(names[i] for i in chosen), values=tuple(decimal(one["value"]) for one in found), units=tuple(units),
        uncertainty=ExpandedList(
            uncertainties=tuple(decimal(one["U"]) for one in found), factors=tuple(decimal(one["k"]) for one in found),
            probabilities=(P95,),
        ),
        region=region,
    )  # fmt: skip
    title, ref_type = words_of(say("Estimates together, with their covariance"), say_in), ("cmm_covariance",)
    quantity = DccQuantity(id=figures.id_of(("covariance",)), name=title, value=stated, ref_type=ref_type)
    return DccResult(name=title, data=Data(parts=(quantity,)), ref_type=ref_type)


def _of(results: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    """An estimate, or a size of the artefact, by its name in the covariance."""
    owner, _, parameter = name.partition(".")
    place = results.get("artefact", {}) if owner == "artefact" else results["estimates"].get(owner, {})
    found = place.get(parameter)
    return found if isinstance(found, Mapping) and "u" in found else None


def _everything(results: bytes, say_in: SayIn) -> DccResult:
    """results.json itself: what D-SI has no place for stands there."""
    file = Attached(file_name="results.json", mime_type="application/json", data=results)
    name = words_of(say("Every figure, for other programs"), say_in)
    return DccResult(name=name, data=Data(parts=(file,)), ref_type=("cmm_resultsFile",))
