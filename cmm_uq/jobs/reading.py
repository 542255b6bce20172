"""From a job folder to a :class:`~cmm_uq.jobs.job.Job`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import create_model

from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.earlier import against_earlier
from cmm_uq.jobs.job import ArtefactFacts, Job, JobFile, MachineFacts, Tables, job_file_of
from cmm_uq.jobs.origin import altered, check_mark, is_planned
from cmm_uq.jobs.recording import read_recording
from cmm_uq.jobs.toml_file import checked
from cmm_uq.points import AXES, Machine, Points
from cmm_uq.writing import finish_interrupted


def read_job(folder: Path, tables: Tables, known: Callable[[], Sequence[str]], *, recorded: bool = True) -> Job:
    """Read and check a job.

    Parameters
    ----------
    folder : the job folder, or its job.toml.
    tables, known : of the kinds that may be read, and their names.
    recorded : whether the recording must be there; otherwise a job still to be measured has no points.

    Raises
    ------
    CmmUqError : a file is missing or unreadable, or says something unknown or contradictory.
    """
    path = folder if folder.suffix == ".toml" else folder / "job.toml"
    folder = path.parent
    finish_interrupted(folder)
    content = content_of(path, "A job is a folder with a job.toml and the recording that it names")
    facts = checked(content, path, lambda data: _model_for(data, tables, known))
    inputs = {"job.toml": content}
    earlier = facts.recording.earlier
    if earlier is not None and not facts.artefact.with_earlier:
        raise CmmUqError(f"earlier compares two recordings at two dates, which a job of kind {facts.artefact.kind!r} has not",
                         where=f"{path}: [recording] earlier", fix="Leave it out")  # fmt: skip
    machine = _machine(facts.machine)
    maps = [error_map.file for error_map in facts.machine.error_map]
    if not facts.artefact.with_recording:
        if facts.recording.file:
            raise CmmUqError(f"a job of kind {facts.artefact.kind!r} has no recording of points",
                             where=f"{path}: [recording] file",
                             fix="Leave [recording] out, and name what is measured under [machine]")  # fmt: skip
        return Job(folder, facts, _no_points(machine), inputs | _contents(folder, maps, path))
    if not recorded and not _inside(folder, facts.recording.file, path).exists():
        return Job(folder, facts, _no_points(machine), inputs)
    derived = facts.job.derived_from
    names = [facts.recording.file, *filter(None, [earlier]), *maps, *(derived.files if derived else ())]
    inputs |= _contents(folder, list(dict.fromkeys(names)), path)
    where = str(folder / facts.recording.file)
    check_mark(folder, facts.job.origin, inputs[facts.recording.file], where)
    points = read_recording(inputs[facts.recording.file], where, machine)
    if earlier is not None:
        then = read_recording(inputs[earlier], str(folder / earlier), machine)
        points = against_earlier(points, then, facts.artefact.cte_per_k, where)
    return Job(folder, facts, points, inputs, altered(derived, inputs), is_planned(inputs[facts.recording.file]))


def _model_for(data: dict[str, Any], tables: Tables, known: Callable[[], Sequence[str]]) -> type[JobFile]:
    """What a job.toml must say for the kind that it names."""
    artefact = data.get("artefact")
    kind = artefact.get("kind") if isinstance(artefact, dict) else None
    if not isinstance(kind, str):
        return JobFile
    table = tables(kind)
    if table is None:
        names: Any = Literal[tuple(known())]
        table = create_model("ArtefactFacts", __base__=ArtefactFacts, kind=(names, ...))
    return job_file_of(table)


def sha256(inputs: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of every input, by its name."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()}


def content_of(path: Path, fix: str) -> bytes:
    """Bytes of a file.

    Raises
    ------
    CmmUqError : it is missing or cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise CmmUqError("no such file", where=str(path), fix=fix) from None
    except IsADirectoryError:
        raise CmmUqError("is a folder, not a file", where=str(path), fix=fix) from None
    except OSError as error:
        raise CmmUqError(f"cannot be read: {error.strerror}", where=str(path), fix=fix) from error


def _contents(folder: Path, names: Sequence[str], toml: Path) -> dict[str, bytes]:
    return {
        name: content_of(_inside(folder, name, toml), f"Put it beside job.toml, or mend its name in {toml}")
        for name in names
    }


def _no_points(machine: Machine) -> Points:
    none = np.zeros(0, dtype=np.int64)
    return Points(np.zeros((0, 3)), none, none, none, machine)


def _inside(folder: Path, name: str, toml: Path) -> Path:
    path = (folder / name).resolve()
    if not name or not path.is_relative_to(folder.resolve()):
        raise CmmUqError(f"file {name!r} is not inside the job folder", where=str(toml),
                         fix="Copy the file into the folder and name it there: a job must be complete by itself")  # fmt: skip
    return path


def _machine(facts: MachineFacts) -> Machine:
    travel = np.array([getattr(facts.travel_mm, axis) or [np.nan, np.nan] for axis in AXES], dtype=np.float64)
    return Machine(facts.name, facts.chain, travel, np.array(facts.origin_mm, dtype=np.float64))
