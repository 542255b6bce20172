"""``cmm-uq new``, ``import``, ``check``, ``simulate`` and ``compensate``: jobs begun, read, checked, and made of others."""

from __future__ import annotations

import json as json_text
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.asking import job_answers, part_answers, value_of
from cmm_uq.app.cli.options import Ending, argument, flag, job_folder, option
from cmm_uq.app.cli.summary import conclude_derived, put_manifest, screen_layout
from cmm_uq.app.cli.terminal import BAD_INPUT, can_answer, put, put_data, say, show
from cmm_uq.base.errors import CmmUqError, printable

if TYPE_CHECKING:
    from cmm_uq.app.commands.jobs.check import JobCheck
    from cmm_uq.certificate.wording import Summary
    from cmm_uq.jobs.importing.format import Recognition
    from cmm_uq.jobs.importing.keys import ImportKeys
    from cmm_uq.jobs.job import Job

COLUMN = option(
    None,
    'Column of the recording and of the file: x_mm="X actual", or its number: x_mm=3.',
    "NAME=COLUMN",
    "as recognised",
    "--column",
)
KEY = option(
    None, 'Any other key of an import: unit=inch, sheet="Run 2", decimal=",".', "KEY=VALUE", "as recognised", "--key"
)


def new(
    kind: str = argument("", "Kind of measurement, shift_plate, plan, part or budget; without it they are listed.", "KIND",
                         autocompletion=opt.kinds),
    folder: Path | None = argument(None, "New folder.", "FOLDER", "the kind's name"),
    machine: str = option("", "Name of the machine.", "TEXT", "asked for, or a name to be replaced"),
    serial: str = option("", "Serial number of the machine.", "TEXT", "asked for, or none"),
    settings: list[str] | None = option(
        None, 'Any key of job.toml: artefact.length_mm=500, job.customer="A Ltd".', "KEY=VALUE", "none", "--set"),
    export: Path | None = option(
        None, "Begin from a laboratory's export (see cmm-uq import), which needs --machine and --set job.date=…; "
              "a part from a QIF plan or a DMIS program.", "FILE", "simulated readings", "--from"),
    column: list[str] | None = COLUMN,
    key: list[str] | None = KEY,
    end: Ending = opt.BRIEF,
) -> None:  # fmt: skip
    """Begin a job: job.toml with every key explained, and a simulated recording to be replaced by your own.

    On a terminal it asks for machine, artefact and limits, of a part for the machine's certificate, features, datums and
    tolerances, unless one of the options gives something.
    """
    from cmm_uq.app.commands.jobs.new import BUDGET, check_empty, known, titles, write_new
    from cmm_uq.app.commands.parts.new import PART

    if not kind:
        if end.json:
            put_data({"kinds": titles()})
        else:
            put("".join(f"{name}  {title}\n" for name, title in titles().items()))
        return
    target, silent = folder or Path(kind), end.silent
    check_empty(target)
    if kind == PART and (column or key):
        raise CmmUqError(
            "the plan of a part has no columns that an option could name", where="--column", fix="Leave it out"
        )
    tables = _tables(machine, serial, settings or [])
    if export is not None and kind != PART:
        from cmm_uq.app.commands.jobs.exchange import read_export, write_job_of_export

        keys = import_keys(column, key)
        recognised = read_export(export, keys).recognised
        if not silent:
            show_recognised(recognised)
        files: Mapping[str, Path] = write_job_of_export(kind, export, target, tables, keys)
    else:
        if not (tables or silent) and kind != BUDGET and kind in known() and can_answer():
            tables = job_answers(kind)
        answers = part_answers() if kind == PART and not (export or tables or silent) and can_answer() else None
        files = write_new(kind, target, tables, drawing=export, answers=answers)
    if end.json:
        put_manifest(files)
    elif not end.quiet:
        say(f"{target}: {', '.join(name for name in files if '/' not in name and name != 'manifest.json')}")
        if export is None or kind == PART:
            say(f"What to do next: {target / 'README.md'}. What is missing or wrong: cmm-uq check {target}")


def _tables(machine: str, serial: str, settings: list[str]) -> dict[str, dict[str, Any]]:
    """What the options say, by table and key."""
    named = {name: value for name, value in (("name", machine), ("serial", serial)) if value}
    tables: dict[str, dict[str, Any]] = {"machine": dict(named)} if named else {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        table, dot, key = place.strip().partition(".")
        if not (equals and dot and key):
            raise CmmUqError(
                f"{setting!r} names no key of a table", where="--set", fix="Write it as artefact.length_mm=500"
            )
        tables.setdefault(table, {})[key] = value_of(text.strip())
    return tables


def import_export(
    file: Path = argument(..., "Export: CSV, .xlsx, .ods, PC-DMIS, Calypso, DMIS, QIF, I++.", "FILE"),
    column: list[str] | None = COLUMN,
    key: list[str] | None = KEY,
    out: Path | None = option(None, "Write it as a recording, such as recording.csv.", "FILE", "not written"),
    quiet: bool = opt.QUIET,
    json: bool = flag(False, "--json", "Print what is recognised as JSON."),
) -> None:
    """Show what is recognised of a laboratory's export; a job takes the same file with the same keys under [recording]."""
    from cmm_uq.app.commands.jobs.exchange import read_export, write_recording

    export = read_export(file, import_keys(column, key))
    if json:
        put(json_text.dumps(export.recognised.data, indent=2, ensure_ascii=False) + "\n")
    elif not quiet:
        show_recognised(export.recognised)
    if out is not None:
        write_recording(file, export, out)
        if not (quiet or json):
            say(str(out))


def import_keys(columns: Iterable[str] | None, keys: Iterable[str] | None) -> ImportKeys:
    """Keys of an import that options say; one that is none, or has a value that it cannot have, is refused."""
    from pydantic import ValidationError

    from cmm_uq.jobs.importing.keys import ImportKeys

    data: dict[str, Any] = dict(map(_setting, keys or ()))
    if columns:
        data["columns"] = dict(map(_setting, columns))
    try:
        return ImportKeys.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"][:2])
        raise CmmUqError(first["msg"].removeprefix("Value error, "), where=f"--key {where}",
                         fix=f"Known: {', '.join(ImportKeys.model_fields)}") from None  # fmt: skip


def _setting(text: str) -> tuple[str, str | int]:
    """Name and value, which is a whole number, or a text without the quotes around it."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not name:
        raise CmmUqError(f"{text!r} says nothing", where="--column, --key", fix='Write it as x_mm="X actual"')
    return name, int(value) if value.isdecimal() else value.strip("\"'")


def show_recognised(recognised: Recognition) -> None:
    """What was recognised, as a table."""
    show([(("Recognised", "bold"),), *screen_layout(verbose=True).table(recognised.rows), ()])


def show_imported(job: Job) -> None:
    """What was recognised of the files of a job that were imported, before anything is computed of them."""
    for recognised in job.imported:
        show_recognised(recognised)


def check(
    jobs: list[Path] = argument(..., "Job folders.", "JOB...", autocompletion=opt.job_folders),
    clauses: bool = flag(False, "--clauses", "Every clause of ISO/IEC 17025:2017, 7.8, and what of it is stated."),
    end: Ending = opt.BRIEF,
) -> None:
    """Say all that is wrong with each job at once: file, line, key, fix. Exit code 2 when something would stop report.

    What ISO/IEC 17025:2017, 7.8 asks for and a job does not state makes its certificate a draft, and is told with its key.
    """
    from cmm_uq.app.commands.jobs.check import check_job

    checks = [check_job(job) for job in jobs]
    if end.json:
        put_data({"schema": "cmm-uq/check/1", "jobs": [each.as_data() for each in checks]})
    elif not end.quiet:
        for each in checks:
            show(screen_layout(verbose=True).screen(_check_summary(each)))
            if clauses:
                _show_clauses(each)
    if not all(each.sound for each in checks):
        raise typer.Exit(BAD_INPUT)


def _show_clauses(check: JobCheck) -> None:
    """Each clause on a line: what it asks for, and what satisfies it or would."""
    if not check.clauses:
        put("No calibration certificate is made of this job, so ISO/IEC 17025:2017, 7.8 asks nothing of it.\n")
    for clause in check.clauses:
        content = {
            "stated": clause.stated, "missing": f"MISSING: {clause.key}",
            "not applicable": f"none stated ({clause.key})",
            "laboratory": "of the laboratory, not of the certificate",
        }[clause.status].removesuffix(" ()")  # fmt: skip
        say(printable(f"{clause.clause:<11} {clause.asks}: {content}"))


def _check_summary(check: JobCheck) -> Summary:
    """Whether anything would stop report, and all that is wrong."""
    from cmm_uq.base.messages import Verbatim, plural, say
    from cmm_uq.certificate.wording import Headline, Summary

    count = len(check.problems)
    if check.sound:
        nothing = say("nothing would stop {command}", command=Verbatim(check.command))
        verdict = Headline("SOUND", "good", Verbatim(check.job), (nothing,))
    else:
        stops = plural(count, one=say("1 problem"), many=say("{count} problems", count=count))
        verdict = Headline("STOPS", "bad", Verbatim(check.job), (stops,))
    problems, warnings = (tuple(map(Verbatim, each)) for each in (check.problems, check.warnings))
    return Summary(verdicts=(verdict,), remarks=problems, warnings=warnings)


def simulate(
    job: Path = job_folder(..., "Job folder whose recording gives the placings."),
    truth: Path = option(
        ..., "TOML file with the effects, the noise and the seed.", "FILE", autocompletion=opt.toml_files
    ),
    out: Path = option(..., "Folder for the simulated job.", "DIR"),
    seed: int | None = option(None, "Seed of everything random.", "N", "the truth's", min=0),
    force: bool = opt.FORCE,
    end: Ending = opt.END,
) -> None:
    """Draw a recording from the same model that report fits, as a job folder of its own."""
    from cmm_uq.app.commands.jobs.simulate import write_simulation

    files = write_simulation(job, truth, out, seed=seed, force=force)
    conclude_derived(files, f"A recording of {job}, drawn from {truth}", end)


def compensate(
    job: Path = job_folder(..., "Job folder with [machine] error_map."),
    out: Path = option(..., "Folder for the compensated job.", "DIR"),
    extrapolate: bool = option(False, "Extrapolate beyond the maps, and flag those points."),
    map_text: float | None = option(
        None, "Also write the error map at this temperature, in °C, in the contractors' text form.", "T", "not written"),
    cloud: Path | None = option(
        None, "Cloud of a digitizer to correct instead: .csv, .parquet, .npy or a folder of them.", "FILE",
        "the job's recording"),
    force: bool = opt.FORCE,
    end: Ending = opt.END,
) -> None:  # fmt: skip
    """Correct a recording by its machine's error maps, as a job folder of its own."""
    from cmm_uq.app.commands.jobs.compensate import write_compensated, write_compensated_cloud
    from cmm_uq.machine.physics.map_interpolation import Beyond

    beyond: Beyond = "extrapolate" if extrapolate else "refuse"
    if cloud is None:
        files = write_compensated(job, out, beyond=beyond, map_text_c=map_text, force=force)
    elif map_text is not None:
        raise CmmUqError("--map-text goes with a recording, not with --cloud", fix="Leave out one of them")
    else:
        with end.progress() as stage:
            part = None if stage is None else partial(stage, f"Compensating {cloud.name}")
            files = write_compensated_cloud(job, cloud, out, beyond=beyond, force=force, progress=part)
    what = f"{'The recording' if cloud is None else cloud.name} of {job}, compensated by its error maps"
    conclude_derived(files, what, end, is_job=cloud is None)
