"""What ``cmm-uq instruments new`` asks on a terminal: how the line is set, an example line, which of its numbers is what."""

from __future__ import annotations

import typer

from cmm_uq.laboratory.live.instruments.library import numbers_in, range_of

Asked = tuple[str, dict[int, str], dict[str, tuple[float, float]], str, str, dict[str, str | int]]


def asked(title: str) -> Asked:
    """Line, quantities by their places, ranges, question, title and settings."""
    title = typer.prompt("What is the instrument", default=title)
    settings: dict[str, str | int] = {
        "baud": typer.prompt("Bits per second", default=9600, type=int),
        "data_bits": typer.prompt("Data bits", default=8, type=int),
        "parity": typer.prompt("Parity (none, even, odd)", default="none"),
        "stop_bits": typer.prompt("Stop bits", default=1, type=int),
    }
    ask = typer.prompt(
        "What is sent to get a line, such as T?<CR>; nothing where it speaks by itself", default="", show_default=False
    )
    line = typer.prompt("An example line with its end, such as T=20.13 C<CR><LF>")
    places: dict[int, str] = {}
    ranges: dict[str, tuple[float, float]] = {}
    for place, number in enumerate(numbers_in(line), 1):
        name = typer.prompt(f"What is {number}: a name with its unit at its end, such as temp_c; nothing to pass it over",
                            default="", show_default=False)  # fmt: skip
        if not name:
            continue
        places[place] = name
        span = typer.prompt(
            f"Plausible values of {name}, such as 0:40; nothing for any", default="", show_default=False
        )
        if span:
            ranges[name] = range_of(span, name)
    return line, places, ranges, ask, title, settings
