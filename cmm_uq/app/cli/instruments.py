"""``cmm-uq instruments …``: instruments and their profiles; and the operator's screen of ``cmm-uq acquire``.

On a terminal the screen stands still, with a line to type in; elsewhere it is lines, each once.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.asking import instrument_answers
from cmm_uq.app.cli.options import Ending, argument, examples, option
from cmm_uq.app.cli.terminal import on_terminal, say, say_now
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.output.interruption import speaking

if TYPE_CHECKING:
    from rich.console import RenderableType

    from cmm_uq.base.messages import Text
    from cmm_uq.laboratory.live.running import Acquisition
    from cmm_uq.laboratory.live.screen import SessionView as View


PROMPT = "> "
_LINES = 12  # of what happened, that stay on the screen
_ERASE = ("\x7f", "\b")


def operated(acquisition: Acquisition, *, plain: bool, quiet: bool) -> None:
    """Run a session before its operator; ``plain``: lines, although there is a terminal; ``quiet``: nothing but errors."""
    from cmm_uq.laboratory.live.running import OperatorLine as Line

    def typed(text: str | None) -> None:
        acquisition.items.put(Line(text))

    if plain or quiet or not (on_terminal(sys.stdin) and on_terminal(sys.stdout)) or not _keys_can_be_read():
        screen = Plain(quiet=quiet)
        threading.Thread(target=_lines, args=(typed,), daemon=True).start()
        acquisition.run(screen)
    else:
        with Whole.shown(typed) as whole:
            acquisition.run(whole)
    if not quiet:  # how it stands at the end
        view, story = acquisition.conductor.view(), acquisition.conductor.story
        say(f"{view.head}; {len(story.points)} points are kept in {acquisition.journals.folder}")
        say(f"cmm-uq report {acquisition.folder}" if acquisition.conductor.reportable else "no set-up is complete yet")


class Plain:
    """Says each thing once, and what comes next whenever that changes."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._last = quiet, ""

    def tell(self, text: Text) -> None:
        if not self._quiet:
            say_now(str(text))

    def show(self, view: View) -> None:
        now = f"{view.head}; next: {view.next}"
        if now != self._last and not self._quiet:
            self._last = now
            say_now(now)


class Whole:
    """A screen of rich that stands still."""

    def __init__(self, live: Any) -> None:
        self._live, self._typed = live, ""
        self._view: View | None = None

    @classmethod
    @contextlib.contextmanager
    def shown(cls, typed: Callable[[str | None], None]) -> Iterator[Whole]:
        """While it lasts, keys go to ``typed``, a line at a time; afterwards the terminal is as it was, whatever happens."""
        from rich.console import Console
        from rich.live import Live

        with _every_key() as restore:
            live = Live(console=Console(highlight=False), auto_refresh=False, screen=True)
            whole = cls(live)
            threading.Thread(target=whole._keys, args=(typed,), daemon=True).start()

            def hush() -> None:
                restore()
                with contextlib.suppress(OSError):
                    os.write(sys.stdout.fileno(), b"\x1b[?1049l\x1b[?25h")

            with speaking(hush), live:
                yield whole

    def tell(self, text: Text) -> None:
        """See :class:`~cmm_uq.laboratory.live.running.Screen`: it stands on the screen."""

    def show(self, view: View) -> None:
        self._view = view
        self._live.update(_page(view, self._typed, self._live.console.size.height), refresh=True)

    def _keys(self, typed: Callable[[str | None], None]) -> None:
        while True:
            try:
                chunk = os.read(sys.stdin.fileno(), 1024).decode(errors="replace")
            except OSError:
                chunk = ""
            if not chunk:
                typed(None)
                return
            for key in chunk:
                self._key(key, typed)

    def _key(self, key: str, typed: Callable[[str | None], None]) -> None:
        if key in "\r\n":
            line, self._typed = self._typed, ""
            typed(line)
        elif key in _ERASE:
            self._typed = self._typed[:-1]
        elif key == "\x15":
            self._typed = ""
        elif key == "\x04":
            typed(None)
        elif key.isprintable():
            self._typed += key


def _page(view: View, typed: str, height: int) -> RenderableType:
    from rich.console import Group
    from rich.text import Text as Styled

    rows = [Styled(str(view.head), style="bold red" if view.head.startswith("NOTHING") else "bold"),
            Styled(f"next: {view.next}", style="bold cyan")]  # fmt: skip
    rows += [Styled(line, no_wrap=True) for line in view.picture]
    rows += [Styled(str(text), style="bold") for text in view.shown]
    rows += [Styled(str(view.again), style="bold yellow")] if view.again else []
    rows += [Styled(str(text), style="red" if "NOT within" in text else "") for text in view.temperatures]
    rows += [Styled(str(text), style="dim") for text in view.instruments]
    room = max(1, min(_LINES, height - len(rows) - 3))
    rows += [Styled(str(text), style="yellow" * text.startswith(("WARNING", "REPEAT"))) for text in view.said[-room:]]
    keys = "Enter takes the point · x y z · undo REASON · repeat · skip · go N · note · clear · pause · help · quit"
    return Group(*rows, Styled(f"{PROMPT}{typed}▏", style="reverse"), Styled(keys, style="dim"))


def _lines(typed: Callable[[str | None], None]) -> None:
    with contextlib.suppress(OSError, ValueError):
        while sys.stdin is not None and (line := sys.stdin.readline()):
            typed(line.rstrip("\r\n"))
    typed(None)


def _keys_can_be_read() -> bool:
    try:
        import termios  # noqa: F401
    except ImportError:  # Windows: lines
        return False
    return True


@contextlib.contextmanager
def _every_key() -> Iterator[Callable[[], None]]:
    """Keys come one by one and are not echoed; gives what puts the terminal back."""
    import termios
    import tty

    file = sys.stdin.fileno()
    before = termios.tcgetattr(file)

    def restore() -> None:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(file, termios.TCSADRAIN, before)

    try:
        tty.setcbreak(file)
        yield restore
    finally:
        restore()


app = typer.Typer(
    help="Instruments as live sources: which profiles are ready, one tried at its port, a new one from an example line.",
    epilog=examples("instruments list", "instruments test fluke-1502a /dev/ttyUSB0"),
    rich_markup_mode=None,
    invoke_without_command=True,
)

SHOWN = 44  # characters of a message beside what was understood of it

_READY = "Ready profile, a TOML file, or with --job the name of a source in it."
PROFILE = argument(..., _READY, "PROFILE", autocompletion=opt.profiles)
_PORTS = "/dev/ttyUSB0, COM3, socket://host:port, rfc2217://host:port, tcp://host:port or file:NAME."
PORT = argument("", _PORTS, "PORT", "that of the job")
JOB = option(None, "Job folder whose source is meant.", "JOB", "none", "--job")
SECONDS = option(None, "How long.", "S", "until it is interrupted", min=0.1)


@app.callback()
def _alone(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        list_all(Ending())


@opt.command(app, "list", "instruments list", "instruments list --json")
def list_all(end: Ending = opt.ONLY_JSON) -> None:
    """List the ready profiles and the serial ports of this computer."""
    from cmm_uq.app.commands.laboratory.acquire import ready_profiles
    from cmm_uq.laboratory.live.instruments.source import serial_ports

    rows, ports = ready_profiles(), serial_ports()
    wide = max(len(name) for name, _, _ in rows)
    lines = [*(f"{name:{wide}}  {title}" for name, title, _ in rows), ""]
    lines += [f"{port}  {description}".rstrip() for port, description in ports] or ["No serial port is here."]
    profiles = [dict(zip(("name", "title", "tried"), row, strict=True)) for row in rows]
    end.put({"profiles": profiles, "ports": dict(ports)}, lines)


_UNASKED = "answers to no question; where they belong to it, see messages and unasked in [send] of a profile"


@opt.command(app, "test", "instruments test fluke-1502a /dev/ttyUSB0", "instruments test table_top --job my-job")
def try_out(
    profile: str = PROFILE,
    port: str = PORT,
    job: Path | None = JOB,
    seconds: float = option(5.0, "How long.", "S", min=0.1, max=86400),
    end: Ending = opt.ONLY_JSON,
) -> None:
    """Try an instrument for a few seconds: who it is, and each message beside what was understood of it.

    Exit code 2 when nothing was, with what was seen, what was expected and what to check.
    """
    from cmm_uq.app.commands.laboratory.acquire import Attempt

    attempt = Attempt(profile, port, job)
    for event in attempt.events(seconds):
        if not end.json:
            _show(event)
    attempt.trial.conclude()
    trial, identity = attempt.trial, attempt.source.identity()
    told = [(key, value) for key, value in vars(identity).items() if isinstance(value, str) and value and key != "name"]
    who = ", ".join(printable(f"{key} {value}") for key, value in told)
    count = f"{trial.messages} messages, {trial.with_values} with values, {trial.wrong} with something wrong"
    if trial.unasked:
        count += f", {trial.unasked} of them {_UNASKED}"
    by = {name: "the job" if name in identity.units_stated else "the profile" for name in identity.units}
    units = [f"{name} in {unit}, as {by[name]} has it" for name, unit in identity.units.items()]
    end.put({
        "identity": vars(identity), "messages": trial.messages, "with_values": trial.with_values, "wrong": trial.wrong,
        "unasked": trial.unasked, "quantities": trial.quantities,
    }, ["", f"{identity.name}: {who or 'does not say who it is'}", *units, count])  # fmt: skip


@opt.command(app, "watch", "instruments watch line-logger socket://logger:4001")
def watch(profile: str = PROFILE, port: str = PORT, job: Path | None = JOB, seconds: float | None = SECONDS) -> None:
    """Show each message beside what is understood of it, gaps and returns too, until it is interrupted."""
    from cmm_uq.app.commands.laboratory.acquire import Attempt
    from cmm_uq.base.output.interruption import speaking

    attempt = Attempt(profile, port, job)
    with speaking(attempt.source.close):
        for event in attempt.events(seconds):
            _show(event)


class Parity(StrEnum):
    NONE, EVEN, ODD = "none", "even", "odd"


_NEW = "instruments new my-gauge.toml"


@opt.command(app, "new", _NEW, f"{_NEW} --line 'T=20.13 C<CR><LF>' --quantity temp_c=1 --ask 'T?<CR>'")
def new(
    file: Path = argument(..., "New file: NAME.toml.", "FILE"),
    line: str = option("", "An example line with its end: T=20.13 C<CR><LF>.", "TEXT", "asked for on a terminal"),
    quantity: list[str] | None = option(
        None, "Name of a quantity with its unit at its end, and which number of the line it is: temp_c=1.", "NAME=N",
        "asked for on a terminal"),
    limits: list[str] | None = option(None, "Plausible values: temp_c=0:40.", "NAME=LOW:HIGH", "none", "--range"),
    ask: str = option("", "What is sent to get a line: T?<CR>.", "TEXT", "nothing is sent"),
    every: float = option(1.0, "Seconds from one question to the next.", "S", min=0.01),
    title: str = option("", "What the instrument is.", "TEXT", "the file's name"),
    baud: int = option(9600, "Bits per second.", "N", min=50),
    bits: int = option(8, "Data bits.", "N", min=5, max=8),
    parity: Parity = option(Parity.NONE, "Parity.", None, "none"),
    stop: int = option(1, "Stop bits.", "N", min=1, max=2),
) -> None:  # fmt: skip
    """Write a profile from an example line; on a terminal it asks for what no option says."""
    from cmm_uq.app.commands.laboratory.acquire import write_profile
    from cmm_uq.laboratory.live.instruments.library import ProfileDraft, range_of

    settings: dict[str, str | int] = {"baud": baud, "data_bits": bits, "parity": parity.value, "stop_bits": stop}
    places: dict[int, str] = {}
    for name, text in _pairs(quantity, "--quantity", "temp_c=1"):
        if not text.isdecimal():
            where = f"--quantity {name}"
            raise CmmUqError(f"{text!r} is no number of the line", where=where, fix="Write it as temp_c=1")
        places[int(text)] = name
    ranges = {name: range_of(text, name) for name, text in _pairs(limits, "--range", "temp_c=0:40")}
    if not line:
        if sys.stdin is None or not sys.stdin.isatty():
            raise CmmUqError("no example line is given", where="--line", fix="Give one: --line 'T=20.13 C<CR><LF>'")
        line, places, ranges, ask, title, settings = instrument_answers(title or file.stem)
    write_profile(file, ProfileDraft(file.stem, title or file.stem, line, places, ranges, ask, every, settings))
    say(str(file))
    say(f"Try it: cmm-uq instruments test {file} PORT")


@opt.command(app, "simulate", "instruments simulate fluke-1502a", "instruments simulate ipp")
def simulate(
    profile: str = argument(..., "Ready profile.", "PROFILE", autocompletion=opt.profiles),
    way: str = option("", "pty (a port of this computer), socket or rfc2217.", "WAY", "pty"),
    seconds: float | None = SECONDS,
) -> None:
    """Be an instrument without hardware, at a port that is printed, until it is interrupted."""
    from cmm_uq.app.commands.laboratory.acquire import simulated_instrument

    with simulated_instrument(profile, way) as port:
        say_now(port)
        time.sleep(seconds or 0.0)
        while seconds is None:
            time.sleep(0.1)


def _show(event: Any) -> None:
    from cmm_uq.laboratory.live.instruments.library import beside

    raw, meaning = beside(event)
    shown = raw if len(raw) <= SHOWN else f"{raw[: SHOWN - 1]}…"
    say_now(f"{shown:{SHOWN}}  {printable(meaning)}".rstrip())


def _pairs(given: list[str] | None, option: str, like: str) -> list[tuple[str, str]]:
    found = []
    for text in given or ():
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise CmmUqError(f"{text!r} says nothing", where=option, fix=f"Write it as {like}")
        found.append((name.strip(), value.strip()))
    return found
