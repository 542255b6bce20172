"""What ISO/IEC 17025 asks of a certificate, in words for customers."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from pydantic import BaseModel

from cmm_uq.app.commands.forms import shipped
from cmm_uq.base.messages import Message, Text, Verbatim
from cmm_uq.certificate.certificate import conditions
from cmm_uq.certificate.clauses import claimed, formal_warnings
from cmm_uq.certificate.document import Document
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.beside import ShortGaugeFacts
from cmm_uq.jobs.tables.artefact import Traceability
from tests.artefacts.simulated import document, job_read
from tests.certificate.saying import leaves
from tests.conftest import MACHINE_JOBS, ROOT

CERTIFIED = {
    "digitizer-simulated", "gauge-blocks-simulated", "iota-1102-20C", "plate-simulated", "shift-plate-simulated",
    "shift-simulated", "sphere-simulated", "step-gauge-simulated", "triangle-simulated",
}  # fmt: skip
"""Examples of whose artefact something is certified."""

UNCERTIFIED = {"bryan-simulated", "iota-1102-20C-compensated", "plane-simulated", "plate-two-dates-simulated"}


def changed(job: Job, /, **tables: dict[str, Any]) -> Job:
    """The job with other values in its tables."""
    facts: BaseModel = job.facts
    parts = {name: getattr(facts, name).model_copy(update=values) for name, values in tables.items()}
    return replace(job, facts=facts.model_copy(update=parts))


def measured(name: str, /, **tables: dict[str, Any]) -> Job:
    """An example as if somebody had measured it."""
    return changed(changed(job_read(name), job={"origin": "measured"}), **tables)


def missing(job: Job) -> list[str]:
    """Keys that the warning names."""
    found = [text for text in formal_warnings(job) if text.startswith("Not complete by ISO/IEC 17025:2017")]
    return [part.rpartition(": ")[2] for text in found for part in text.removesuffix(".").split("; ")[1:]]


WHOLE = {
    "laboratory": {"name": "L", "address": "A", "signatory": "S"},
    "job": {"origin": "measured", "place": "P", "customer": "C", "address": "D", "procedure": "M", "conditions": "20 °C",
            "issued": dt.date(2030, 1, 1)},
    "machine": {"serial": "7"},
}  # fmt: skip
CHAIN = Traceability(
    number="4711", laboratory="NMI", date=dt.date(2003, 5, 1), due=dt.date(2029, 5, 1), issuer="national institute",
    arrangement="CIPM MRA",
)  # fmt: skip
KEYS = ["[artefact.certificate] " + key for key in ("number", "laboratory", "issuer", "date", "due")]


@pytest.mark.parametrize("name", sorted(CERTIFIED))
def test_an_artefact_of_any_kind_that_is_certified_needs_its_certificate(name: str) -> None:
    job = measured(name, **WHOLE, artefact={"certificate": None})
    assert missing(job) == KEYS
    assert missing(changed(job, artefact={"certificate": CHAIN})) == []


@pytest.mark.parametrize("name", sorted(UNCERTIFIED))
def test_one_of_which_nothing_is_certified_needs_none(name: str) -> None:
    assert missing(measured(name, **WHOLE)) == []


@pytest.mark.parametrize("name", sorted(CERTIFIED | UNCERTIFIED))
@pytest.mark.parametrize(
    ("table", "key"), [(table, key) for table, keys in WHOLE.items() for key in keys if key != "origin"]
)
def test_each_statement_that_is_missing_is_named_with_its_key(name: str, table: str, key: str) -> None:
    empty = None if key == "issued" else ""
    job = changed(measured(name, **WHOLE, artefact={"certificate": CHAIN}), **{table: {key: empty}})
    assert missing(job) == [f"[{table}] {key}"]


@pytest.mark.parametrize("name", sorted(CERTIFIED | UNCERTIFIED))
def test_a_recording_that_nobody_measured_is_asked_for_nothing(name: str) -> None:
    job = job_read(name)
    assert (formal_warnings(job) == ()) == (job.origin != "measured")


@pytest.mark.parametrize(("says", "circular"), [
    ("DEA Iota 1102", True), ("  dea iota 1102 ", True), ("A-17", True), ("another", False), ("", False),
])  # fmt: skip
def test_an_artefact_certified_on_the_machine_that_it_tests_is_told(says: str, circular: bool) -> None:
    chain = CHAIN.model_copy(update={"machine": says})
    job = measured("iota-1102-20C", machine={"serial": "A-17"}, artefact={"certificate": chain})
    assert any("certified on the machine that it now tests" in text for text in formal_warnings(job)) == circular
    assert ("no independent reference" in claimed(job).statement) == circular
    assert ("traceable to the metre" in claimed(job).statement) != circular
    assert (missing(job)[-1:] == ["[artefact.certificate] machine"]) == circular


DAY, BEFORE, AFTER = dt.date(2026, 3, 2), dt.date(2026, 3, 1), dt.date(2026, 3, 3)


@pytest.mark.parametrize(("dates", "chain", "told"), [
    ({"issued": BEFORE}, {}, ["issued before it was measured, 2026-03-01 against 2026-03-02 ([job] issued)"]),
    ({"issued": DAY}, {}, []),
    ({}, {"date": AFTER}, ["artefact, the certificate is dated 2026-03-03, after the measurement of 2026-03-02 "
                           "([artefact.certificate] date)"]),
    ({}, {"date": DAY}, []),
    ({}, {"due": BEFORE}, ["artefact, the calibration was due on 2026-03-01, before the measurement of 2026-03-02 "
                           "([artefact.certificate] due)"]),
    ({}, {"due": DAY, "date": DAY}, []),
    ({}, {"due": DAY, "date": AFTER}, ["after the measurement of", "was due before the certificate was issued"]),
    ({"recalibration_agreed": BEFORE}, {}, ["agreed for a day before this one"]),
])  # fmt: skip
def test_dates_out_of_their_order_are_told(
    dates: dict[str, dt.date], chain: dict[str, dt.date], told: list[str]
) -> None:
    job = measured("sphere-simulated", job={"origin": "measured", "date": DAY, **dates},
                   artefact={"certificate": Traceability(**chain)})  # fmt: skip
    found = [text for text in formal_warnings(job) if text.startswith("Dates out of order")]
    assert len(found) == len(told)
    assert all(part in text for text, part in zip(found, told, strict=True))


def test_the_statement_of_traceability_names_the_certificate_that_carries_it() -> None:
    job = measured("sphere-simulated", artefact={"certificate": CHAIN})
    assert "Artefact: certificate 4711 of 2003-05-01, issued by NMI, " in claimed(job).statement
    assert "not shown to be traceable" in claimed(measured("sphere-simulated")).statement


@pytest.mark.parametrize(("name", "said"), [
    ("bryan-simulated", "No certified length enters"), ("plate-two-dates-simulated", "changes since the earlier recording"),
])  # fmt: skip
def test_without_a_certified_length_nothing_is_said_to_be_traceable_to_the_metre(name: str, said: str) -> None:
    text = claimed(measured(name, artefact={"certificate": CHAIN})).statement
    assert said in text
    assert "are traceable to" not in text


def test_the_conditions_are_those_stated_and_the_least_and_largest_recorded_temperature() -> None:
    job = measured("iota-1102-20C")
    points = replace(job.points, columns={"temp_artefact_c": job.points.xyz[:, 0] * 0 + 20.5})
    points.columns["temp_artefact_c"][:2] = -3.25, 31.0
    assert dict(conditions(replace(job, points=points)).rows) == {
        "Conditions": "20 °C, controlled; 11 thermocouples on the machine",
        "Temperatures recorded": "artefact −3.25 to 31.00 °C",
    }
    assert conditions(changed(job, job={"conditions": ""})).rows == ()


def test_the_page_on_the_standard_tells_of_every_clause_once_and_of_every_key_that_is_warned_of() -> None:
    """ISO/IEC 17025:2017, 7.8.2.1 a to p and 7.8.4.1 a to f; rows marked as warned name exactly the keys of the warnings."""
    page = (ROOT / "docs" / "iso17025.md").read_text(encoding="utf-8")
    table = page.split("| clause | asks for |")[1].split("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in table]
    letters = [cell[0].removeprefix("7.8.2.1 ").removeprefix("7.8.4.1 ") for cell in cells]
    after = letters.index("7.8.2.2")
    assert "".join(letters[:after]) == "abcdefghijklmnop"
    assert "".join(letters[after + 1 :])[:6] == "abcdef"
    warned = {key for cell in cells if "warned" in cell[2] for key in re.findall(r"`([^`]+)`", cell[3]) if "[" in key}
    gauge = ShortGaugeFacts(file="s.csv", length_mm=20.0, u_um=0.1)
    bare = measured("step-gauge-simulated", job={"origin": "measured", "procedure": ""})
    assert warned == set(missing(replace(bare, facts=bare.facts.model_copy(update={"short_gauge": gauge}))))


def test_an_interim_check_says_that_it_is_no_certificate_and_lacks_none_of_what_one_states() -> None:
    told = [str(text) for text in formal_warnings(measured("step-gauge-simulated", job={"interim": True}))]
    assert told[0].startswith("An interim check")
    assert not [text for text in told if "17025" in text]


REPORTED = sorted(
    path.name for path in MACHINE_JOBS
    if not path.name.startswith("plan-") and path.name not in ("iota-1102-maps", "iota-1102-20C-against-simulation")
)  # fmt: skip


@cache
def keys() -> re.Pattern[str]:
    """Keys that are no words: with an underscore, of any depth of the schema of a job; tables in brackets; job.toml."""

    def names(schema: Any) -> Iterator[str]:
        if isinstance(schema, dict):
            yield from (schema.get("properties") or {})
            for part in schema.values():
                yield from names(part)
        elif isinstance(schema, list):
            for part in schema:
                yield from names(part)

    every = {name for schema in ("job", "part") for name in names(json.loads(shipped(schema)))}
    joined = [*sorted(name for name in every if "_" in name), "job.toml", "temp_artefact_c", "time_s", "tip_x_mm"]
    tables = sorted(name for name in every if "_" not in name)
    return re.compile(rf"\b({'|'.join(map(re.escape, joined))})\b|\[\[?({'|'.join(map(re.escape, tables))})\b")


def customers(made: Document) -> Document:
    """Without the annex of opinions, the names of the files, and where they come from."""
    return replace(
        made, attachments=(), produced_by=Verbatim(""), sections=tuple(one for one in made.sections if not one.opinion)
    )


def said(text: Text) -> Iterator[str]:
    """What a text says by itself; what the user wrote, in whichever message, is the user's."""
    if isinstance(text, Message):
        yield re.sub(r"\{[^}]*\}", "", text.pattern)
        for argument in text.arguments.values():
            if isinstance(argument, Text):
                yield from said(argument)


def mentioned(made: Document) -> list[str]:
    return sorted({f"{found[0]}: {part}" for text in leaves(customers(made)) for part in said(text)
                   for found in keys().finditer(part)})  # fmt: skip


@pytest.mark.parametrize("name", REPORTED)
def test_no_key_of_a_job_file_stands_on_a_certificate(name: str) -> None:
    assert mentioned(document(name)) == []
