"""``cmm-uq import FILE``: what is recognised of a laboratory's export, and the same in the project's own format."""

from __future__ import annotations

import json as json_text
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cmm_uq.app.cli import terminal
from cmm_uq.app.cli.options import Quiet, examples
from cmm_uq.app.cli.summary import screen_layout
from cmm_uq.app.cli.terminal import put, say
from cmm_uq.base.errors import CmmUqError

if TYPE_CHECKING:
    from cmm_uq.jobs.importing.keys import ImportKeys
    from cmm_uq.jobs.importing.recognised import Recognised
    from cmm_uq.jobs.job import Job

EXAMPLES = examples(
    "import export.xlsx", "import export.csv --key unit=inch --out recording.csv",
    "new ballbar my-job --from export.xlsx --machine 'CMM 3' --set job.date=2026-05-31",
)  # fmt: skip

Columns = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        help='Column of the recording and of the file: x_mm="X actual", or its number: x_mm=3.',
        metavar="NAME=COLUMN",
        show_default="as recognised",
    ),
]
Keys = Annotated[
    list[str] | None,
    typer.Option(
        "--key",
        help='Any other key of an import: unit=inch, sheet="Run 2", decimal=",".',
        metavar="KEY=VALUE",
        show_default="as recognised",
    ),
]


def command(
    file: Annotated[
        Path, typer.Argument(help="Export: CSV, .xlsx, .ods, PC-DMIS, Calypso, DMIS, QIF, I++.", metavar="FILE")
    ],
    column: Columns = None,
    key: Keys = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write it as a recording, such as recording.csv.", metavar="FILE", show_default="not written"
        ),
    ] = None,
    quiet: Quiet = False,
    json: Annotated[bool, typer.Option("--json", help="Print what is recognised as JSON.")] = False,
) -> None:
    """Show what is recognised of a laboratory's export; a job takes the same file with the same keys under [recording]."""
    from cmm_uq.app.commands.jobs.exchange import read_export, write_recording

    found = read_export(file, keys_of(column, key))
    if json:
        put(json_text.dumps(found.recognised.data, indent=2, ensure_ascii=False) + "\n")
    elif not quiet:
        show(found.recognised)
    if out is not None:
        write_recording(file, found, out)
        if not (quiet or json):
            say(str(out))


def keys_of(columns: Iterable[str] | None, keys: Iterable[str] | None) -> ImportKeys:
    """Keys of an import that options say.

    Raises
    ------
    CmmUqError : one that is none, or has a value that it cannot have.
    """
    from pydantic import ValidationError

    from cmm_uq.jobs.importing.keys import ImportKeys

    data: dict[str, Any] = {name: _value(text) for name, text in map(_split, keys or ())}
    if columns:
        data["columns"] = {name: _value(text) for name, text in map(_split, columns)}
    try:
        return ImportKeys.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"][:2])
        raise CmmUqError(first["msg"].removeprefix("Value error, "), where=f"--key {where}",
                         fix=f"Known: {', '.join(ImportKeys.model_fields)}") from None  # fmt: skip


def _split(setting: str) -> tuple[str, str]:
    name, equals, text = setting.partition("=")
    if not equals or not name.strip():
        raise CmmUqError(f"{setting!r} says nothing", where="--column, --key", fix='Write it as x_mm="X actual"')
    return name.strip(), text.strip()


def _value(text: str) -> str | int:
    """A whole number, or a text without the quotes around it."""
    return int(text) if text.isdecimal() else text.strip("\"'")


def show(recognised: Recognised) -> None:
    """What was recognised, as a table."""
    terminal.show([(("Recognised", "bold"),), *screen_layout(verbose=True).table(recognised.rows), ()])


def show_imported(job: Job) -> None:
    """What was recognised of the files of a job that were imported, before anything is computed of them."""
    for recognised in job.imported:
        show(recognised)
