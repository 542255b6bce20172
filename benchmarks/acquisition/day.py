"""A day of six instruments at 100 Hz in fast time: ``python benchmarks/acquisition/day.py FOLDER [HOURS]``.

Everything is as in a session but the clock, which runs as fast as the readings are taken in: the journals are written and put
on the disk every tenth of a second of that clock. Afterwards the journal of the streams is read from its first byte to its
last, and every number, value and byte is looked at. A point every minute is joined to six streams, two of them waves whose
values are known at every moment; they are stamped late by their latency, as a real instrument is.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.source import Moment, Reading
from cmm_uq.laboratory.live.journal import lines_in
from cmm_uq.laboratory.live.recorder import Recorder, readings_of
from cmm_uq.laboratory.live.story import begin

RATE, TICK_S, S = 100, 0.1, 1_000_000_000
LATENCY_MS = (0.0, 50.0, 0.0, 20.0, 0.0, 0.0)
PERIOD_S, AMPLITUDE = 7.0, 1.0
START_UTC, START = 1_790_000_000 * S, 1000 * S


@dataclass
class FastClock:
    now: int = 0

    def utc_ns(self) -> int:
        return START_UTC + self.now

    def monotonic_ns(self) -> int:
        return START + self.now

    def sleep(self, s: float) -> None:
        self.now += round(s * S)


def truth(source: int, time_s: float) -> float:
    """What an instrument measures: two waves, the others straight lines within each hour."""
    if source < 2:
        return 20 + AMPLITUDE * math.sin(2 * math.pi * time_s / PERIOD_S + source)
    return 20 + source + 1e-4 * (time_s % 3600)


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def main(folder: Path, hours: float) -> None:
    clock = FastClock()
    declared = [DeclaredSource(name=f"s{i}", profile="line-logger", values={"temp_c": f"temp_{i}_c"}, latency_ms=LATENCY_MS[i])
                for i in range(6)]  # fmt: skip
    journals = begin(folder, {"plan": ""}, Moment(clock.utc_ns(), clock.monotonic_ns()))
    recorder = Recorder(journals, declared, max_gap_s=1.0, clock=clock)
    began, count, points = time.process_time(), 0, 0
    wall = time.monotonic()
    late = [round(ms * 1e6) for ms in LATENCY_MS]
    for tick in range(round(hours * 3600 / TICK_S)):
        for step in range(round(RATE * TICK_S)):
            at = tick * round(TICK_S * S) + step * S // RATE
            count += 1
            for i in range(6):
                value = truth(i, at / S)
                raw = b"%.9f\r\n" % value
                recorder.take(
                    Reading(f"s{i}", count, START_UTC + at + late[i], START + at + late[i], raw, {"temp_c": float(raw)})
                )
        clock.now = (tick + 1) * round(TICK_S * S)
        if tick % 600 == 300:
            moment = clock.now - 37_123_457
            points += 1
            recorder.accept((points, 1, 1), {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0},
                            Moment(START_UTC + moment, START + moment), "machine")  # fmt: skip
        recorder.tick()
        if tick % 18_000 == 17_999:
            print(f"{(tick + 1) * TICK_S / 3600:5.1f} h  {6 * count:>10} readings  {resident_mb():6.1f} MB resident  "
                  f"{time.process_time() - began:6.0f} s CPU  {time.monotonic() - wall:6.0f} s", flush=True)  # fmt: skip
    clock.sleep(5)
    recorder.tick()
    joined(recorder)
    journals.close()
    kept(folder / "0001-streams.jsonl", count)


def joined(recorder: Recorder) -> None:
    """Every join against what the instruments really measured at that moment."""
    worst, ratio, number = 0.0, 0.0, 0
    for point in recorder.story.points.values():
        assert point.settled, point
        assert not point.missing, point
        for i in range(6):
            found = point.joined[f"temp_{i}_c"]
            moment = (point.moment.monotonic_ns - START) / S
            error = abs(found.value - truth(i, moment))
            number += 1
            if i < 2:
                ratio = max(ratio, error / found.u)
            elif 1 < moment % 3600 < 3599:
                worst = max(worst, error)
    print(f"{number} joins: straight lines off by {worst:.2e} at most (the last digit is 1e-09), "
          f"waves by {ratio:.2f} of their standard uncertainty at most")  # fmt: skip


def kept(path: Path, count: int) -> None:
    """Every reading, from the file alone."""
    following, sound = [1] * 6, 0
    for line in lines_in(path):
        assert line.record is not None, line.number
        for reading in readings_of(line.record.data):
            i = int(reading.source[1:])
            assert reading.number == following[i], (reading.number, following)
            assert float(reading.raw) == reading.values["temp_c"]
            following[i] += 1
            sound += 1
    assert following == [count + 1] * 6, following
    print(f"{sound} of {6 * count} readings are in the journal, {path.stat().st_size / 2**30:.2f} GiB; none is missing")


if __name__ == "__main__":
    hours = float(sys.argv[2]) if len(sys.argv) > 2 else 24.0
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()), hours)
