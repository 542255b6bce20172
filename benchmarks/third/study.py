"""The third and the fourth concealed study: ``python -m benchmarks.third.study FOLDER [--generator fourth] [--seed 0]``.

Cases are made first, and their truth is sealed by a hash; then they are diagnosed, one after the other in this process, and
oracles are asked. Every result is a line; stopped with Ctrl-C, what is there is counted, and ``--resume`` goes on.

``--truth APART`` keeps the truth and what the oracles say in another folder than the jobs; ``--make`` only makes, seals and
asks the oracles, ``--run`` only diagnoses what has not been and sees no truth, ``--tally`` only counts; each goes on where it
was stopped. ``--page docs`` writes the page; ``--before FOLDER`` sets another run beside this one.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fourth.page import FOURTH
from benchmarks.second.cases import seal
from benchmarks.second.running import lines
from benchmarks.third.judging import Judged, Name, judged
from benchmarks.third.page import THIRD, write
from benchmarks.third.running import Generator, asked, run, truths
from benchmarks.third.runs import table

COUNTED = "counted.json"
GENERATORS: Mapping[str, Generator] = {"third": THIRD, "fourth": FOURTH}


def main() -> None:
    """Make, seal, diagnose, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the jobs and of what is said of them")
    parser.add_argument("--generator", choices=GENERATORS, default="third")
    parser.add_argument("--count", type=int, help="cases; else as many as the study has")
    parser.add_argument("--seed", type=int, default=0, help="of the cases")
    parser.add_argument("--truth", type=Path, help="another folder for the truth")
    parser.add_argument("--resume", action="store_true", help="go on where a run was stopped")
    some = parser.add_mutually_exclusive_group()
    some.add_argument("--make", action="store_true", help="make, seal and ask the oracles alone")
    some.add_argument("--run", action="store_true", help="diagnose alone")
    some.add_argument("--tally", action="store_true", help="run nothing; count what is there")
    parser.add_argument("--before", type=Path, help="folder of another run to set beside this one")
    parser.add_argument("--runs", type=Path, help="folder of reports of positioning runs, diagnosed in the end")
    parser.add_argument("--page", type=Path, help="write the page into this folder")
    chosen = parser.parse_args()
    folder, generator = chosen.folder, GENERATORS[chosen.generator]
    if chosen.run:
        run(folder)
        return
    truth, seed, count = chosen.truth or folder, chosen.seed, chosen.count or generator.count
    for each in (folder, truth):
        each.mkdir(parents=True, exist_ok=True)
    if lines(folder / "said.jsonl") and not (chosen.resume or chosen.tally):
        parser.error(f"{folder} has results already: give --resume to go on, or another folder")
    seed_file = truth / "seed.txt"
    if seed_file.exists() and int(seed_file.read_text()) != seed and not chosen.tally:
        parser.error(f"{truth} was begun with --seed {seed_file.read_text().strip()}")
    if not chosen.tally:
        seed_file.write_text(f"{seed}\n")
        every, mark = truths(generator, seed, count, folder, truth)
        print(f"{len(every)} cases, truth sealed: {mark}", flush=True)
        try:
            asked(generator, seed, every, truth)
            if not chosen.make:
                run(folder)
        except KeyboardInterrupt:
            print("Stopped; --resume goes on.", flush=True)
    if not chosen.make:
        counted(generator, folder, truth, chosen)


def counted(generator: Generator, folder: Path, truth: Path, chosen: argparse.Namespace) -> None:
    """The page of what is there."""
    every, records = tally(generator, folder, truth)
    (folder / COUNTED).write_text(json.dumps([asdict(one) for one in every], default=str), encoding="utf-8")
    made, seed = lines(truth / "truths.jsonl"), int((truth / "seed.txt").read_text())
    state = stated(every, records, f"{len(made)} made with seed {seed}", seal(made))
    before = recounted(chosen.before / COUNTED) if chosen.before else []
    if before:
        state += f" *Before*: {len(before)} other cases."
    note = folder / "note.txt"
    if note.exists():
        state += "\n\n" + note.read_text(encoding="utf-8").strip()
    further = table(chosen.runs, folder / "runs") if chosen.runs else []
    asked_for = {"count": len(made), "seed": seed}
    write(every, before, state, asked_for, chosen.page, further, said=generator.said, marks=generator.marks)


def stated(counted: Sequence[Judged], records: Sequence[dict[str, Any]], of: str, mark: str) -> str:
    """How many cases were diagnosed of those made, how long it took, and what was refused."""
    seconds = [record["seconds"] for record in records] or [0.0]
    faults = [f"{record['name']}: {record['fault']}" for record in records if "fault" in record]
    state = (
        f"{len(counted)} cases were diagnosed of {of}, whose truth was sealed before as `{mark[:16]}…`. A diagnosis took "
        f"{np.median(seconds):.1f} s of processor time (median; mean {np.mean(seconds):.1f} s)."
    )
    return state + (f" {len(faults)} ended in a refusal or a fault: {'; '.join(faults[:8])}." if faults else "")


def tally(generator: Generator, folder: Path, truth: Path) -> tuple[list[Judged], list[dict[str, Any]]]:
    """Cases of a folder that an oracle was asked of, counted, and the records that they come from.

    Raises
    ------
    SystemExit : a case comes out otherwise than it was sealed.
    """
    seed, records = int((truth / "seed.txt").read_text()), lines(folder / "said.jsonl")
    sealed = {one["name"]: one for one in lines(truth / "truths.jsonl")}
    oracles = {one["name"]: one["oracle"] for one in (*records, *lines(truth / "oracle.jsonl")) if "oracle" in one}
    oracles |= {name: {} for name, one in sealed.items() if one["kind"] == "nothing"}
    every = []
    for name, said in ((each["name"], each["said"]) for each in records if "said" in each and each["name"] in oracles):
        found = generator.case(seed, sealed[name]["number"])
        if {**sealed[name], **json.loads(json.dumps(found.one.truth))} != sealed[name]:
            raise SystemExit(f"{name} is no longer what was sealed")
        every.append(judged(found, sealed[name], said, oracles[name]))
    return every, records


def recounted(file: Path) -> list[Judged]:
    """Cases of another run as that run counted them: its cases may have been made by another state of this program."""
    every = json.loads(file.read_text(encoding="utf-8"))
    return [Judged(**{**one, "names": [Name(**name) for name in one["names"]]}) for one in every]


if __name__ == "__main__":
    main()
