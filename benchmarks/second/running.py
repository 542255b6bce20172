"""Cases made, sealed, diagnosed and searched by the oracles: each result is a line, so that a run can be taken up again."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.coverage.measuring import run
from benchmarks.second.cases import CAUSES, FAULTS, KINDS, NOTHING, case, name_of, seal, write
from benchmarks.second.maps import concealed

Task = tuple[str, int, str, int, str]
"""Folder, seed, kind, number, what to do: make, diagnose, or search."""


def tasks(folder: Path, seed: int, cases: int, nulls: int, what: str) -> list[Task]:
    """Of every kind as many as asked, spread evenly, so that a run that is cut short has some of each."""
    many = {**dict.fromkeys(NOTHING, nulls), **dict.fromkeys(CAUSES, cases)}
    if what == "search":
        del many["maps"]  # oracles search recordings of artefacts
    listed = [((i + 0.5) / many[kind], k, i) for k, kind in enumerate(KINDS) if kind in many for i in range(many[kind])]
    return [(str(folder), seed, KINDS[k], i, what) for _, k, i in sorted(listed)]


def done(task: Task) -> dict[str, Any]:
    """Make, diagnose or search one case; a refusal or a fault is kept in words."""
    folder, seed, kind, number, what = task
    made: Any = case(seed, kind, number) if kind != "maps" else concealed(seed, number, name_of(kind, number))
    found: dict[str, Any] = {"name": made.name, "what": what}
    start = time.process_time()
    if what == "make":
        _written(made, Path(folder) / "jobs")
        return found | {"truth": made.truth}
    try:
        found |= _searched(made, number) if what == "search" else diagnosed(Path(folder) / "jobs" / made.name)
        if what == "diagnose" and kind == "shuffled":
            found["in_order"] = diagnosed(Path(folder) / "jobs" / f"{made.name}-in-order")
    except Exception as fault:  # a study of thousands goes on, and counts it
        found["fault"] = f"{type(fault).__name__}: {fault}"
    return found | {"seconds": time.process_time() - start}


def _written(made: Any, folder: Path) -> None:
    if made.truth["kind"] != "maps":
        write(made, folder)
        return
    (folder / made.name).mkdir(parents=True, exist_ok=True)
    for name, text in made.files.items():
        (folder / made.name / name).write_text(text, encoding="utf-8")


def _searched(made: Any, number: int) -> dict[str, Any]:
    from benchmarks.second.oracle import known_forms, searched

    by = {
        "estimates": searched(made, knows_noise=False, seed=number),
        "knows": searched(made, knows_noise=True, seed=number),
    }
    told: dict[str, Any] = {key: {"effects": list(found.effects), "p": found.p_value} for key, found in by.items()}
    if made.truth["kind"] == "outside":
        p_value, named = known_forms(made, seed=number)
        told["knows_form"] = {"p": p_value, "named": named}
    return told


class ConsistentError(Exception):
    """No error but an end: a recording agrees with its model, with the p-value that this carries."""


def diagnosed(job: Path, *, whole: bool = False) -> dict[str, Any]:
    """What ``diagnose`` says of a job, as any program may read it from results.json.

    Where the verdict is *consistent*, nothing is asserted and nothing of the posterior is looked at: it is then not sampled,
    which is two thirds of the time, unless ``whole``.
    """
    import cmm_uq
    from cmm_uq.analysis.diagnosis import diagnosis

    sampled = diagnosis.joint_posterior

    def stopped(found: Any, *more: Any, **named: Any) -> Any:
        if found.first.p_value >= diagnosis.FALSE_ALARMS:
            raise ConsistentError(found.first.p_value)
        return sampled(found, *more, **named)

    try:
        diagnosis.joint_posterior = sampled if whole else stopped
        said = cmm_uq.diagnose(job).results["diagnosis"]
    except ConsistentError as found:
        return {
            "verdict": "consistent",
            "p": float(found.args[0]),
            "groups": [],
            "effects": {},
            "withheld": [],
            "remaining": [],
        }
    finally:
        diagnosis.joint_posterior = sampled
    return {
        "verdict": said["verdict"], "p": said["p_value"], "groups": [list(group) for group in said["indistinguishable"]],
        "effects": {
            each["effect"]: {
                "probability": each["probability"], "together": each.get("probability_together", each["probability"]),
                "group": [*each.get("group", []), *(name for one in each.get("alternatives", []) for name in one["effects"])],
                "periods": [p["value"] for p in (*each.get("periods_mm", ()), *each.get("other_periods_mm", ()))],
                "parameters": {k: [q["value"], q["u"], *q["interval95"]] for k, q in each["parameters"].items()},
            }
            for each in said["effects"]
        },
        "withheld": [each["effect"] for each in said.get("withheld", [])],
        "remaining": [[each["probability"], each["effects"]] for each in said.get("remaining", [])],
    }  # fmt: skip


def lines(file: Path) -> list[dict[str, Any]]:
    """Records of a file; a last line that was cut off is left out."""
    found = []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        try:
            found.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return found


def kept(listed: Sequence[Task], file: Path, workers: int) -> None:
    """Do what is not done yet, each result a line of the file.

    Parameters
    ----------
    listed : all tasks of one kind of work.
    file : that keeps the results.
    workers : processes at once; each is replaced now and then, so that none grows.
    """
    from rich.progress import track

    ready = {record["name"] for record in lines(file)}
    waiting = [task for task in listed if name_of(task[2], task[3]) not in ready]
    cut = file.exists() and not file.read_bytes().endswith(b"\n")
    with file.open("a", encoding="utf-8") as out:
        out.write("\n" * cut)
        for record in track(run(waiting, workers, done), file.stem, total=len(waiting)):
            out.write(json.dumps(record) + "\n")
            out.flush()


def sealed(folder: Path, listed: Sequence[Task]) -> tuple[list[dict[str, Any]], str]:
    """Truths of all cases asked for, and their hash, which is written down with the time before anything is diagnosed."""
    wanted = [name_of(kind, number) for _, _, kind, number, _ in listed]
    truth = {record["name"]: record["truth"] for record in lines(folder / "make.jsonl")}
    truths = [{"name": name, **truth[name]} for name in wanted]
    mark = seal(truths)
    book = folder / "sealed.txt"
    if not book.exists() or mark not in book.read_text(encoding="utf-8"):
        when = datetime.now(UTC).isoformat(timespec="seconds")
        ready = len(lines(folder / "diagnose.jsonl"))
        with book.open("a", encoding="utf-8") as out:
            out.write(f"{mark}  {len(truths)} cases, {ready} of them diagnosed before, {when}\n")
    return truths, mark


def completed(truths: list[dict[str, Any]], seed: int) -> list[dict[str, Any]]:
    """Truths of runs that were sealed before it was written down which effects a fault of the artefact is, with these."""
    return [
        {"name": each["name"], **case(seed, each["kind"], int(each["name"].split("-")[1])).truth}
        if each["kind"] in FAULTS and "same" not in each else each
        for each in truths
    ]  # fmt: skip
