"""What ``new`` and ``instruments new`` ask on a terminal: each answer may be its default.

Of a part each answer is held against what the readers of a job would say of it, and asked for again where they refuse it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cmm_uq.app.cli.terminal import say
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import value_of

if TYPE_CHECKING:
    from cmm_uq.app.commands.parts.new import Answers

CHAIN = {
    "number": "Number of its certificate", "laboratory": "Laboratory that certified it",
    "issuer": "What that is (national institute, accredited, not accredited, in-house)",
    "arrangement": "Arrangement that covers it (CIPM MRA, ILAC MRA, EA MLA, …)",
    "accreditation": "Number of its accreditation", "accredited_by": "Body that accredited it",
    "date": "Date of the certificate, as 2026-05-31", "due": "Last day on which it holds",
}  # fmt: skip
_TEXTS = ("name", "serial", "customer", "mpe", *(f"certificate_{key}" for key in CHAIN if key not in ("date", "due")))
InstrumentAnswers = tuple[str, dict[int, str], dict[str, tuple[float, float]], str, str, dict[str, str | int]]


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
    sizes = {"length_mm": "Certified length or diameter in mm", "u_um": "Its standard uncertainty (k = 1) in µm"}
    for key, question in sizes.items():
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


_BEST_FIT = "best fit"


def part_answers() -> Answers:
    from cmm_uq.app.commands.parts.new import Answers, certificate_files
    from cmm_uq.jobs.part.job import TABLES

    part, stylus, answers = TABLES["part"], TABLES["stylus"][0], Answers()
    answers.part["name"] = _ask("Part", part["name"])
    answers.part["drawing"] = _ask("Its drawing", "")
    answers.part["cte_per_k"] = _ask("Its coefficient of thermal expansion, 1/K", str(part["cte_per_k"]), float)
    say("The machine is stated by its certificate (PDF), or by the folder that its report wrote.")
    stated = "Certificate of the machine, empty to put it in later"
    answers.machine = _ask(stated, "", lambda text: certificate_files(Path(text))) or {}
    offset = " ".join(f"{number:g}" for number in stylus["offset_mm"])
    answers.stylus["diameter_mm"] = _ask("Diameter of the stylus tip in mm", str(stylus["diameter_mm"]), float)
    answers.stylus["offset_mm"] = _ask("Centre of the tip from the ram, x y z in mm", offset, _three)
    doubt = "Standard uncertainty of its diameter in µm"
    answers.stylus["u_diameter_um"] = _ask(doubt, str(stylus["u_diameter_um"]), float)
    say("Features, one after another, in coordinates of the part; those of the example where none is named.")
    while name := _ask("Name of a feature, empty for no more", "", answers.free_name):
        _ask_until_sound(name, _feature, answers.add_feature)
    if not answers.features:
        return answers
    answers.alignment = _ask(f"Datums of the alignment in order, as A, B, C, or {_BEST_FIT}", _BEST_FIT, lambda text:
                             answers.aligned([] if text == _BEST_FIT else _names(text)))  # fmt: skip
    say("Tolerances, one after another.")
    while name := _ask(
        "Name or number of a tolerance, empty for no more", "", lambda text: answers.free_name(text, tolerance=True)
    ):
        _ask_until_sound(name, _characteristic, answers.add_characteristic)
    return answers


def _ask(question: str, default: str, read: Callable[[str], Any] | None = None) -> Any:
    """An answer as it is read; asked for again where it cannot be. An empty one that is the default stays empty."""
    while True:
        answer = str(typer.prompt(question, default=default, show_default=default != "")).strip()
        if read is None or (answer == default == ""):
            return answer
        try:
            return read(answer)
        except CmmUqError as error:
            say(f"{error.problem}. {error.fix or ''}".strip())
        except ValueError:
            say(f"{answer!r} is not understood")


def _ask_until_sound(name: str, ask: Callable[[str], dict[str, Any]], take: Callable[[dict[str, Any]], None]) -> None:
    """Ask for a table until the readers of a job take it."""
    while True:
        try:
            return take(ask(name))
        except CmmUqError as error:
            say(f"{error.problem}. {error.fix or ''}".strip())


def _feature(name: str) -> dict[str, Any]:
    from cmm_uq.jobs.part.drawing import usual_strategy
    from cmm_uq.jobs.part.feature import DIRECTED, FEWEST, KEYS, ROUND

    kind = _ask(f"What it is: {', '.join(FEWEST)}", KEYS["width_mm"][0], _one_of(tuple(FEWEST)))
    table: dict[str, Any] = {"name": name, "kind": kind}
    table["point_mm"] = _ask("A point of it, its centre or the middle of its axis, x y z in mm", "0 0 0", _three)
    if kind in DIRECTED:
        what = "Its axis" if kind in ROUND else "Along it" if kind == "line" else "Its normal, out of the material"
        table["direction"] = _ask(f"{what}, x y z", "0 0 1", _three)
    for key, kinds, question, default, read in (
        ("normal", KEYS["normal"], "Normal of its surface, out of the material, x y z", "1 0 0", _three),
        ("diameter_mm", ROUND, "Its diameter in mm", "", float), ("inner", ROUND, "Whether it is a hole, y or n", "y", _yes),
        ("angle_deg", KEYS["angle_deg"], "Its whole angle in °", "60", float),
        ("length_mm", KEYS["length_mm"], "Its length in mm", "20", float),
        ("width_mm", KEYS["width_mm"], "Its width in mm", "20", float),
    ):  # fmt: skip
        if kind in kinds:
            table[key] = _ask(question, default, read)
    if kind != "point":
        usual = {"pattern": "points", "points": usual_strategy(kind, 24 if kind == "cylinder" else None)["points"]}
        table["strategy"] = {**usual, "points": _ask("Points on it, spread evenly", str(usual["points"]), int)}
    return table


def _characteristic(name: str) -> dict[str, Any]:
    from cmm_uq.jobs.part.feature import ASKS

    what = _ask(f"What it is: {', '.join(ASKS)}", "size", _one_of(tuple(ASKS)))
    asks, features = ASKS[what], "Its feature" if ASKS[what].features == 1 else "Its two features, as A, B"
    table: dict[str, Any] = {"name": name, "what": what, "features": _ask(features, "", _names)}
    if asks.datum_kinds:
        later = "" if asks.datums else ", empty for those of the alignment"
        datums = _ask(f"Its datums in order, as A, B or A-B for a common one{later}", "", _names)
        table |= {"datums": datums} if datums else {}
    if asks.limits == "zone":
        return {**table, "tolerance_mm": _ask("Its tolerance in mm", "0.1", float)}
    unit, sign = ("deg", "°") if asks.limits == "angles" else ("mm", "mm")
    for end in ("lower", "upper"):
        limit = _ask(f"Its {end} limit in {sign}, empty for none", "", float)
        table |= {} if limit == "" else {f"{end}_{unit}": limit}
    return table


def _one_of(known: tuple[str, ...]) -> Callable[[str], str]:
    def read(text: str) -> str:
        from cmm_uq.base.errors import suggestion

        if text not in known:
            raise CmmUqError(f"{text!r} is none of them", fix=suggestion(text, known))
        return text

    return read


def _yes(text: str) -> bool:
    answers = {"y": True, "yes": True, "n": False, "no": False}
    if text.casefold() not in answers:
        raise ValueError(text)
    return answers[text.casefold()]


def _names(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _three(text: str) -> list[float]:
    numbers = [float(word) for word in text.replace(",", " ").split()]
    if len(numbers) != 3:
        raise ValueError(text)
    return numbers
