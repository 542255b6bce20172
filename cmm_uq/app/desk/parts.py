"""The job of a part, as the worker writes it from a plan and the certificate of the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cmm_uq.app.commands.jobs.new import check_empty, job_id, put_new
from cmm_uq.app.commands.parts.new import PART, Answers, certificate_files, part_of_drawing
from cmm_uq.base.files.content import value_of
from cmm_uq.base.output import Owner
from cmm_uq.jobs.tables.identification import MEASURED


def create_part(plan: str, certificate: str, folder: str, date: str, not_measured: bool) -> dict[str, Any]:
    """Write the job of a part as ``cmm-uq new part --from`` does, with the machine's certificate in it."""
    target = Path(folder)
    check_empty(target)
    given: dict[str, dict[str, Any]] = {"job": {"date": value_of(date)}} if date else {}
    if not_measured:
        given[PART] = {"not_measured": ["*"]}
    machine = certificate_files(Path(certificate))
    given["machine_state"] = {"certificate": Answers(machine=machine).certificate}
    name = job_id(target, given)
    files = part_of_drawing(Path(plan), given, id=name)
    return {"files": sorted(put_new(target, Owner("new", name, MEASURED), {**files, **machine}, (Path(plan),)))}
