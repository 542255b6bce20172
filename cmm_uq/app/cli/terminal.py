"""What goes to standard output and standard error, of any encoding and width, and how a command ends."""

from __future__ import annotations

import codecs
import json
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import StringIO
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

from rich.cells import cell_len

from cmm_uq.base.errors import LONGEST_MESSAGE, CmmUqError, OutputError, printable, shortened
from cmm_uq.base.output.interruption import speaking, written

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Stage

NEEDS_A_PERSON = 1  # exit code of a scheduled run after which a person has to look at something, and was told of it
BAD_INPUT = 2  # exit code of everything that the user can mend

NO_OUTPUT = 3  # exit code where the input is sound and the output impossible: disk, permissions, a closed pipe, a fault
NOT_CONFORMING = 4  # exit code of a strict run: a machine does not conform, or a recording contradicts its model
NOT_VERIFIED, NOT_WHOLLY_CHECKED = 1, 3  # exit codes of a verification: something is wrong, or could not be checked

NAME = "cmm-uq:"
WIDEST, NARROWEST = 120, 40  # columns that are used: longer lines are hard to read, and fewer are not enough
Line = tuple[tuple[str, str], ...]  # parts of a line, each with its style in the words of rich; none for the usual one

NEAREST = {  # what this program prints beyond ASCII
    "±": "+/-", "−": "-", "–": "-", "—": "-", "·": "*", "×": "x", "→": "->", "…": "...", "″": '"', "′": "'", "µ": "u",
    "μ": "u", "°": "deg", "α": "alpha", "β": "beta", "γ": "gamma", "ε": "epsilon", "λ": "lambda", "ν": "nu", "σ": "sigma",
    "φ": "phi", "√": "sqrt", "≤": "<=", "≥": ">=", "⁻": "^-", "²": "2", "³": "3", "⁶": "6", "\u00a0": " ", "\u202f": " ",
    "✓": "yes", "✗": "no", "“": '"', "”": '"', "„": '"', "’": "'", "━": "-", "╸": "-", "╺": "-", "⠋": "-", "▏": "|",
}  # fmt: skip

HANDLER = "cmm_uq.nearest"


def any_character() -> None:
    """From now on standard output and standard error write everything, as well as their encodings allow."""
    codecs.register_error(HANDLER, _nearest)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=HANDLER)


def _nearest(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    beyond = error.object[error.start : error.end]
    return "".join(NEAREST.get(c) or c.encode("ascii", "backslashreplace").decode() for c in beyond), error.end


def json_for(encoding: str | None, text: str) -> str:
    r"""JSON as it is where an encoding has all of it, else with ``\uXXXX``, which says the same."""
    try:
        text.encode(encoding or "ascii")
    except UnicodeEncodeError:
        return "".join(c if c.isascii() else json.dumps(c)[1:-1] for c in text)
    return text


def folded(text: str, width: int | None) -> list[str]:
    """Lines of at most ``width`` cells, broken at spaces; a no-break space holds, and a longer word stays whole."""
    words = printable(text.replace("\n", " ")).split(" ")
    if width is None:
        return [" ".join(words)]
    lines, line = [], words[0]
    for word in words[1:]:
        if cell_len(line) + 1 + cell_len(word) <= width:
            line += f" {word}"
        else:
            lines.append(line)
            line = word
    return [*lines, line]


def put(text: str, *, now: bool = False) -> None:
    """Text on standard output, as it is; ``now`` of a command that goes on. An OutputError where nobody takes it."""
    try:
        if sys.stdout is None:
            raise closed()
        sys.stdout.write(text)
        if now:
            sys.stdout.flush()
    except (OSError, ValueError):
        raise closed() from None


def say(text: str = "") -> None:
    put(f"{text}\n")


def say_now(text: str) -> None:
    put(f"{text}\n", now=True)


def put_json(text: str) -> None:
    """JSON on standard output, whatever its encoding."""
    put(json_for(getattr(sys.stdout, "encoding", None), text))


def put_data(data: Mapping[str, Any]) -> None:
    put_json(json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def closed() -> OutputError:
    """Standard output is closed, or its disk is full."""
    there = ", ".join(map(str, written()))
    return OutputError("standard output cannot be written", fix=f"The files are written in {there}" if there else None)


def on_terminal(stream: TextIO | None) -> bool:
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


def show(lines: Iterable[Line]) -> None:
    """Lines on standard output, in colour where it has any."""
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


def tell(error: CmmUqError, code: int) -> None:
    """What went wrong, on standard error: a line, or a JSON object where JSON was asked for, though it could not be read.

    Where nobody listens the exit code tells.
    """
    arguments = sys.argv[1:]
    if "--" in arguments:
        arguments = arguments[: arguments.index("--")]
    with suppress(OSError, ValueError, AttributeError):
        if "--json" in arguments:
            data = {"problem": error.problem, "where": error.where, "fix": error.fix, "exit_code": code}
            print(json.dumps({"error": data}), file=sys.stderr, flush=True)  # noqa: T201
            return
        text = f"{NAME} {shortened(printable(str(error)), LONGEST_MESSAGE)}"
        if on_terminal(sys.stderr):
            text = "\n".join(folded(text, columns()))
            if styled(sys.stderr) and os.name != "nt":  # old consoles of Windows would show the codes
                text = text.replace(NAME, f"\x1b[1;31m{NAME}\x1b[0m", 1)
        print(text, file=sys.stderr, flush=True)  # noqa: T201


ROOMY = 80  # columns from which on there is room for how long it will take
SOON = 5.0  # s, before which nothing is said of how long a command will take


def time_left(elapsed: float, part: float) -> str:
    """How long a command that has done a part of its work will go on, in a few letters; nothing before that can be said."""
    if elapsed < SOON or not 0.02 < part < 1.0:
        return ""
    left = elapsed * (1 - part) / part
    if left < 90:
        return f"~{left:.0f} s left"
    return f"~{left / 60:.0f} min left" if left < 5400 else f"~{left / 3600:.1f} h left"


@contextmanager
def progress(*, quiet: bool, verbose: bool) -> Iterator[Stage]:
    """The stages of a command on standard error: a bar on a terminal; elsewhere a line each when asked for, else nothing.

    A stage is what is being done, and after a colon what of it is counted, which changes while it lasts.
    """
    if quiet or not (verbose or styled(sys.stderr)):
        yield lambda what, part: None
    elif styled(sys.stderr):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Column

        width, times = columns() // 6, " 0:00:00 ~99 min left " if columns() >= ROOMY else " 0:00:00 "
        column = Column(no_wrap=True, overflow="ellipsis", max_width=columns() - width - len(times))
        what, bar = TextColumn("{task.description}", markup=False, table_column=column), BarColumn(bar_width=width)
        console = Console(stderr=True)

        def silence() -> None:
            console.file = StringIO()

        beside = [TimeElapsedColumn(), *([TextColumn("{task.fields[left]}")] if columns() >= ROOMY else [])]
        bars = Progress(
            what, bar, *beside, console=console, transient=True, redirect_stdout=False, redirect_stderr=False
        )
        with speaking(silence), bars as shown:
            task, begun = shown.add_task("Starting", total=1.0, left=""), monotonic()

            def update(what: str, part: float) -> None:
                shown.update(task, description=what, completed=part, left=time_left(monotonic() - begun, part))

            yield update
    else:
        before: set[str] = set()

        def line(what: str, part: float) -> None:
            stage = what.partition(":")[0]
            if stage not in before:
                before.add(stage)
                with suppress(OSError, AttributeError):
                    print(stage, file=sys.stderr, flush=True)  # noqa: T201

        yield line
