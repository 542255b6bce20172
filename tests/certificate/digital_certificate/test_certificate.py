"""The digital certificate says what results.json and the job say: every figure with its unit, and no more than that."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from functools import cache
from math import isclose, pi, sqrt
from typing import Any

import numpy as np
import pytest
from lxml import etree
from scipy import stats

from cmm_uq.app.commands.reading import read_job
from cmm_uq.certificate.digital_certificate.certificate import IN_THE_SCHEMA, digital_certificate
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.wording import OUTCOME_WORDS
from cmm_uq.jobs.dcc import Certificate, read, written
from cmm_uq.jobs.dcc.certificate import (
    DccQuantity as Quantity,
    Expanded,
    Hybrid,
    Interval,
    Real,
    RealList,
    StatementMetadata as Statement,
)
from cmm_uq.jobs.job import Job
from tests.artefacts.simulated import results
from tests.certificate.test_completeness import CHAIN
from tests.certificate.test_every_layout import REPORTED
from tests.conftest import ROOT
from tests.jobs.dcc.schemas import by_lxml
from tests.recordings import with_columns

pytestmark = pytest.mark.filterwarnings("ignore")  # PTB's parser warns of its own tables when it is loaded

HTML = b"<!doctype html><title>the page</title>"
MEASURED = "iota-1102-20C"
STATED_ELSEWHERE = {
    "schema", "software", "job", "sampling", "identifiability", "diagnosis", "screening", "posterior", "accuracy", "iso17025",
    "traceability", "replaced",
    "verdicts", "regions",
}  # fmt: skip
"""Keys of results.json that hold no result of the machine, but what was done, or what is thought of it."""

ARCSECOND = pi / 180 / 3600
SI = {
    "um": 1e-6, "mm": 1e-3, "ppm": 1e-6, "arcsec": ARCSECOND, "rad": 1.0, "deg": pi / 180, "c": 1.0, "k": 1.0, "s": 1.0,
    "h": 3600.0, "mm2": 1e-6, "arcsec_per_m": ARCSECOND, "per_k": 1.0, "um_per_h": 1e-6 / 3600, "arcsec_per_m_k": ARCSECOND,
    "arcsec_per_m_kg": ARCSECOND,
}  # fmt: skip
"""SI size of the unit that a key of results.json ends in: the contract of the file, from shared/formats.md."""


@cache
def job_of(name: str) -> Job:
    return read_job(ROOT / "examples" / name)


@cache
def made(name: str) -> bytes:
    return written(digital_certificate(results(name), job_of(name), html=HTML))


@cache
def certificate(name: str) -> Certificate:
    return read(made(name), name)


def quantities(name: str) -> dict[str, Quantity]:
    """Every quantity by its id."""
    found: dict[str, Quantity] = {}

    def walk(part: Any) -> None:
        if isinstance(part, Quantity) and part.id is not None:
            found[part.id] = part
        for inner in getattr(part, "parts", ()):
            walk(inner)

    whole = certificate(name)
    for result in whole.measurements[0].results:
        walk(result.data)
    for statement in whole.administrative.statements:
        walk(statement.data)
    return found


@cache
def si_of(unit: str) -> float:
    """SI size of a unit in D-SI, by PTB's parser."""
    dsi = pytest.importorskip("dsi_unit")
    found = dsi.DsiUnit(unit)
    assert found.valid
    assert not found.warnings
    return float(found.to_base_unit_tree().scale_factor)


def expected(key: str) -> float | None:
    """SI size of a key's unit; None where its last word names none."""
    fitting = [ending for ending in SI if key == ending or key.endswith(f"_{ending}")]
    return SI[max(fitting, key=len)] if fitting and key != "k" else None


def numbers(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """Every number below a key, by its path."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers(inner, (*path, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from numbers(inner, (*path, str(i)))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value


def stated(name: str) -> dict[str, set[tuple[Decimal, str]]]:
    """Every number of the certificate with its unit, by the first part of its id."""
    found: dict[str, set[tuple[Decimal, str]]] = {}
    for id_, quantity in quantities(name).items():
        mine, value = found.setdefault(id_.split(".")[0], set()), quantity.value
        if isinstance(value, Real):
            mine.add((value.value, value.unit))
            mine |= {(number, value.unit) for number in uncertain(value.uncertainty)}
        elif isinstance(value, RealList):
            units = value.units * len(value.values) if len(value.units) == 1 else value.units
            mine |= set(zip(value.values, units, strict=True))
            if value.uncertainty is not None:
                mine |= {(number, units[0]) for number in spread(value.uncertainty)}
    return found


def uncertain(given: Any) -> tuple[Decimal, ...]:
    """Numbers of an uncertainty: U with k, and u, which is U over k; or an interval with u."""
    if isinstance(given, Expanded):
        return (given.uncertainty, given.factor, given.uncertainty / given.factor)
    return (given.standard, given.low, given.high) if isinstance(given, Interval) else ()


def spread(given: Any) -> Iterator[Decimal]:
    for name in given.FIELDS:
        if name != "distributions":
            yield from getattr(given, name)
    if hasattr(given, "uncertainties"):
        factors = given.factors * len(given.uncertainties) if len(given.factors) == 1 else given.factors
        yield from (U / k for U, k in zip(given.uncertainties, factors, strict=True))


def by_number(found: set[tuple[Decimal, str]]) -> Mapping[str, set[str]]:
    """Units of each number, by its first eight digits."""
    units: dict[str, set[str]] = {}
    for value, unit in found:
        units.setdefault(f"{float(value):.7e}", set()).add(unit)
    return units


def there(number: float, si: float | None, found: Mapping[str, set[str]]) -> bool:
    """Whether a number stands there, in a unit of that SI size where one is expected."""
    near = (number * (1 + side) for side in (-2e-9, 0.0, 2e-9))
    alike = {unit for value in near for unit in found.get(f"{value:.7e}", ())}
    return bool(alike) if si is None else any(isclose(si_of(unit), si, rel_tol=1e-9) for unit in alike)


@pytest.mark.parametrize("name", REPORTED)
def test_every_figure_is_there_with_its_unit(name: str) -> None:
    data, found, missing = results(name), stated(name), []
    free = {key for one in data["identifiability"].get("undetermined", ()) for key in one}
    for section in data.keys() - STATED_ELSEWHERE - {"covariance"}:
        known = by_number(found.get(section, set()))
        for path, number in numbers(data[section], (section,)):
            keys = [key for key in path if not key.isdecimal()]
            in_quantity = keys[-1] in ("value", "u", "U", "k", "interval95")
            owner = keys[-2] if in_quantity and len(keys) > 1 else keys[-1]
            parameter = ".".join(keys[1:3]) if section == "estimates" else ".".join(keys[:2])
            if section in ("estimates", "artefact") and parameter in free:
                continue
            hidden = keys[-1] == "interval95" and isclose_interval(data, path)
            hidden = hidden or (
                keys[-1] in ("U", "k") and (owner_of(data, path).get("k") or 1.0) < 1
            )  # a DCC has none below 1
            exact = keys[-1] in ("u", "U") and number == 0  # without an uncertainty
            if not hidden and not exact and not there(number, None if keys[-1] == "k" else expected(owner), known):
                missing.append((path, number))
    assert missing == [], missing[:8]
    assert sum(map(len, found.values())) > 10


def owner_of(data: Any, path: tuple[str, ...]) -> Any:
    for key in path[:-1]:
        data = data[int(key) if isinstance(data, list) else key]
    return data


def isclose_interval(data: Any, path: tuple[str, ...]) -> bool:
    """Whether an interval is symmetric to the two digits that are printed of U, so that U says it."""
    data = owner_of(data, path[:-1])
    low, high = data["interval95"]
    digits = 1 - math.floor(math.log10(data["U"] or 1.0))
    above, below = (round(side, digits) for side in (high - data["value"], data["value"] - low))
    return above == below or abs((high - data["value"]) - (data["value"] - low)) < 0.06 * data["U"]


@pytest.mark.parametrize("name", REPORTED)
def test_it_is_valid_by_the_schema(name: str) -> None:
    assert by_lxml("3.2.1").validate(etree.fromstring(made(name), etree.XMLParser(huge_tree=True)))


@pytest.mark.parametrize("name", REPORTED)
def test_every_unit_is_one_of_d_si(name: str) -> None:
    for unit in {unit for found in stated(name).values() for _, unit in found}:
        assert si_of(unit) > 0


def test_value_and_uncertainty_are_those_of_results_json_to_the_last_digit() -> None:
    found, data = quantities(MEASURED)["estimates.scale_x.ppm"].value, results(MEASURED)["estimates"]["scale_x"]["ppm"]
    assert isinstance(found, Real)
    assert isinstance(found.uncertainty, Expanded)
    assert (str(found.value), found.unit) == (repr(data["value"]), r"\ppm")
    assert (str(found.uncertainty.uncertainty), str(found.uncertainty.factor)) == (repr(data["U"]), repr(data["k"]))
    assert found.uncertainty.probability == Decimal("0.95")


def test_an_interval_that_is_not_symmetric_is_stated_beside_u() -> None:
    data, found = results(MEASURED)["noise"]["coordinate_um"], quantities(MEASURED)
    interval = found["noise.coordinate_um.interval95"].value
    assert isinstance(interval, Real)
    assert isinstance(interval.uncertainty, Interval)
    assert [float(interval.uncertainty.low), float(interval.uncertainty.high)] == data["interval95"]
    assert "estimates.scale_x.ppm.interval95" not in found


def test_what_the_recording_does_not_determine_has_no_figure() -> None:
    """The mean of a prior is no result; the differences, which are determined, are there."""
    data, found = results("bryan-simulated"), quantities("bryan-simulated")
    free = [key for one in data["identifiability"]["undetermined"] for key in one]
    assert len(free) == 4
    for key in free:
        path = key if key.startswith("artefact.") else f"estimates.{key}"
        assert str(found[path].value) == "not determined by this recording"
        assert f"{path}.interval95" not in found
    assert {"scale_x.ppm", "artefact.length_mm"} & set(labels("bryan-simulated")) == set()
    differences = found["differences.ppm"].value
    assert isinstance(differences, RealList)
    assert [float(value) for value in differences.values] == [one["ppm"]["value"] for one in data["differences"]]


def labels(name: str) -> tuple[str, ...]:
    value = quantities(name)["covariance"].value
    assert isinstance(value, RealList)
    return value.labels


def test_estimates_stand_with_their_covariance_as_a_95_percent_ellipsoid() -> None:
    value, data = quantities(MEASURED)["covariance"].value, results(MEASURED)["covariance"]
    assert isinstance(value, RealList)
    assert value.region is not None
    assert list(value.labels) == data["parameters"]
    assert [[float(one.value) for one in column.covariances] for column in value.region.columns] == data["matrix"]
    units = [[one.unit for one in column.covariances] for column in value.region.columns]
    assert units[0][3] == r"\arcsecond\ppm"
    assert isclose(si_of(units[0][3]), 1e-6 * ARCSECOND)
    assert isclose(float(value.region.factor), sqrt(stats.chi2.ppf(0.95, len(value.values))), abs_tol=1e-6)


@pytest.mark.parametrize(("decision", "word"), [
    ("pass", "pass"), ("fail", "fail"), ("conditional pass", "conditionalPass"), ("conditional fail", "conditionalFail"),
    ("undecided", "noPass"), ("incomplete", "noPass"), ("remeasure", "noPass"),
])  # fmt: skip
def test_each_decision_is_one_word_of_the_schema_and_none_but_a_pass_reads_as_one(decision: str, word: str) -> None:
    data = results(MEASURED)
    decided = {**data, "conformity": [{**data["conformity"][0], "decision": decision}]}
    statement = conformity(digital_certificate(decided, complete(), html=None))
    assert statement.conformity == IN_THE_SCHEMA[decision] == word
    assert statement.ref_type == ("basic_conformity", f"cmm_{decision.replace(' ', '')}")
    assert str(statement.declaration).startswith(decision)
    assert ("noPass" in str(statement.declaration)) == (word == "noPass")
    assert set(IN_THE_SCHEMA) == set(OUTCOME_WORDS)


def conformity(whole: Certificate) -> Statement:
    return next(one for one in whole.administrative.statements if one.id == "conformity.0")


def test_a_statement_names_standard_rule_limits_and_probability() -> None:
    one, statement, found = results(MEASURED)["conformity"][0], conformity(certificate(MEASURED)), quantities(MEASURED)
    assert (statement.norms, statement.references) == ((one["standard"],), (one["rule"],))
    wanted = {"value_um": one["value_um"], "limit_um": one["limit_um"], "guard_band_um": one["guard_band_um"],
              "acceptance_limit_um": one["limit_um"] - one["guard_band_um"],
              "probability_conforming": one["probability_conforming"]}  # fmt: skip
    for key, figure in wanted.items():
        value = found[f"conformity.0.{key}"].value
        assert isinstance(value, Real)
        assert isclose(float(value.value), figure, rel_tol=1e-9)
        assert isclose(si_of(value.unit), 1.0 if "probability" in key else 1e-6)
    value = found["conformity.0.value_um"].value
    assert isinstance(value, Real)
    assert isinstance(value.uncertainty, Expanded)
    assert isclose(float(value.uncertainty.uncertainty), 2 * one["u_um"], rel_tol=1e-9)
    assert isclose(float(value.uncertainty.probability), stats.norm.cdf(2) - stats.norm.cdf(-2), abs_tol=5e-5)


def test_a_range_that_may_be_zero_is_stated_in_words_by_its_interval_as_on_the_page() -> None:
    """3 µm with U = 8 µm against 10 µm: 0 to 11 µm, and no ± U; 340 ± 14 µm where U is the smaller."""
    data = results(MEASURED)
    near = {**data["conformity"][0], "value_um": 3.0, "u_um": 4.0, "limit_um": 10.0005, "decision": "undecided"}
    stated = str(conformity(digital_certificate({**data, "conformity": [near]}, complete(), html=None)).declaration)
    assert data["conformity"][0]["signed"] is False
    assert "undecided: 0.0 to 11.0 µm, limit 10.0005 µm" in stated
    assert "fail: 340 ± 14 µm, limit 60 µm" in str(conformity(certificate(MEASURED)).declaration)
    both = {**near, "signed": True}
    stated = str(conformity(digital_certificate({**data, "conformity": [both]}, complete(), html=None)).declaration)
    assert "undecided: 3.0 ± 8.0 µm, limit 10.0005 µm" in stated


def complete() -> Job:
    """The measured example with all that ISO/IEC 17025 asks for."""
    job = job_of(MEASURED)
    facts, lab = job.facts.job, job.facts.laboratory
    stated = facts.model_copy(update={
        "number": "K 4711", "customer": "Ball & Co", "address": "1 Way\nTown", "issued": facts.date, "order": "77",
        "received": facts.date,
    })  # fmt: skip
    laboratory = lab.model_copy(update={
        "name": "Laboratory", "address": "2 Way", "signatory": "A. N. Other", "country": "CA", "accreditation": "D-K-1",
    })  # fmt: skip
    machine = job.facts.machine.model_copy(update={"serial": "S 1"})
    artefact = job.facts.artefact.model_copy(update={"certificate": CHAIN})
    tables = {"job": stated, "laboratory": laboratory, "machine": machine, "artefact": artefact}
    return replace(job, facts=job.facts.model_copy(update=tables))


def test_a_complete_certificate_says_who_for_whom_and_what() -> None:
    whole = read(written(digital_certificate(results(MEASURED), complete(), html=HTML)), "c.xml")
    administrative = whole.administrative
    core = administrative.core
    assert (core.identifier, core.country, str(core.issued), core.issued) == (
        "K 4711",
        "CA",
        "2004-09-01",
        core.received,
    )
    assert administrative.items.items[0].identifications[0].value == "S 1"
    assert str(administrative.laboratory.contact.name) == "Laboratory"
    assert administrative.laboratory.code == "D-K-1"
    assert str(administrative.persons[0].person.name) == "A. N. Other"
    assert str(administrative.customer.name) == "Ball & Co"
    assert [str(one) for one in administrative.customer.location.further] == ["1 Way\nTown"]
    assert [one.value for one in core.identifications] == [MEASURED, "77"]
    assert all("cmm_notACertificate" not in one.ref_type for one in administrative.statements)
    assert [one.valid for one in administrative.statements if one.valid is not None] == []
    standard = whole.measurements[0].equipment
    assert standard is not None
    assert standard.equipment[0].certificate is not None
    assert standard.equipment[0].certificate.referral_id == "4711"
    assert standard.equipment[0].certificate.in_validity_range
    traced = next(one for one in administrative.statements if "basic_metrologicallyTraceableToSI" in one.ref_type)
    assert traced.traceable
    assert "certificate 4711 of 2003-05-01, issued by NMI" in str(traced.declaration)
    assert whole.document is not None
    assert whole.document.data == HTML
    assert by_lxml("3.2.1").validate(etree.fromstring(written(whole)))


def test_what_is_not_stated_says_so_and_makes_a_draft() -> None:
    administrative = certificate(MEASURED).administrative
    assert administrative.core.identifier == f"DRAFT-{MEASURED}"
    assert str(administrative.laboratory.contact.name) == "not stated"
    assert administrative.core.country == "ZZ"
    assert administrative.statements[0].valid is False


def test_nobody_measured_so_nothing_of_it_can_be_taken_for_a_certificate() -> None:
    for name in REPORTED:
        if job_of(name).origin == "measured":
            continue
        text, whole = made(name).decode(), certificate(name)
        administrative = whole.administrative
        word = job_of(name).origin.upper()
        assert administrative.core.identifier.startswith(f"{word}-NOT-A-CERTIFICATE-")
        assert administrative.core.issued is None
        assert str(administrative.laboratory.contact.name) == "nobody: nothing is certified"
        assert [str(one.person.name) for one in administrative.persons] == ["nobody: nothing is certified"]
        assert administrative.statements[0].valid is False
        assert f"{word} RECORDING" in str(whole.measurements[0].name)
        assert "<dcc:conformity" not in text
        assert "basic_conformity" not in text
        assert "<dcc:traceable>true" not in text
        assert whole.document is not None
        assert whole.document.file_name == f"certificate-{word.lower()}.html"


def test_temperatures_are_in_kelvin_and_in_degrees_celsius() -> None:
    job = job_of(MEASURED)
    recorded = with_columns(job.points, temp_artefact_c=np.linspace(19.5, 20.75, len(job.points)))
    whole = digital_certificate(results(MEASURED), replace(job, points=recorded), html=None)
    ends = next(one for one in whole.measurements[0].conditions if one.ref_type == ("basic_temperature",)).data.parts
    lowest, highest = (end.value.values for end in ends if isinstance(end, Quantity) and isinstance(end.value, Hybrid))
    assert [(str(one.value), one.unit) for one in (*lowest, *highest) if isinstance(one, Real)] == [
        ("292.65", r"\kelvin"), ("19.5", r"\degreecelsius"), ("293.90", r"\kelvin"), ("20.75", r"\degreecelsius"),
    ]  # fmt: skip


def test_it_carries_results_json_and_says_the_language_of_the_job_beside_english() -> None:
    data = {**results(MEASURED), "job": {**results(MEASURED)["job"], "language": "de"}}
    whole = digital_certificate(data, job_of(MEASURED), html=None)
    assert (whole.administrative.core.languages, whole.administrative.core.mandatory_languages) == (
        ("de", "en"),
        ("de",),
    )
    named = whole.measurements[0].results[0].name
    assert [one.language for one in named.contents] == ["de", "en"]
    assert named.contents[0].text != named.contents[1].text == "Figures of performance"
    file = whole.measurements[0].results[-1].data.parts[0]
    assert json.loads(file.data) == data
    assert file.data == as_json(data)


def test_the_same_results_give_the_same_bytes() -> None:
    again = written(digital_certificate(json.loads(as_json(results(MEASURED))), job_of(MEASURED), html=HTML))
    assert again == made(MEASURED)
