"""Dates that were found before stand in for the whole computation, whatever is entered between and whichever day is asked."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.app.commands.laboratory import due as command
from cmm_uq.app.commands.laboratory.due import WhatIsDue, what_is_due
from cmm_uq.app.serve.view import MachineOverview, by_rule, overview
from cmm_uq.laboratory.due.due import machine_due
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.store import New, Records
from tests.laboratory.records.histories import certificate, made, moment

TODAY, SOON = dt.date(2018, 1, 20), dt.timedelta(days=30)
RULES: tuple[dict[str, Any] | None, ...] = (
    None, {"every_months": 6}, {"every_months": 24, "longest_months": 36}, {"method": "staircase", "reliability": 0.9},
    {"reliability": 0.9}, {"method": "S2", "reliability": 0.8},
)  # fmt: skip
"""None said, fixed ones, one by the machine's own calibrations, and two that take those of all machines of the model."""


def stated(random: np.random.Generator, count: int, day: dt.date, **further: Any) -> dict[str, Any]:
    k = int(random.integers(count))
    rule = RULES[random.integers(len(RULES))]
    machine = {"serial": f"{100000 + k}", "name": f"CMM {100000 + k}", "manufacturer": f"Maker {k % 5 % 3}",
               "model": f"Model {k % 5}", "place": "Hall 8"}  # fmt: skip
    machine |= ({} if rule is None else {"calibrate": rule}) | further.pop("machine", {})
    return certificate(
        machine["serial"], day, machine=machine, results_sha256=f"{random.integers(2**60):064x}", **further
    )


def entered(random: np.random.Generator, count: int, records: Records) -> Iterator[New]:
    """One event of each kind, of machines and days drawn at random: before what is known, after it, or in the future."""
    machine = {"serial": f"{100000 + int(random.integers(count))}"}
    machine["manufacturer"] = f"Maker {int(machine['serial']) % 5 % 3}"
    standing = [one.entry for one in records.latest(values=False)]
    chosen = [int(one) for one in random.choice(standing, 2, replace=False)]
    day = TODAY + dt.timedelta(days=int(random.integers(-500, 20)))
    decision = ("pass", "fail", "conditional pass")[random.integers(3)]
    yield "report", stated(random, count, day, decision=decision), moment(day)
    yield "check", stated(random, count, day, interim=True), moment(day)
    yield "report", stated(random, count, day, origin="simulated"), moment(day)
    yield "adjustment", {"machine": machine, "day": day.isoformat()}, moment(day)
    rule = RULES[1 + random.integers(5)]
    yield "machine", {**machine, "place": "Hall 9", "calibrate": rule, "day": day.isoformat()}, moment(day)
    yield "artefact", {"serial": f"BB-{random.integers(20)}", "certificate": f"C-{random.integers(99)}", "kind": "ballbar",
                       "due": day.isoformat(), "calibrated": "2017-01-01", "day": "2018-01-20"}, moment(day)  # fmt: skip
    yield "release", {"certificate": chosen[0], "by": "A", "reason": "checked", "complete": True}, moment(TODAY)
    yield "withdrawal", {"certificate": chosen[1], "by": "B", "reason": "damaged"}, moment(TODAY)
    yield (
        "report",
        stated(random, count, day, machine={"serial": f"new {random.integers(99)}", "name": "New"}),
        moment(day),
    )


@pytest.fixture(params=[pytest.param(40, id="few"), pytest.param(1000, id="many")])
def count(request: pytest.FixtureRequest) -> int:
    return int(request.param)


def both(place: Path, file: Path, on: dt.date, monkeypatch: pytest.MonkeyPatch) -> tuple[WhatIsDue, WhatIsDue, int]:
    """As found with what is kept, and without; and of how many machines the date was found anew."""
    asked: list[str] = []

    def counted(*given: Any) -> Any:
        asked.append(given[0].machine.serial)
        return machine_due(*given)

    monkeypatch.setattr(command, "machine_due", counted)
    found = []
    for kept in (str(file), "none"):
        monkeypatch.setenv("CMM_UQ_DATES", kept)
        found.append(what_is_due(place, on=on, within=SOON))
        if kept != "none":
            anew = len(asked)
    return found[0], found[1], anew


@pytest.mark.long(but="few")
def test_what_is_due_is_found_as_if_nothing_were_kept(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    random, place, file = np.random.default_rng(count), tmp_path / "records.db", tmp_path / "dates.json"
    with made(place, count, 2, seed=1) as records:
        kept, whole, anew = both(place, file, TODAY, monkeypatch)
        assert (kept, anew) == (whole, count)
        kept, whole, anew = both(place, file, TODAY, monkeypatch)
        assert kept == whole
        assert anew < 0.5 * count, "dates that were kept were found anew"
        for round_ in range(1 if count < 1000 else 4):
            for one in entered(random, count, records):
                records.append_all([one])
                # also as it was, and as it will be, when what is dated later counts
                for on in (TODAY, TODAY + dt.timedelta(days=int(random.integers(-200, 200)))):
                    kept, whole, anew = both(place, file, on, monkeypatch)
                    assert kept == whole, (round_, one[0], on)
    records = json.loads(file.read_text(encoding="utf-8"))["records"]
    assert len(records[str(place)]["days"]) > 0.5 * count


@pytest.mark.long(but="few")
def test_how_machines_stand_is_found_as_if_nothing_were_kept(count: int, tmp_path: Path) -> None:
    random = np.random.default_rng(count + 1)
    with made(tmp_path / "records.db", count, 2, seed=2) as records:
        known: MachineOverview | None = None
        for round_ in range(1 if count < 1000 else 4):
            for one in entered(random, count, records):
                records.append_all([one])
                known = overview(records, by_rule, TODAY, known)
                assert known == overview(records, by_rule, TODAY), (round_, one[0])


def test_days_of_other_records_at_the_same_place_are_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, file = tmp_path / "records.db", tmp_path / "dates.json"
    for seed, count in ((1, 8), (2, 8), (3, 9)):
        place.unlink(missing_ok=True)
        made(place, count, 2, seed=seed).close()
        kept, whole, anew = both(place, file, TODAY, monkeypatch)
        assert (kept, anew) == (whole, count)


@pytest.mark.parametrize("damaged", [
    "[", "[1]", '{"intervals": 1, "records": []}', '{"intervals": {}, "records": {"PLACE": {"head": 3}}}',
    '{"intervals": {}, "records": {"PLACE": {"head": [1, "x"], "program": 1, "days": {"A": null}}}}',
])  # fmt: skip
def test_a_damaged_file_costs_time_alone(damaged: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, file = tmp_path / "records.db", tmp_path / "dates.json"
    made(place, 5, 2, seed=4).close()
    file.write_text(damaged.replace("PLACE", str(place)), encoding="utf-8")
    kept, whole, anew = both(place, file, TODAY, monkeypatch)
    assert (kept, anew) == (whole, 5)
    assert open_records(place, read_only=True).head()[0] == 10


QUARTERLY = {"serial": "1", "name": "One", "calibrate": {"every_months": 3}}
LATER = dt.date(2018, 2, 15)  # than an entry that is dated after today


@pytest.mark.parametrize(("event", "on"), [
    (("machine", {**QUARTERLY, "day": "2017-01-01"}), TODAY),  # a rule of before the calibration, which states none
    (("machine", {**QUARTERLY, "day": "2018-02-10"}), LATER),  # one that counts from a day on
    (("adjustment", {"machine": {"serial": "1"}, "day": "2018-02-10"}), LATER),
    (("report", certificate("1", dt.date(2018, 2, 10), decision="fail", machine={"serial": "1", "name": "One"})), LATER),
], ids=["older rule", "coming rule", "coming adjustment", "coming failure"])  # fmt: skip
def test_what_an_entry_brings_forward_is_due(
    event: tuple[str, dict[str, Any]], on: dt.date, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, file, day = tmp_path / "records.db", tmp_path / "dates.json", dt.date(2017, 9, 1)
    with open_records(place, create=True) as records:
        records.append("report", certificate("1", day, machine={"serial": "1", "name": "One"}), at=moment(day))
        assert both(place, file, TODAY, monkeypatch)[0].of("overdue") == []
        records.append(*event)
        for asked in (TODAY, on, TODAY, on):
            kept, whole, _ = both(place, file, asked, monkeypatch)
            assert kept == whole
            assert [one.serial for one in kept.of("overdue")] == (["1"] if asked == on else [])


def test_what_others_of_its_model_found_brings_a_machine_forward(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By method A3: of ten intervals first all were in tolerance, then half."""
    place, file = tmp_path / "records.db", tmp_path / "dates.json"
    known = {"manufacturer": "DEA", "model": "Iota", "calibrate": {"method": "A3", "reliability": 0.9}}
    value = ("scale_x.ppm", "Scale error of x", "ppm", 2.0, 0.5, 1.0, 3.0, 0.2, 8.0)

    def of(serial: int, day: dt.date, error: float) -> New:
        machine = {"serial": f"{serial}", "name": f"{serial}", **known}
        stated = [(*value[:3], error, *value[4:])]
        return "report", certificate(f"{serial}", day, stated, machine=machine), moment(day)

    with open_records(place, create=True) as records:
        days = (dt.date(2016, 3, 1), dt.date(2017, 3, 1))
        records.append_all([of(serial, day, 2.0) for day in days for serial in range(10)])
        before = both(place, file, TODAY, monkeypatch)[0]
        assert [one for one in before.items if one.item == "machine"] == []
        records.append_all([of(serial, dt.date(2018, 1, 10), 20.0) for serial in range(1, 10)])
        kept, whole, _ = both(place, file, TODAY, monkeypatch)
        assert kept == whole
        assert "0" in [one.serial for one in kept.of("due", "overdue")]


def test_a_full_disk_leaves_the_days_as_they_were_and_nothing_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, file = tmp_path / "records.db", tmp_path / "cache" / "dates.json"
    with made(place, 5, 2, seed=5) as records:
        kept = both(place, file, TODAY, monkeypatch)[0]
        before = file.read_bytes()
        records.append("adjustment", {"machine": {"serial": "100001", "manufacturer": "Maker 1"}, "day": "2018-01-19"})

        def full(self: Path, text: str, **_: str) -> int:
            self.write_bytes(text[:20].encode())
            raise OSError(28, "No space left on device")

        with monkeypatch.context() as disk:
            disk.setattr(Path, "write_text", full)
            assert both(place, file, TODAY, monkeypatch)[0] != kept
        assert file.read_bytes() == before
        assert [path.name for path in file.parent.iterdir()] == [file.name]
