"""What goes to standard output, how a command ends, and what happens where nobody takes what it says."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import typer

from cmm_uq.cli import NOT_CONFORMING
from cmm_uq.errors import OutputError
from cmm_uq.writing.interruption import written

if TYPE_CHECKING:
    from cmm_uq.commands.written import Written


def say(text: str = "") -> None:
    """One line on standard output.

    Raises
    ------
    OutputError : nobody takes it.
    """
    put(f"{text}\n")


def put(text: str) -> None:
    """Text on standard output, as it is.

    Raises
    ------
    OutputError : nobody takes it.
    """
    try:
        if sys.stdout is None:
            raise closed()
        sys.stdout.write(text)
    except (OSError, ValueError):
        raise closed() from None


def closed() -> OutputError:
    """Standard output is closed, or its disk is full."""
    there = ", ".join(map(str, written()))
    return OutputError("standard output cannot be written", fix=f"The files are written in {there}" if there else None)


def table(
    rows: Iterable[Sequence[str]], *headings: str, separator: str = "\t", title: str = "", bold: int = -1
) -> None:
    """Rows of text: with lines on a terminal, elsewhere a line each; with spaces between, empty cells are left out.

    Raises
    ------
    OutputError : nobody takes it.
    """
    cells = [tuple(row) for row in rows]
    if sys.stdout is None or not sys.stdout.isatty():
        for row in (headings, *cells) if headings else cells:
            say(separator.join(cell for cell in row if cell or separator == "\t"))
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    shown = Table(title=escape(title) or None, show_header=bool(headings), title_justify="left")
    for i in range(max(map(len, (headings, *cells)))):
        style = "bold" if i == bold else None
        shown.add_column(headings[i] if headings else "", overflow="fold", justify="left", style=style)
    for row in cells:
        shown.add_row(*(escape(cell) for cell in row))
    try:
        Console().print(shown)
    except OSError:
        raise closed() from None


def conclude(
    ended: Written, summarise: Callable[[Written], None], *, json: bool, quiet: bool, strict: bool
) -> None:  # fmt: skip
    """How a command ends that wrote an outcome: results.json or a summary, unless it is to be quiet.

    Raises
    ------
    typer.Exit : with ``strict``, when not all is well.
    """
    if json:
        put(ended.results.decode())
    elif not quiet:
        summarise(ended)
    if strict and not ended.conforming:
        raise typer.Exit(NOT_CONFORMING)
