"""Nothing lost, hung or half-written: ``python benchmarks/hostile/study.py [--cases N] [--kills N] [--workers N] [--seed S]``.

``--part NAME`` runs one part; all but kills, disk and collisions go on where they were stopped;
``--only PART:NUMBER`` repeats one case and shows what it said.
The first inputs of every violation are kept under ``--keep`` (reports/hostile), counts beside them, and the page is written
from the counts.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from benchmarks.hostile import collisions, disk, every_command, kills, pool, programs, signatures, terminals
from benchmarks.hostile.cases import case, lay_out
from benchmarks.hostile.invariants import Outcome
from benchmarks.hostile.page import PARTS, Tally, load, page
from benchmarks.hostile.processes import COMMANDS, memory

ROOT = Path(__file__).parents[2]
SAVED_EVERY = 20
RESUMED = ("mutations", "commands", "programs", "signatures", "acquisitions", "calls", "terminals")
PAGE = ROOT / "docs" / "hostile-study.md"
Trial = tuple[str, str, Callable[[Path], tuple[Outcome, list[str]]]]
"""Kind, words, and what runs it in an empty folder."""


def trials(part: str, options: argparse.Namespace) -> Iterator[Trial]:
    """The cases of a part that runs real processes, in an order that does not change."""
    if part == "kills":
        traced = kills.available()
        if not traced:
            print("strace may not trace here: all kills come at random moments", file=sys.stderr)
        for kill in kills.plan(options.kills, options.seed, kills.SHARES, traced):
            yield f"{kill.command}, {kill.signal}", kill.what, partial(kills.strike, kill)
    elif part == "disk":
        mount = disk.may_mount()
        if not mount:
            print("may not mount here: no full disks, no read-only file systems", file=sys.stderr)
        for command in COMMANDS:
            for what, place in disk.places(command, mount=mount).items():
                yield command, f"{command}: {what}", partial(disk.attempt, command, place)
    else:
        for collision in collisions.collisions(tuple(COMMANDS)):
            yield collision.second, collision.what, partial(collisions.meet, collision)


def in_process(tally: Tally, options: argparse.Namespace, work: Path, tick: Callable[[], None]) -> None:
    """Run mutated inputs or attacks; records are lines of a file, from which a study that was stopped goes on."""
    part = tally.part
    for record in resumed(
        f"{part}-{options.seed}", range(count_of(part, options)), options, _runs(tally, options, work)
    ):
        found: Any = record["found"]
        fields: dict[str, Any] = {name: record[name] for name in ("number", "target", "what", "code", "said", "ran")}
        if tally.add(kind=str(fields.pop("target")), found=found, **fields) and part == "mutations":
            _keep(int(record["number"]), record, options)
        tick()


def _runs(tally: Tally, options: argparse.Namespace, work: Path) -> Callable[[Sequence[int]], Iterator[dict[str, Any]]]:
    """What gives the records of cases of a part by their numbers."""
    runs = {"mutations": partial(_pooled, options, work, "mutations"), "commands": partial(_pooled, options, work, "commands"),
            "signatures": partial(signatures.run, options.seed), "programs": partial(programs.altered, options.seed, work),
            "acquisitions": partial(programs.acquisitions, options.seed, work),
            "calls": partial(programs.calls, options.seed, work),
            "terminals": partial(programs.terminals, work)}  # fmt: skip
    return runs[tally.part]


def count_of(part: str, options: argparse.Namespace) -> int:
    return int(
        {
            "mutations": options.cases,
            "commands": options.each * len(every_command.LINES),
            "signatures": options.attacks,
            "programs": options.programs,
            "acquisitions": options.acquisitions,
            "calls": options.calls,
            "terminals": len(terminals.trials()),
        }[part]
    )


def _pooled(options: argparse.Namespace, work: Path, part: str, numbers: Sequence[int]) -> Iterator[dict[str, Any]]:
    return pool.run_all(numbers, options.seed, options.workers, work, part)


def resumed(
    name: str, numbers: Iterable[int], options: argparse.Namespace,
    run: Callable[[Sequence[int]], Iterator[dict[str, Any]]],
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Records of all numbers: those of a study that was stopped from its file, the others run and written there."""
    options.keep.mkdir(parents=True, exist_ok=True)
    path = options.keep / f"{name}.jsonl"
    known = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        with contextlib.suppress(ValueError):  # the last line of a study that was killed
            record = json.loads(line)
            known[record["number"]] = record
    yield from (known[number] for number in numbers if number in known)
    with path.open("a", encoding="utf-8") as file:
        for record in run([number for number in numbers if number not in known]):
            file.write(json.dumps(record) + "\n")
            file.flush()
            yield record


def _keep(number: int, record: dict[str, object], options: argparse.Namespace) -> None:
    """Lay the case out once more where it can be looked at."""
    folder = options.keep / f"mutations-{number}"
    shutil.rmtree(folder, ignore_errors=True)
    this = case(options.seed, number)
    lay_out(this, folder)
    run = "\n".join(f"cmm-uq {' '.join(ascii(part) for part in run)}" for run in (this.reads, this.command) if run)
    text = f"{record['what']}\n{record['found']}\n{run}\n\n{record['said']}\n"
    (folder / "case.txt").write_text(text, encoding="utf-8", errors="replace")


def processes(
    tally: Tally, given: Sequence[Trial], options: argparse.Namespace, work: Path, tick: Callable[[], None]
) -> None:
    """Run cases that are real processes, several at once."""

    def one(item: tuple[int, Trial]) -> tuple[int, Trial, Outcome, list[str]]:
        number, trial = item
        folder = work / str(number)
        outcome, found = trial[2](folder)
        shutil.rmtree(folder, ignore_errors=True)
        return number, trial, outcome, found

    with ThreadPoolExecutor(options.workers) as workers:
        for number, (kind, what, _), outcome, found in workers.map(one, enumerate(given)):
            tally.add(number, kind, what, outcome.code, found, outcome.stderr)
            if number % SAVED_EVERY == 0:
                tally.save(options.keep)  # what was found stays where the study is stopped
            tick()


def run_part(part: str, options: argparse.Namespace, progress: Progress) -> Tally:
    """Run one part to its end and keep its counts."""
    tally, began = Tally(part, options.seed), time.monotonic()
    task = progress.add_task(PARTS[part][0], total=None)
    with tempfile.TemporaryDirectory(prefix="hostile-", dir=memory()) as work:
        tick = partial(progress.advance, task)
        if part in RESUMED:
            progress.update(task, total=count_of(part, options))
            in_process(tally, options, Path(work), tick)
        else:
            given = list(trials(part, options))
            progress.update(task, total=len(given))
            processes(tally, given, options, Path(work), tick)
    tally.seconds = time.monotonic() - began
    tally.save(options.keep)
    return tally


def repeat(which: str, options: argparse.Namespace) -> None:
    """Run one case again, and show all of it."""
    part, number = which.split(":")
    with tempfile.TemporaryDirectory(prefix="hostile-", dir=memory()) as work:
        if part == "mutations":
            record: Any = next(iter(pool.run_all([int(number)], options.seed, 1, Path(work))))
            _keep(int(number), dict(record), options)
        elif part in RESUMED:
            tally = Tally(part, options.seed)
            record = next(iter(_runs(tally, options, Path(work))([int(number)])))
        else:
            kind, what, run = next(itertools.islice(trials(part, options), int(number), None))
            record = (kind, what, *run(Path(work) / "case"))
    print(record)


def main(arguments: Iterable[str] | None = None) -> int:
    """Run the study; 1 when anything did not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--attacks", type=int, default=1000)
    parser.add_argument("--each", type=int, default=50, help="cases of each command line, in process")
    parser.add_argument("--programs", type=int, default=2000, help="cases of all commands, each a process")
    parser.add_argument("--acquisitions", type=int, default=1000, help="kills of cmm-uq acquire")
    parser.add_argument("--calls", type=int, default=1000, help="kills at system calls that change the disk")
    parser.add_argument("--workers", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument("--only", metavar="PART:NUMBER")
    parser.add_argument("--keep", type=Path, default=ROOT / "reports" / "hostile")
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args(None if arguments is None else list(arguments))
    if options.only:
        repeat(options.only, options)
        return 0
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns) as progress:
        tallies = [run_part(part, options, progress) for part in options.part or PARTS]
    options.page.write_text(page(load(options.keep)), encoding="utf-8")
    for tally in tallies:
        print(f"{tally.part}: {tally.cases} cases, {tally.violating} with a violation, {tally.seconds:.0f} s")
    if never := sorted(set(every_command.commands()) - {line.command for line in every_command.LINES}):
        print(f"never run: {', '.join(never)}", file=sys.stderr)
    return int(bool(never) or any(tally.violating or not tally.cases for tally in tallies))


if __name__ == "__main__":
    sys.exit(main())
