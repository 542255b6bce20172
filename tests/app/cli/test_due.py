"""``cmm-uq due`` and ``history``."""

from __future__ import annotations

import datetime as dt
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.laboratory.due import WhatIsDue, what_is_due
from cmm_uq.laboratory.due import intervals
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import RecordedCertificate
from tests.app.cli.process import run
from tests.laboratory.records.histories import certificate, moment

ON = "2026-11-22"


def recorded(folder: Path, *contents: Mapping[str, Any]) -> Path:
    """Records with these reports."""
    place = folder / "records.db"
    with open_records(place, create=True) as records:
        records.append_all(
            ("check" if one.get("interim") else "report", one, moment(dt.date.fromisoformat(one["day"])))
            for one in contents
        )
    return place


def machine(serial: str, **further: Any) -> dict[str, Any]:
    """Facts of a machine."""
    return {
        "serial": serial,
        "name": f"Machine {serial}",
        "manufacturer": "DEA",
        "model": "Iota",
        "place": "Hall 1",
        **further,
    }


@pytest.fixture
def three(tmp_path: Path) -> Path:
    """One machine overdue, one due in December, one later by its rule of two years."""
    return recorded(
        tmp_path, certificate("1101", dt.date(2025, 3, 2)), certificate("1102", dt.date(2025, 12, 5)),
        certificate("1103", dt.date(2025, 12, 5), machine=machine("1103", calibrate={"every_months": 24})),
    )  # fmt: skip


def test_the_list_is_sorted_and_says_why(three: Path) -> None:
    done = run("due", "--records", three, "--on", ON)
    assert (done.returncode, done.stderr) == (0, "")
    first, *rows = done.stdout.splitlines()
    assert first == "2026-11-22: 1 overdue, 1 due within 90 days"
    assert [row.split()[0] for row in rows] == ["2026-03-02", "2026-12-05", "2027-06-01", "2027-12-05"]
    assert "machine 1101" in rows[0]
    assert "265 d ago" in rows[0]
    assert "artefact BB-7" in rows[2]
    assert "Fixed interval of 24 months." in rows[3]


def test_within_leaves_out_what_is_later(three: Path) -> None:
    data = json.loads(run("due", "--records", three, "--on", ON, "--within", "2w", "--json").stdout)
    assert [(one["serial"], one["state"]) for one in data["items"]] == [("1101", "overdue"), ("1102", "due")]
    assert (data["schema"], data["on"], data["within_days"]) == ("cmm-uq/due/1", ON, 14)


def test_some_machines_bring_their_artefact_however_their_serial_is_spelled(three: Path) -> None:
    data = json.loads(run("due", " 1102", "Machine 1102", "--records", three, "--on", ON, "--json").stdout)
    assert [(one["item"], one["serial"]) for one in data["items"]] == [("machine", "1102"), ("artefact", "BB-7")]


def test_strict_ends_with_4_where_anything_is_overdue(three: Path) -> None:
    assert run("due", "--records", three, "--on", ON, "--strict", "-q").returncode == 4
    assert run("due", "1102", "--records", three, "--on", ON, "--strict", "-q").returncode == 0


def test_an_artefact_out_of_date_blocks(tmp_path: Path) -> None:
    old = {
        "serial": "BB-9",
        "certificate": "PTB 2",
        "laboratory": "PTB",
        "calibrated": "2024-01-01",
        "due": "2026-10-01",
    }
    place = recorded(tmp_path, certificate("1102", dt.date(2026, 3, 2), artefact=old))
    items = {
        one["item"]: one for one in json.loads(run("due", "--records", place, "--on", ON, "--json").stdout)["items"]
    }
    assert items["artefact"]["state"] == "overdue"
    assert "BB-9 is out of date since 2026-10-01" in items["machine"]["blocked"]


def test_a_certificate_of_tomorrow_does_not_hide_that_a_machine_is_overdue(tmp_path: Path) -> None:
    place = recorded(tmp_path, certificate("1102", dt.date(2025, 3, 2)), certificate("1102", dt.date(2096, 3, 2)))
    item = json.loads(run("due", "1102", "--records", place, "--on", ON, "--json").stdout)["items"][0]
    assert (item["state"], item["due"], item["last"]) == ("overdue", "2026-03-02", "2025-03-02")
    assert any("2096-03-02 is dated after" in text for text in item["remarks"])


def test_a_certificate_of_tomorrow_changes_no_artefact_and_no_rule(tmp_path: Path) -> None:
    mine = certificate("1102", dt.date(2026, 3, 2))
    bar = mine["artefact"] | {"due": "2026-10-01"}
    later = mine["machine"] | {"calibrate": {"every_months": 60}}
    place = recorded(
        tmp_path, certificate("1102", dt.date(2026, 3, 2), artefact=bar),
        certificate("1102", dt.date(2096, 3, 2), artefact=bar | {"due": "2098-10-01", "certificate": "PTB 9"}, machine=later),
        certificate("1102", dt.date(2096, 3, 2), artefact=bar | {"serial": "BB-8"}),
    )  # fmt: skip
    for asked in ((), ("1102",)):
        items = json.loads(run("due", *asked, "--records", place, "--on", ON, "--json").stdout)["items"]
        found = {one["serial"]: (one["due"], one["why"]) for one in items}
        assert found["BB-7"] == ("2026-10-01", "as its certificate PTB 1 says")
        assert found["1102"] == ("2027-03-02", "12 months, as its job does not say otherwise")
        assert found.get("BB-8", (None,))[0] is None
    with open_records(place, read_only=True) as records:
        assert {one.serial: str(one.due) for one in records.artefacts()}["BB-7"] == "2098-10-01"
        assert records.machine("1102").calibrate == {"every_months": 60}


@pytest.mark.parametrize("backwards", [False, True], ids=["in turn", "the last first"])
def test_what_a_later_job_leaves_unsaid_erases_nothing(tmp_path: Path, backwards: bool) -> None:
    """Due on 2026-10-01 by the first job; every six months by its rule. Neither was so any more after a job without."""
    first, second = certificate("1102", dt.date(2025, 12, 1)), certificate("1102", dt.date(2026, 3, 2))
    first["artefact"] |= {"due": "2026-10-01"}
    first["machine"] |= {"calibrate": {"every_months": 6}}
    second["artefact"] = {"serial": "BB-7", "name": "Ballbar", "certificate": "", "calibrated": None, "due": None}
    second["machine"] |= {"calibrate": None}
    place = recorded(tmp_path, *((second, first) if backwards else (first, second)))
    for on in (ON, "2026-11-01"):
        items = json.loads(run("due", "--records", place, "--on", on, "--json").stdout)["items"]
        found = {one["item"]: (one["state"], one["due"]) for one in items}
        assert found == {"artefact": ("overdue", "2026-10-01"), "machine": ("overdue", "2026-09-02")}
    with open_records(place, read_only=True) as records:
        assert [one for one in records.verify(files=False) if one.kind != "clock"] == []


def test_another_certificate_of_the_artefact_takes_nothing_over_from_the_one_before(tmp_path: Path) -> None:
    """Calibrated again, until when nobody says: not until the day of the old certificate, nor later."""
    again = certificate("1102", dt.date(2026, 3, 2))
    again["artefact"] |= {"certificate": "PTB 2", "calibrated": "2026-02-01", "due": None}
    place = recorded(tmp_path, certificate("1102", dt.date(2025, 12, 1)), again)
    item = json.loads(run("due", "--records", place, "--on", ON, "--json").stdout)["items"][-1]
    assert (item["state"], item["due"], item["last"]) == ("unknown", None, "2026-02-01")


def test_a_job_of_after_the_day_that_says_nothing_erases_nothing_then(tmp_path: Path) -> None:
    place = recorded(
        tmp_path, certificate("1102", dt.date(2025, 11, 2), machine=machine("1102", calibrate={"every_months": 6})),
        certificate("1102", dt.date(2026, 1, 2), artefact={"serial": "BB-7", "name": "Ballbar"}),
        certificate("1102", dt.date(2096, 3, 2), artefact={"serial": "BB-7", "certificate": "PTB 9", "due": "2098-10-01"},
                    machine=machine("1102", calibrate={"every_months": 60})),
    )  # fmt: skip
    items = json.loads(run("due", "--records", place, "--on", ON, "--json").stdout)["items"]
    assert {one["item"]: one["due"] for one in items} == {"artefact": "2027-06-01", "machine": "2026-07-02"}


@pytest.mark.parametrize("asked", [(), ("1102",)])
def test_a_draft_moves_no_day_that_a_released_certificate_set(tmp_path: Path, asked: tuple[str, ...]) -> None:
    """Where nothing was ever released, drafts are all there is; a draft that fails ends the interval."""
    place = recorded(tmp_path, certificate("1102", dt.date(2025, 11, 2)), certificate("1102", dt.date(2026, 11, 1)),
                     certificate("1103", dt.date(2026, 11, 1)))  # fmt: skip
    signed = {"certificate": 1, "by": "A. Releaser", "reason": "checked", "complete": True}

    def found(serial: str = "1102") -> dict[str, Any]:
        items = json.loads(run("due", *asked, "--records", place, "--on", ON, "--json").stdout)["items"]
        one: dict[str, Any] = next((each for each in items if each["serial"] == serial), {})
        return one

    assert (found()["state"], found()["due"]) == ("later", "2027-11-01")
    with open_records(place) as records:
        records.append("release", signed)
    assert (found()["state"], found()["due"], found()["last"]) == ("overdue", "2026-11-02", "2025-11-02")
    assert found()["remarks"] == [
        "Its certificate of 2026-11-01 is a draft that nobody has released: it begins no interval."
    ]
    if not asked:
        assert found("1103")["due"] == "2027-11-01"
    with open_records(place) as records:
        records.append("release", signed | {"certificate": 2})
    assert (found()["state"], found()["due"]) == ("later", "2027-11-01")
    assert not any("draft" in text for text in found()["remarks"])
    with open_records(place) as records:
        records.append("report", certificate("1102", dt.date(2026, 11, 5), decision="fail"))
    assert (found()["state"], found()["due"]) == ("overdue", "2026-11-05")


def test_an_interim_check_out_of_control_is_found_among_all_machines(three: Path) -> None:
    far = (("scale_x.ppm", "Scale error of x", "ppm", 6.0, 0.5, 5.0, 7.0, 0.2, 8.0),)
    with open_records(three) as records:
        records.append(
            "check", certificate("1103", dt.date(2026, 9, 1), far, interim=True), at=moment(dt.date(2026, 9, 1))
        )
    items = json.loads(run("due", "--records", three, "--on", ON, "--json").stdout)["items"]
    found = next(one for one in items if one["serial"] == "1103")
    assert (found["state"], found["due"]) == ("overdue", "2026-09-01")
    assert "out of control (Scale error of x:" in found["why"]


@pytest.mark.parametrize("asked", [(), ("1102",)])
def test_a_draft_after_a_check_out_of_control_does_not_hide_it(tmp_path: Path, asked: tuple[str, ...]) -> None:
    far = (("scale_x.ppm", "Scale error of x", "ppm", 6.0, 0.5, 5.0, 7.0, 0.2, 8.0),)
    check = certificate("1102", dt.date(2026, 9, 1), far, interim=True)
    place = recorded(
        tmp_path, certificate("1102", dt.date(2026, 3, 2)), check, certificate("1102", dt.date(2026, 10, 1))
    )
    with open_records(place) as records:
        records.append("release", {"certificate": 1, "by": "A. Releaser", "reason": "checked", "complete": True})
    found = json.loads(run("due", *asked, "--records", place, "--on", ON, "--json").stdout)["items"][0]
    assert (found["state"], found["due"]) == ("overdue", "2026-09-01")


def test_a3_pools_the_machines_of_a_model(tmp_path: Path) -> None:
    """Twenty intervals, fifteen within the limits, target 95 %: 231 days of 365 in the tutorial; here of 12 mean months."""
    rule = {"method": "A3", "reliability": 0.95}
    contents = []
    for number in range(20):
        value = 9.0 if number % 4 == 0 else 1.0
        stated = (("scale_x.ppm", "Scale error of x", "ppm", value, 0.5, value - 1, value + 1, 0.2, 8.0),)
        facts = machine(str(number), calibrate=rule)
        contents += [certificate(str(number), dt.date(2025, 9, 1), machine=facts),
                     certificate(str(number), dt.date(2026, 9, 1), stated, machine=facts)]  # fmt: skip
    place = recorded(tmp_path, *sorted(contents, key=lambda one: one["day"]))
    items = json.loads(run("due", "1", "--records", place, "--on", ON, "--json").stdout)["items"]
    assert "15 of 20 intervals of about 12 months" in items[0]["why"]
    assert items[0]["due"] == (dt.date(2026, 9, 1) + dt.timedelta(days=int(365.2425 * 230.846 / 365))).isoformat()


def test_the_page_and_its_data_are_written_together(three: Path, tmp_path: Path) -> None:
    done = run("due", "--records", three, "--on", ON, "--out", tmp_path / "out")
    assert done.returncode == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["due.html", "due.json", "manifest.json"]
    page = (tmp_path / "out" / "due.html").read_text(encoding="utf-8")
    assert "1 overdue, 1 due within 90 days" in page
    assert json.loads((tmp_path / "out" / "due.json").read_bytes())["items"][0]["serial"] == "1101"


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("1l02",), "no machine '1l02' is recorded. Did you mean '1102'?"),
        (("--within", "soon"), "'soon' is no time. Write it as 90d, 12w, 3m or 1y"),
        (("--within", "99999y"), "is no time"),
        (("--on", "22.11.2026"), "'22.11.2026' is no date. Write it as 2026-11-22"),
    ],
)
def test_what_cannot_be_asked_is_told_in_a_line(three: Path, arguments: tuple[str, ...], words: str) -> None:
    done = run("due", *arguments, "--records", three)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_without_records_it_says_where_they_would_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CMM_UQ_RECORDS", raising=False)
    done = run("due", cwd=tmp_path)
    assert done.returncode == 2
    assert "there are no records" in done.stderr
    assert list(tmp_path.iterdir()) == []


def scale(value: float) -> tuple[tuple[object, ...], ...]:
    """One value, limit 8, 0.4 of its u = 0.5 from the artefact; and the size of the artefact."""
    return (
        ("scale_x.ppm", "Scale error of x", "ppm", value, 0.5, value - 1, value + 1, 0.4, 8.0),
        ("artefact.length_mm", "Length", "mm", 404.2, 0.001, 404.198, 404.202, 0.001, None),
    )


@pytest.fixture
def drifting(tmp_path: Path) -> Path:
    """Calibrated yearly, adjusted in 2023, then 1 ppm a year but for the last, 2 more."""
    values = [(2021, 5.0, None), (2022, 6.5, None), (2023, 0.0, "2023-02-20"), (2024, 1.0, None), (2025, 2.0, None),
              (2026, 5.0, None)]  # fmt: skip
    return recorded(tmp_path, *(certificate("1102", dt.date(year, 3, 2), scale(value), adjusted_since=since)
                                for year, value, since in values))  # fmt: skip


def test_every_value_has_its_change_its_trend_and_its_limit(drifting: Path) -> None:
    done = run("history", "1102", "--records", drifting, "--on", ON)
    assert (done.returncode, done.stderr) == (0, "")
    head, row, *note = done.stdout.splitlines()
    assert "k = 2" in note[0]
    assert "by the drift model" in " ".join(note)
    assert head == "Machine 1102, serial number 1102: 6 recordings up to 2026-11-22"
    assert "5.0 ± 1.0 ppm" in row
    assert "change 3.00 significant ± 0.85" in row  # 2·√(2·0.25 − 2·0.16)
    assert "a year" in row
    assert "limit 8: about 20" in row


def test_the_data_of_a_history(drifting: Path) -> None:
    data = json.loads(run("history", "1102", "--records", drifting, "--on", ON, "--json").stdout)
    assert data["schema"] == "cmm-uq/history/1"
    assert list(data["values"]) == ["scale_x.ppm"]  # a size is the artefact's, not the machine's
    value = data["values"]["scale_x.ppm"]
    assert [one["value"] for one in value["recorded"]] == [5.0, 6.5, 0.0, 1.0, 2.0, 5.0]
    assert value["change"]["u"] == pytest.approx(0.18**0.5)
    assert (value["change"]["value"], value["change"]["significant"], value["change"]["adjusted_between"]) == (
        3.0,
        True,
        False,
    )
    assert value["trend"]["count"] == 4
    assert value["trend"]["per_year"] == pytest.approx(
        1.6, abs=0.01
    )  # of 0, 1, 2, 5: (−1.5·0 − 0.5·1 + 0.5·2 + 1.5·5)/5
    assert value["crosses_limit"]["last"] == "2026-03-02"
    assert value["crosses_limit"]["day_5"] < value["crosses_limit"]["day_50"]
    assert data["machine"]["adjusted"] == ["2023-02-20"]


def test_a_change_across_an_adjustment_is_none_of_the_machine(drifting: Path) -> None:
    value = json.loads(run("history", "1102", "--records", drifting, "--on", "2023-12-31", "--json").stdout)["values"][
        "scale_x.ppm"
    ]
    assert (value["change"]["value"], value["change"]["adjusted_between"], value["change"]["significant"]) == (
        -6.5,
        True,
        False,
    )
    assert value["trend"] is None
    assert "adjusted" in run("history", "1102", "--records", drifting, "--on", "2023-12-31").stdout


def test_what_is_dated_later_does_not_count_and_is_said(drifting: Path) -> None:
    done = run("history", "Machine 1102", "--records", drifting, "--on", "2022-06-01")
    assert "2 recordings" in done.stdout
    assert "4 certificates are dated after 2022-06-01 and do not count" in done.stdout


def test_the_page_shows_a_picture_of_every_value(drifting: Path, tmp_path: Path) -> None:
    done = run("history", "1102", "--records", drifting, "--on", ON, "--out", tmp_path / "out")
    assert done.returncode == 0
    page = (tmp_path / "out" / "history.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 1
    assert "Changed significantly" in page
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "history.html",
        "history.json",
        "manifest.json",
    ]
    again = run("history", "1102", "--records", drifting, "--on", ON, "--out", tmp_path / "out")
    assert (again.returncode, (tmp_path / "out" / "history.html").read_text(encoding="utf-8")) == (0, page)


def test_another_machine_is_not_written_over_it(tmp_path: Path) -> None:
    place = recorded(tmp_path, certificate("1101"), certificate("1102"))
    assert run("history", "1101", "--records", place, "--out", tmp_path / "out").returncode == 0
    assert run("history", "1102", "--records", place, "--out", tmp_path / "out").returncode == 2


@pytest.mark.parametrize("name", ["1103", "machine 1101"])
def test_a_machine_that_is_not_known_is_answered_with_those_near(drifting: Path, name: str) -> None:
    done = run("history", name, "--records", drifting)
    assert (done.returncode, done.stdout) == (2, "")
    assert "1102" in done.stderr


@pytest.mark.long
def test_a_history_without_a_picture_waits_for_nothing_that_draws_or_fits() -> None:
    heavy = ["matplotlib", "pandas", "scipy", "jinja2", "emcee"]
    code = f"import sys, cmm_uq.app.commands.laboratory.due; print([m for m in {heavy} if m in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


DRIFTS = {"calibrate": {"method": "drift", "reliability": 0.95, "every_months": 12}}


def test_a_date_by_drift_is_found_anew_only_where_the_history_has_new_entries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And stands in for the whole computation: what is kept gives the same list, reasons included."""
    found: list[str] = []
    whole = intervals.drift_interval
    values = [("scale_x.ppm", "Scale error of x", "ppm", 2.0, 0.5, 1.0, 3.0, 0.2, 8.0)]

    def counted(certificates: Sequence[RecordedCertificate], *given: Any) -> intervals.DriftInterval:
        found.append(certificates[-1].machine)
        return whole(certificates, *given)

    def due(file: Path | str) -> tuple[WhatIsDue, list[str]]:
        found.clear()
        monkeypatch.setenv("CMM_UQ_DATES", str(file))
        monkeypatch.setattr(intervals, "KNOWN", {})  # as in a new process
        return what_is_due(place, on=dt.date.fromisoformat(ON)), sorted(found)

    def of(serial: str, day: str) -> dict[str, Any]:
        return certificate(serial, dt.date.fromisoformat(day), values, machine=machine(serial, **DRIFTS))

    monkeypatch.setattr(intervals, "drift_interval", counted)
    place = recorded(tmp_path, *(of(serial, day) for day in ("2024-03-04", "2025-03-03") for serial in "ABC"))
    file = tmp_path / "cache" / "dates.json"
    first = due(file)
    assert first[1] == ["A", "B", "C"]
    assert due(file) == (first[0], [])
    with open_records(place) as records:
        records.append_all([("report", of("B", "2026-03-02"), moment(dt.date(2026, 3, 2)))])
    second = due(file)
    assert second[1] == ["B"]
    assert second[0] != first[0]
    assert second[0] == due("none")[0]
    for damaged in ("[", "[1]", '{"a": 1}', '{"a": [NaN, "", true]}'):
        file.write_text(damaged, encoding="utf-8")
        assert due(file) == (second[0], ["A", "B", "C"])
    assert due(file) == (second[0], [])
