"""A replayed file gives the readings that its bytes gave, to the end, at the pace that is asked for."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import open_source
from cmm_uq.laboratory.live.instruments.source import Gap, Reading


class FastClock:
    def __init__(self) -> None:
        self.now = 0

    def utc_ns(self) -> int:
        return 1_000 + self.now

    def monotonic_ns(self) -> int:
        return self.now

    def sleep(self, s: float) -> None:
        self.now += round(s * 1e9)


def events(port: str, profile: str, folder: Path, clock: FastClock) -> list[object]:
    source = open_source(DeclaredSource(name="a", profile=profile, port=port), clock=clock, folder=folder)
    try:
        return list(source.events(threading.Event()))
    finally:
        source.close()


def test_a_file_is_read_to_its_end_at_its_pace(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_bytes(b"1,2\n3,4\nhalf")
    *readings, end = events("file:log.txt?every_s=0.5", "line-logger", tmp_path, FastClock())
    found = [one for one in readings if isinstance(one, Reading)]
    assert [one.values for one in found] == [{"value1": 1, "value2": 2}, {"value1": 3, "value2": 4}, {}]
    assert [one.monotonic_ns for one in found] == [500_000_000, 1_000_000_000, 1_500_000_000]
    assert (found[2].raw, found[2].status) == (b"half", "part of a message, or noise: half")
    assert isinstance(end, Gap)
    assert end.why == "the file is at its end"


def test_answers_to_several_questions_go_to_their_channels_in_turn(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"20.1\r\n20.2\r\n20.3\r\n20.4\r\n21.1\r\n")
    found = [one.values for one in events("file:log", "fluke-1529", tmp_path, FastClock()) if isinstance(one, Reading)]
    assert found == [{"temp1_c": 20.1}, {"temp2_c": 20.2}, {"temp3_c": 20.3}, {"temp4_c": 20.4}, {"temp1_c": 21.1}]


@pytest.mark.parametrize(("port", "told"), [("file:none", "(?i)no such file"), ("file:log?every_s=x", "says no pace")])
def test_a_file_or_a_pace_that_is_none_is_refused(port: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"")
    with pytest.raises(CmmUqError, match=told):
        events(port, "line-logger", tmp_path, FastClock())


def test_a_profile_beside_the_job_is_found(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("name = 'own'\ntitle = 'Own'\n[parse]\npattern = '(?P<x_mm>\\d+)'\n")
    (tmp_path / "log").write_bytes(b"7\r\n")
    assert events("file:log", "own.toml", tmp_path, FastClock())[0].values == {"x_mm": 7.0}  # type: ignore[attr-defined]
