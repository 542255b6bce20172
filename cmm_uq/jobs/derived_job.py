"""Jobs made from another: job.toml of a derived recording, the truth that one is drawn from, a job beside a prediction."""

from __future__ import annotations

import contextlib
import hashlib
import json
import tomllib
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import tomlkit
from pydantic import Field, field_validator
from tomlkit.exceptions import TOMLKitError

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import COLUMNS, EFFECTS
from cmm_uq.base.files.table import AnyFloat, Column, JobTable, Uncertainty, key, required
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.columns import REQUIRED, largest
from cmm_uq.jobs.importing.format import FileKeys, ImportKeys
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.recording import compared
from cmm_uq.jobs.recording.compared import reference_file
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.identification import DERIVING, MEASURED, SIMULATED

PROGRAM = f"cmm-uq {__version__}"
LONGEST_ID = 100
# keys of [job] that belong to the certificate of the measured recording alone
OF_THE_CERTIFICATE = ("number", "replaces", "received", "issued", "recalibration_agreed", "as_found", "interim")
OF_THE_RECORDED_MACHINE = ("short_gauge", "simulation")  # tables of it as it was, not of one simulated or compensated
DERIVED_RECORDING = "recording.csv"  # name of a recording that was made from one in another format
IN_THE_RECORDING = ("temperature_log",)  # keys of [machine] whose figures stand in every recording that is written


def recording_name(job: Job) -> str:
    """Name of the recording that a command makes from a job's: its own, or another where that one was imported."""
    if not _was_imported(job):
        return job.facts.recording.file
    if job.facts.recording.earlier is not None:
        raise CmmUqError("an imported recording that is compared with an earlier one cannot be simulated",
                         where=f"{job.folder / 'job.toml'} [recording] earlier",
                         fix="Write both in the own format first: cmm-uq import FILE --out recording.csv")  # fmt: skip
    return DERIVED_RECORDING


def kept_inputs(job: Job) -> dict[str, bytes]:
    """Inputs of a job that one derived from it has too: not job.toml, nor how its recording was taken.

    Nor what stands in the new recording, one that was imported and certified values of a file, nor further certificates.
    """
    left = {"job.toml", provenance_name(job.facts.recording.file), *reference_file(job.facts.artefact), *job.further}
    left |= {job.facts.recording.file} if _was_imported(job) else set()
    return {name: content for name, content in job.inputs.items() if name not in left}


def derived_toml(job: Job, by: str, files: Mapping[str, bytes], *, without: tuple[str, ...] = ()) -> bytes:
    """job.toml for a recording that a command made from a job; a simulated one stays simulated whatever is made from it."""
    text, written = job.inputs["job.toml"].decode("utf-8-sig"), sha256(files)
    # an id that no other recording has: that of the job, what was done, and the beginning of a hash of what came out
    end = f"-{DERIVING[by]}-{hashlib.sha256(json.dumps(written, sort_keys=True).encode()).hexdigest()[:8]}"
    changes = {
        "id": job.facts.job.id[: LONGEST_ID - len(end)] + end,
        "origin": SIMULATED if job.origin == SIMULATED else DERIVING[by],
        "derived_from": {
            "job": job.facts.job.id, "by": by, "program": PROGRAM, "inputs": sha256(job.inputs), "files": written,
        },
    }  # fmt: skip
    file = recording_name(job) if _was_imported(job) else None
    plain = _changed(tomllib.loads(text), changes, without, file, job.certified)
    # in a layout that the library cannot keep comments are lost, no value is
    with contextlib.suppress(TOMLKitError, tomllib.TOMLDecodeError, KeyError, ValueError, TypeError):
        commented = tomlkit.dumps(_changed(tomlkit.parse(text), changes, without, file, job.certified))
        if tomllib.loads(commented) == plain:
            return commented.encode()
    return tomlkit.dumps(plain).encode()


def _was_imported(job: Job) -> bool:
    """Whether the recording was in another format than the project's own."""
    name = PurePosixPath(job.facts.recording.file).name
    return any(recognised.file == name for recognised in job.imported)


def _changed(
    document: Any, changes: Mapping[str, Any], without: tuple[str, ...], file: str | None, certified: Mapping[str, Any]
) -> Any:
    table = document["job"]
    _drop(table, (*OF_THE_CERTIFICATE, *changes))
    for name, value in changes.items():
        table[name] = _inline(value) if isinstance(document, tomlkit.TOMLDocument) else deepcopy(value)
    _drop(document, OF_THE_RECORDED_MACHINE)
    _drop(document["machine"], (*without, "further"))  # of the measured machine
    # certified values stand in every recording that is written
    if "file" in document["artefact"].get("certificate", {}):
        _drop(document["artefact"]["certificate"], ("file", *FileKeys.model_fields))
    if not {"u_um", "U_um"} & document["artefact"].keys():  # of columns alone, which are written with what it adds to u
        _drop(document["artefact"], ("degrees_of_freedom",))
    _state(document["artefact"], certified)
    if file is not None:  # the recording in the project's own format, without the keys by which it was imported
        document["recording"]["file"] = file
        _drop(document["recording"], (*ImportKeys.model_fields, "constant"))
    return document


def _drop(table: Any, keys: Iterable[str]) -> None:
    for name in keys:
        if name in table:
            del table[name]


def _state(table: Any, certified: Mapping[str, Any]) -> None:
    """What the digital certificate said, which the derived job does not have."""
    for name, value in certified.items():
        if isinstance(value, Mapping) and name in table:
            _state(table[name], value)
        else:
            table[name] = deepcopy(value)


def _inline(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    table = tomlkit.inline_table()
    for name, item in value.items():
        table.append(name, _inline(item))
    return table


def is_compensated(job: Job) -> bool:
    """Whether the coordinates of a job were corrected by error maps already."""
    derived = job.facts.job.derived_from
    return job.origin not in (MEASURED, SIMULATED) or (derived is not None and derived.by == "compensate")


def against(job: Job, content: bytes, name: str, path: Path | None = None) -> Job:
    """A job that is compared with what a simulation predicts, whatever its ``[simulation]`` says."""
    where = str(path or name)
    is_map, predicted = compared.is_error_map(content, where), {"file": name, "temperature_c": compared.NOMINAL_C}
    simulation = compared.SimulationFacts.model_validate({"map": predicted} if is_map else {"file": name})
    facts, before = job.facts.model_copy(update={"simulation": simulation}), job.facts.simulation
    _refuse_beside_a_simulation(facts, where)
    left = set() if before is None else {before.file, *(each.file for each in before.map)}
    left -= {each.file for each in facts.machine.error_map}
    inputs = {of: each for of, each in job.inputs.items() if of not in left}
    if inputs.get(name, content) != content:
        raise CmmUqError(f"the job has another file {name!r}", where=where, fix="Rename the prediction")
    prediction = None if is_map else compared.read_prediction(content, where, simulation)
    beside = job.beside if path is None else (*job.beside, path)
    return replace(job, facts=facts, inputs={**inputs, name: content}, prediction=prediction, beside=beside)


def prediction_of(
    facts: compared.SimulationFacts | None, inputs: Mapping[str, bytes], folder: Path
) -> compared.Prediction | None:
    """What a job's simulation predicts, from the contents of its files; ``None`` without a file of points."""
    if facts is None or facts.file is None:
        return None
    return compared.read_prediction(inputs[facts.file], str(folder / facts.file), facts)


def files_of(facts: JobFile, path: Path) -> tuple[list[str], list[str]]:
    """Files of predicted coordinates, and of maps that predict."""
    if facts.simulation is None:
        return [], []
    _refuse_beside_a_simulation(facts, f"{path}: {compared.KEY}")
    file = facts.simulation.file
    return [] if file is None else [file], [given.file for given in facts.simulation.map]


def _refuse_beside_a_simulation(facts: JobFile, where: str) -> None:
    """Refuse what cannot be compared with a prediction."""
    if not facts.artefact.with_recording:
        raise CmmUqError(f"a job of kind {facts.artefact.kind!r} has no recording of points", where=where,
                         fix="Leave the simulation out")  # fmt: skip
    if facts.recording.earlier is not None:
        raise CmmUqError("the change between two dates is not what a simulation predicts", where=where,
                         fix="Leave [recording] earlier out, and compare each date by itself")  # fmt: skip


class ByAxis(JobTable):
    """One number for each axis."""

    x: Uncertainty = required("Along x.")
    y: Uncertainty = required("Along y.")
    z: Uncertainty = required("Along z.")


class NoiseFacts(JobTable):
    """``[noise]``: standard deviations of a coordinate."""

    coordinate_um: Uncertainty | ByAxis = 0.0
    """Standard deviation of each reading, of every coordinate or by axis."""
    placing_um: Uncertainty = 0.0
    """Standard deviation of the offset of each point of each placing, which its repeats share."""
    growth_um: Uncertainty = 0.0
    """Standard deviation of what is added at the longest distance in a placing, in proportion to the distance."""
    slow_um: Uncertainty = key(0.0, "Standard deviation of slow noise; needs `time_s` in the recording.")
    slow_time_s: Annotated[float, Field(gt=0, le=1e9)] | Literal["never"] = 600.0
    """Time over which slow noise forgets; `"never"` for a random walk from the first reading on, of which `slow_um` is
    then the root mean square over the recording."""
    tails_dof: Annotated[float, Field(gt=2, le=1000)] | None = None
    """Degrees of freedom of readings with Student's t distribution of the same standard deviation; normal by
    default."""
    resolution_um: Uncertainty = key(0.0, "Step of the display.")

    @property
    def coordinates_um(self) -> tuple[float, float, float]:
        given = self.coordinate_um
        return (given.x, given.y, given.z) if isinstance(given, ByAxis) else (given, given, given)


class Truth(JobTable):
    """All of truth.toml.

    What a simulated recording is drawn from:

    [effects.squareness_xy]
    angle_arcsec = -173.0
    [artefact]
    length_mm = 404.236
    [noise]
    coordinate_um = 1.2
    placing_um = 0.5
    [columns]
    temp_x_c = 22.5
    """

    effects: Annotated[dict[str, dict[str, AnyFloat]], Field(max_length=EFFECTS.most)] = {}
    """True parameters of each effect that acts, by the effect's name, whatever the job's model names."""
    artefact: dict[str, AnyFloat] = {}
    """True sizes of the artefact, by name, such as `length_mm`; as certified by default."""
    noise: NoiseFacts = NoiseFacts.left_out("Noise of the simulated readings.")
    columns: Annotated[dict[Column, AnyFloat], Field(max_length=COLUMNS.most)] = {}
    """Columns of the recording at a value that holds for every row, such as temperatures."""
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = key(0, "Seed of the random numbers.")

    @field_validator("columns")
    @classmethod
    def _of_a_recording(cls, columns: dict[str, float]) -> dict[str, float]:
        for name, value in columns.items():
            if name in (*REQUIRED, "repeat"):
                raise ValueError(f"{name} comes from the job's own recording")
            if abs(value) > largest(name):
                raise ValueError(f"{name} = {value:g} is more than anything that is measured")
        return columns
