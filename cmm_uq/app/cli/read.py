"""``cmm-uq read FILE…``: digital calibration certificates, of any laboratory, for a person."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cmm_uq.app.cli.options import Json, Quiet, examples
from cmm_uq.app.cli.terminal import put, put_data
from cmm_uq.base.errors import printable

if TYPE_CHECKING:
    from cmm_uq.jobs.dcc.shown import Grid, Shown

EXAMPLES = examples("read certificate.xml", "read ball-plate.xml --json", "read certificate.xml --schema schemas")


def command(
    files: Annotated[list[Path], typer.Argument(help="Certificates: DCC of version 3 (XML).", metavar="FILE...")],
    schema: Annotated[
        Path | None,
        typer.Option(
            help="Folder with the schemas of DCC and D-SI (.xsd), to check the files by as well.",
            metavar="DIR",
            show_default="own checks",
        ),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Print digital calibration certificates (DCC). Exit code 2 for a file that is none.

    Signatures are counted and not verified: cmm-uq verify does.
    """
    from cmm_uq.app.commands.jobs.exchange import read_certificate
    from cmm_uq.jobs.dcc.shown import data, shown

    found = [read_certificate(file, schema) for file in files]
    if json:
        put_data({"schema": "cmm-uq/read/1", "certificates": [
            {"file": str(file), **data(one)} for file, one in zip(files, found, strict=True)
        ]})  # fmt: skip
    elif not quiet:
        for file, one in zip(files, found, strict=True):
            put(_text(str(file), shown(one)))


def _text(file: str, certificate: Shown) -> str:
    lines = [file, *_labelled(certificate.rows)]
    for title, rows, grids in certificate.parts:
        lines += ["", title, *_labelled(rows)]
        for grid in grids:
            lines += ["", *_table(grid)]
    return "\n".join(printable(line).rstrip() for line in lines) + "\n\n"


def _labelled(rows: tuple[tuple[str, str], ...]) -> list[str]:
    """Labels in a column, the lines of a text below each other."""
    width = max((len(label) for label, _ in rows), default=0)
    return [
        f"  {label if first else '':<{width}}  {line}"
        for label, text in rows
        for first, line in ((number == 0, line) for number, line in enumerate(text.splitlines()))
    ]


def _table(grid: Grid) -> list[str]:
    """Columns as wide as their widest cell; a value never breaks."""
    cells = [grid.headings, *grid.rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(grid.headings))]
    head, *rows = ("  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in cells)
    return [f"  {grid.title}", f"    {head}", *(f"    {row}" for row in rows)]
