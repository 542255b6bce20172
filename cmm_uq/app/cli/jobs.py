"""``cmm-uq new``, ``import``, ``check``, ``simulate`` and ``compensate``: jobs begun, read, checked, and made of others."""

from __future__ import annotations

import json as json_text
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.asking import job_answers, part_answers
from cmm_uq.app.cli.options import Ending, argument, flag, job_folder, option
from cmm_uq.app.cli.summary import (
    conclude_derived,
    put_manifest,
    screen_layout,
    show_offered,
    show_proposed,
    show_recognised,
)
from cmm_uq.app.cli.terminal import BAD_INPUT, can_answer, put, say, show
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.files.limits import value_of

if TYPE_CHECKING:
    from cmm_uq.app.commands.jobs.check import JobCheck
    from cmm_uq.certificate.wording import Summary
    from cmm_uq.jobs.importing.format import ImportKeys

_COLUMN = (
    'Column of the recording and of the file: x_mm="X actual", or its number: x_mm=3; of two points in a row: x_mm=3,6.'
)
COLUMN = option(None, _COLUMN, "NAME=COLUMN", "as recognised", "--column")
_KEY = 'Any other key of an import: unit=inch, sheet="Run 2", decimal=",".'
KEY = option(None, _KEY, "KEY=VALUE", "as recognised", "--key")


LINE = option(
    None, 'Where a line of lengths lies: "1=along X from 100,200,300", in mm.', "NAME=PLACE", "asked for", "--line"
)
_PLAN = "Plan, or a recording, whose measurements lie where the lines of lengths with their numbers do."
PLAN = option(None, _PLAN, "FILE", "asked for", "--plan")


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
              "a part from a QIF plan, a DMIS program or a table.", "FILE", "simulated readings", "--from"),
    column: list[str] | None = COLUMN,
    key: list[str] | None = KEY,
    line: list[str] | None = LINE,
    plan: Path | None = PLAN,
    end: Ending = opt.BRIEF,
) -> None:  # fmt: skip
    """Begin a job: job.toml with the lines that matter, and a simulated recording to be replaced by your own.

    On a terminal it asks for machine, artefact and limits, of a part for the machine's certificate, features, datums and
    tolerances, unless one of the options gives something.
    """
    from cmm_uq.app.commands.jobs.new import BUDGET, PART, check_empty, known, titles, write_new

    if not kind:
        kinds = titles()
        end._replace(quiet=False).put({"kinds": kinds}, (f"{name}  {title}" for name, title in kinds.items()))
        return
    target, silent = folder or Path(kind), end.silent
    check_empty(target)
    if kind == PART and (column or key):
        what = "the plan of a part has no columns that an option could name"
        raise CmmUqError(what, where="--column", fix="Leave it out")
    tables = _tables(machine, serial, settings or [])
    if export is not None and kind != PART:
        from cmm_uq.app.commands.jobs.exchange import placed_by_plan, read_export, remembered_keys, write_job_of_export

        keys, _ = remembered_keys(export, import_keys(column, key, line))
        with in_options():
            keys = keys if plan is None else placed_by_plan(export, keys, plan)
            recognised = read_export(export, keys).recognised
        if not silent:
            show_recognised(recognised)
        with _in_settings(tables):
            files: Mapping[str, Path] = write_job_of_export(kind, export, target, tables, keys, fetched=True)
    else:
        if not (tables or silent) and kind != BUDGET and kind in known() and can_answer():
            tables = job_answers(kind)
        answers = part_answers() if kind == PART and not (export or tables or silent) and can_answer() else None
        with _in_settings(tables):
            files = write_new(kind, target, tables, drawing=export, answers=answers)
    if end.json:
        put_manifest(files)
    elif not end.quiet:
        say(f"{target}: {', '.join(name for name in files if '/' not in name and name != 'manifest.json')}")
        if export is None or kind == PART:
            say(f"What to do next: {target / 'README.md'}. What is missing or wrong: cmm-uq check {target}")


def _tables(machine: str, serial: str, settings: list[str]) -> dict[str, dict[str, Any]]:
    named: dict[str, Any] = {name: value for name, value in (("name", machine), ("serial", serial)) if value}
    tables = {"machine": named} if named else {}
    for setting in settings:
        place, equals, text = setting.partition("=")
        table, dot, key = place.strip().partition(".")
        if not (equals and dot and table) or "" in key.split("."):
            what = f"{setting!r} names no key of a table"
            raise CmmUqError(what, where="--set", fix="Write it as artefact.length_mm=500")
        for other in tables.setdefault(table, {}):
            if other.startswith(f"{key}.") or key.startswith(f"{other}."):
                within, whole = sorted((f"{table}.{key}", f"{table}.{other}"), key=len, reverse=True)
                said = f"{whole} has a value, and {within} lies within it"
                raise CmmUqError(said, where="--set", fix="Give one of them")
        tables[table][key] = value_of(text.strip())
    return tables


_IN_JOB = re.compile(r"job\.toml: \[{1,2}(\w+)\]{1,2}(?: \d+)?(?: ([\w.-]+))?")


@contextmanager
def _in_settings(tables: Mapping[str, Mapping[str, Any]]) -> Iterator[None]:
    """What a message says of keys of a job.toml that is not written, as the options that give them."""
    try:
        yield
    except CmmUqError as error:
        for each in (error, *error.also):
            if place := _IN_JOB.fullmatch(each.where or ""):
                key = ".".join(filter(None, place.groups()))
                each.where = f"--set {key}" if place[1] in tables else key
                quoted, fix = f"Write --set '{key}=\"…\"': a shell takes other quotes away", each.fix or ""
                each.fix = fix.replace("Put it in quotes", quoted).replace("Add it to job.toml", f"Give --set {key}=…")
                each.args = (str(each),)
        if error.also:  # the command tells the first alone
            others = "; ".join(one.fix or one.problem for one in error.also)
            error.fix = f"{error.fix}. Also {others[0].lower()}{others[1:]}"
        raise


def import_export(
    file: Path = argument(..., "Export: CSV, .xlsx, .ods, PC-DMIS, Calypso, DMIS, QIF, I++.", "FILE"),
    column: list[str] | None = COLUMN,
    key: list[str] | None = KEY,
    line: list[str] | None = LINE,
    plan: Path | None = PLAN,
    save_as: str = option(
        "", "Remember the answers for exports with the same head.", "NAME", "not remembered", "--save-as"
    ),
    out: Path | None = option(None, "Write it as a recording, such as recording.csv.", "FILE", "not written"),
    quiet: bool = opt.QUIET,
    json: bool = flag(False, "--json", "Print what is recognised as JSON."),
) -> None:
    """Show what is recognised of a laboratory's export; a job takes the same file with the same keys under [recording]."""
    from cmm_uq.app.commands.jobs import exchange

    keys, known = exchange.remembered_keys(file, import_keys(column, key, line))
    silent = quiet or json
    if known and not silent:
        say(f"As remembered in {known}")
    try:
        with in_options():
            keys = keys if plan is None else exchange.placed_by_plan(file, keys, plan)
            export = exchange.read_export(file, keys)
    except CmmUqError as error:
        asked = exchange.lines_asked(error)
        if save_as and asked is not None and asked[0] is not None:
            exchange.remember(save_as, keys, asked[0].head)
        if asked is not None and not silent:
            show_proposed(*asked)
            show_offered(exchange.offered(file, keys))
        raise
    if save_as:
        exchange.remember(save_as, keys, export.recognised.head)
    if json:
        offered = exchange.offered(file, keys)
        stated = {one.key: {"value": one.value, "words": one.words, "line": one.line} for one in offered}
        put(json_text.dumps({**export.recognised.data, "stated": stated}, indent=2, ensure_ascii=False) + "\n")
    elif not quiet:
        show_recognised(export.recognised)
        show_offered(exchange.offered(file, keys))
        say(f"Read: {exchange.amounts(export)}; the first {exchange.example(export)}")
        say("Another column: --column x_mm=3. The answers for the next export of this kind: --save-as NAME")
    if out is not None:
        exchange.write_recording(file, export, out)
        if not (quiet or json):
            say(str(out))


_KEYS = r'\b(unit|sheet|decimal|delimiter|encoding|points_per_measurement) = ("[^"]*"|\d+|N)'


@contextmanager
def in_options() -> Iterator[None]:
    """What a message says to write into job.toml, as options of the command."""
    try:
        yield
    except CmmUqError as error:
        fix = re.sub(_KEYS, r"--key \1=\2", error.fix or "")
        fix = re.sub(
            r"\bcolumns = \{ (\w+) = \[(.*?)\] \}",
            lambda of: " ".join(f"--column {of[1]}={one.strip()}" for one in of[2].split(", ")),
            fix,
        )
        fix = re.sub(
            r"\bcolumns = \{ (.*?) \}",
            lambda of: " ".join(f"--column {one.replace(' = ', '=')}" for one in of[1].split(", ")),
            fix,
        )
        error.fix = re.sub(r'\blines = \{ "(.*?)" = "(.*?)" \}', r'--line "\1=\2"', fix)
        error.args = (str(error),)
        raise


def import_keys(
    columns: Iterable[str] | None, keys: Iterable[str] | None, lines: Iterable[str] | None = None
) -> ImportKeys:
    """Keys of an import that options say; one that is none, or has a value that it cannot have, is refused."""
    from pydantic import ValidationError

    from cmm_uq.jobs.importing.format import ImportKeys

    data: dict[str, Any] = {}
    for name, value in map(_setting, keys or ()):
        if name in data:
            raise CmmUqError(f"{name} is said twice", where="--key", fix="Say it once")
        data[name] = value
    several: dict[str, list[Any]] = {}
    for name, value in map(_setting, columns or ()):
        numbers = re.fullmatch(r"\d+(,\s*\d+)+", str(value))
        several.setdefault(name, []).extend(map(int, str(value).split(",")) if numbers else [value])
    if several:
        data["columns"] = {name: own if len(own) > 1 else own[0] for name, own in several.items()}
    if lines:
        data["lines"] = {line.rpartition("=")[0].strip() or "1": line.rpartition("=")[2] for line in lines}
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
    for each in () if end.silent else checks:
        show(screen_layout(verbose=True).screen(_check_summary(each)))
        for line in _clauses_shown(each) if clauses else ():
            say(printable(line))
    data = {"schema": "cmm-uq/check/1", "jobs": [each.as_data() for each in checks]}
    end.put(data, (), 0 if all(each.sound for each in checks) else BAD_INPUT)


def _clauses_shown(check: JobCheck) -> Iterable[str]:
    """Each clause on a line: what it asks for, and what satisfies it or would."""
    if not check.clauses:
        yield "No calibration certificate is made of this job, so ISO/IEC 17025:2017, 7.8 asks nothing of it."
    for clause in check.clauses:
        content = {
            "stated": clause.stated, "missing": f"MISSING: {clause.key}",
            "not applicable": f"none stated ({clause.key})",
            "laboratory": "of the laboratory, not of the certificate",
        }[clause.status].removesuffix(" ()")  # fmt: skip
        yield f"{clause.clause:<11} {clause.asks}: {content}"


def _check_summary(check: JobCheck) -> Summary:
    from cmm_uq.base.messages import Verbatim, plural, say
    from cmm_uq.certificate.wording import Headline, Summary

    count = len(check.problems)
    if check.sound:
        nothing = say("nothing would stop {command}", command=Verbatim(check.command))
        verdict = Headline("SOUND", "good", Verbatim(check.job), (nothing,))
    else:
        stops = plural(count, one=say("1 problem"), many=say("{count} problems", count=count))
        verdict = Headline("STOPS", "bad", Verbatim(check.job), (stops,))
    problems, warnings = (tuple(map(Verbatim, each)) for each in check.lines)
    return Summary(verdicts=(verdict,), remarks=problems, warnings=warnings)


def simulate(
    job: Path = job_folder(..., "Job folder whose recording gives the placings."),
    truth: Path = option(
        ..., "TOML file with the effects, the noise and the seed.", "FILE", autocompletion=opt.toml_files
    ),
    out: Path = option(..., "Folder for the simulated job.", "DIR"),
    seed: int | None = option(None, "Seed of everything random.", "N", "the truth's", min=0),
    end: Ending = opt.FORCED,
) -> None:
    """Draw a recording from the same model that report fits, as a job folder of its own."""
    from cmm_uq.app.commands.jobs.simulate import write_simulation

    files = write_simulation(job, truth, out, seed=seed, force=end.force)
    conclude_derived(files, f"A recording of {job}, drawn from {truth}", end)


def compensate(
    job: Path = job_folder(..., "Job folder with [machine] error_map, or rotary_errors; of a robot with --poses."),
    out: Path = option(..., "Folder for the compensated job.", "DIR"),
    extrapolate: bool = option(False, "Extrapolate beyond the maps, and flag those points."),
    map_text: float | None = option(
        None, "Also write the error map at this temperature, in °C, in the contractors' text form.", "T", "not written"),
    cloud: Path | None = option(
        None, "Cloud of a digitizer, or of rotary axes, to correct instead: .csv, .parquet, .npy or a folder of them.", "FILE",
        "the job's recording"),
    poses: Path | None = option(None, "Poses of a robot to correct instead: .csv of q1_deg, q2_deg …", "FILE", "none"),
    new_map: bool = option(
        False, "Write instead an error map of all errors that the job's recording shows; with rotary axes a file of them."),
    controller: str = option(
        "", "Write instead tables of runs that position axes, for a controller: linuxcnc, sinumerik, twincat, or a file that "
        "is a jinja2 template of your own.", "FORM", "not written"),
    end: Ending = opt.FORCED,
) -> None:  # fmt: skip
    """Correct a recording by its machine's error maps, as a job folder of its own, or a robot's poses; or make maps of one."""
    from cmm_uq.analysis.machine.correction import FieldMap
    from cmm_uq.app.commands.jobs import compensate as corrected, compensate_poses, controller as tables
    from cmm_uq.machine.physics.map_interpolation import Beyond

    beyond: Beyond = "extrapolate" if extrapolate else "refuse"
    kinds = {"--poses corrects poses": poses, "--new-map makes a map": new_map, "--controller makes tables": controller}
    instead, others = (
        [what for what, asked in kinds.items() if asked],
        (cloud, map_text, extrapolate) != (None, None, False),
    )
    if instead[1:] or (instead and others):
        against = "none of --cloud, --map-text and --extrapolate" if others else "nothing else that is written instead"
        raise CmmUqError(f"{instead[0]}, and goes with {against}", fix="Leave out one of them")
    if poses is not None:
        with end.progress() as stage:
            files, said = compensate_poses.write_corrected_poses(job, poses, out, force=end.force, stage=stage)
        conclude_derived(files, f"{poses.name}, corrected by the recording of {job}", end, is_job=False, remarks=said)
        return
    if new_map:
        with end.progress() as stage:
            files, found = corrected.write_new_map(job, out, force=end.force, stage=stage)
        kind = "An error map" if isinstance(found, FieldMap) else "A file"
        what = f"{kind} of all errors that the recording of {job} shows"
        conclude_derived(files, what, end, is_job=False, remarks=corrected.worth_of(found))
        return
    if controller:
        files, said = tables.write_tables(job, out, controller, force=end.force)
        conclude_derived(files, f"Tables of the axes of {job} for a controller", end, is_job=False, remarks=said)
        return
    if cloud is None:
        files = corrected.write_compensated(job, out, beyond=beyond, map_text_c=map_text, force=end.force)
    elif map_text is not None:
        raise CmmUqError("--map-text goes with a recording, not with --cloud", fix="Leave out one of them")
    else:
        with end.progress() as stage:
            tell = partial(stage, f"Compensating {cloud.name}")
            files = corrected.write_compensated_cloud(job, cloud, out, beyond=beyond, force=end.force, progress=tell)
    what = f"{'The recording' if cloud is None else cloud.name} of {job}, compensated by the errors of its machine"
    conclude_derived(files, what, end, is_job=cloud is None)
