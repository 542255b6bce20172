"""What ``new`` and ``instruments new`` ask on a terminal; each answer may be its default."""

from __future__ import annotations

import tomllib
from typing import Any

import typer

CHAIN = {
    "number": "Number of its certificate", "laboratory": "Laboratory that certified it",
    "issuer": "What that is (national institute, accredited, not accredited, in-house)",
    "arrangement": "Arrangement that covers it (CIPM MRA, ILAC MRA, EA MLA, …)",
    "accreditation": "Number of its accreditation", "accredited_by": "Body that accredited it",
    "date": "Date of the certificate, as 2026-05-31", "due": "Last day on which it holds",
}  # fmt: skip
_TEXTS = ("name", "serial", "customer", "mpe", *(f"certificate_{key}" for key in CHAIN if key not in ("date", "due")))
InstrumentAnswers = tuple[str, dict[int, str], dict[str, tuple[float, float]], str, str, dict[str, str | int]]


def value_of(text: str) -> Any:
    """A value as TOML has it; a text without quotes as it is."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def job_answers(name: str) -> dict[str, dict[str, Any]]:
    """What the user says of a new job of a kind, by table and key; only what differs from what it begins with."""
    from cmm_uq.app.commands.jobs.new import usual

    answers: dict[str, dict[str, Any]] = {}
    for table, key, question, default in _questions(usual(name)):
        answer = typer.prompt(question, default=default, show_default=default != "")
        if answer != default:
            text = isinstance(default, str) and key in _TEXTS
            answers.setdefault(table, {})[key] = answer if text else value_of(str(answer))
    artefact = answers.get("artefact", {})
    chain = {key: artefact.pop(f"certificate_{key}") for key in CHAIN if f"certificate_{key}" in artefact}
    if chain:
        artefact["certificate"] = chain
    return {table: keys for table, keys in answers.items() if keys}


def _questions(usual: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """Table, key, question and default of each."""
    machine, artefact = usual["machine"], usual["artefact"]
    travel = ", ".join(f"{axis} = {span}" for axis, span in machine["travel_mm"].items())
    questions = [
        ("machine", "name", "Machine", machine["name"]), ("machine", "serial", "Its serial number", ""),
        ("machine", "travel_mm", "Its travel, lowest and highest reading in mm", f"{{ {travel} }}"),
        ("job", "customer", "Customer", ""),
    ]  # fmt: skip
    if "name" in artefact:
        questions += [
            ("artefact", "name", "Artefact", artefact["name"]), ("artefact", "serial", "Its serial number", ""),
            *(("artefact", f"certificate_{key}", question, "") for key, question in CHAIN.items()),
        ]  # fmt: skip
    for key, question in (
        ("length_mm", "Certified length or diameter in mm"),
        ("u_um", "Its standard uncertainty (k = 1) in µm"),
    ):
        if key in artefact:
            questions.append(("artefact", key, question, str(artefact[key])))
    for wish in usual.get("conformity", ()):
        for key, question in (("limit_um", "Limit in µm"), ("mpe", "Maximum permissible error, L in mm, in µm")):
            if key in wish:
                questions.append(("conformity", key, f"{question} ({wish['standard']})", str(wish[key])))
    return questions


def instrument_answers(title: str) -> InstrumentAnswers:
    """Line, quantities by their places, ranges, question, title and settings of an instrument."""
    from cmm_uq.laboratory.live.instruments.library import numbers_in, range_of

    title = typer.prompt("What is the instrument", default=title)
    settings: dict[str, str | int] = {
        "baud": typer.prompt("Bits per second", default=9600, type=int),
        "data_bits": typer.prompt("Data bits", default=8, type=int),
        "parity": typer.prompt("Parity (none, even, odd)", default="none"),
        "stop_bits": typer.prompt("Stop bits", default=1, type=int),
    }
    ask = _optional("What is sent to get a line, such as T?<CR>; nothing where it speaks by itself")
    line = typer.prompt("An example line with its end, such as T=20.13 C<CR><LF>")
    places: dict[int, str] = {}
    ranges: dict[str, tuple[float, float]] = {}
    for place, number in enumerate(numbers_in(line), 1):
        name = _optional(f"What is {number}: a name with its unit at its end, such as temp_c; nothing to pass it over")
        if not name:
            continue
        places[place] = name
        if span := _optional(f"Plausible values of {name}, such as 0:40; nothing for any"):
            ranges[name] = range_of(span, name)
    return line, places, ranges, ask, title, settings


def _optional(question: str) -> str:
    return str(typer.prompt(question, default="", show_default=False))
