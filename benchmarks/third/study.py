"""The third concealed study: ``python -m benchmarks.third.study FOLDER [--count 200] [--seed 0] [--resume]``.

Cases are made first and their truth is sealed by a hash; then they are diagnosed, one after the other in this process, and an
oracle is asked. Every result is a line in ``FOLDER``; stopped with Ctrl-C, what is there is counted, and ``--resume`` goes on.
``--page docs`` writes the page; ``--before FOLDER`` sets another run beside this one; with ``--tally`` nothing is run.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.second.running import lines
from benchmarks.third.cases import case
from benchmarks.third.judging import Judged, Name, judged
from benchmarks.third.page import write
from benchmarks.third.running import run, truths
from benchmarks.third.runs import table

COUNTED = "counted.json"


def main() -> None:
    """Make, seal, diagnose, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=200, help="cases")
    parser.add_argument("--seed", type=int, default=0, help="of the cases")
    parser.add_argument("--resume", action="store_true", help="go on where a run was stopped")
    parser.add_argument("--tally", action="store_true", help="run nothing; count what is there")
    parser.add_argument("--before", type=Path, help="folder of another run to set beside this one")
    parser.add_argument("--runs", type=Path, help="folder of reports of positioning runs, diagnosed in the end")
    parser.add_argument("--page", type=Path, help="write the page into this folder")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    if lines(chosen.folder / "said.jsonl") and not (chosen.resume or chosen.tally):
        parser.error(f"{chosen.folder} has results already: give --resume to go on, or another folder")
    seed_file = chosen.folder / "seed.txt"
    if seed_file.exists() and int(seed_file.read_text()) != chosen.seed:
        parser.error(f"{chosen.folder} was begun with --seed {seed_file.read_text().strip()}")
    seed_file.write_text(f"{chosen.seed}\n")
    every, mark = truths(chosen.folder, chosen.seed, chosen.count)
    print(f"{len(every)} cases, truth sealed: {mark}", flush=True)
    if not chosen.tally:
        try:
            run(chosen.folder, chosen.seed, every)
        except KeyboardInterrupt:
            print("Stopped; --resume goes on.", flush=True)
    counted, records = tally(chosen.folder)
    (chosen.folder / COUNTED).write_text(json.dumps([asdict(one) for one in counted], default=str), encoding="utf-8")
    before = recounted(chosen.before / COUNTED) if chosen.before else []
    faults = [f"{record['name']}: {record['fault']}" for record in records if "fault" in record]
    seconds = [record["seconds"] for record in records]
    state = (
        f"{len(counted)} cases were diagnosed of {len(every)} made with seed {chosen.seed}, whose truth was sealed before as "
        f"`{mark[:16]}…`. A diagnosis took {np.median(seconds) if seconds else 0:.1f} s of processor time (median; mean "
        f"{np.mean(seconds) if seconds else 0:.1f} s)."
    )
    if before:
        state += f" *Before*: {len(before)} other cases by 0.14.0, which had no empirical model."
    if faults:
        state += f" {len(faults)} ended in a refusal or a fault: {'; '.join(faults[:8])}."
    note = chosen.folder / "note.txt"
    if note.exists():
        state += "\n\n" + note.read_text(encoding="utf-8").strip()
    further = table(chosen.runs, chosen.folder / "runs") if chosen.runs else []
    write(counted, before, state, {"count": chosen.count, "seed": chosen.seed}, chosen.page, further)


def tally(folder: Path) -> tuple[list[Judged], list[dict[str, Any]]]:
    """Cases of a folder, counted, and the records that they come from."""
    seed, truth = (
        int((folder / "seed.txt").read_text()),
        {each["name"]: each for each in lines(folder / "truths.jsonl")},
    )
    records = lines(folder / "said.jsonl")
    return [
        judged(case(seed, truth[record["name"]]["number"]), truth[record["name"]], record["said"], record["oracle"])
        for record in records if "said" in record
    ], records  # fmt: skip


def recounted(file: Path) -> list[Judged]:
    """Cases of another run as that run counted them: its cases may have been made by another state of this program."""
    every = json.loads(file.read_text(encoding="utf-8"))
    return [Judged(**{**one, "names": [Name(**name) for name in one["names"]]}) for one in every]


if __name__ == "__main__":
    main()
