"""What goes to standard output, and what happens where nobody takes it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

from cmm_uq.errors import OutputError
from cmm_uq.writing.interruption import written


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
