"""Progress of a command: a bar on a terminal; elsewhere a line a stage when asked for, else nothing."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import StringIO
from typing import TYPE_CHECKING

from cmm_uq.app.cli.printing import columns, styled
from cmm_uq.base.output.interruption import speaking

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Stage


@contextmanager
def shown(*, quiet: bool, verbose: bool) -> Iterator[Stage | None]:
    """What is told of the stages of a command, on standard error.

    A stage is what is being done, and after a colon what of it is counted, which changes while it lasts.
    """
    if quiet:
        yield None
    elif styled(sys.stderr):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Column

        width = columns() // 6
        told = Column(no_wrap=True, overflow="ellipsis", max_width=columns() - width - len(" 0:00:00 "))
        what, bar = TextColumn("{task.description}", markup=False, table_column=told), BarColumn(bar_width=width)
        console = Console(stderr=True)

        def hush() -> None:
            console.file = StringIO()

        bars = Progress(what, bar, TimeElapsedColumn(), console=console, transient=True, redirect_stdout=False,
                        redirect_stderr=False)  # fmt: skip
        with speaking(hush), bars as progress:
            task = progress.add_task("Starting", total=1.0)
            yield lambda what, part: progress.update(task, description=what, completed=part)
    elif verbose:
        said: set[str] = set()

        def tell(what: str, part: float) -> None:
            stage, _, _ = what.partition(":")
            if stage not in said:
                said.add(stage)
                with suppress(OSError, AttributeError):
                    print(stage, file=sys.stderr, flush=True)  # noqa: T201

        yield tell
    else:
        yield None
