"""The tables of right answers, and the job folder that each of their rows describes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from tests.analysis.conformity.by_hand.recordings import RECORDINGS, csv, wish_of

FOLDER = Path(__file__).parent

_BETWEEN = re.compile(r';(?=(?:[^"]*"[^"]*")*[^"]*$)')
"""Changes of a job: semicolons outside quotes."""


@dataclass(frozen=True)
class Right:
    """The right answer to a case.

    Parameters
    ----------
    outcome : of the statement; ``refused`` where nothing may be stated.
    lacks : words that name what is missing, or of the refusal.
    """

    outcome: str
    lacks: tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """A row of a table.

    Parameters
    ----------
    name : table and number.
    base : the complete test that it changes: recording, and table of jobs.toml.
    recording, job : its changes.
    right : the answer.
    figures : value, u and limit, µm, of what decides; empty where the table gives none.
    why : how the answer follows.
    """

    name: str
    base: tuple[str, str]
    recording: str
    job: str
    right: Right
    figures: tuple[float, ...]
    why: str

    def files(self) -> dict[str, bytes]:
        """The job folder."""
        job = job_of(self.base[1], self.job)
        recording = csv(RECORDINGS[self.base[0]](wish_of(self.recording)))
        return {"job.toml": toml(job).encode(), "recording.csv": b"# simulated\n" + recording}


@cache
def _jobs() -> Mapping[str, Any]:
    return tomllib.loads((FOLDER / "jobs.toml").read_text())


def job_of(base: str, changes: str) -> dict[str, Any]:
    """A job of jobs.toml with changes such as ``artefact.u_um = 0.3; no test_uncertainty.negligible.alignment``."""
    job = deepcopy(dict(_jobs()["common"]))
    for table, values in _jobs()[base].items():
        job[table] = deepcopy(values)
    for change in filter(None, (part.strip() for part in _BETWEEN.split(changes))):
        if change.startswith("no "):
            *path, last = change[3:].split(".")
            at(job, path).pop(last)
        else:
            key, value = change.split("=", 1)
            *path, last = key.strip().split(".")
            at(job, path)[last] = tomllib.loads(f"value = {value}")["value"]
    return job


def at(job: dict[str, Any], path: list[str]) -> dict[str, Any]:
    for name in path:
        job = job.setdefault(name, {})
    return job


def toml(job: Mapping[str, Any]) -> str:
    """Tables of a job; [[conformity]] is one statement."""
    lines = []
    for name, table in job.items():
        lines.append(f"[[{name}]]" if name == "conformity" else f"[{name}]")
        lines += [f"{key} = {value_of(value)}" for key, value in table.items()]
    return "\n".join([*lines, ""])


def value_of(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {value_of(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(value_of, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


def cases() -> list[Case]:
    """Every row of every table."""
    return [case for path in sorted(FOLDER.glob("*.md")) for case in of_file(path)]


def of_file(path: Path) -> list[Case]:
    """Rows of the tables of a file; a line ``Base: recording | job | changes`` stands before each."""
    found: list[Case] = []
    base, common, heading = ("", ""), "", ""
    for line in path.read_text().splitlines():
        if line.startswith("## "):
            heading = line[3:].strip()
        elif line.startswith("Base: "):
            recording, job, *more = (part.strip() for part in line[6:].split("|"))
            base, common = (recording, job), "; ".join(more)
        elif line.startswith("| ") and not line.startswith(("| recording", "| ---")):
            recording, job, right, figures, why = (part.strip().strip("`") for part in line.strip("| ").split(" | "))
            number = 1 + sum(case.name.startswith(f"{heading} ") for case in found)
            found.append(Case(
                f"{heading} {number}", base, blank(recording), "; ".join(filter(None, (common, blank(job)))), right_of(right),
                tuple(float(figure) for figure in blank(figures).split()), why,
            ))  # fmt: skip
    return found


def blank(text: str) -> str:
    return "" if text == "–" else text


def right_of(text: str) -> Right:
    """``pass``, ``fail, lacks: parallel to X, 3 of 105``, ``refused: metres``."""
    outcome, _, lacks = re.sub(r", lacks:|:", "|", text, count=1).partition("|")
    return Right(outcome.strip(), tuple(word.strip() for word in lacks.split(",") if word.strip()))
