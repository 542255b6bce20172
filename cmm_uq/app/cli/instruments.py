"""``cmm-uq instruments list | test | watch | new | simulate``: instruments and their profiles."""

from __future__ import annotations

import sys
import time
from enum import StrEnum
from pathlib import Path
from typing import Any

import typer

from cmm_uq.app.cli import options as opt
from cmm_uq.app.cli.asking import instrument_answers
from cmm_uq.app.cli.options import argument, examples, option
from cmm_uq.app.cli.terminal import put_data, say, say_now
from cmm_uq.base.errors import CmmUqError, printable

app = typer.Typer(
    help="Instruments as live sources: which profiles are ready, one tried at its port, a new one from an example line.",
    epilog=examples("instruments list", "instruments test fluke-1502a /dev/ttyUSB0"),
    rich_markup_mode=None,
    invoke_without_command=True,
)

SHOWN = 44  # characters of a message beside what was understood of it

PROFILE = argument(
    ..., "Ready profile, a TOML file, or with --job the name of a source in it.", "PROFILE", autocompletion=opt.profiles
)
PORT = argument(
    "",
    "/dev/ttyUSB0, COM3, socket://host:port, rfc2217://host:port, tcp://host:port or file:NAME.",
    "PORT",
    "that of the job",
)
JOB = option(None, "Job folder whose source is meant.", "JOB", "none", "--job")
SECONDS = option(None, "How long.", "S", "until it is interrupted", min=0.1)


@app.callback()
def _alone(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        list_all(json=False)


@opt.command(app, "list", "instruments list", "instruments list --json")
def list_all(json: bool = opt.JSON) -> None:
    """List the ready profiles and the serial ports of this computer."""
    from cmm_uq.app.commands.laboratory.instruments import ready_profiles
    from cmm_uq.laboratory.live.instruments.source import serial_ports

    rows, ports = ready_profiles(), serial_ports()
    if json:
        keys = ("name", "title", "tried")
        put_data({"profiles": [dict(zip(keys, row, strict=True)) for row in rows], "ports": dict(ports)})
        return
    wide = max(len(name) for name, _, _ in rows)
    for name, title, _ in rows:
        say(f"{name:{wide}}  {title}")
    say()
    for port, description in ports:
        say(f"{port}  {description}".rstrip())
    if not ports:
        say("No serial port is here.")


@opt.command(app, "test", "instruments test fluke-1502a /dev/ttyUSB0", "instruments test table_top --job my-job")
def try_out(
    profile: str = PROFILE,
    port: str = PORT,
    job: Path | None = JOB,
    seconds: float = option(5.0, "How long.", "S", min=0.1, max=86400),
    json: bool = opt.JSON,
) -> None:
    """Try an instrument for a few seconds: who it is, and each message beside what was understood of it.

    Exit code 2 when nothing was, with what was seen, what was expected and what to check.
    """
    from cmm_uq.app.commands.laboratory.instruments import Attempt

    attempt = Attempt(profile, port, job)
    for event in attempt.events(seconds):
        if not json:
            _show(event)
    attempt.trial.conclude()
    trial, identity = attempt.trial, attempt.source.identity()
    if json:
        put_data({
            "identity": vars(identity), "messages": trial.messages, "with_values": trial.with_values, "wrong": trial.wrong,
            "quantities": trial.quantities,
        })  # fmt: skip
        return
    who = ", ".join(printable(f"{key} {value}") for key, value in vars(identity).items() if value and key != "name")
    say()
    say(f"{identity.name}: {who or 'does not say who it is'}")
    say(f"{trial.messages} messages, {trial.with_values} with values, {trial.wrong} with something wrong")


@opt.command(app, "watch", "instruments watch line-logger socket://logger:4001")
def watch(profile: str = PROFILE, port: str = PORT, job: Path | None = JOB, seconds: float | None = SECONDS) -> None:
    """Show each message beside what is understood of it, gaps and returns too, until it is interrupted."""
    from cmm_uq.app.commands.laboratory.instruments import Attempt
    from cmm_uq.base.output.interruption import speaking

    attempt = Attempt(profile, port, job)
    with speaking(attempt.source.close):
        for event in attempt.events(seconds):
            _show(event)


class Parity(StrEnum):
    """Of a serial line."""

    NONE, EVEN, ODD = "none", "even", "odd"


@opt.command(
    app,
    "new",
    "instruments new my-gauge.toml",
    "instruments new my-gauge.toml --line 'T=20.13 C<CR><LF>' --quantity temp_c=1 --ask 'T?<CR>'",
)
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
    from cmm_uq.app.commands.laboratory.instruments import write_profile
    from cmm_uq.laboratory.live.instruments.library import ProfileDraft, range_of

    settings: dict[str, str | int] = {"baud": baud, "data_bits": bits, "parity": parity.value, "stop_bits": stop}
    places = {_whole(text, name): name for name, text in _pairs(quantity, "--quantity", "temp_c=1")}
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
    from cmm_uq.app.commands.laboratory.instruments import simulated_instrument

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


def _whole(text: str, name: str) -> int:
    if not text.isdecimal():
        raise CmmUqError(f"{text!r} is no number of the line", where=f"--quantity {name}", fix="Write it as temp_c=1")
    return int(text)
