"""A job tried without instruments: a copy of it in which recordings are simulated, and marked so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomlkit

from cmm_uq.app.commands.acquire import plan_file
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.origin import SIMULATED
from cmm_uq.laboratory.live.journal import made_folder, written_whole


def write_trial(folder: Path, out: Path) -> Path:
    """A copy of a job in which recordings are simulated, to be tried without instruments.

    Parameters
    ----------
    folder : of the job.
    out : folder of the copy, which is made, or holds such a copy already.

    Raises
    ------
    CmmUqError : something else is there.
    OutputError : it cannot be written.
    """
    job = read_job(folder, recorded=False)
    if (out / "job.toml").exists():
        if read_job(out, recorded=False).origin != SIMULATED:
            raise CmmUqError(
                "is a job whose recording is measured", where=str(out), fix="Name another folder with --out"
            )
        return out
    document: Any = tomlkit.parse(job.inputs["job.toml"].decode("utf-8-sig"))
    document["job"]["id"] = f"{job.facts.job.id}-trial"
    document["job"]["origin"] = SIMULATED
    left_out = {"job.toml", job.facts.recording.file, provenance_name(job.facts.recording.file)}
    made_folder(out)
    for name, content in {**job.inputs, **plan_file(job)}.items():
        if name not in left_out:
            made_folder((out / name).parent)
            written_whole(out / name, content)
    written_whole(out / "job.toml", tomlkit.dumps(document).encode())
    return out
