"""A job beside a simulation: the prediction that ``[simulation]`` names, or one that is given in its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job, JobFile
from cmm_uq.jobs.prediction import Prediction, is_error_map, read_prediction
from cmm_uq.jobs.simulation import KEY as SIMULATION
from cmm_uq.jobs.simulation import NOMINAL_C, SimulationFacts


def against(job: Job, content: bytes, name: str, path: Path | None = None) -> Job:
    """A job that is compared with what a simulation predicts, whatever its ``[simulation]`` says.

    Parameters
    ----------
    job : that was read, with its recording.
    content : the bytes of the prediction, or of an error map.
    name : of its file.
    path : where that lies, if anywhere.

    Raises
    ------
    CmmUqError : it is no prediction, or has the name of another input of the job.
    """
    where, is_map = str(path or name), is_error_map(content, str(path or name))
    predicted = {"file": name, "temperature_c": NOMINAL_C}
    simulation = SimulationFacts.model_validate({"map": predicted} if is_map else {"file": name})
    facts = job.facts.model_copy(update={"simulation": simulation})
    _refuse_beside_a_simulation(facts, where)
    inputs = _without_the_simulation(job)
    if inputs.get(name, content) != content:
        raise CmmUqError(f"the job has another file {name!r}", where=where, fix="Rename the prediction")
    prediction = None if is_map else read_prediction(content, where, simulation)
    beside = () if path is None else (path,)
    return replace(
        job, facts=facts, inputs={**inputs, name: content}, prediction=prediction, beside=(*job.beside, *beside)
    )


def _without_the_simulation(job: Job) -> dict[str, bytes]:
    """Inputs of a job but those that only its ``[simulation]`` names."""
    simulation = job.facts.simulation
    if simulation is None:
        return dict(job.inputs)
    own = {simulation.file, *(given.file for given in simulation.map)} - {
        given.file for given in job.facts.machine.error_map
    }
    return {name: content for name, content in job.inputs.items() if name not in own}


def prediction_of(facts: SimulationFacts | None, inputs: Mapping[str, bytes], folder: Path) -> Prediction | None:
    """What a job's simulation predicts, from the contents of its files; ``None`` without a file of points."""
    if facts is None or facts.file is None:
        return None
    return read_prediction(inputs[facts.file], str(folder / facts.file), facts)


def files_of(facts: JobFile, path: Path) -> tuple[list[str], list[str]]:
    """Files of predicted coordinates, and of maps that predict."""
    if facts.simulation is None:
        return [], []
    _refuse_beside_a_simulation(facts, f"{path}: {SIMULATION}")
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
