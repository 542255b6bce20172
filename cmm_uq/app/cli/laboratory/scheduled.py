"""Where the lines of a scheduled run go: standard output, or a file; neither stops the run when it cannot take them."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.app.cli.terminal import put_json
from cmm_uq.base.errors import OutputError

if TYPE_CHECKING:
    from cmm_uq.app.commands.laboratory.scheduled import ScheduledOptions as Asked

STANDARD_OUTPUT = Path("-")  # in place of a file for the lines


def run(asked: Asked, lines: Path | None) -> int:
    """A scheduled run from the command line; its exit code.

    Parameters
    ----------
    asked : what is to be run.
    lines : file that the lines are added to, :data:`STANDARD_OUTPUT`, or ``None`` for nowhere.

    Raises
    ------
    CmmUqError : the schedule is wrong.
    OutputError : the records cannot be written; or the lines could not be, after all else was done.
    """
    from cmm_uq.app.commands.laboratory.scheduled import run_scheduled

    failed: list[OutputError] = []
    write = _nowhere if lines is None else _printed if lines == STANDARD_OUTPUT else _added_to(lines)

    def tell(told: dict[str, Any]) -> None:
        try:
            write(json.dumps(told, ensure_ascii=False) + "\n")
        except OutputError as error:
            failed.append(error)

    code = run_scheduled(asked, tell)
    if failed:
        raise failed[0]
    return code


def _nowhere(line: str) -> None:
    """Nobody asked for it."""


def _printed(line: str) -> None:
    put_json(line)
    try:
        sys.stdout.flush()  # a line that a program waits for, whatever comes of the next job
    except (OSError, ValueError) as error:
        raise OutputError("standard output cannot be written") from error


def _added_to(path: Path) -> Callable[[str], None]:
    """Adds whole lines to a file, so that two runs may write it at once.

    Raises
    ------
    OutputError : the file cannot be opened.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot be written: {error}", where=str(path), fix="Name another file") from error

    def add(line: str) -> None:
        try:
            os.write(descriptor, line.encode("utf-8", "backslashreplace"))
        except OSError as error:
            raise OutputError(f"cannot be written: {error.strerror}", where=str(path)) from error

    return add
