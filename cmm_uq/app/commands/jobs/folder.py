"""The folder of a new job, or of a new budget: every other key as a comment, a schema, and what to do next."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from typing import Any

from cmm_uq.app.commands.jobs.schemas import shipped
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import kind_named, names
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.columns import REQUIRED
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.schema import commented
from cmm_uq.jobs.tables.origin import EXAMPLE, SIMULATED
from cmm_uq.machine.model.kind import Kind

RECORDING, SCHEMA, README = "recording.csv", ".cmm-uq/job.schema.json", "README.md"
KEPT = (SCHEMA, README)  # files beside those of the job itself
PLAN, BUDGET = "plan", "budget"  # names beside those of kinds
Tables = Mapping[str, Mapping[str, Any]]


def job_files(
    kind: str, tables: Tables, files: Mapping[str, bytes], examples: Collection[str] = (), *,
    begin: Beginning | None = None,
) -> dict[str, bytes]:  # fmt: skip
    """A job's folder around a recording: job.toml with every other key as a comment, its schema, and what to do next."""
    found = kind_or_refused(kind)
    job = read_new(found, tables, files)
    begin = found.beginning(kind) if begin is None else begin
    return {
        "job.toml": _job_text(found, begin, tables, examples), **files, README: _readme_text(job, begin).encode(),
        SCHEMA: shipped("job").encode(),
    }  # fmt: skip


def kind_or_refused(name: str) -> Kind:
    """The kind of this name."""
    found = kind_named(name)
    if found is None:
        raise CmmUqError(f"there is no kind {name!r}", fix=suggestion(name, names()))
    return found


def read_new(kind: Kind, tables: Tables, files: Mapping[str, bytes]) -> Job:
    """The job as any command reads it."""
    return job_of(
        {"job.toml": as_toml(tables, "job.toml"), **files}, recorded=bool(files) or not kind.table.with_recording
    )


def example_keys(tables: Mapping[str, Any], given: Tables) -> set[str]:
    """Dotted keys of machine, artefact, test and limits that nobody gave, and the date of what nobody has measured yet."""
    dated = set() if "date" in given.get("job", {}) else {"job.date"}
    return dated | {
        f"{table}.{key}"
        for table in ("machine", "artefact", "conformity", "test_uncertainty", "rated_conditions")
        for key in (tables[table][0] if table == "conformity" and table in tables else tables.get(table, {}))
        if key not in (*given.get(table, ()), "kind", "error_map")
    }


def _job_text(kind: Kind, begin: Beginning, tables: Tables, examples: Collection[str]) -> bytes:
    """job.toml with a comment for whatever else a job of this kind may say."""
    out = {"job.derived_from", *(f"job.{key}" for key in ("as_found",) if SIMULATED in tables["job"].values())}
    if not kind.tested:
        out |= {"conformity", "short_gauge", "test_uncertainty", "rated_conditions"} - set(tables)
    out |= set() if kind.plan else {"plan"}
    out |= set() if kind.table.with_recording else {"recording"}
    out |= set() if kind.table.with_earlier else {"recording.earlier", "recording.earlier_date"}
    head = [
        f"#:schema ./{SCHEMA}",
        f"# {begin.title}. What stands behind # is the default, or what may be said besides.",
    ]
    if tables["job"].get("origin") == SIMULATED:
        head.append(
            "# THE READINGS ARE SIMULATED: put in your own, then take away their first line and origin below. Figures marked "
            f"{EXAMPLE} are nobody's."
        )
    body = commented(json.loads(shipped("job")), tables, out, kind.name, examples=examples)
    return ("\n".join(head) + "\n\n" + body).encode()


def _readme_text(job: Job, begin: Beginning) -> str:
    """What lies here, and what to do next, in ten lines or so."""
    facts = job.facts
    columns = ", ".join(f"`{name}`" for name in (*REQUIRED, *begin.columns))
    further = ", ".join(f"`{name}`" for name in ("repeat", *begin.further))
    simulated = facts.job.origin == SIMULATED
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
    if simulated:
        lines.append(
            "- **The figures are simulated**, and all that is made of them says so. Put in your own, then take away their "
            f'first line and `origin = "simulated"` in job.toml, and state what is marked {EXAMPLE} there.'
        )
    if begin.command == PLAN:
        lines.append(
            f"- Nothing is recorded yet: the plan writes `plan.csv`, to be filled in as `{facts.recording.file}`."
        )
    return "\n".join(lines) + "\n"


BUDGET_FILE, BUDGET_SCHEMA, BUDGET_README = "budget.toml", ".cmm-uq/budget.schema.json", "README.md"

_MODEL = {
    "outputs": {"length": "indicated - gauge * cte * (temperature - 20)"}, "title": "Length at 20 °C",
    "units": {"length": "mm"},
}  # fmt: skip
_INPUTS = {
    "indicated": {"distribution": "normal", "value": 100.0021, "u": 0.0004, "unit": "mm", "source": "repeats"},
    "gauge": {"distribution": "constant", "value": 100.0, "unit": "mm", "source": "drawing"},
    "cte": {"distribution": "rectangular", "value": 11.5e-6, "half_width": 1e-6, "unit": "1/K", "source": "data sheet"},
    "temperature": {
        "distribution": "rectangular", "value": 20.4, "half_width": 0.2, "unit": "°C", "source": "thermometer",
    },
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
    head = (
        f"#:schema ./{BUDGET_SCHEMA}\n# An example: put in your own model and figures. What stands behind # is the default, "
        "or what may be said besides.\n"
    )
    correlation = f'# [correlation]  # {keys["correlation"]["description"]}\n# "indicated,temperature" = 0.0\n'
    readme = (
        "# A measurement model and its uncertainty\n\n"
        f"`cmm-uq budget {BUDGET_FILE}` in this folder evaluates it by the law of propagation and by Monte Carlo.\n\n"
        f"- `{BUDGET_FILE}`: outputs as expressions, and what is known of each input. The figures are an example.\n"
        f"- Editors that know TOML schemas explain every key (`{BUDGET_SCHEMA}`).\n"
    )
    text = "\n".join([head, model, *inputs, correlation])
    return {BUDGET_FILE: text.encode(), BUDGET_README: readme.encode(), BUDGET_SCHEMA: shipped("budget").encode()}
