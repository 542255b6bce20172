"""When a machine is in doubt, which parts were measured then, and that drafts of one recording count once."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.laboratory.due import history_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.pages.doubt import doubt_data, doubt_words
from cmm_uq.certificate.pages.history import history_document, overview_of
from cmm_uq.certificate.render import render_html
from cmm_uq.laboratory.due.doubt import DoubtfulPeriod, doubtful_periods, parts_measured, with_parts
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import RecordedCertificate
from tests.laboratory.due.histories import MACHINE, certificate, value
from tests.laboratory.records.histories import certificate as recorded, moment


def on(month: int, number: float = 1.0, **further: Any) -> RecordedCertificate:
    further = {"decision": "fail" if abs(number) > 8.0 else "pass", "entry": month} | further
    return certificate(dt.date(2024, month, 1), value(number), **further)


def check(month: int, number: float = 1.0, **further: Any) -> RecordedCertificate:
    return on(month, number, **({"interim": True, "decision": "none"} | further))


@pytest.mark.parametrize(("made", "periods"), [
    ([on(1), check(3), on(6)], []),
    ([on(1), check(3, 7.0)], [(1, 3, None)]),
    ([on(1), check(3), check(5, 7.0), check(6), on(8)], [(3, 5, 8)]),  # a check in control ends nothing
    ([on(1), check(3, state="draft"), check(5, 7.0)], [(1, 5, None)]),  # nor does one that nobody released begin anything
    ([on(1, state="draft"), check(3, state="draft"), check(5, 7.0, state="draft")], [(3, 5, None)]),
    ([on(1), on(6, 9.0), on(6, 1.0, entry=7)], [(1, 6, 6)]),  # as found and as left
    ([on(1), on(6, 9.0), on(8, state="draft")], [(1, 6, None)]),
    ([on(2, 9.0), on(4), on(9, 9.0)], [(None, 2, 4), (4, 9, None)]),
    ([on(1), on(3, 7.5, decision="undecided"), on(6, 9.0), on(7, decision="incomplete")], [(1, 6, 7)]),
    ([check(1, 9.0, decision="fail"), on(3)], [(None, 1, 3)]),
    ([on(1), check(2, 2.9), check(3, 2.9)], [(1, 3, None)]),  # beyond the warning limit twice
])  # fmt: skip
def test_in_doubt_is_from_the_last_day_in_order_to_the_next_calibration_that_is(
    made: list[RecordedCertificate], periods: list[tuple[int | None, int, int | None]]
) -> None:
    def month(day: dt.date | None) -> int | None:
        return None if day is None else day.month

    assert [(month(one.after), one.found.day.month, month(one.until)) for one in doubtful_periods(made)] == periods


def part_report(folder: Path, day: str, calibrated: str = "2024-01-01", **changes: Any) -> Path:
    said = {
        "schema": "cmm-uq/part/1", "job": {"id": f"part-{day}", "origin": "measured", "date": day},
        "part": {"name": "Flange", "serial": None}, "decision": {"outcome": "pass"},
        "machine": {"machine": "Iota", "serial": "11 02", "number": "K-1", "date": calibrated},
    }  # fmt: skip
    file = folder / f"{day}-{len(list(folder.glob('*')))}" / "results.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(said | changes), encoding="utf-8")
    return file


def test_parts_in_doubt_are_those_measured_since_by_no_newer_certificate(tmp_path: Path) -> None:
    days = ("2024-02-29", "2024-03-01", "2024-04-30", "2024-06-02", "2024-09-02")
    files = [part_report(tmp_path, day) for day in days]
    files.append(part_report(tmp_path, "2024-08-01", "2024-08-01"))  # calibrated anew
    files.append(
        part_report(
            tmp_path, "2024-04-01", machine={"machine": "Iota", "serial": "78", "number": "K", "date": "2024-01-01"}
        )
    )
    files.append(part_report(tmp_path, "2024-04-01", job={"id": "s", "origin": "simulated", "date": "2024-04-01"}))
    files.append(part_report(tmp_path, "2024-04-01", schema="cmm-uq/report/1"))
    files.append(
        part_report(
            tmp_path, "2024-04-29", machine={"machine": "iota", "serial": None, "number": "K", "date": "2024-01-01"}
        )
    )
    until = dt.date(2024, 8, 1)
    periods = [DoubtfulPeriod(dt.date(2024, 3, 1), check(5, 9.0), until)]
    (found,) = with_parts(periods, parts_measured(MACHINE, files), dt.date(2024, 8, 15))
    assert [one.day.isoformat() for one in found.parts] == ["2024-03-01", "2024-04-29", "2024-04-30", "2024-06-02"]
    (none,) = with_parts([replace(periods[0], after=dt.date(2024, 8, 1))], parts_measured(MACHINE, files), until)
    assert none.parts == ()
    damaged = tmp_path / "results.json"
    damaged.write_text('{"schema": "cmm-uq/part/1", "job": 1}', encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"is no results\.json of a part"):
        with_parts(periods, parts_measured(MACHINE, [damaged]), until)


def test_history_names_the_parts_between_a_good_and_a_failed_check(tmp_path: Path) -> None:
    """Records beside the reports, as commands keep them; and folders that are named."""
    stated = [["scale_x.ppm", "Scale error of x", "ppm", 2.0, 0.5, 1.0, 3.0, 0.2, 8.0]]
    bad = [["scale_x.ppm", "Scale error of x", "ppm", 9.0, 0.5, 8.0, 10.0, 0.2, 8.0]]
    with open_records(tmp_path / "records.db", create=True) as records:
        for day, values, further in (
            (dt.date(2024, 1, 1), stated, {}), (dt.date(2024, 3, 1), stated, {"interim": True}),
            (dt.date(2024, 6, 1), bad, {"interim": True, "decision": "fail"}),
        ):  # fmt: skip
            entry = recorded(day=day, values=values, **further)
            records.append_all([("check" if further else "report", entry, moment(day))])
    part_report(
        tmp_path, "2024-04-30", machine={"machine": "m", "serial": "1102", "number": "K-1", "date": "2024-01-01"}
    )
    part_report(
        tmp_path, "2024-02-01", machine={"machine": "m", "serial": "1102", "number": "K-1", "date": "2024-01-01"}
    )
    found = history_of("1102", tmp_path / "records.db", on=dt.date(2024, 7, 1))
    ((data,),) = [doubt_data(found)]
    assert (data["after"], data["found"]["date"], data["until"]) == ("2024-03-01", "2024-06-01", None)
    assert [one["number"] for one in data["parts"]] == ["part-2024-04-30"]
    assert str(doubt_words(found.doubtful[0])) == (
        "The interim check K-1102-2024-06-01 of 2024-06-01 finds the machine out of control. What was measured on it from "
        "2024-03-01 on is in doubt. Nothing since finds it in order. The report of one part that was measured then is known."
    )
    assert "part-2024-04-30" in render_html(history_document(found))
    with pytest.raises(CmmUqError, match="is no folder"):
        history_of("1102", tmp_path / "records.db", on=dt.date(2024, 7, 1), parts=[tmp_path / "other"])
    (tmp_path / "other").mkdir()
    nowhere = history_of("1102", tmp_path / "records.db", on=dt.date(2024, 7, 1), parts=[tmp_path / "other"])
    assert str(doubt_words(nowhere.doubtful[0])).endswith("No report of a part that was measured then is known.")


def test_a_machine_that_its_last_check_finds_out_of_control_is_in_doubt_whatever_its_values(tmp_path: Path) -> None:
    """A pass of its certificate, and values within their limits, do not say that it is in order."""
    stated = [["scale_x.ppm", "Scale error of x", "ppm", 2.0, 0.5, 1.0, 3.0, 0.2, 8.0]]
    with open_records(tmp_path / "records.db", create=True) as records:
        for day, further in ((dt.date(2024, 1, 1), {}), (dt.date(2024, 6, 1), {"interim": True, "decision": "fail"})):
            entry = recorded(day=day, values=stated, **further)
            records.append_all([("check" if further else "report", entry, moment(day))])
    said = overview_of(history_of("1102", tmp_path / "records.db", on=dt.date(2024, 7, 1)))
    assert (str(said.verdict), said.standing) == ("In doubt", "bad")
    assert ("In doubt", "K-1102-2024-06-01, 2024-06-01") in [(str(label), str(text)) for label, text in said.rows]


def test_drafts_of_one_recording_count_once(tmp_path: Path) -> None:
    """Reported again a value changed by 0.0 since "the recording before", and the trend had it twice."""
    january, march = dt.date(2024, 1, 8), dt.date(2024, 3, 4)

    def stating(number: float) -> list[list[Any]]:
        return [["scale_x.ppm", "Scale error of x", "ppm", number, 0.5, number - 1, number + 1, 0.2, 8.0]]

    with open_records(tmp_path / "records.db", create=True) as records:
        each = [(january, 1.0), (march, 5.0), (march, 5.1)]
        made = [recorded(day=day, values=stating(number)) for day, number in each]
        entries = records.append_all([("report", one, moment(january)) for one in made])
        assert records.series("1102")["scale_x.ppm"].value.tolist() == [1.0, 5.1]
        assert records.all_series()["1102"]["scale_x.ppm"].value.tolist() == [1.0, 5.1]
        signed = {"certificate": entries[1].number, "by": "A. Releaser", "reason": "checked", "complete": True}
        records.append_all([("release", signed, moment(march))])
        assert records.series("1102")["scale_x.ppm"].value.tolist() == [1.0, 5.0]
        left = recorded(day=march, values=stating(0.4), adjusted_since="2024-03-04")  # as left on that day
        records.append_all([("report", left, moment(march))])
        assert records.series("1102")["scale_x.ppm"].value.tolist() == [1.0, 5.0, 0.4]
