"""A new job, or a new budget: a folder that can be reported at once, with a simulated recording to be replaced by one's own.

The set-ups are those of the kind's usual plan in the machine's volume, the readings are drawn from the model that the job
names, and everything that is made of them says that they are simulated. job.toml has the lines that matter; beside it lie its
schema, which has all others, and what to do next.
"""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.app.commands.forms import shipped
from cmm_uq.app.commands.reading import job_of, unwritten
from cmm_uq.artefacts import kind_named, names
from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.toml_file import as_toml, nested, toml_of
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.columns import REQUIRED
from cmm_uq.jobs.derived_job import PROGRAM, Truth
from cmm_uq.jobs.importing.format import FileKeys
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import PART as PART
from cmm_uq.jobs.schema import commented
from cmm_uq.jobs.tables.identification import EXAMPLE, MEASURED, SIMULATED, Origin, first_line
from cmm_uq.machine.model.kind import MACHINE, Beginning, Kind
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.stated import physics_of

if TYPE_CHECKING:
    from cmm_uq.app.commands.parts.new import Answers
    from cmm_uq.jobs.importing.cells.stated import Offer

RECORDING, SCHEMA, README = "recording.csv", ".cmm-uq/job.schema.json", "README.md"
REST = "docs/reference/job.md, cmm-uq schema job, or what an editor that knows TOML schemas completes"
KEPT = (SCHEMA, README)  # files beside those of the job itself
PLAN, BUDGET = "plan", "budget"  # names beside those of kinds
Tables = Mapping[str, Mapping[str, Any]]


def job_files(
    kind: str, tables: Tables, files: Mapping[str, bytes], examples: Collection[str] = (), *,
    begin: Beginning | None = None,
) -> dict[str, bytes]:  # fmt: skip
    """A job's folder around a recording: job.toml, its schema, and what to do next."""
    found = kind_or_refused(kind)
    job = read_new(found, tables, files)
    begin = found.beginning(kind) if begin is None else begin
    return {
        "job.toml": _job_text(found, begin, tables, examples), **files, README: _readme_text(job, begin).encode(),
        SCHEMA: shipped("job").encode(),
    }  # fmt: skip


def kind_or_refused(name: str) -> Kind:
    found = kind_named(name)
    if found is None:
        raise CmmUqError(f"there is no kind {name!r}", fix=suggestion(name, names()))
    return found


def read_new(kind: Kind, tables: Tables, files: Mapping[str, bytes]) -> Job:
    recorded = bool(files) or not kind.table.with_recording
    with unwritten():
        return job_of({"job.toml": as_toml(tables, "job.toml"), **files}, recorded=recorded)


def example_keys(tables: Mapping[str, Any], given: Tables) -> set[str]:
    """Dotted keys of machine, artefact, test and limits that nobody gave, and the date of what nobody has measured yet."""
    dated = set() if "date" in given.get("job", {}) else {"job.date"}
    return dated | {
        f"{table}.{key}"
        for table in ("machine", "artefact", "conformity", "test_uncertainty", "rated_conditions")
        for key, value in (
            tables[table][0] if table == "conformity" and table in tables else tables.get(table, {})
        ).items()
        if key not in ("kind", "error_map") and not _stated(key, value, given.get(table, {}))
    }


def _stated(key: str, value: Any, given: Mapping[str, Any]) -> bool:
    """Whether all of a key's value is given: itself, or every key of the table that it is."""
    return key in given or (
        isinstance(value, Mapping) and all(_stated(f"{key}.{k}", v, given) for k, v in value.items())
    )


def _job_text(kind: Kind, begin: Beginning, tables: Tables, examples: Collection[str]) -> bytes:
    """job.toml with what a job of this kind must say, and where all else that it may say is found."""
    head = f"#:schema ./{SCHEMA}\n# {begin.title}. Whatever else may be said: {REST}.\n"
    simulated = (
        "# THE READINGS ARE SIMULATED: put in your own, then take away their first line and origin below. Figures marked "
        f"{EXAMPLE} are nobody's.\n"
    )
    body = commented(json.loads(shipped("job")), tables, (), kind.name, comment=False, examples=examples)
    return (head + (simulated if tables["job"].get("origin") == SIMULATED else "") + "\n" + body).encode()


def _readme_text(job: Job, begin: Beginning) -> str:
    facts = job.facts
    columns = ", ".join(f"`{name}`" for name in (*REQUIRED, *begin.columns))
    further = ", ".join(f"`{name}`" for name in ("repeat", *begin.further))
    lines = [
        f"# {begin.title}", "",
        f"`cmm-uq {begin.command} .` in this folder makes the pages; `cmm-uq check .` says what is missing or wrong.", "",
        f"- `job.toml`: machine, artefact and limits. Editors that know TOML schemas explain every key (`{SCHEMA}`).",
    ]  # fmt: skip
    if facts.recording.file:
        lines += [
            f"- `{facts.recording.file}`: one row a point. {begin.numbering}",
            f"- Its columns: {columns}; it may have {further} and temperatures besides.",
        ]
    if facts.job.origin == SIMULATED:
        lines.append(
            "- **The figures are simulated**, and all that is made of them says so. Put in your own, then take away their "
            f'first line and `origin = "simulated"` in job.toml, and state what is marked {EXAMPLE} there.'
        )
    if begin.command == PLAN:
        to_be = f"to be filled in as `{facts.recording.file}`"
        lines.append(f"- Nothing is recorded yet: the plan writes `plan.csv`, {to_be}.")
    return "\n".join(lines) + "\n"


BUDGET_FILE, BUDGET_SCHEMA = "budget.toml", ".cmm-uq/budget.schema.json"

_MODEL = {"outputs": {"length": "indicated - gauge * cte * (temperature - 20)"}, "title": "Length at 20 °C",
          "units": {"length": "mm"}}  # fmt: skip
_INPUTS = {
    "indicated": {"distribution": "normal", "value": 100.0021, "u": 0.0004, "unit": "mm", "source": "repeats"},
    "gauge": {"distribution": "constant", "value": 100.0, "unit": "mm", "source": "drawing"},
    "cte": {"distribution": "rectangular", "value": 11.5e-6, "half_width": 1e-6, "unit": "1/K", "source": "data sheet"},
    "temperature": {"distribution": "rectangular", "value": 20.4, "half_width": 0.2, "unit": "°C", "source": "thermometer"},
}  # fmt: skip


def budget_files() -> dict[str, bytes]:
    """Contents of every file of a new budget, by name; its figures are an example."""
    schema = json.loads(shipped("budget"))
    keys = schema["properties"]
    one = keys["inputs"]["additionalProperties"]
    inputs = [
        commented({"properties": {f"inputs.{name}": {**one, "description": "An input of the model."}}},
                  {f"inputs.{name}": given}, comment=i == 0)
        for i, (name, given) in enumerate(_INPUTS.items())
    ]  # fmt: skip
    model = commented({"properties": {"model": keys["model"]}}, {"model": _MODEL})
    example = "# An example: put in your own model and figures."
    head = f"#:schema ./{BUDGET_SCHEMA}\n{example} What stands behind # is the default, or what may be said besides.\n"
    correlation = f'# [correlation]  # {keys["correlation"]["description"]}\n# "indicated,temperature" = 0.0\n'
    readme = (
        "# A measurement model and its uncertainty\n\n"
        f"`cmm-uq budget {BUDGET_FILE}` in this folder evaluates it by the law of propagation and by Monte Carlo.\n\n"
        f"- `{BUDGET_FILE}`: outputs as expressions, and what is known of each input. The figures are an example.\n"
        f"- Editors that know TOML schemas explain every key (`{BUDGET_SCHEMA}`).\n"
    )
    text = "\n".join([head, model, *inputs, correlation])
    return {BUDGET_FILE: text.encode(), README: readme.encode(), BUDGET_SCHEMA: shipped("budget").encode()}


SEED = 1  # of the simulated readings


def known() -> dict[str, str]:
    """The kind of each name that a new job can be asked for by."""
    kinds = ((name, kind) for name in names() if (kind := kind_named(name)) is not None)
    return {one: name for name, kind in kinds for one in (name, *kind.begin_also)}


def titles() -> dict[str, str]:
    others = {PLAN: "A job that is only planned (--set artefact.kind=…)", BUDGET: "A measurement model of one's own",
              PART: "A part: its features, tolerances, and the machine that measures it"}  # fmt: skip
    kinds = {name: kind_or_refused(kind).beginning(name).title for name, kind in known().items()}
    return kinds | {name: others[name] for name in (PLAN, PART, BUDGET)}


def usual(name: str) -> dict[str, Any]:
    kind, begin = _begun(name)
    return _tables(kind, begin, {}, name)


@naming_package()
def new_job(name: str, given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
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
    files = {RECORDING: content + recording(points)}
    return job_files(kind.name, tables, files, example_keys(tables, given), begin=begin)


def job_of_export(kind: str, given: Tables, files: Mapping[str, bytes], *, id: str) -> dict[str, bytes]:  # noqa: A002
    """A new job of a recording that was measured: nothing of machine, artefact and limits but what is given."""
    found, begin = _begun(kind)
    wrong = Gathered()
    if not given.get("machine", {}).get("name"):
        wrong.tell("the machine that was measured has no name", fix='Give --machine "…"')
    if "date" not in given.get("job", {}):
        by_file = _day_in(given.get("recording", {}), files)
        fix = f"Give the date of measurement: --set job.date={by_file.value if by_file and by_file.value else '2026-05-31'}"
        said = f"no date is given, and the file has it in line {by_file.line}: {by_file.words}" if by_file else ""
        wrong.tell(said or "an export does not say when it was measured", where="[job] date", fix=fix)
    wrong.refuse()
    bare = replace(begin, artefact={}, conformity=None, test={})
    whole = _tables(found, bare, given, id, origin=MEASURED) | {"machine": nested(given.get("machine", {}))}
    if "effects" not in given.get("model", {}):  # what the export has no column for it cannot tell
        read = read_new(found, whole, files)
        with physics_of(read):  # an arm has as many effects as joints
            every_one = [one for name in begin.effects if (one := every().get(name)) is not None]
            able = [one for one in every_one if set(one.columns) <= set(read.points.columns)]
            named = [one.name for one in able if not found.by_effects or _seen(one, found, read)]
        whole["model"] = {**whole["model"], "effects": named}
    return job_files(found.name, whole, files, begin=begin)


def _seen(effect: Effect, kind: Kind, job: Job) -> bool:
    """Whether an effect changes anything that was read, as the scale of an axis without runs does not."""
    try:
        artefact = kind.observing("reported")(job.facts.artefact, job.points, where=job.recording_path)
    except CmmUqError:  # which check and report say of the job
        return True
    points = artefact.points
    return bool(effect.shape) or bool(np.any(artefact.project(points.xyz, points.on_artefact(effect.basis(points)))))


def _day_in(recording: Mapping[str, Any], files: Mapping[str, bytes]) -> Offer | None:
    """When an export says that it was measured."""
    from cmm_uq.jobs.importing.cells.stated import offers

    name, keys = str(recording.get("file", "")), {k: v for k, v in recording.items() if k in FileKeys.model_fields}
    if name not in files:
        return None
    found = offers(files[name], name, FileKeys.model_validate(keys))
    return next((one for one in found if one.key == "job.date"), None)


@naming_package()
def new_plan(given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a job that is only planned: nothing is recorded."""
    name = str(given.get("artefact", {}).get("kind", "ballbar"))
    kind, begin = _begun(name)
    if kind.plan is None:
        raise kind.refused("planned")
    tables = _tables(kind, begin, given, id, origin=MEASURED)
    sized = "length_mm" in tables["artefact"] or {"pitch_mm", "number"} & set(begin.plan)
    length = {} if sized else {"length_mm": 600.0}
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
    if name == BUDGET and given:
        raise CmmUqError("a new budget has no machine, artefact or job", where="--set", fix="Leave it out")
    if name == BUDGET:
        files = budget_files()
    elif name == PART:
        from cmm_uq.app.commands.parts.new import part_files, part_of_answers, part_of_drawing

        if answers is not None:
            files = part_of_answers(answers, id=id)
        else:
            files = part_of_drawing(drawing, given, id=id) if drawing else part_files(given, id=id)
    else:
        files = new_plan(given, id=id) if name == PLAN else new_job(name, given, id=id)
    return put_new(folder, Owner("new", id, MEASURED if name in (BUDGET, PLAN) else SIMULATED), files)


def put_new(folder: Path, owner: Owner, files: Mapping[str, bytes], inputs: tuple[Path, ...] = ()) -> dict[str, Path]:
    """Put the files of a new folder in place, if those of TOML can be read."""
    for name in (name for name in files if name.endswith(".toml")):
        try:
            toml_of(files[name].decode(), name)
        except tomllib.TOMLDecodeError as error:
            raise CmmUqError(
                f"would be no valid TOML, and is not written: {error}",
                where=str(folder / name),
                fix="Please report it with what was given; plain names may help",
            ) from None
    with staged(folder, owner, expected=files, inputs=inputs) as place:
        check_empty(folder, but=".unfinished-")
        return place.write(files)


def job_id(folder: Path, given: Tables, otherwise: str = "job") -> str:
    """Id of a new job: as given, or by its folder's name."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", folder.resolve().name or otherwise).strip("-.")[:100]
    return str(given.get("job", {}).get("id", "")) or plain or "job"


def check_empty(folder: Path, but: str = "") -> None:
    try:
        there = sorted(path.name for path in folder.iterdir() if not (but and path.name.startswith(but)))
    except FileNotFoundError:
        return
    except OSError as error:
        problem = f"cannot be a new folder: {error.strerror}"
        raise CmmUqError(problem, where=str(folder), fix="Name another one") from None
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
        "job": {"id": id, "date": today} | ({} if origin == MEASURED else {"origin": origin}),
        "machine": {**({} if begin.machine.keys() & {"joint", "arm"} else MACHINE), **begin.machine},
        "artefact": {"kind": kind.name, **begin.artefact},
        **({"recording": {"file": RECORDING}} if recorded else {}),
        "model": {"effects": list(begin.effects)},
        **({"conformity": [dict(begin.conformity)]} if begin.conformity else {}),
        **{table: dict(keys) for table, keys in begin.test.items() if table not in given},
    }
    conformity = given.get("conformity", {})
    for table, keys in given.items():
        listed = table == "conformity"
        begun = (whole.get(table) or [{}])[0] if listed else whole.get(table, {})
        merged = nested({**begun, **keys})
        whole[table] = [merged] if listed else merged
    if "U_um" in given.get("artefact", {}):
        whole["artefact"].pop("u_um", None)
    limits, stated = {"limit_um", "limit_arcsec", "limit_deg", "mpe"}, {key.partition(".")[0] for key in conformity}
    for other in limits - stated if limits & stated else ():
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
    if not kind.by_effects:
        noise = np.random.default_rng(SEED).normal(0.0, begin.noise_um * MICROMETRE, points.xyz.shape)
        return points.at(points.xyz + noise)
    from cmm_uq.app.commands.jobs.simulate import simulate

    truth = Truth.model_validate({"seed": SEED, "noise": {"coordinate_um": begin.noise_um}})
    return simulate(replace(job, points=points, planned=True), truth)
