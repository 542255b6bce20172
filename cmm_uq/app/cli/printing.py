"""What goes to standard output, how a command ends, and what happens where nobody takes what it says."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO

import typer

from cmm_uq.app.cli import NOT_CONFORMING
from cmm_uq.app.cli.encoding import json_for
from cmm_uq.base.errors import OutputError
from cmm_uq.base.output.interruption import written

if TYPE_CHECKING:
    from cmm_uq.app.cli.layout import Layout, Line
    from cmm_uq.certificate.in_short import Summary

WIDEST = 120
"""Columns that are used: longer lines are hard to read."""

NARROWEST = 40
"""Columns that are used even where there are fewer."""


def say(text: str = "") -> None:
    """One line on standard output.

    Raises
    ------
    OutputError : nobody takes it.
    """
    put(f"{text}\n")


def helped(context: typer.Context) -> None:
    """Say the help of a group of commands where none of them is named.

    Raises
    ------
    OutputError : nobody takes it.
    """
    if context.invoked_subcommand is None:
        say(context.get_help())


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


def say_now(text: str) -> None:
    """One line on standard output, of a command that goes on.

    Raises
    ------
    OutputError : nobody takes it.
    """
    say(text)
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        raise closed() from None


def put_json(text: str) -> None:
    """JSON on standard output, whatever its encoding.

    Raises
    ------
    OutputError : nobody takes it.
    """
    put(json_for(getattr(sys.stdout, "encoding", None), text))


def put_data(data: Mapping[str, Any]) -> None:
    """One JSON object on standard output, as :func:`put_json`."""
    put_json(json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def closed() -> OutputError:
    """Standard output is closed, or its disk is full."""
    there = ", ".join(map(str, written()))
    return OutputError("standard output cannot be written", fix=f"The files are written in {there}" if there else None)


def on_terminal(stream: TextIO | None) -> bool:
    """Whether somebody looks at it."""
    return stream is not None and stream.isatty()


def can_answer() -> bool:
    """Whether somebody sees a question and can answer it."""
    return on_terminal(sys.stdin) and on_terminal(sys.stdout)


def styled(stream: TextIO | None) -> bool:
    """Whether it shows colours, and is to (https://no-color.org)."""
    return on_terminal(stream) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") not in ("dumb", "unknown")


def columns() -> int:
    """Of the terminal, as far as they are used."""
    return min(WIDEST, max(NARROWEST, shutil.get_terminal_size().columns))


def layout(*, verbose: bool) -> Layout:
    """For standard output."""
    from cmm_uq.app.cli.layout import Layout

    return Layout(columns() if on_terminal(sys.stdout) else None, verbose)


def show(lines: Iterable[Line]) -> None:
    """Lines on standard output, in colour where it has any.

    Raises
    ------
    OutputError : nobody takes them.
    """
    if not styled(sys.stdout):
        for line in lines:
            say("".join(text for text, _ in line).rstrip(" "))
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False, soft_wrap=True)
    try:
        for line in lines:
            console.print(Text.assemble(*line))
    except OSError:
        raise closed() from None


def show_summary(
    summary: Summary, files: Mapping[str, Path], *, verbose: bool, name: str = "", banner: str = ""
) -> None:
    """A summary and the files that were written, on standard output.

    Raises
    ------
    OutputError : nobody takes it.
    """
    from cmm_uq.app.cli.files_told import folder_of, told

    rows, folder = told(files, whole=verbose), folder_of(files)
    show(layout(verbose=verbose).screen(summary, name=name, banner=banner, files=rows, folder=folder))


class Ended(Protocol):
    """What a command wrote and found."""

    @property
    def results(self) -> bytes:
        """Contents of results.json."""

    @property
    def files(self) -> Mapping[str, Path]:
        """What was written, by name."""

    @property
    def summary(self) -> Summary:
        """In a few lines."""

    @property
    def conforming(self) -> bool:
        """Whether nothing that was decided is anything but a pass."""

    @property
    def name(self) -> str:
        """Id of the job."""

    @property
    def origin(self) -> str:
        """Of the recording."""

    @property
    def recorded(self) -> str:
        """Where it was recorded, in a sentence; empty where it was not."""


def conclude(ended: Ended, *, json: bool, quiet: bool, strict: bool, verbose: bool) -> None:
    """How a command ends that wrote an outcome: results.json or a summary, unless it is to be quiet.

    Raises
    ------
    typer.Exit : with ``strict``, when not all is well.
    OutputError : nobody takes what is said.
    """
    if json:
        put_json(ended.results.decode())
    elif not quiet:
        from cmm_uq.certificate.origin import BANNERS

        banner = BANNERS.get(ended.origin, "")
        show_summary(ended.summary, ended.files, verbose=verbose, name=ended.name, banner=banner)
        if ended.recorded:
            say(ended.recorded)
    if strict and not ended.conforming:
        raise typer.Exit(NOT_CONFORMING)
