"""What a list shows is what going through every certificate would find."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import RecordedCertificate
from cmm_uq.laboratory.records.listing import CertificateFilter, chosen, courses, entry_of, standing_of_all
from cmm_uq.laboratory.records.store import Records
from tests.laboratory.records.histories import certificate, made, moment

DAY = dt.date(2026, 3, 2)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("listing") / "records.db"
    with made(place, 12, 3, released=True) as records:
        for number, further in enumerate(
            ({"origin": "simulated"}, {"command": "diagnose", "diagnosis": "partial"}, {"interim": True}, {"decision": "fail"},
             {"job": "100%_a/b\\", "number": "ÄÖ-1"}, {"artefact": {}}, {"diagnosis": "explained", "decision": "undecided"})
        ):  # fmt: skip
            records.append("report", certificate(f"K {number}", DAY, **further), at=moment(DAY))
        last = records.append("report", certificate("K 9", DAY), at=moment(DAY)).number
        records.append("withdrawal", {"certificate": last, "by": "B", "reason": "damaged"}, at=moment(DAY))
        records.append("machine", {"serial": "K 10", "name": "Never measured"}, at=moment(DAY))
    return place


CHOICES = st.builds(
    CertificateFilter,
    text=st.sampled_from(["", "", "1000", "K-", "k 4", "K4", "MACHINE", "%", "_", "/", "\\", "ÄÖ", "m100003-1"]),
    machine=st.sampled_from(["", "", "K 3", "100001", "nobody"]), artefact=st.sampled_from(["", "", "BB-7", "BB-1"]),
    origin=st.sampled_from(["", "measured", "measured", "simulated"]),
    command=st.sampled_from(["", "report", "report", "diagnose"]),
    states=st.sampled_from([(), (), ("draft",), ("released", "withdrawn")]),
    decisions=st.sampled_from([(), (), ("fail", "undecided")]),
    verdicts=st.sampled_from([(), (), ("explained", "partial")]), interim=st.sampled_from([None, None, True, False]),
    since=st.sampled_from([None, None, DAY, dt.date(2017, 6, 1)]), until=st.sampled_from([None, None, dt.date(2017, 9, 1)]),
)  # fmt: skip


def fits(one: RecordedCertificate, choice: CertificateFilter, names: dict[str, str]) -> bool:
    key = "".join(choice.text.casefold().split())
    spelled = ["".join(text.casefold().split()) for text in (one.machine, names[one.machine])]
    texts = [one.job.casefold(), one.number.casefold()]
    return all((
        not choice.text or any(choice.text.casefold() in text for text in texts) or any(key in text for text in spelled),
        choice.machine in ("", one.machine), choice.artefact in ("", one.artefact), choice.origin in ("", one.origin),
        choice.command in ("", one.command), not choice.states or one.state in choice.states,
        not choice.decisions or one.decision in choice.decisions, not choice.verdicts or one.diagnosis in choice.verdicts,
        choice.interim in (None, one.interim), choice.since is None or one.day >= choice.since,
        choice.until is None or one.day <= choice.until,
    ))  # fmt: skip


@pytest.fixture(scope="module")
def every(place: Path) -> Iterator[tuple[Records, list[RecordedCertificate], dict[str, str]]]:
    with open_records(place, read_only=True) as records:
        found = records.certificates(origin=None, command=None, values=False)[::-1]
        yield records, found, {one.serial: one.name for one in records.machines()}


@pytest.mark.long
@given(choice=CHOICES, most=st.integers(1, 7), left_out=st.integers(0, 9))
def test_a_page_has_what_fits_newest_first(
    every: tuple[Records, list[RecordedCertificate], dict[str, str]], choice: CertificateFilter, most: int, left_out: int
) -> None:  # fmt: skip
    records, found, names = every
    listed, count = chosen(records, choice, most, left_out)
    wanted = [one.entry for one in found if fits(one, choice, names)]
    assert count == len(wanted)
    assert [one.entry for one in listed] == wanted[left_out : left_out + most]
    by_entry = {one.entry: one for one in found}
    for one in listed:
        whole = by_entry[one.entry]
        assert {name: value for name, value in one._asdict().items() if name != "machine_name"} == {
            name: getattr(whole, name) for name in one._fields if name != "machine_name"
        }
        assert one.machine_name == names[one.machine]


def test_every_machine_stands_by_its_newest_certificate(place: Path) -> None:
    with open_records(place, read_only=True) as records:
        found = {one.machine.serial: one.certificate for one in standing_of_all(records)}
        newest = {one.machine: one.entry for one in records.latest()}
        assert set(found) == {one.serial for one in records.machines()}
    assert {serial: one.entry for serial, one in found.items() if one is not None} == newest
    assert {serial for serial, one in found.items() if one is None} == {"K 0", "K 1", "K 2", "K 9", "K 10"}


def test_a_course_is_the_machine_s_series_with_the_stated_intervals(place: Path) -> None:
    """The other way to the same values is :meth:`Records.series`."""
    with open_records(place, read_only=True) as records:
        for serial in ("100000", "100003", "K 2"):
            machine, series = records.machine(serial), records.series(serial)
            found = {course.name: course for course in courses(records, machine, 50)}
            assert set(found) == set(series)
            for name, course in found.items():
                one = series[name]
                assert [stated.value for stated in course.stated] == list(one.value)
                assert [stated.entry for stated in course.stated] == list(one.entry)
                assert [stated.interim for stated in course.stated] == list(one.interim)
                since = [stated.adjusted_since.toordinal() if stated.adjusted_since else 0 for stated in course.stated]
                assert since == list(one.adjusted_since)
                assert [stated.lower for stated in course.stated] == pytest.approx(list(one.value - 2 * one.u))
                assert [stated.upper for stated in course.stated] == pytest.approx(list(one.value + 2 * one.u))
            short = courses(records, machine, 1)
            assert {len(course.stated) for course in short} == {1}
            assert short[0].stated[0].entry == found[short[0].name].stated[-1].entry


def test_one_entry_is_read_by_its_number(place: Path) -> None:
    with open_records(place, read_only=True) as records:
        assert entry_of(records, 3) == list(records.entries())[2]
        assert entry_of(records, 10**6) is None
