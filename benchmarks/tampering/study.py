"""Are alterations of certificates found, and good certificates left alone?

    python benchmarks/tampering/study.py                       all of it, resumed where it was left, and the page written
    python benchmarks/tampering/study.py --cases 200 --good 50 a sample
    python benchmarks/tampering/study.py --only 17             one case, told
    python benchmarks/tampering/study.py --commands 500        so many good certificates by the command itself, too

Records are lines of JSON below build/tampering (--keep); docs/tampering-study.md is written of them. Good certificates are
made and verified in processes that import once and go on to the next one.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import json
import multiprocessing
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ["CMM_UQ_RECORDS"] = "none"

from benchmarks.tampering import page  # noqa: E402
from benchmarks.tampering.cases import SEED, case  # noqa: E402
from benchmarks.tampering.certificates import bases, good_job  # noqa: E402
from cmm_uq.app.cli import NEW_OBJECTS  # noqa: E402

WORK = ROOT / "build" / "tampering"


def main() -> None:
    asked = argparse.ArgumentParser()
    asked.add_argument("--cases", type=int, default=2400)
    asked.add_argument("--good", type=int, default=10_000)
    asked.add_argument("--commands", type=int, default=500)
    asked.add_argument("--keep", type=Path, default=WORK)
    asked.add_argument("--workers", type=int, default=2)
    asked.add_argument("--only", type=int)
    asked.add_argument("--page", action="store_true", help="write the page alone")
    options = asked.parse_args()
    work: Path = options.keep
    work.mkdir(parents=True, exist_ok=True)
    if options.only is not None:
        _tell(work, options.only)
        return
    files = {name: work / f"{name}.jsonl" for name in ("altered", "good", "commands")}
    if not options.page:
        if options.cases:
            bases(work / "bases")
        _run(partial(_altered, work), files["altered"], options.cases, options.workers)
        _run(partial(_good, work), files["good"], options.good, options.workers)
        _run(partial(_by_command, work), files["commands"], options.commands, options.workers)
    altered, good, commands = map(_records, files.values())
    text = page.written(altered, good, commands, seed=SEED)
    (ROOT / "docs" / "tampering-study.md").write_text(text, encoding="utf-8")


def _records(path: Path) -> list[dict[str, Any]]:
    """Those that are kept, by number; the last line of a study that was killed is none, and U+2028 ends no line."""
    found = {}
    for line in path.read_text(encoding="utf-8").split("\n") if path.exists() else ():
        with contextlib.suppress(ValueError):
            record = json.loads(line)
            found[record["number"]] = record
    return [found[number] for number in sorted(found)]


def _run(work: Any, path: Path, count: int, workers: int) -> None:
    """What is not recorded yet, in processes, each record written as it comes."""
    if path.exists() and not path.read_bytes().endswith(b"\n"):  # of a study that was killed while it wrote
        path.write_bytes(path.read_bytes() + b"\n")
    done = {record["number"] for record in _records(path)}
    left = [number for number in range(count) if number not in done]
    began, command = time.monotonic(), ["git", "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.strip()
    spawn = multiprocessing.get_context("spawn")
    with (
        spawn.Pool(workers, gc.set_threshold, (NEW_OBJECTS,), maxtasksperchild=400) as pool,
        path.open("a", encoding="utf-8") as file,
    ):
        for record in pool.imap_unordered(work, left, chunksize=1):
            file.write(json.dumps(record | {"commit": commit}, ensure_ascii=False) + "\n")
            file.flush()
    print(f"{path.name}: {len(left)} in {time.monotonic() - began:.0f} s")


_BASES: dict[str, dict[str, bytes]] = {}


def _altered(work: Path, number: int) -> dict[str, Any]:
    from benchmarks.tampering.judged import judged

    if not _BASES:
        _BASES.update(bases(work / "bases"))
    return judged(case(number, _BASES), work / f"case-{os.getpid()}")


def _good(work: Path, number: int) -> dict[str, Any]:
    from benchmarks.tampering.judged import verified

    folder = work / f"good-{os.getpid()}"
    return verified(good_job(number, folder), folder)


def _by_command(work: Path, number: int) -> dict[str, Any]:
    from benchmarks.tampering.judged import by_command

    folder = work / f"good-{os.getpid()}"
    return by_command(good_job(number, folder), folder)


def _tell(work: Path, number: int) -> None:
    record = _altered(work, number)
    for key, value in record.items():
        print(f"{key}: {value}")


if __name__ == "__main__":
    main()
