"""The statement of traceability, against ILAC-P10:07/2020 by hand: of which certificates it is claimed, and when it is not.

Routes 1 and 2 (a national institute under the CIPM MRA, a laboratory accredited by a signatory of the ILAC arrangement) are
ISO/IEC 17025:2017, A.3.2 a and b too. The others are accepted on evidence that the laboratory itself holds.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from cmm_uq.certificate.clauses import claimed, clauses, clauses_data, draft, traceability_section
from cmm_uq.certificate.digital_certificate.administration import Languages, formal_statements
from cmm_uq.certificate.document import Paragraph
from cmm_uq.jobs.acquired import AcquisitionRecord, Provenance
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.beside import ShortGauge, ShortGaugeFacts
from cmm_uq.jobs.tables.artefact import ThermometerFacts, Traceability
from tests.certificate.test_completeness import changed, measured

DAY = dt.date(2026, 3, 2)
NATIONAL: dict[str, Any] = {
    "number": "1234-PTB-25", "laboratory": "PTB", "date": dt.date(2025, 6, 1), "due": dt.date(2027, 6, 1),
    "issuer": "national institute", "arrangement": "CIPM MRA",
}  # fmt: skip
ACCREDITED: dict[str, Any] = {
    "number": "K-77", "laboratory": "Messlabor AG", "date": dt.date(2025, 6, 1), "due": dt.date(2027, 6, 1),
    "issuer": "accredited", "accreditation": "D-K-15000-01-00", "accredited_by": "DAkkS", "arrangement": "ILAC MRA",
}  # fmt: skip
EVIDENCE = {"evidence": "audit report 12 of 2025-04-01, comparison with our own step gauge"}
ORDER = ("not shown", "by evidence", "traceable")
NOT_SHOWN = "The results are not shown to be traceable to the International System of Units (SI). "
TRACEABLE = "The results are traceable to the metre of the International System of Units (SI) by what follows. "


def job_with(chain: dict[str, Any] | None, **tables: dict[str, Any]) -> Job:
    """A measured sphere, whose certificate says this."""
    certificate = None if chain is None else Traceability(**chain)
    return changed(
        measured("sphere-simulated", job={"origin": "measured", "date": DAY}, artefact={"certificate": certificate}),
        **tables,
    )


def without(chain: dict[str, Any], *keys: str, **other: Any) -> dict[str, Any]:
    """A certificate that does not state these, and states others."""
    return {key: value for key, value in chain.items() if key not in keys} | other


@pytest.mark.parametrize(("certified_on", "serial", "own"), [
    ("", "1102", False), ("", "", False), ("Bridge machine", "", True), ("bridge  MACHINE", "", True),
    ("Bridge-machine", "", True),
    ("1102", "1102", True), ("DEA Iota, no. 1102", "1102", True), ("DEA Iota 1102", "IOTA 1102", True),
    ("PTB's large bridge machine", "1102", False), ("DEA Iota 11022", "1102", False), ("PMM 12", "12", False),
    ("PMM 12", "PMM", False),
])  # fmt: skip
def test_the_machine_is_recognised_however_the_artefacts_certificate_writes_it(
    certified_on: str,
    serial: str,
    own: bool,
) -> None:
    """As its name or serial number, or with that number among its words, where it is a telling one."""
    found = job_with(NATIONAL | {"machine": certified_on}, machine={"name": "Bridge machine", "serial": serial})
    assert found.facts.certified_on_this_machine == own


@pytest.mark.parametrize(("chain", "claim", "sentence"), [
    (NATIONAL, "traceable", TRACEABLE +
     "Artefact: certificate 1234-PTB-25 of 2025-06-01, issued by PTB, a national metrology "
     "institute whose service the CIPM MRA covers (route 1 of ILAC-P10:07/2020), valid until 2027-06-01."),
    (ACCREDITED, "traceable", TRACEABLE +
     "Artefact: certificate K-77 of 2025-06-01, issued by Messlabor AG, accredited by DAkkS "
     "(D-K-15000-01-00), a signatory of the ILAC MRA (route 2 of ILAC-P10:07/2020), valid until 2027-06-01."),
    (without(ACCREDITED, arrangement="EA MLA"), "traceable", "a signatory of the EA MLA"),
    (without(NATIONAL, "arrangement", **EVIDENCE), "by evidence", "by a service that the CIPM MRA does not cover (route 3a of "
     "ILAC-P10:07/2020; evidence held: audit report 12 of 2025-04-01, comparison with our own step gauge)"),
    (without(ACCREDITED, "arrangement", **EVIDENCE), "by evidence", "a laboratory that no arrangement covers (route 3b of"),
    (without(NATIONAL, "arrangement", issuer="not accredited", **EVIDENCE), "by evidence", "(route 3b of"),
    (without(NATIONAL, "arrangement", issuer="in-house", **EVIDENCE), "by evidence", "an in-house calibration"),
    (without(NATIONAL, "arrangement", issuer="reference material", **EVIDENCE), "by evidence", "certified reference material"),
    (without(NATIONAL, "arrangement", issuer="consensus", **EVIDENCE), "not shown", "by consensus is no route to the SI"),
    (None, "not shown", NOT_SHOWN + "Artefact: no certificate is stated."),
    ({"number": "7", "laboratory": "our own toolroom"}, "not shown", NOT_SHOWN +
     "Artefact: whether its issuer is a national "
     "metrology institute or an accredited laboratory is not stated; the date of the certificate is not stated; until when "
     "the calibration holds is not stated."),
    (without(NATIONAL, "arrangement"), "not shown", "no arrangement covers this calibration, and no evidence"),
    (without(ACCREDITED, "arrangement"), "not shown", "no arrangement covers this calibration, and no evidence"),
    (without(NATIONAL, "arrangement", issuer="not accredited"), "not shown", "no evidence of the issuer's competence"),
    (without(ACCREDITED, "accreditation"), "not shown", "the number of the issuer's accreditation is not stated"),
    (without(ACCREDITED, "accredited_by"), "not shown", "who accredited the issuer is not stated"),
    (without(ACCREDITED, accreditation=" "), "not shown", "the number of the issuer's accreditation is not stated"),
    (without(NATIONAL, "number"), "not shown", "the number of the certificate is not stated"),
    (without(NATIONAL, "laboratory"), "not shown", "who issued the certificate is not stated"),
    (without(NATIONAL, "date"), "not shown", "the date of the certificate is not stated"),
    (without(NATIONAL, "due"), "not shown", "until when the calibration holds is not stated"),
])  # fmt: skip
def test_traceability_is_claimed_of_an_issuer_by_its_route_and_of_nothing_else(
    chain: dict[str, Any] | None, claim: str, sentence: str
) -> None:
    found = claimed(job_with(chain))
    assert found.claim == claim
    assert sentence in found.statement
    assert ("are traceable to" in found.statement) == (claim == "traceable")


@pytest.mark.parametrize(("dates", "claim"), [
    ({"date": DAY, "due": DAY}, "traceable"),
    ({"date": DAY + dt.timedelta(1), "due": dt.date(2027, 1, 1)}, "not shown"),
    ({"date": dt.date(2024, 1, 1), "due": DAY - dt.timedelta(1)}, "not shown"),
    ({"date": dt.date(2025, 3, 2), "interval_months": 12}, "traceable"),
    ({"date": dt.date(2025, 3, 1), "interval_months": 12}, "not shown"),
    ({"date": dt.date(2025, 8, 31), "interval_months": 6}, "not shown"),
    ({"date": dt.date(2025, 11, 30), "interval_months": 4}, "traceable"),
])  # fmt: skip
def test_the_day_of_the_measurement_lies_between_the_dates_the_first_and_the_last_among_them(
    dates: dict[str, Any], claim: str
) -> None:
    assert claimed(job_with(without(NATIONAL, "date", "due", **dates))).claim == claim


@pytest.mark.parametrize(("date", "months", "last"), [
    (dt.date(2025, 8, 31), 6, dt.date(2026, 2, 28)), (dt.date(2024, 2, 29), 12, dt.date(2025, 2, 28)),
    (dt.date(2024, 12, 15), 1, dt.date(2025, 1, 15)), (dt.date(2023, 11, 30), 3, dt.date(2024, 2, 29)),
    (dt.date(9999, 12, 1), 24, dt.date(9999, 12, 1)),
])  # fmt: skip
def test_an_interval_ends_on_the_same_day_of_the_month_or_on_its_last(
    date: dt.date, months: int, last: dt.date
) -> None:
    assert Traceability(date=date, interval_months=months).until == last


@pytest.mark.parametrize("chain", [
    without(NATIONAL, interval_months=12), without(NATIONAL, arrangement="ILAC MRA"),
    without(ACCREDITED, arrangement="CIPM MRA"), without(NATIONAL, issuer="our own toolroom"),
])  # fmt: skip
def test_what_contradicts_itself_is_refused(chain: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Traceability(**chain)


@pytest.mark.parametrize("seed", range(200))
def test_leaving_out_any_word_never_improves_the_claim(seed: int) -> None:
    """The machine that it was certified on is no word for the claim: it is an admission against it."""
    rng = np.random.default_rng(seed)
    dates = [None, dt.date(2024, 1, 1), DAY, dt.date(2027, 1, 1)]
    words = {
        "number": ["", "7"], "laboratory": ["", "L"], "date": dates, "due": dates, "interval_months": [None, 12, 60],
        "issuer": [None, "national institute", "accredited", "not accredited", "in-house", "reference material", "consensus"],
        "accreditation": ["", "D-K-1"], "accredited_by": ["", "DAkkS"], "arrangement": [None, "CIPM MRA", "ILAC MRA"],
        "evidence": ["", "audit"],
    }  # fmt: skip
    compared = 0
    while not compared:
        likely = {key: values[-1 if rng.random() < 0.5 else rng.integers(len(values))] for key, values in words.items()}
        stated = likely | {"issuer": words["issuer"][rng.integers(len(words["issuer"]))]}
        stated = {key: value for key, value in stated.items() if value not in (None, "")}
        try:
            whole = claimed(job_with(stated)).claim
        except ValidationError:
            continue
        for key in stated:
            try:
                less = claimed(job_with(without(stated, key))).claim
            except ValidationError:
                continue  # a word fewer that nobody reads
            assert ORDER.index(less) <= ORDER.index(whole), (stated, key)
            compared += 1


WARM = replace(
    (SPHERE := job_with(NATIONAL)),
    points=replace(SPHERE.points, columns={**SPHERE.points.columns, "temp_artefact_c": SPHERE.points.xyz[:, 0] * 0 + 20.5}),
)  # fmt: skip
"""A sphere whose temperature was recorded."""


@pytest.mark.parametrize(("thermometers", "claim", "sentence"), [
    ([], "not shown", "Thermometer of the temperature of the artefact: no certificate is stated."),
    ([{"serial": "T 7"}], "not shown", "Thermometer T 7: the number of the certificate is not stated; who issued"),
    ([{"serial": "T 7", "certificate": Traceability(**ACCREDITED)}], "traceable",
     "traceable to the metre and the kelvin of the International System of Units (SI) by what follows. Artefact: "),
    ([{"serial": "T 7", "columns": ["temp_air_c"], "certificate": Traceability(**ACCREDITED)}], "not shown",
     "Thermometer of the temperature of the artefact"),
    ([{"serial": "T 7", "certificate": Traceability(**without(ACCREDITED, due=dt.date(2026, 3, 1)))}], "not shown",
     "Thermometer T 7: the calibration was due on 2026-03-01, before the measurement of 2026-03-02."),
    ([{"certificate": Traceability(**without(ACCREDITED, "arrangement", **EVIDENCE))}], "by evidence",
     "Thermometer of the temperature of the artefact: certificate K-77"),
])  # fmt: skip
def test_a_recorded_temperature_of_the_artefact_needs_its_thermometer(
    thermometers: list[dict[str, Any]], claim: str, sentence: str
) -> None:
    facts = WARM.facts.model_copy(update={"thermometer": [ThermometerFacts(**one) for one in thermometers]})
    found = claimed(replace(WARM, facts=facts))
    assert found.claim == claim
    assert sentence in found.statement


def test_temperatures_that_an_effect_goes_by_need_theirs_and_others_do_not() -> None:
    columns = {**WARM.points.columns, "temp_air_c": WARM.points.xyz[:, 0] * 0 + 20.5}
    columns["temp_x_c"] = columns["temp_air_c"]
    job = replace(WARM, points=replace(WARM.points, columns=columns))
    owners = [ThermometerFacts(certificate=Traceability(**NATIONAL))]
    job = replace(job, facts=job.facts.model_copy(update={"thermometer": owners}))
    assert claimed(job).claim == "traceable"
    thermal = changed(job, model={"effects": ["thermal_scale_x"]})
    assert claimed(thermal).statement.endswith("Thermometer of the temperature of scale X: no certificate is stated.")


@pytest.mark.parametrize(("serial", "claim"), [("T 7", "traceable"), ("T 8", "not shown"), ("", "not shown")])
def test_a_live_recording_names_the_thermometer_that_it_was_taken_with(serial: str, claim: str) -> None:
    said = AcquisitionRecord.model_validate({
        "schema": "cmm-uq/acquired/1", "program": "cmm-uq", "simulated": False, "recording_sha256": [], "sessions": [],
        "typed": 0, "instruments": [{"name": "bath", "serial": "T 7", "columns": {"temperature": "temp_artefact_c"}}],
    })  # fmt: skip
    thermometer = ThermometerFacts(serial=serial, certificate=Traceability(**ACCREDITED))
    facts = WARM.facts.model_copy(update={"thermometer": [thermometer]})
    found = claimed(replace(WARM, facts=facts, acquired=Provenance(said, False)))
    assert found.claim == claim
    assert ("the temperatures were read from T 7" in found.statement) == (claim == "not shown")


def test_a_short_gauge_has_a_certificate_of_its_own() -> None:
    def with_gauge(chain: Traceability | None, **artefact: Any) -> Job:
        gauge = ShortGaugeFacts(file="s.csv", length_mm=20.0, u_um=0.1, certificate=chain)
        job = job_with(NATIONAL, artefact={"certificate": Traceability(**NATIONAL), **artefact})
        recorded = ShortGauge(gauge, job.points, np.zeros((0, 2), dtype=np.int64))
        return replace(job, facts=job.facts.model_copy(update={"short_gauge": gauge}), short_gauge=recorded)

    assert claimed(with_gauge(None)).statement == NOT_SHOWN + "Short gauge: no certificate is stated."
    assert claimed(with_gauge(Traceability(**ACCREDITED))).claim == "traceable"
    alone = claimed(with_gauge(Traceability(**ACCREDITED), length_mm=None, u_um=None))
    assert alone.statement.startswith("No certified length of the artefact enters; the short gauge is the only length")
    assert "No certified length enters." not in alone.statement


def test_nothing_is_claimed_of_a_recording_that_nobody_measured() -> None:
    for origin in ("simulated", "compensated"):
        assert claimed(changed(job_with(NATIONAL), job={"origin": origin})).claim == "not shown"


@pytest.mark.parametrize(
    "chain", [NATIONAL, without(NATIONAL, "due"), without(NATIONAL, due=dt.date(2026, 3, 1)), None]
)
def test_the_clause_is_stated_where_traceability_is_shown_and_missing_where_it_is_not(
    chain: dict[str, Any] | None,
) -> None:
    job = job_with(chain)
    status = {one.status for one in clauses(job) if one.clause == "7.8.4.1 c"}
    assert status == ({"stated"} if chain is NATIONAL else {"missing"})
    assert draft(job)


@pytest.mark.parametrize("chain", [NATIONAL, without(NATIONAL, "arrangement", **EVIDENCE), {"number": "7"}, None])
def test_page_results_and_digital_certificate_say_the_same_of_it(chain: dict[str, Any] | None) -> None:
    job = job_with(chain)
    found = claimed(job)
    page = next(block.text for block in traceability_section(job, ()).blocks if isinstance(block, Paragraph))
    data = clauses_data(job)["traceability"]
    digital = next(
        one for one in formal_statements(job, {}, Languages("en"))
        if "basic_metrologicallyTraceableToSI" in one.ref_type
    )  # fmt: skip
    assert page == data["statement"] == found.statement == str(digital.declaration)
    assert data["claim"] == found.claim
    assert digital.traceable == (found.claim == "traceable")


@pytest.mark.parametrize("chain", [NATIONAL, ACCREDITED, without(NATIONAL, "due"), {"number": "7"}, None])
def test_a_sentence_for_customers_names_no_key(chain: dict[str, Any] | None) -> None:
    statement = claimed(job_with(chain)).statement
    assert not [word for word in ("[", "]", "accredited_by", "interval_months", "temp_", " = ") if word in statement]
