"""Readings read back from the journal as they came, byte for byte."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings, strategies as st

from cmm_uq.base.messages import Verbatim
from cmm_uq.laboratory.live.instruments.source import Moment, Reading
from cmm_uq.laboratory.live.journal import RecordingJournal, opened
from cmm_uq.laboratory.live.recorder import put_blocks, readings_of

NOW = Moment(1, 2)
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
