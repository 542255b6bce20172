"""Cases sealed, diagnosed and searched one after the other: each result is a line, so that a run can be taken up again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.second.cases import job, seal
from benchmarks.second.running import lines
from benchmarks.third.cases import case
from benchmarks.third.oracle import searched_for

STEPS = 600
"""Most steps of a chain here; a diagnosis takes up to 6000. Intervals' ends depend on it, which nothing here counts."""
KEPT = (
    "verdict", "p_value", "where", "effects", "withheld", "indistinguishable", "empirical", "improvement", "noise",
    "alternatives",
)  # fmt: skip
"""Of a diagnosis in results.json; what is not there is left out."""


def truths(folder: Path, seed: int, count: int) -> tuple[list[dict[str, Any]], str]:
    """Of all cases, and their hash, which is written down with the time before anything is diagnosed."""
    from rich.progress import track

    file = folder / "truths.jsonl"
    ready = lines(file)
    with file.open("a", encoding="utf-8") as out:
        for number in track(range(len(ready), count), "making", disable=len(ready) >= count):
            found = case(seed, number)
            job(found.one, folder / "jobs" / found.one.name, found.one.order)
            ready.append(json.loads(json.dumps({"name": found.one.name, "number": number, **found.one.truth})))
            out.write(json.dumps(ready[-1]) + "\n")
            out.flush()
    every = ready[:count]
    mark, book = seal(every), folder / "sealed.txt"
    if not book.exists() or mark not in book.read_text(encoding="utf-8"):
        when, done = datetime.now(UTC).isoformat(timespec="seconds"), len(lines(folder / "said.jsonl"))
        with book.open("a", encoding="utf-8") as out:
            out.write(f"{mark}  {len(every)} cases, {done} of them diagnosed before, {when}\n")
    return every, mark


def run(folder: Path, seed: int, every: list[dict[str, Any]]) -> None:
    """Diagnose and search what is not done yet."""
    from rich.progress import track

    ready = {record["name"] for record in lines(folder / "said.jsonl")}
    waiting = [truth for truth in every if truth["name"] not in ready]
    with (folder / "said.jsonl").open("a", encoding="utf-8") as out:
        for truth in track(waiting, "diagnosing", total=len(waiting)):
            out.write(json.dumps(done(folder, seed, truth), default=str) + "\n")
            out.flush()


def done(folder: Path, seed: int, truth: Mapping[str, Any]) -> dict[str, Any]:
    """One case; a refusal or a fault is kept in words."""
    found: dict[str, Any] = {"name": truth["name"]}
    start = time.process_time()
    try:
        found["said"] = diagnosed(folder / "jobs" / truth["name"])
    except Exception as fault:  # a study goes on, and counts it
        found["fault"] = f"{type(fault).__name__}: {fault}"
    found["seconds"] = time.process_time() - start
    start = time.process_time()
    found["oracle"] = searched_for(case(seed, truth["number"]), truth["number"])
    return found | {"oracle_seconds": time.process_time() - start}


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
