"""The rule of a machine: from job.toml into the records, and out of them."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from cmm_uq.app.commands.reading import read_job
from cmm_uq.certificate.results.contents import head
from cmm_uq.jobs.tables.machine import Recalibration
from cmm_uq.laboratory.due.intervals import METHODS
from cmm_uq.laboratory.due.rule import DAYS_A_MONTH, Rule
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.content import certificate_content, kind_of_entry
from tests.laboratory.records.histories import certificate, moment

FACTS: dict[str, Any] = {
    "serial": "1102",
    "name": "Machine 1102",
    "manufacturer": "DEA",
    "model": "Iota",
    "place": "Hall 1",
}


def test_the_key_of_a_job_is_recorded_with_its_certificate(job: Path) -> None:
    text = (job / "job.toml").read_text(encoding="utf-8")
    rule = "[machine]\ncalibrate = { every_months = 6, longest_months = 9 }"
    (job / "job.toml").write_text(text.replace("[machine]", rule, 1), encoding="utf-8")
    data = {"job": {"id": "x", "origin": "measured", "date": "2004-09-01", "machine": "DEA Iota 1102"}}
    content = certificate_content(data, read_job(job).facts, command="report", folder="f", results_sha256="", files={},
                                  named=str)  # fmt: skip
    recorded = content["machine"]["calibrate"]
    assert Rule.of(recorded) == Rule("fixed", 6, longest_months=9, stated=True)


@pytest.mark.parametrize("interim", [True, False])
def test_an_interim_check_of_which_only_results_are_left_begins_no_interval(interim: bool, job: Path) -> None:
    text = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(
        text.replace("[job]", f"[job]\ninterim = {str(interim).lower()}", 1), encoding="utf-8"
    )
    content = certificate_content(head(read_job(job)), None, command="report", folder="f", results_sha256="", files={},
                                  named=str)  # fmt: skip
    assert (content["interim"], kind_of_entry(content)) == (interim, "check" if interim else "report")


def test_the_newest_certificate_rules_and_another_entry_leaves_it_alone(tmp_path: Path) -> None:
    rules = ({"every_months": 6}, {"every_months": 9}, None)
    with open_records(tmp_path / "records.db", create=True) as records:
        for year, rule in zip((2024, 2025, 2026), rules, strict=True):
            day = dt.date(year, 3, 2)
            records.append("report", certificate("1102", day, machine={**FACTS, "calibrate": rule}), at=moment(day))
            stated = rule or rules[1]  # which a certificate that says nothing leaves alone
            assert records.machine("1102").calibrate == stated
            assert records.machines()[0].calibrate == stated
        late = certificate("1102", dt.date(2020, 1, 1), machine={**FACTS, "calibrate": {"every_months": 1}})
        records.append("report", late)
        assert records.machine("1102").calibrate == rules[1]
        assert records.verify(files=False) == []


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"every_months": 12, "longest_months": 9}, "lies outside 1 to 9 months"),
        ({"method": "fixed", "reliability": 0.9}, "knows no reliability"),
        ({"method": "guess"}, "Input should be"),
        ({"reliability": 1.0}, "less than or equal to 0.999"),
        ({"every_months": 0}, "greater than or equal to 1"),
    ],
)
def test_what_cannot_be_a_rule_is_refused(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Recalibration(**keys)


def test_every_method_of_the_key_is_there() -> None:
    annotation = Recalibration.model_json_schema()["properties"]["method"]["anyOf"][0]["enum"]
    assert set(annotation) == {"fixed", *METHODS}


def test_bounds_are_in_days_and_five_years_where_nothing_is_said() -> None:
    assert Rule.of({"every_months": 12}).changing.longest_days == pytest.approx(60 * DAYS_A_MONTH)
    assert Rule.of({"every_months": 72}).changing.longest_days == pytest.approx(72 * DAYS_A_MONTH)
    assert Rule.of({"longest_months": 24, "shortest_months": 3}).changing.shortest_days == pytest.approx(
        91.31, abs=0.01
    )
