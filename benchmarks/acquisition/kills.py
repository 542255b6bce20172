"""Kills at random moments: ``python benchmarks/acquisition/kills.py FOLDER [KILLS] [SEED]``.

A session is forked, which takes readings of two instruments and points as fast as the disk allows, and says each point that
it has accepted through a pipe. After a random while it is killed with SIGKILL, wherever it is: in a write, between two, while
it writes the recording. The journal must open, hold every point that was said, and none that was never sent; the recording and
what stands beside it must be read by a job; and the next session goes on. Every fifth kill is followed by a cut of the
journal's end at a random byte behind what was accepted, as a power cut leaves it.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
from itertools import accumulate
from pathlib import Path

from cmm_uq.app.commands.laboratory import acquire
from cmm_uq.app.commands.reading import read_job
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Reading
from cmm_uq.laboratory.live.journal import lines_in
from cmm_uq.laboratory.live.story import read_story, sessions_in

EACH = 40
"""Kills of one job, whose plan has so many bars that none is ever complete."""

BARS = 20_000 // EACH
JOB = """
[job]
id = "killed"
date = 2026-05-31
[machine]
name = "Bridge"
travel_mm = { x = [0, 9000], y = [0, 8000], z = [-600, 0] }
[artefact]
kind = "ballbar"
[recording]
file = "bar.csv"
[model]
effects = ["squareness_xy"]
[acquire]
plan = "plan.csv"
max_gap_s = 0.2
"""


def child(folder: Path, pipe: int) -> None:
    """Take points until the kill comes."""
    taking = acquire.begin_acquisition(folder)
    conductor, numbers = taking.conductor, [0, 0]
    while (step := conductor.step) is not None:
        for i in range(2):
            numbers[i] += 1
            raw = b"%d" % numbers[i]
            conductor.event(
                Reading(f"t{i}", numbers[i], SYSTEM.utc_ns(), SYSTEM.monotonic_ns(), raw, {"temp_c": 20.0 + i})
            )
        x, y, z = (float(v) for v in step.xyz)
        values = {"x_mm": x, "y_mm": y, "z_mm": z + 1e-4 * step.place[0]}
        conductor.event(
            Reading("cmm", sum(numbers), SYSTEM.utc_ns(), SYSTEM.monotonic_ns(), b"#", values, point="PtMeas")
        )
        conductor.tick()
        for text in conductor.said:
            if text.startswith("accepted: "):
                os.write(pipe, b"%d %d %d\n" % step.place)
        conductor.said.clear()


def killed(folder: Path, dice: random.Random) -> list[tuple[int, ...]]:
    """Places that were said to be accepted before the kill."""
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading)
        try:
            child(folder, writing)
        finally:
            os._exit(1)
    os.close(writing)
    first = os.read(reading, 1 << 16) if dice.random() < 0.7 else b""  # else it may be killed before its first point
    time.sleep(dice.expovariate(1 / 0.05))
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    said = first
    while more := os.read(reading, 1 << 16):
        said += more
    os.close(reading)
    whole = said[: said.rfind(b"\n") + 1].decode().split("\n")[:-1]
    return [tuple(map(int, line.split())) for line in whole]


def cut(folder: Path, dice: random.Random, kept: int) -> int:
    """Cut the end of the last journal of events behind its ``kept`` first whole lines; how many bytes that took."""
    path = sessions_in(folder / "acquisition")[-1]
    ends = list(accumulate((len(line.text) for line in lines_in(path)), initial=0))
    start = ends[min(kept, len(ends) - 1)]
    place = dice.randint(start, ends[-1])
    os.truncate(path, place)
    return ends[-1] - place


def main(folder: Path, kills: int, seed: int) -> None:
    acquire._sources = lambda job, **_: ([], None)  # its events are given here
    dice, said_all, torn, empty, cuts = random.Random(seed), 0, 0, 0, 0
    for number in range(kills):
        job = folder / f"{number // EACH:04d}"
        if number % EACH == 0:
            job.mkdir(parents=True)
            (job / "job.toml").write_text(JOB)
            rows = [f"{m},{p},1,{p * 500},{m},-300" for m in range(1, BARS + 1) for p in (1, 2)]
            (job / "plan.csv").write_text("measurement,point,repeat,x_mm,y_mm,z_mm\n"
                                          + "\n".join(rows) + "\n")  # fmt: skip
            before: set[tuple[int, ...]] = set()
        said = killed(job, dice)
        if sessions_in(job / "acquisition"):
            last = sessions_in(job / "acquisition")[-1]
            torn += any(not line.text.endswith(b"\n") for line in lines_in(last))
            if number % 5 == 4 and said:  # else the last journal may be that of an earlier session
                marks = [i for i, line in enumerate(lines_in(last), 1) if line.record and line.record.kind == "point"
                         and tuple(line.record.data["place"]) in set(said)]  # fmt: skip
                cuts += cut(job, dice, max(marks)) > 0
            story = read_story(job / "acquisition")
            there = set(story.by_place)
            assert before | set(said) <= there, (number, sorted((before | set(said)) - there))
            assert len(there) - len(before | set(said)) <= 1, "more than the one that was not said yet"
            if (job / "bar.csv").exists():
                read = read_job(job)
                assert len(read.points) % 2 == 0
                assert read.acquired is not None
                assert not read.acquired.changed
            before = there
        said_all += len(said)
        empty += not said
        if number % 100 == 99:
            print(f"{number + 1} kills: {said_all} points said to be accepted, all there; {torn} ended in a torn line, "
                  f"{cuts} were cut besides, {empty} came before the first point", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(
        Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()),
        int(sys.argv[2]) if len(sys.argv) > 2 else 1000, int(sys.argv[3]) if len(sys.argv) > 3 else 0,
    )  # fmt: skip
