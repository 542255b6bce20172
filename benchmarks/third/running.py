"""Cases sealed, diagnosed and searched one after the other: each result is a line, so that a run can be taken up again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.second.cases import job, seal
from benchmarks.second.running import lines
from benchmarks.third.cases import Hidden
from benchmarks.third.oracle import searched_for

STEPS = 600
"""Most steps of a chain here; a diagnosis takes up to 6000. Intervals' ends depend on it, which nothing here counts."""
KEPT = (
    "verdict", "p_value", "where", "effects", "withheld", "indistinguishable", "empirical", "improvement", "noise",
    "alternatives",
)  # fmt: skip
"""Of a diagnosis in results.json; what is not there is left out."""


@dataclass(frozen=True)
class Generator:
    """What makes the cases of a study.

    Parameters
    ----------
    case : of a seed and a number.
    count : of its cases, if nobody asks for another.
    whole : whether it hides effects of the whole catalogue.
    marks, said : where its page stands, and what it says of how it was done.
    """

    case: Callable[[int, int], Hidden]
    count: int
    whole: bool
    marks: tuple[str, str]
    said: str


def truths(generator: Generator, seed: int, count: int, folder: Path, apart: Path) -> tuple[list[dict[str, Any]], str]:
    """Of all cases, ``apart``, and their hash, which is written down with the time before anything is diagnosed; the jobs are
    written into ``folder``."""
    from rich.progress import track

    file = apart / "truths.jsonl"
    ready = lines(file)
    with file.open("a", encoding="utf-8") as out:
        for number in track(range(len(ready), count), "making", disable=len(ready) >= count):
            found = generator.case(seed, number)
            job(found.one, folder / "jobs" / found.one.name, found.one.order)
            ready.append(json.loads(json.dumps({"name": found.one.name, "number": number, **found.one.truth})))
            out.write(json.dumps(ready[-1]) + "\n")
            out.flush()
    every = ready[:count]
    mark, book = seal(every), apart / "sealed.txt"
    if not book.exists() or mark not in book.read_text(encoding="utf-8"):
        when, done = datetime.now(UTC).isoformat(timespec="seconds"), len(lines(folder / "said.jsonl"))
        with book.open("a", encoding="utf-8") as out:
            out.write(f"{mark}  {len(every)} cases, {done} of them diagnosed before, {when}\n")
    return every, mark


def run(folder: Path) -> None:
    """Diagnose every job that has not been."""
    jobs = sorted(path.parent for path in (folder / "jobs").glob("*/job.toml"))
    _kept(folder / "said.jsonl", ((path.name, lambda path=path: _told(path)) for path in jobs), len(jobs))


def asked(generator: Generator, seed: int, every: list[dict[str, Any]], apart: Path) -> None:
    """Ask an oracle of every case that hides something."""
    some = [one for one in every if one["kind"] != "nothing"]
    each = ((one["name"], lambda number=one["number"]: _searched(generator, seed, number)) for one in some)
    _kept(apart / "oracle.jsonl", each, len(some))


def _kept(file: Path, each: Iterable[tuple[str, Callable[[], dict[str, Any]]]], many: int) -> None:
    from rich.progress import track

    ready = {record["name"] for record in lines(file)}
    cut = file.exists() and not file.read_bytes().endswith(b"\n")
    with file.open("a", encoding="utf-8") as out:
        out.write("\n" * cut)
        for name, done in track(each, file.stem, total=many):
            if name not in ready:
                out.write(json.dumps({"name": name, **done()}, default=str) + "\n")
                out.flush()


def _told(folder: Path) -> dict[str, Any]:
    """What is said of a job; a refusal or a fault is kept in words."""
    found: dict[str, Any] = {}
    start = time.process_time()
    try:
        found["said"] = diagnosed(folder)
    except Exception as fault:  # a study goes on, and counts it
        found["fault"] = f"{type(fault).__name__}: {fault}"
    return found | {"seconds": time.process_time() - start}


def _searched(generator: Generator, seed: int, number: int) -> dict[str, Any]:
    start = time.process_time()
    said = searched_for(generator.case(seed, number), number, whole=generator.whole)
    return {"oracle": said, "oracle_seconds": time.process_time() - start}


def diagnosed(folder: Path) -> dict[str, Any]:
    """What ``diagnose`` says of a job, as any program may read it from results.json."""
    import cmm_uq

    with short():
        said = cmm_uq.diagnose(folder).results["diagnosis"]
    return {key: said[key] for key in KEPT if key in said}


@contextmanager
def short() -> Iterator[None]:
    """Without what is not counted here and takes most of the time: long chains, and what to measure next."""
    from cmm_uq.app.commands import diagnose
    from cmm_uq.maths.inference import ensembles

    with ExitStack() as patched:
        patched.enter_context(patch.object(ensembles, "MOST_STEPS", STEPS))
        patched.enter_context(patch.object(diagnose, "next_plan", lambda *some, **more: None))
        patched.enter_context(patch.object(diagnose, "smallest_effects", lambda *some, **more: ()))
        yield
