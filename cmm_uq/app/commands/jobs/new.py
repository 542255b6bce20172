"""A new job: a folder that can be reported at once, with a simulated recording to be replaced by the laboratory's own.

The set-ups are those of the kind's usual plan in the machine's volume, the readings are drawn from the model that the job
names, and everything that is made of them says that they are simulated.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq.app.commands.jobs.folder import (
    BUDGET,
    KEPT,
    PLAN,
    README,
    RECORDING,
    SCHEMA,
    Tables,
    example_keys,
    job_files,
    kind_or_refused,
    read_new,
)
from cmm_uq.app.commands.parts.new import PART, Answers, part_files, part_of_answers, part_of_drawing
from cmm_uq.artefacts import kind_named, names
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.beginning import MACHINE, Beginning
from cmm_uq.jobs.derived_job import PROGRAM, Truth
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.origin import MEASURED, SIMULATED, Origin, first_line
from cmm_uq.machine.model.kind import Kind

__all__ = [
    "BUDGET", "KEPT", "PART", "PLAN", "README", "RECORDING", "SCHEMA", "job_files", "job_id", "job_of_export", "known",
    "new_job", "new_plan", "titles", "usual", "write_new",
]  # fmt: skip

SEED = 1  # of the simulated readings


def known() -> dict[str, str]:
    """The kind of each name that a new job can be asked for by."""
    kinds = ((name, kind) for name in names() if (kind := kind_named(name)) is not None)
    return {one: name for name, kind in kinds for one in (name, *kind.begin_also)}


def titles() -> dict[str, str]:
    """What a new job can be asked for by, each with what it is."""
    kinds = {name: kind_or_refused(kind).beginning(name).title for name, kind in known().items()}
    return {
        **kinds,
        PLAN: "A job that is only planned (--set artefact.kind=…)",
        PART: "A part: its features, tolerances, and the machine that measures it",
        BUDGET: "A measurement model of one's own",
    }


def usual(name: str) -> dict[str, Any]:
    """What job.toml of a new job says where nothing is given."""
    kind, begin = _begun(name)
    return _tables(kind, begin, {}, name)


@naming_package()
def new_job(name: str, given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a new job, by name."""
    kind, begin = _begun(name)
    tables = _tables(kind, begin, given, id)
    if begin.files is not None:
        bare = {**tables, "machine": {k: v for k, v in tables["machine"].items() if k not in begin.machine}}
        machine = read_new(kind, bare, {}).points.machine
        return job_files(kind.name, tables, begin.files(machine), example_keys(tables, given), begin=begin)
    planned = read_new(kind, {**tables, "plan": {**begin.plan, **tables.get("plan", {})}}, {})
    points = _drawn(planned, kind, begin)
    from cmm_uq.app.commands.jobs.simulate import recording

    content = first_line("simulate", f"{PROGRAM} new", ": put in your own readings, and take this line away").encode()
    return job_files(
        kind.name, tables, {RECORDING: content + recording(points)}, example_keys(tables, given), begin=begin
    )


def job_of_export(kind: str, given: Tables, files: Mapping[str, bytes], *, id: str) -> dict[str, bytes]:  # noqa: A002
    """A new job of a recording that was measured: nothing of machine, artefact and limits but what is given."""
    found, begin = _begun(kind)
    if "date" not in given.get("job", {}):
        raise CmmUqError("an export does not say when it was measured", where="[job] date",
                         fix="Give the date of measurement: --set job.date=2026-05-31")  # fmt: skip
    bare = replace(begin, artefact={}, conformity=None, test={})
    whole = _tables(found, bare, given, id, origin=MEASURED) | {"machine": dict(given.get("machine", {}))}
    return job_files(found.name, whole, files, begin=begin)


@naming_package()
def new_plan(given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a job that is only planned: nothing is recorded."""
    name = str(given.get("artefact", {}).get("kind", "ballbar"))
    kind, begin = _begun(name)
    if kind.plan is None:
        raise kind.refused("planned")
    tables = _tables(kind, begin, given, id, origin=MEASURED)
    length = {} if "length_mm" in tables["artefact"] or "pitch_mm" in begin.plan else {"length_mm": 600.0}
    tables["plan"] = {**length, **begin.plan, **tables.get("plan", {})}
    return job_files(kind.name, tables, {}, example_keys(tables, given), begin=replace(begin, command=PLAN))


def write_new(
    name: str, folder: Path, given: Tables, *, drawing: Path | None = None, answers: Answers | None = None
) -> dict[str, Path]:
    """Write the folder of a new job, of a part or of a new budget; never over anything.

    folder : that does not exist, or is empty.
    """
    check_empty(folder)
    id = job_id(folder, given, name)  # noqa: A001
    if name == BUDGET:
        from cmm_uq.app.commands.jobs.folder import budget_files

        if given:
            raise CmmUqError("a new budget has no machine, artefact or job", where="--set", fix="Leave it out")
        files, origin = budget_files(), MEASURED
    elif name == PART:
        files, origin = _part(given, drawing, answers, id), SIMULATED
    elif name == PLAN:
        files, origin = new_plan(given, id=id), MEASURED
    else:
        files, origin = new_job(name, given, id=id), SIMULATED
    with staged(folder, Owner("new", id, origin), expected=files) as place:
        check_empty(folder, but=".unfinished-")
        return place.write(files)


def _part(given: Tables, drawing: Path | None, answers: Answers | None, id: str) -> dict[str, bytes]:  # noqa: A002
    if answers is not None:
        return part_of_answers(answers, id=id)
    return part_of_drawing(drawing, given, id=id) if drawing else part_files(given, id=id)


def job_id(folder: Path, given: Tables, otherwise: str = "job") -> str:
    """Id of a new job: as given, or by its folder's name."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", folder.resolve().name or otherwise).strip("-.")[:100]
    return str(given.get("job", {}).get("id", "")) or plain or "job"


def check_empty(folder: Path, but: str = "") -> None:
    """Refuse a folder that something lies in."""
    try:
        there = sorted(path.name for path in folder.iterdir() if not (but and path.name.startswith(but)))
    except FileNotFoundError:
        return
    except OSError as error:
        raise CmmUqError(f"cannot be a new folder: {error.strerror}", where=str(folder),
                         fix="Name another one") from None  # fmt: skip
    if there:
        raise CmmUqError(f"is not empty: {there[0]!r} lies in it", where=str(folder),
                         fix="Name a folder that does not exist yet; nothing is overwritten")  # fmt: skip


def _begun(name: str) -> tuple[Kind, Beginning]:
    kind = kind_named(name)
    if kind is None:
        kinds = known()
        if name not in kinds:
            raise CmmUqError(f"there is no kind {name!r}", fix=suggestion(name, (*kinds, PLAN, PART, BUDGET)))
        kind = kind_or_refused(kinds[name])
    return kind, kind.beginning(name)


def _tables(kind: Kind, begin: Beginning, given: Tables, id: str, origin: Origin = SIMULATED) -> dict[str, Any]:  # noqa: A002
    """What job.toml says: what the kind begins with, and over it what is given."""
    recorded, today = kind.table.with_recording, dt.datetime.now(tz=dt.UTC).date()
    whole: dict[str, Any] = {
        "job": {"id": id, "date": today, **({} if origin == MEASURED else {"origin": origin})},
        "machine": {**MACHINE, **begin.machine},
        "artefact": {"kind": kind.name, **begin.artefact},
        **({"recording": {"file": RECORDING}} if recorded else {}),
        "model": {"effects": list(begin.effects)},
        **({"conformity": [dict(begin.conformity)]} if begin.conformity else {}),
        **{table: dict(keys) for table, keys in begin.test.items() if table not in given},
    }
    for table, keys in given.items():
        if table == "conformity":
            whole[table] = [{**(whole.get(table) or [{}])[0], **keys}]
        else:
            whole[table] = {**whole.get(table, {}), **keys}
    artefact = whole["artefact"]
    if "U_um" in given.get("artefact", {}):
        artefact.pop("u_um", None)
    conformity = given.get("conformity", {})
    for one, other in (("limit_um", "mpe"), ("mpe", "limit_um")):
        if one in conformity and other not in conformity:
            whole["conformity"][0].pop(other, None)
    return whole


def _drawn(job: Job, kind: Kind, begin: Beginning) -> Points:
    """Readings at the kind's set-ups: noise alone, of a machine without errors."""
    from cmm_uq.analysis.planning.candidates import ready_plan
    from cmm_uq.analysis.planning.set_up import join as joined
    from cmm_uq.analysis.planning.setting import Setting

    if begin.points is not None:
        points = begin.points(job.points.machine)
    else:
        points = joined(ready_plan(Setting.of(job, kind))[1])
        wanted = {name: values for name, values in points.columns.items() if name != "time_s"}
        constant = {name: np.full(len(points), value) for name, value in begin.recorded.items()}
        points = replace(points, columns=wanted | constant)
    if kind.observe is None:
        noise = np.random.default_rng(SEED).normal(0.0, begin.noise_um * MICROMETRE, points.xyz.shape)
        return points.at(points.xyz + noise)
    from cmm_uq.app.commands.jobs.simulate import simulate

    truth = Truth.model_validate({"seed": SEED, "noise": {"coordinate_um": begin.noise_um}})
    return simulate(replace(job, points=points, planned=True), truth)
