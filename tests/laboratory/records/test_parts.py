"""Reports of parts in the records: which machine measured them, however it came to be known, and what they are not."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.certificates.release import release, withdraw
from cmm_uq.app.commands.laboratory.due import history_of, what_is_due
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.backup import migrate
from cmm_uq.laboratory.records.content import certificate_content
from cmm_uq.laboratory.records.listing import standing_of_all
from cmm_uq.laboratory.records.store import New, Records
from tests.laboratory.records.histories import certificate, moment


def part(day: dt.date, serial: str = "11 02", name: str = "Machine 1102", **further: Any) -> New:
    content = certificate(serial, day, (), **{
        "command": "part", "job": f"flange-{day}", "number": f"P-{day}", "kind": "", "artefact": {}, "folder": f"p-{day}",
        "machine": {"serial": serial, "name": name, "manufacturer": "", "model": "", "place": ""}, "measured": True,
        "part": {"name": "Flange", "serial": "F-7", "drawing": ""}, "plan": "job.toml", "points": "points.csv",
        "certificate": {"number": "K-1", "laboratory": "", "calibrated": "2024-01-01", "due": None, "files": []},
        "inputs": {"job.toml": "0" * 64},
    } | further)  # fmt: skip
    return "part", content, moment(day)


def calibrated(day: dt.date, manufacturer: str = "DEA", name: str = "Machine 1102") -> New:
    machine = {"serial": "1102", "name": name, "manufacturer": manufacturer, "model": "Iota", "place": "Hall 1"}
    return "report", certificate(day=day, machine=machine), moment(day)


JANUARY, MARCH, JUNE = (dt.date(2024, month, 1) for month in (1, 3, 6))


def of(records: Records, serial: str) -> list[dt.date]:
    return [one.day for one in records.parts(serial)]


@pytest.mark.parametrize(("new", "found"), [
    ([calibrated(JANUARY), part(MARCH)], {"1102": [MARCH]}),
    ([part(MARCH), calibrated(JUNE), part(JUNE)], {"11 02": [MARCH, JUNE]}),  # known by its report first
    ([calibrated(JANUARY), calibrated(JANUARY, "Zeiss", "Z"), part(MARCH, name="z")], {"1102": [], "1102 (Zeiss)": [MARCH]}),
    ([calibrated(JANUARY), calibrated(JANUARY, "Zeiss", "Z"), part(MARCH, name="other")], {"1102": [], "1102 (Zeiss)": []}),
    ([calibrated(JANUARY), part(MARCH, origin="simulated"), part(JUNE, measured=False)], {"1102": []}),
])  # fmt: skip
def test_a_part_is_of_the_one_machine_that_its_report_names(
    tmp_path: Path, new: Sequence[New], found: dict[str, list[dt.date]]
) -> None:
    with open_records(tmp_path / "records.db", create=True) as records:
        for one in new:
            records.append_all([one])  # each by itself, as reports come; verify makes the tables of all at once
        assert {one.serial: of(records, one.serial) for one in records.machines()} == found
        assert records.verify(files=False) == []


def test_a_machine_that_parts_alone_name_is_none_of_the_records(tmp_path: Path) -> None:
    place = tmp_path / "records.db"
    with open_records(place, create=True) as records:
        records.append_all([part(MARCH)])
        assert (records.machines(), standing_of_all(records), records.certificates()) == ([], [], [])
        with pytest.raises(CmmUqError, match="no machine '1102' is recorded"):
            records.machine("1102")
        records.append_all([calibrated(JUNE)])
        machine = records.machine("1102")
        assert (machine.serial, machine.manufacturer, machine.place) == ("11 02", "DEA", "Hall 1")
        records.append_all([part(JUNE, name="Renamed")])  # what a part's report says of a machine changes nothing of it
        assert records.machine("1102") == machine
        assert migrate(place, to="0004") == ("0004", "0004")
        assert records.verify(files=False) == []
    assert [one.item for one in what_is_due(place, on=JUNE).items] == ["machine", "artefact"]


def test_history_lists_recorded_parts_and_those_in_doubt_by_their_entries(tmp_path: Path) -> None:
    failed = ("report", certificate(day=JUNE, decision="fail"), moment(JUNE))
    with open_records(tmp_path / "records.db", create=True) as records:
        records.append_all(
            [calibrated(JANUARY), part(MARCH), part(MARCH, job="other"), failed, part(JUNE, serial="78", number="P-78")]
        )
        withdraw(records, "3", by="A. Huber", reason="another part")
        assert release(records, "2", by="A. Huber").certificate.state == "released"
        withdraw(records, "2", by="A. Huber", reason="in doubt")
        records.append_all([part(JUNE)])
        release(records, "1", by="A. Huber")
        with pytest.raises(CmmUqError, match="is no report of a part"):
            withdraw(records, f"P-{JUNE}", by="A. Huber", reason="x", replaced_by="1")
    found = history_of("1102", tmp_path / "records.db", on=dt.date(2024, 7, 1))
    assert [(one.day, one.entry, one.certificate) for one in found.parts] == [(JUNE, 9, "K-1")]
    assert [[one.entry for one in period.parts] for period in found.doubtful] == [[9]]


@pytest.mark.parametrize(
    "changes", [{"folder": 2**70}, {"machine": {"serial": 2**70}, "artefact": {"due": 2**70, "name": "A"}}]
)
def test_a_number_that_no_database_holds_is_refused_in_words(tmp_path: Path, changes: dict[str, Any]) -> None:
    with open_records(tmp_path / "records.db", create=True) as records, pytest.raises(CmmUqError, match="too large"):
        records.append_all([("report", certificate(**changes), moment(MARCH))])
    matrix = {"parameters": ["a"], "units": ["mm"], "matrix": [""]}
    data = {"job": {"id": "j", "origin": "measured", "date": "2024-01-01", "machine": "M"}, "covariance": matrix}
    with pytest.raises(CmmUqError, match=r"is no results\.json of a job"):
        certificate_content(data, None, command="report", folder="", results_sha256="", files={}, named=str)
