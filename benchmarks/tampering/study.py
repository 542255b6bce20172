"""Are alterations of certificates found, and good certificates left alone?

    python benchmarks/tampering/study.py                       all of it, resumed where it was left, and the page written
    python benchmarks/tampering/study.py --cases 200 --good 50 a sample
    python benchmarks/tampering/study.py --only 17             one case, told

Records are lines of JSON below build/tampering; docs/tampering-study.md is written of them.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ["CMM_UQ_RECORDS"] = "none"

from benchmarks.tampering import page  # noqa: E402
from benchmarks.tampering.cases import SEED, case  # noqa: E402
from benchmarks.tampering.certificates import bases, good  # noqa: E402

WORK = ROOT / "build" / "tampering"


def main() -> None:
    asked = argparse.ArgumentParser()
    asked.add_argument("--cases", type=int, default=2400)
    asked.add_argument("--good", type=int, default=1000)
    asked.add_argument("--workers", type=int, default=2)
    asked.add_argument("--only", type=int)
    asked.add_argument("--page", action="store_true", help="write the page alone")
    options = asked.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    if options.only is not None:
        _tell(options.only)
        return
    if not options.page:
        bases(WORK / "bases")
        _run(_altered, WORK / "altered.jsonl", options.cases, options.workers)
        _run(_good, WORK / "good.jsonl", options.good, options.workers)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    text = page.written(_records(WORK / "altered.jsonl"), _records(WORK / "good.jsonl"), seed=SEED, commit=commit)
    (ROOT / "docs" / "tampering-study.md").write_text(text, encoding="utf-8")


def _records(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    found = {
        record["number"]: record for record in map(json.loads, path.read_text(encoding="utf-8").strip().split("\n"))
    }
    return [found[number] for number in sorted(found)]


def _run(work: Any, path: Path, count: int, workers: int) -> None:
    """What is not recorded yet, in processes, each record written as it comes."""
    done = {record["number"] for record in _records(path)}
    left = [number for number in range(count) if number not in done]
    began = time.monotonic()
    spawn = multiprocessing.get_context("spawn")
    with spawn.Pool(workers, maxtasksperchild=400) as pool, path.open("a", encoding="utf-8") as file:
        for record in pool.imap_unordered(work, left, chunksize=4):
            file.write(json.dumps(record, ensure_ascii=False) + "\n")
            file.flush()
    print(f"{path.name}: {len(left)} in {time.monotonic() - began:.0f} s")


_BASES: dict[str, dict[str, bytes]] = {}


def _altered(number: int) -> dict[str, Any]:
    from benchmarks.tampering.judged import judged

    if not _BASES:
        _BASES.update(bases(WORK / "bases"))
    return judged(case(number, _BASES), WORK / f"case-{os.getpid()}")


def _good(number: int) -> dict[str, Any]:
    from benchmarks.tampering.judged import verified

    return verified(number, good(number, WORK / f"good-{os.getpid()}"))


def _tell(number: int) -> None:
    record = _altered(number)
    for key, value in record.items():
        print(f"{key}: {value}")


if __name__ == "__main__":
    main()
