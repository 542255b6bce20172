"""From a job folder to a :class:`~cmm_uq.jobs.job.Job`."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from cmm_uq.errors import CmmUqError, suggestion
from cmm_uq.jobs.job import Job, JobFile, MachineFacts
from cmm_uq.jobs.recording import read_recording
from cmm_uq.points import AXES, Machine


def read_job(folder: Path) -> Job:
    """Read and check a job.

    Parameters
    ----------
    folder : the job folder, or its job.toml.

    Raises
    ------
    CmmUqError : a file is missing or unreadable, or says something unknown or contradictory.
    """
    path = folder if folder.suffix == ".toml" else folder / "job.toml"
    folder = path.parent
    content = _bytes(path, "A job is a folder with a job.toml and the recording that it names")
    facts = _facts(content, path)
    inputs = {"job.toml": content}
    for name in (facts.recording.file, *(error_map.file for error_map in facts.machine.error_map)):
        inputs[name] = _bytes(_inside(folder, name, path), f"Put it beside job.toml, or mend its name in {path}")
    points = read_recording(inputs[facts.recording.file], str(folder / facts.recording.file), _machine(facts.machine))
    return Job(folder, facts, points, inputs)


def sha256(inputs: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of every input, by its name."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()}


def _bytes(path: Path, fix: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise CmmUqError("no such file", where=str(path), fix=fix) from None
    except OSError as error:
        raise CmmUqError(f"cannot be read: {error.strerror}", where=str(path), fix=fix) from error


def _inside(folder: Path, name: str, toml: Path) -> Path:
    path = (folder / name).resolve()
    if not name or not path.is_relative_to(folder.resolve()):
        raise CmmUqError(f"file {name!r} is not inside the job folder", where=str(toml),
                         fix="Copy the file into the folder and name it there: a job must be complete by itself")  # fmt: skip
    return path


def _facts(content: bytes, path: Path) -> JobFile:
    try:
        text = content.decode("utf-8-sig")
        data = tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise CmmUqError(f"is not UTF-8 text (byte {error.start})", where=str(path), fix="Save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise CmmUqError(f"is not valid TOML: {error}", where=str(path),
                         fix="Text stands in quotes, dates as 2026-01-31, decimals with a point") from None  # fmt: skip
    try:
        return JobFile.model_validate(data)
    except ValidationError as error:
        raise _located(error.errors(include_url=False)[0], text, path) from None


def _located(error: ErrorDetails, text: str, path: Path) -> CmmUqError:
    """The first validation error, with line and key."""
    keys = [str(part) for part in error["loc"] if not (isinstance(part, str) and "[" in part)]
    named = [key for key in keys if not re.match(r"^(GuardBand|FalseAccept|literal)", key)]
    line = _line_of(named, text)
    where = f"{path}{f' line {line}' if line else ''}: [{named[0]}]{' ' + '.'.join(named[1:]) if named[1:] else ''}"
    if error["type"] == "missing":
        return CmmUqError("is missing", where=where, fix="Add it to job.toml")
    if error["type"] == "extra_forbidden":
        return CmmUqError("unknown key", where=where, fix=suggestion(named[-1], _known_keys(named[:-1])))
    message = error["msg"].removeprefix("Value error, ")
    given = "" if isinstance(error["input"], dict) else f" (it says {error['input']!r})"
    return CmmUqError(f"{message[0].lower()}{message[1:]}{given}", where=where)


def _known_keys(parents: list[str]) -> list[str]:
    model: object = JobFile
    for parent in parents:
        if parent.isdigit() or not isinstance(model, type):
            continue
        model = _model_inside(model.model_fields[parent].annotation) if hasattr(model, "model_fields") else model
    fields = getattr(model, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _model_inside(annotation: object) -> object:
    """The table class in ``Table``, ``Table | None`` or ``list[Table]``."""
    for candidate in (annotation, *getattr(annotation, "__args__", ())):
        if hasattr(candidate, "model_fields"):
            return candidate
    return annotation


def _line_of(keys: list[str], text: str) -> int | None:
    """Line of the deepest of ``keys`` that stands in its table; the table's own line when none does."""
    table, found, count = "", None, -1
    wanted = int(keys[1]) if len(keys) > 1 and keys[1].isdigit() else None
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", line)
        if header:
            table = header[1]
            count += table == keys[0]
            here = table == keys[0] and wanted in (None, count)
            found = number if here and found is None else found
        elif table.split(".")[0] == keys[0] and wanted in (None, count):
            key = re.match(r"\s*[\"']?([A-Za-z0-9_-]+)[\"']?\s*[.=]", line)
            if key and key[1] in keys[1:]:
                return number
    return found


def _machine(facts: MachineFacts) -> Machine:
    travel = np.array([getattr(facts.travel_mm, axis) or [np.nan, np.nan] for axis in AXES], dtype=np.float64)
    return Machine(facts.name, facts.chain, travel, np.array(facts.origin_mm, dtype=np.float64))
