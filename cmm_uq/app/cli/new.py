"""``cmm-uq new KIND [FOLDER]``: a job folder that can be reported at once, to be filled with the laboratory's own figures."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmm_uq.app.cli.importing import Columns, Keys, keys_of, show
from cmm_uq.app.cli.options import Json, Quiet, examples, kinds
from cmm_uq.app.cli.summary import put_manifest
from cmm_uq.app.cli.terminal import can_answer, put_data, say
from cmm_uq.base.errors import CmmUqError

if TYPE_CHECKING:
    from cmm_uq.app.commands.new_part_answers import Answers
    from cmm_uq.jobs.importing.keys import ImportKeys

EXAMPLES = examples("new", "new step_gauge my-gauge", "new ballbar --machine 'CMM 3' --set artefact.length_mm=500")


def command(
    kind: Annotated[
        str,
        typer.Argument(
            help="Kind of measurement, shift_plate, plan, part or budget; without it they are listed.",
            metavar="KIND",
            autocompletion=kinds,
        ),
    ] = "",
    folder: Annotated[
        Path | None, typer.Argument(help="New folder.", metavar="FOLDER", show_default="the kind's name")
    ] = None,
    machine: Annotated[
        str,
        typer.Option(help="Name of the machine.", metavar="TEXT", show_default="asked for, or a name to be replaced"),
    ] = "",
    serial: Annotated[
        str, typer.Option(help="Serial number of the machine.", metavar="TEXT", show_default="asked for, or none")
    ] = "",
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help='Any key of job.toml: artefact.length_mm=500, job.customer="A Ltd".',
            metavar="KEY=VALUE",
            show_default="none",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Begin from a laboratory's export (see cmm-uq import), which needs --machine and --set job.date=…; "
            "a part from a QIF plan or a DMIS program.",
            metavar="FILE",
            show_default="simulated readings",
        ),
    ] = None,
    column: Columns = None,
    key: Keys = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Begin a job: job.toml with every key explained, and a simulated recording to be replaced by your own.

    On a terminal it asks for machine, artefact and limits, of a part for the machine's certificate, features, datums and
    tolerances, unless one of the options gives something.
    """
    from cmm_uq.app.commands.jobs.folder import BUDGET
    from cmm_uq.app.commands.jobs.new import check_empty, known, titles, write_new
    from cmm_uq.app.commands.new_part import PART

    if not kind:
        if json:
            put_data({"kinds": titles()})
            return
        for name, title in titles().items():
            say(f"{name}  {title}")
        return
    target = folder or Path(kind)
    check_empty(target)
    if kind == PART and (column or key):
        raise CmmUqError(
            "the plan of a part has no columns that an option could name", where="--column", fix="Leave it out"
        )
    given = _given(machine, serial, settings or [])
    if export is not None and kind != PART:
        files = _of_export(kind, export, target, given, keys_of(column, key), quiet=quiet or json)
        if json:
            put_manifest(files)
        return
    if not given and not (quiet or json) and kind != BUDGET and kind in known() and can_answer():
        from cmm_uq.app.cli.asking import answers

        given = answers(kind)
    described = _described() if kind == PART and not (export or given or quiet or json) else None
    files = write_new(kind, target, given, drawing=export, answers=described)
    if json:
        put_manifest(files)
    elif not quiet:
        say(f"{target}: {', '.join(name for name in files if '/' not in name and name != 'manifest.json')}")
        say(f"What to do next: {target / 'README.md'}. What is missing or wrong: cmm-uq check {target}")


def _described() -> Answers | None:
    """What a user at a terminal says of a part; ``None`` where there is none."""
    if not can_answer():
        return None
    from cmm_uq.app.cli.asking_part import part_answers

    return part_answers()


def _of_export(
    kind: str, export: Path, folder: Path, given: dict[str, dict[str, Any]], keys: ImportKeys, *, quiet: bool
) -> Mapping[str, Path]:  # fmt: skip
    """Show what is recognised of an export, then write the job around it."""
    from cmm_uq.app.commands.jobs.exchange import read_export, write_job_of_export

    recognised = read_export(export, keys).recognised
    if not quiet:
        show(recognised)
    files = write_job_of_export(kind, export, folder, given, keys)
    if not quiet:
        say(f"{folder}: {', '.join(name for name in files if '/' not in name and name != 'manifest.json')}")
    return files


def _given(machine: str, serial: str, settings: list[str]) -> dict[str, dict[str, Any]]:
    """What the options say, by table and key."""
    found: dict[str, dict[str, Any]] = {}
    for name, value in (("name", machine), ("serial", serial)):
        if value:
            found.setdefault("machine", {})[name] = value
    for setting in settings:
        place, equals, text = setting.partition("=")
        table, dot, key = place.strip().partition(".")
        if not (equals and dot and key):
            raise CmmUqError(
                f"{setting!r} names no key of a table", where="--set", fix="Write it as artefact.length_mm=500"
            )
        found.setdefault(table, {})[key] = value_of(text.strip())
    return found


def value_of(text: str) -> Any:
    """A value as TOML has it; a text without quotes as it is."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text
