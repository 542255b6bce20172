"""One recording through the API: its intervals beside the truth, the verdict, and the time that it took."""

from __future__ import annotations

import json
import lzma
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from benchmarks.coverage.cells import Cell
from benchmarks.coverage.recordings import Recording, recording

BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
TASKS = 100
"""After which a process is replaced by a fresh one, so that none grows."""

Task = tuple[Cell, int, int]
"""Cell, seed of the study, number of the recording."""


def measured(task: Task) -> dict[str, Any]:
    """What ``report`` says of one recording; a refusal or a fault is kept in words."""
    import cmm_uq

    cell, seed, number = task
    made = recording(cell, seed, number)
    found: dict[str, Any] = {"cell": cell.name, "number": number, "noisy_axis": made.noisy_axis}
    with tempfile.TemporaryDirectory() as folder:
        job = made.write(Path(folder) / "coverage")
        start = time.perf_counter()
        try:
            said = cmm_uq.report(job, seed=number)
        except Exception as fault:  # a study of thousands goes on, and counts it
            return found | {"fault": f"{type(fault).__name__}: {fault}", "seconds": time.perf_counter() - start}
        found["seconds"] = time.perf_counter() - start
    stated = {name: [*row, truth] for name, row, truth in _beside(said.results, made)}
    verdict = said.results.get("diagnosis", {})
    named = [each["effect"] for each in verdict.get("effects", [])]
    return found | {"verdict": verdict.get("verdict"), "p": verdict.get("p_value"), "named": named, "intervals": stated}


def _beside(results: Mapping[str, Any], made: Recording) -> Iterator[tuple[str, list[float], float]]:
    """Name; value, u, lower and upper end; truth; of all that has a truth. What is not stated is a fault of the study."""
    places = {"figures": results.get("accuracy_uncertainty", {}), "artefact": results["artefact"],
              "noise": results.get("noise") or results["diagnosis"]["noise"]}  # fmt: skip
    for name, truth in made.truth.items():
        first, second, *rest = name.split(".")
        if first == "lines":
            line = next(line for line in results["lines"] if line["measurement"] == int(second))[rest[0]]
            quantity = {"u": line["U"] / 2, "interval95": [line["value"] - line["U"], line["value"] + line["U"]]} | line
        else:
            quantity = (places[first] if first in places else results["estimates"][first])[second]
        yield name, [quantity["value"], quantity["u"], *quantity["interval95"]], truth


def run(
    tasks: Iterable[Any], processes: int, work: Callable[[Any], dict[str, Any]] = measured
) -> Iterator[dict[str, Any]]:
    """Records of all tasks as they come, each process on one thread."""
    for name in BLAS:
        os.environ[name] = "1"
    with get_context("spawn").Pool(processes, maxtasksperchild=TASKS) as pool:
        yield from pool.imap_unordered(work, tasks)


class StudyCell(Protocol):
    """Of a study in which machines are drawn."""

    @property
    def name(self) -> str: ...

    @property
    def key(self) -> tuple[int, ...]: ...


def counted(
    cell: StudyCell, seed: int, number: int, measure: Callable[[np.random.Generator], dict[str, Any]], *stream: int
) -> dict[str, Any]:
    """One case, with a stream and the processor time of its own; where one fails a study goes on, and counts it."""
    random = np.random.default_rng([seed, *cell.key, number, *stream])
    start = time.process_time()
    try:
        found = measure(random)
    except Exception as fault:
        found = {"fault": f"{type(fault).__name__}: {fault}"}
    return {"cell": cell.name, "number": number, **found, "seconds": round(time.process_time() - start, 3)}


def kept(folder: Path) -> list[dict[str, Any]]:
    """All records of a folder, those packed with xz too; a last line that was cut off is left out."""
    records = []
    for file in sorted((*folder.glob("*.jsonl"), *folder.glob("*.jsonl.xz"))):
        content = lzma.decompress(file.read_bytes()) if file.suffix == ".xz" else file.read_bytes()
        for line in content.decode("utf-8").splitlines():
            try:
                records.append(json.loads(line))
            except json.JSONDecodeError:
                continue
    return records
