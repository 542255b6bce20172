"""Diagnose concealed cases and count: ``python benchmarks/concealed/study.py FOLDER [--cases 13] [--seed 0] [--summary D]``.

The cases are made first and their truth is sealed by a hash. Every diagnosis is appended to ``FOLDER/found*.jsonl``, so that a
run can be interrupted and resumed, or shared among processes (``--part``); ``--peer`` runs a plain search on the same cases;
``--summary`` counts what is there.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from rich.progress import track

from benchmarks.concealed.generator import DESIGNS, NOTHING, SIGNALS, case, seal
from benchmarks.concealed.greedy import searched
from benchmarks.concealed.physics import holds
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.reading import read_job


def make(folder: Path, cases: int, seed: int) -> list[dict]:
    """All cases, by the folder's name; made once."""
    sealed = folder / "truth.json"
    if not sealed.exists():
        truths = []
        for d, what in enumerate(DESIGNS):
            for k, kind in enumerate(SIGNALS + NOTHING):
                for i in range(cases):
                    name, number = f"{d}-{k}-{i}", seed * 10**8 + d * 10**6 + k * 10**4 + i
                    try:
                        truths.append({"name": name, **case(number, what, kind, folder / name)})
                    except RuntimeError:
                        break  # this artefact has nothing of the kind to hide
        sealed.write_text(json.dumps(truths), encoding="utf-8")
    truths = json.loads(sealed.read_text(encoding="utf-8"))
    print(f"{len(truths)} cases, truth sealed: {seal(truths)}", flush=True)
    return truths


def diagnosed(job: Path) -> dict:
    start = time.perf_counter()
    d = diagnose_read(read_job(job)).diagnosis
    return {
        "verdict": d.verdict, "p": d.p_value, "seconds": time.perf_counter() - start,
        "effects": {
            item.effect: {
                "probability": item.probability,
                "together": item.together,
                "parameters": {k: [q.value, q.u, *q.interval95] for k, q in item.parameters.items()},
            }
            for item in d.effects
        },
        "groups": [list(group) for group in d.indistinguishable],
        "rivals": [[name, p] for name, p in d.rivals[:4]],
        "heldout": [d.improvement.heldout_rms_before_um, d.improvement.heldout_rms_after_um, d.improvement.elpd_gain],
    }  # fmt: skip


def right(truth: dict, found: dict) -> tuple[bool, bool]:
    """Whether the verdict and the effects are what was hidden: strictly, and with groups that the oracle cannot part."""
    hidden, named = set(truth["hidden"]), set(found["effects"])
    if truth["kind"] in NOTHING:
        good = found["verdict"] == "consistent"
        return good, good
    if truth["kind"] == "outside":
        good = found["verdict"] in ("unexplained", "partial") and not named
        return good, good
    verdicts = ("explained", "partial") if truth["kind"] == "roughly" else ("explained",)
    good = found["verdict"] in verdicts
    groups = [set(group) for group in found["groups"]]
    together = all(h in named or any(h in g and g & named for g in groups) for h in hidden)
    innocent = [n for n in named - hidden if not any(n in g and g & hidden for g in groups)]
    return good and named == hidden, good and together and not innocent


def covered(truth: dict, found: dict) -> list[tuple[str, bool]]:
    """For every parameter of every hidden effect that was named, whether its interval holds the truth."""
    listed = []
    if truth["kind"] in ("roughly", "outside"):
        return listed
    for name, size in truth["hidden"].items():
        for parameter, (_, _, low, high) in found["effects"].get(name, {"parameters": {}})["parameters"].items():
            listed.append((parameter, holds(truth, name, size, parameter, low, high)))
    return listed


def run(folder: Path, truths: list[dict], part: tuple[int, int], only: str | None, peer: bool) -> None:
    file = "peer" if peer else "found"
    done = {found["name"] for found in _written(folder, file)}
    mine = [t for t in truths[part[0] - 1 :: part[1]] if t["name"] not in done and (only is None or only in t["kind"])]
    with (folder / f"{file}{part[0]}.jsonl").open("a", encoding="utf-8") as out:
        for truth in track(mine, "Diagnosing"):
            job = folder / truth["name"]
            found = plainly(job, truth["sigma_um"]) if peer else diagnosed(job)
            out.write(json.dumps({"name": truth["name"], **found}) + "\n")
            out.flush()


def plainly(job: Path, sigma_um: float) -> dict:
    """What the plain search finds, told as a diagnosis."""
    named = searched(job, sigma_um)
    return {"verdict": "explained" if named else "consistent", "effects": dict.fromkeys(named), "groups": []}


def _written(folder: Path, file: str) -> list[dict]:
    return [
        json.loads(line) for path in sorted(folder.glob(f"{file}*.jsonl"))
        for line in path.read_text(encoding="utf-8").splitlines()
    ]  # fmt: skip


def summary(folder: Path, truths: list[dict], docs: Path | None) -> None:
    from benchmarks.concealed.report import write

    by_name = {t["name"]: t for t in truths}
    pairs, peers = ([(by_name[f["name"]], f) for f in _written(folder, file)] for file in ("found", "peer"))
    write(pairs, peers, right, covered, seal(truths), docs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=13, help="of each kind and artefact")
    parser.add_argument("--seed", type=int, default=0, help="of the cases")
    parser.add_argument("--part", default="1/1", help="which part of how many, to share the work among processes")
    parser.add_argument("--peer", action="store_true", help="run the plain search instead")
    parser.add_argument("--only", help="kinds that contain this word")
    parser.add_argument("--summary", nargs="?", const="", help="count, and write page and plots into this folder")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)
    truths = make(chosen.folder, chosen.cases, chosen.seed)
    if chosen.summary is None:
        part, of = map(int, chosen.part.split("/"))
        run(chosen.folder, truths, (part, of), chosen.only, chosen.peer)
    summary(chosen.folder, truths, Path(chosen.summary) if chosen.summary else None)


if __name__ == "__main__":
    main()
