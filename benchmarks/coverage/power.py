"""What a diagnosis finds of one concealed effect, by its strength: ``python -m benchmarks.coverage.power FOLDER``.

The cases are those of :mod:`benchmarks.concealed`, with white noise that is not stated and √λ set. The counts go to
``FOLDER/power.json``, from which ``study --page`` writes its table; ``FOLDER/power.log`` keeps every case.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections import defaultdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track
from scipy.stats import norm

from benchmarks.concealed.designs import ballbar, step_gauge
from benchmarks.concealed.generator import SIX, Oracle, hide, indicated, sizes_for, write
from benchmarks.concealed.physics import LARGEST, kind_of
from benchmarks.coverage.measuring import BLAS, TASKS

DESIGNS = {
    "ballbar 20 × 3": lambda random: ballbar(random, 20, 3),
    "ballbar 40 × 2": lambda random: ballbar(random, 40, 2),
    "step gauge": step_gauge,
}
ROOTS = (0.0, 4.5, 6.0, 9.0)
"""√λ of what is concealed; nothing at 0."""
ALPHA = 0.01

Task = tuple[int, str, float, int]


def concealed(task: Task, folder: Path) -> tuple[str | None, bool]:
    """Write one job; what it conceals, and whether an oracle that knows effect and noise sees it."""
    seed, what, root, number = task
    for attempt in range(100):
        random = np.random.default_rng([seed, list(DESIGNS).index(what), round(10 * root), number, attempt])
        design, sigma = DESIGNS[what](random), float(random.uniform(0.7, 2.0)) * 1e-3
        shape = {
            "period": float(np.exp(random.uniform(np.log(30), np.log(300)))),
            "phase": float(random.uniform(-3, 3)),
        }
        oracle = Oracle(design, list(SIX), True, sigma, shape)
        chosen = hide(random, "one", design, oracle, list(SIX))
        assert chosen is not None
        hidden, _ = chosen
        ((name, error),) = hidden.items()
        signal = oracle.seen(error)
        sizes = sizes_for(random, oracle, hidden, {name: root}, {name: signal})
        if sizes is None:
            continue
        base = {each: random.normal(0, LARGEST[kind_of(each)] / 6) for each in SIX}
        noise = sigma * random.standard_normal(design.true.shape)
        write(folder, indicated(oracle, base, hidden, sizes) + noise, design, list(SIX), design.length, None)
        seen = oracle.rest.T @ (design.D @ noise.ravel()) / (sigma * design.noise) + sizes[name] * signal
        z = float(signal @ seen / np.linalg.norm(signal))
        return (name if root else None), abs(z) > norm.isf(ALPHA / 2)
    raise RuntimeError(f"nothing to conceal in {what}")


def diagnosed(task: Task) -> dict[str, Any]:
    """What a diagnosis says of one case."""
    import cmm_uq

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "concealed"
        hidden, oracle = concealed(task, folder)
        said = cmm_uq.diagnose(folder, seed=task[3], alpha=ALPHA).diagnosis
    named = {each["effect"] for each in said["effects"]}
    together = named.union(*(set(group) for group in said["indistinguishable"] if named & set(group)))
    return {"task": task, "hidden": hidden, "oracle": bool(oracle), "found": said["verdict"] != "consistent",
            "named": hidden in together, "verdict": said["verdict"]}  # fmt: skip


def counts(records: list[dict[str, Any]]) -> dict[str, dict[str, dict[str, list[int]]]]:
    """How many of how many, by recording and √λ."""
    found: dict[str, dict[str, dict[str, list[int]]]] = defaultdict(dict)
    for record in sorted(records, key=lambda each: (list(DESIGNS).index(each["task"][1]), each["task"][2])):
        _, what, root, _ = record["task"]
        row = found[what].setdefault(f"{root:g}", {key: [0, 0] for key in ("found", "named", "oracle")})
        for key, pair in row.items():
            pair[0] += record[key]
            pair[1] += 1
    return dict(found)


def main() -> None:
    """Run what is not done yet, and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=100, help="of each recording and strength")
    parser.add_argument("--processes", type=int, default=4)
    parser.add_argument("--seed", type=int, default=2026)
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    file = chosen.folder / "power.log"
    records = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {tuple(record["task"]) for record in records}
    tasks = [(chosen.seed, what, root, i) for i in range(chosen.cases) for what in DESIGNS for root in ROOTS]
    tasks = [task for task in tasks if task not in done]
    for name in BLAS:
        os.environ[name] = "1"
    with get_context("spawn").Pool(chosen.processes, maxtasksperchild=TASKS) as pool, file.open("a") as out:
        for record in track(pool.imap_unordered(diagnosed, tasks), "Diagnosing", total=len(tasks)):
            records.append(record)
            out.write(json.dumps(record) + "\n")
            out.flush()
    told = counts(records)
    (chosen.folder / "power.json").write_text(json.dumps(told, indent=1, ensure_ascii=False), encoding="utf-8")
    for what, rows in told.items():
        for root, row in rows.items():
            print(what, root, {key: f"{hits} of {of}" for key, (hits, of) in row.items()})


if __name__ == "__main__":
    main()
