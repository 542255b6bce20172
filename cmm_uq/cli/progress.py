"""Progress of a command: a bar on a terminal, a line a stage elsewhere, nothing when quiet."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from cmm_uq.commands.written import Stage


@contextmanager
def shown(*, quiet: bool) -> Iterator[Stage | None]:
    """A progress bar on a terminal, a line a stage elsewhere, nothing when quiet."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description:<26}"), BarColumn(), TimeElapsedColumn()
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("Starting", total=1.0)
            yield lambda what, part: bar.update(task, description=what, completed=part)
    else:
        said: set[str] = set()

        def tell(what: str, part: float) -> None:
            if what not in said:
                said.add(what)
                with suppress(OSError):
                    typer.echo(what, err=True)

        yield tell
