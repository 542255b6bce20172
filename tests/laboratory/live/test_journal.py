"""Records are kept whole: journals, sessions and blocks of readings."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.output.staging import replace_file
from cmm_uq.laboratory.live.instruments.source import Moment, Reading
from cmm_uq.laboratory.live.journal import (
    NoRoomError,
    Record,
    RecordingJournal,
    line_of,
    opened,
    record_of,
)
from cmm_uq.laboratory.live.recorder import put_blocks, readings_of
from cmm_uq.laboratory.live.story import begin, read_story, sessions_in

NOW = Moment(1_700_000_000_000_000_000, 7)
SAID = st.dictionaries(st.text(max_size=5), st.none() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
                       | st.text(max_size=20), max_size=4)  # fmt: skip


def journal(folder: Path, count: int) -> Path:
    path = folder / "0001-events.jsonl"
    path.unlink(missing_ok=True)
    kept = RecordingJournal(path)
    for number in range(count):
        kept.append("note", {"text": f"nº {number}\n"}, NOW)
    kept.commit()
    kept.close()
    return path


@given(st.text(max_size=10), SAID)
def test_a_record_reads_back_from_one_line_of_ascii(kind: str, data: dict[str, object]) -> None:
    record = Record(3, kind, NOW, data)
    line = line_of(record)
    assert line.isascii()
    assert line.count(b"\n") == 1
    assert record_of(line[:-1]) == record


@given(st.integers(0, 10**6), st.integers(0, 7))
@settings(max_examples=60, deadline=None)
def test_one_bit_that_turned_over_is_seen(tmp_path_factory: pytest.TempPathFactory, place: int, bit: int) -> None:
    """A CRC-32 detects every single-bit error."""
    path = journal(tmp_path_factory.mktemp("j"), 5)
    text = bytearray(path.read_bytes())
    place %= len(text)
    text[place] ^= 1 << bit
    path.write_bytes(text)
    found = opened(path, first=1)
    assert found.damaged or found.torn
    assert len(found.records) < 5


@given(st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_any_truncation_opens_with_all_whole_lines(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    path = journal(tmp_path_factory.mktemp("j"), 6)
    text = path.read_bytes()[: cut % 600]
    path.write_bytes(text)
    found = opened(path, first=1)
    assert len(found.records) == text.count(b"\n")
    assert found.torn == text[text.rfind(b"\n") + 1 :]
    assert found.damaged == ()


def test_a_line_that_was_taken_out_is_missed(tmp_path: Path) -> None:
    path = journal(tmp_path, 5)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2] + lines[3:]))
    assert opened(path, first=1).damaged == (3,)


def test_a_torn_line_is_cut_and_kept_in_the_next_session(tmp_path: Path) -> None:
    begin(tmp_path / "a", {}, NOW).close()
    first = sessions_in(tmp_path / "a")[0]
    whole = first.read_bytes()
    first.write_bytes(whole + b'12ab34cd [2,"poi')
    begin(tmp_path / "a", {}, NOW).close()
    assert first.read_bytes() == whole
    cut = opened(sessions_in(tmp_path / "a")[1]).records[1]
    assert (cut.kind, cut.data["file"], cut.data["text"]) == ("cut", first.name, '12ab34cd [2,"poi')
    assert len(read_story(tmp_path / "a").sessions) == 2


def test_a_damaged_line_is_named_and_only_passed_over_when_told(tmp_path: Path) -> None:
    journals = begin(tmp_path / "a", {}, NOW)
    journals.say("note", {"text": "first"}, NOW)
    journals.say("note", {"text": "second"}, NOW)
    journals.commit()
    journals.close()
    path = sessions_in(tmp_path / "a")[0]
    path.write_bytes(path.read_bytes().replace(b"first", b"fIrst"))
    with pytest.raises(CmmUqError, match=r"0001-events.jsonl line 2: the line is damaged.*--skip-damaged"):
        begin(tmp_path / "a", {}, NOW)
    later = begin(tmp_path / "a", {}, NOW, skip_damaged=True)
    later.close()
    assert later.story.damaged == ["0001-events.jsonl line 2"]
    assert [text for _, text in later.story.notes] == ["second"]


def test_no_session_is_read_without_the_line_that_begins_it(tmp_path: Path) -> None:
    for k in range(2):
        journals = begin(tmp_path / "a", {"plan": "x"}, NOW)
        journals.say("note", {"text": f"{k}"}, NOW)
        journals.commit()
        journals.close()
    for path in sessions_in(tmp_path / "a"):
        content = path.read_bytes()
        path.write_bytes(content.replace(b'"plan"', b'"plam"', 1))
        with pytest.raises(CmmUqError, match=rf"{path.name} line 1: the line that begins the session"):
            read_story(tmp_path / "a", skip_damaged=True)
        path.write_bytes(content)
    assert len(read_story(tmp_path / "a").sessions) == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_journal_that_is_no_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "0001-events.jsonl"
    path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(CmmUqError, match="cannot be read"):
        read_story(tmp_path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(CmmUqError, match="is a pipe"):
        read_story(tmp_path)


def test_a_session_that_lost_whole_lines_at_its_end_is_found_out_by_the_next_one(tmp_path: Path) -> None:
    journals = begin(tmp_path / "a", {}, NOW)
    journals.say("note", {"text": "last"}, NOW)
    journals.commit()
    journals.close()
    begin(tmp_path / "a", {}, NOW).close()
    path = sessions_in(tmp_path / "a")[0]
    path.write_bytes(path.read_bytes().splitlines(keepends=True)[0])
    with pytest.raises(CmmUqError, match=r"0002-events.jsonl line 1"):
        read_story(tmp_path / "a")


def test_two_programs_do_not_record_one_job(tmp_path: Path) -> None:
    journals = begin(tmp_path / "a", {}, NOW)
    with pytest.raises(CmmUqError, match="being recorded by another program"):
        begin(tmp_path / "a", {}, NOW)
    journals.close()
    begin(tmp_path / "a", {}, NOW).close()


def test_with_a_full_disk_records_wait_and_are_kept_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = RecordingJournal(tmp_path / "j")
    kept.append("note", {"text": "one"}, NOW)
    kept.commit()
    kept.append("note", {"text": "two"}, NOW)
    real, left = os.write, [10]

    def little(file: int, text: bytes) -> int:
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        left[0] -= (done := real(file, bytes(text)[: left[0]]))
        return done

    monkeypatch.setattr(os, "write", little)
    with pytest.raises(NoRoomError, match=r"no room on the disk .*1 records wait"):
        kept.commit()
    assert [record.data["text"] for record in opened(tmp_path / "j", first=1).records] == ["one"]
    assert opened(tmp_path / "j").torn == b""
    monkeypatch.setattr(os, "write", real)
    kept.append("note", {"text": "three"}, NOW)
    kept.commit()
    assert [record.data["text"] for record in opened(tmp_path / "j", first=1).records] == ["one", "two", "three"]


def test_a_file_is_written_whole_or_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bar.csv"
    replace_file(path, b"old")

    def full(file: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["bar.csv"]


READING = st.builds(
    Reading, st.sampled_from("ab"), st.integers(1, 9), st.integers(0, 2**62), st.integers(0, 2**62), st.binary(max_size=30),
    st.dictionaries(st.sampled_from(["temp_c", "x_mm"]), st.floats(allow_nan=False, allow_infinity=False), max_size=2),
    st.none() | st.just(Verbatim("out of range")), st.none() | st.just("PtMeas"),
)  # fmt: skip


@given(st.lists(READING, max_size=12))
@settings(max_examples=50, deadline=None)
def test_every_reading_comes_back_with_its_bytes_values_and_clocks(tmp_path_factory, readings: list[Reading]) -> None:  # type: ignore[no-untyped-def]
    path: Path = tmp_path_factory.mktemp("b") / "j"
    journal = RecordingJournal(path)
    put_blocks(readings, journal, NOW)
    journal.commit()
    journal.close()
    found = [reading for record in opened(path).records for reading in readings_of(record.data)]
    assert found == [reading for source in dict.fromkeys(r.source for r in readings) for reading in readings
                     if reading.source == source]  # fmt: skip
