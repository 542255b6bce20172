"""ISO/IEC 17025:2017, 7.8 as data: what is stated, what is missing, and when a certificate is a draft."""

from __future__ import annotations

import datetime as dt
import json
import re
from dataclasses import replace

import pytest

from cmm_uq.app.commands.jobs.check import check_read
from cmm_uq.base.messages import NOTHING, say
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import DRAFT, clauses, clauses_data, contradictions, draft, missing
from cmm_uq.certificate.document import Document, Paragraph, Section
from cmm_uq.certificate.origin import marked
from cmm_uq.certificate.render import render_html
from cmm_uq.certificate.results.contents import head
from cmm_uq.jobs.job import Job, JobFacts
from cmm_uq.jobs.tables.identification import ReplacedCertificate as Replaced
from cmm_uq.jobs.verdicts import TOLERANCE_RULE
from tests.certificate.test_completeness import CHAIN, WHOLE, changed, measured
from tests.conftest import ROOT

REPLACED = Replaced(number="K-1", date=dt.date(2026, 3, 2), reason="wrong bar named", changed="name of the bar")


def document(job: Job) -> Document:
    sections = [
        Section(say("Results"), (Paragraph(say("one")),)),
        Section(say("More"), (Paragraph(say("two")),), opinion=True),
    ]
    return marked(certificate_of(job, sections, (), NOTHING), job)


def complete(**tables: dict[str, object]) -> Job:
    return changed(measured("iota-1102-20C", **WHOLE, artefact={"certificate": CHAIN}), **tables)


def test_every_clause_of_the_page_has_its_entries_and_no_other() -> None:
    page = (ROOT / "docs" / "iso17025.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?:(7\.8\.\d(?:\.\d)?) ?)?([a-p])? \|", page.split("## As data")[0], re.MULTILINE)
    told, last = set(), ""
    for number, letter in rows:
        last = number or last
        told.add(f"{last} {letter}".strip())
    entries = {one.clause for one in clauses(complete())} - {"7.8.1.1", "7.8.1.2", "7.8.1.3"}
    coarse = {"7.8.6.2": "7.8.6.2", "7.8.7": "7.8.7", "7.8.8": "7.8.8"}  # of these the page has one row
    assert {next((one for one in coarse if entry.startswith(one)), entry) for entry in entries} == told


def test_each_entry_is_stated_missing_not_applicable_or_the_laboratory_s() -> None:
    for job in (complete(), measured("step-gauge-simulated", job={"origin": "measured", "procedure": ""})):
        for one in clauses(job):
            assert bool(one.stated) == (one.status == "stated"), one
            assert one.key or one.status != "missing", one


def test_what_is_missing_is_what_the_warning_names_and_makes_a_draft() -> None:
    job = complete(laboratory={"signatory": ""}, machine={"serial": ""})
    assert [(one.clause, one.key) for one in missing(job)] == [
        ("7.8.2.1 g", "[machine] serial"), ("7.8.2.1 o", "[laboratory] signatory"),
    ]  # fmt: skip
    assert draft(job)
    assert not draft(complete())


def test_what_is_asked_for_only_where_there_is_any_makes_no_draft() -> None:
    job = complete()
    none = replace(job, facts=job.facts.model_copy(update={"conformity": []}))
    silent = {one.clause for one in clauses(none) if one.status == "not applicable"}
    assert {"7.8.2.1 h", "7.8.2.1 n", "7.8.2.2", "7.8.4.1 d", "7.8.4.1 e", "7.8.6.1", "7.8.8.3"} <= silent
    assert missing(none) == ()


def test_a_tolerance_is_a_statement_of_conformity_with_its_rule() -> None:
    job = complete()
    model = job.facts.model.model_copy(update={"tolerances": {"scale_x": 25.0}})
    stated = replace(job, facts=job.facts.model_copy(update={"conformity": [], "model": model}))
    found = {one.clause: (one.status, one.stated) for one in clauses(stated)}
    assert found["7.8.4.1 e"] == found["7.8.6.2 b"] == ("stated", "tolerances of the job")
    assert found["7.8.6.2 c"] == ("stated", TOLERANCE_RULE)


@pytest.mark.parametrize(("table", "values"), [("job", {"origin": "simulated"}), ("job", {"interim": True})])
def test_what_is_no_certificate_has_no_clauses_and_is_no_draft(table: str, values: dict[str, object]) -> None:
    job = complete(**{table: values}, laboratory={"name": ""})
    assert clauses_data(job) == {}
    assert not draft(job)
    assert document(job).banner != DRAFT
    assert check_read(job).clauses == ()


def test_a_draft_says_so_at_the_head_of_every_page_and_else_looks_like_the_certificate() -> None:
    whole, lacking = document(complete()), document(complete(job={**WHOLE["job"], "place": ""}))
    assert (whole.banner, lacking.banner) == (NOTHING, DRAFT)
    page = render_html(lacking)
    assert page.count(str.__str__(DRAFT)) == 1
    assert "@top-center" in page
    assert "Opinions and interpretations by ISO/IEC 17025:2017, 7.8.7." in page
    assert "DRAFT" not in render_html(whole)
    assert lacking.signatures == whole.signatures != ()


def test_the_list_is_plain_data_and_check_has_the_same() -> None:
    job = measured("iota-1102-20C")
    data = clauses_data(job)["iso17025"]
    assert json.loads(json.dumps(data)) == data == check_read(job).as_data()["iso17025"]
    assert all(set(one) == {"clause", "asks", "status", "stated", "key"} for one in data)
    place = next(one for one in data if one["key"] == "[job] place")
    assert place["stated"] == "McMaster University, Hamilton, Ontario"


def test_a_replaced_certificate_is_named_on_the_first_page_in_the_results_and_in_the_list() -> None:
    job = complete(job={**WHOLE["job"], "number": "K-2", "replaces": REPLACED})
    rows = dict(document(job).particulars[0].rows)
    assert rows["Replaces certificate"] == "K-1 of 2026-03-02"
    assert (rows["Reason for the replacement"], rows["Changed against it"]) == ("wrong bar named", "name of the bar")
    assert head(job)["job"]["replaces"] == {
        "number": "K-1", "date": "2026-03-02", "reason": "wrong bar named", "changed": "name of the bar",
    }  # fmt: skip
    stated = {one.clause: one.stated for one in clauses(job)}
    assert stated["7.8.8.1"] == "name of the bar (wrong bar named)"
    assert stated["7.8.8.3"] == "K-1 of 2026-03-02"
    simulated = changed(job, job={"origin": "simulated"})
    assert "Replaces certificate" not in dict(document(simulated).particulars[0].rows)


@pytest.mark.parametrize("key", ["number", "date", "reason", "changed"])
def test_number_date_reason_and_change_are_all_asked_for(key: str) -> None:
    given = REPLACED.model_dump() | {"reason": "r"}
    with pytest.raises(ValueError, match=key):
        Replaced.model_validate({name: value for name, value in given.items() if name != key})
    if key != "date":
        with pytest.raises(ValueError, match=key):
            Replaced.model_validate(given | {key: " "})


@pytest.mark.parametrize("own", [{"number": "K-1"}, {"id": "K-1"}])
def test_a_certificate_does_not_replace_itself(own: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="a number of its own"):
        JobFacts.model_validate({"id": "j", "date": dt.date(2026, 3, 1), "replaces": REPLACED, **own})


@pytest.mark.parametrize(("dates", "told"), [
    ({"issued": dt.date(2026, 3, 1), "replaces": REPLACED}, ["[job.replaces] date"]),
    ({"issued": dt.date(2026, 3, 2), "replaces": REPLACED}, []),
    ({"received": dt.date(2004, 9, 2)}, ["[job] received"]),
    ({"received": dt.date(2004, 9, 1)}, []),
])  # fmt: skip
def test_dates_of_receipt_and_replacement_out_of_their_order_are_told(
    dates: dict[str, object], told: list[str]
) -> None:
    found = contradictions(complete(job={**WHOLE["job"], **dates}))
    assert [re.findall(r"\((\[.*\] \w+)\)\.$", text)[0] for text in found] == told


def test_what_is_the_customer_s_or_another_s_is_told_apart() -> None:
    given = {"from_customer": "nominal lengths", "deviations": "one pose left out", "external": "temperatures by NMI"}
    made = document(complete(job={**WHOLE["job"], **given}))
    rows = dict(made.particulars[2].rows)
    assert rows["Data from the customer"] == "nominal lengths"
    assert rows["Deviations from the method"] == "one pose left out"
    assert rows["Results of external providers"] == "temperatures by NMI"
    assert [text for text in made.statements if "does not answer for them" in text]
    assert not [text for text in document(complete()).statements if "does not answer for them" in text]
