"""What ``cmm-uq new part`` asks on a terminal: part, machine's certificate, stylus, features, datums, tolerances.

Each answer is held against what the readers of a job would say of it, and asked for again where they refuse it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from cmm_uq.app.cli.terminal import say
from cmm_uq.base.errors import CmmUqError

if TYPE_CHECKING:
    from cmm_uq.app.commands.parts.new import Answers

Value = TypeVar("Value")
_BEST_FIT = "best fit"
_ANSWERS = {"y": True, "yes": True, "n": False, "no": False}


def part_answers() -> Answers:
    """What the user says of a new job of a part."""
    from cmm_uq.app.commands.parts.new import Answers, certificate_files
    from cmm_uq.jobs.part.job import TABLES

    part, stylus = TABLES["part"], TABLES["stylus"][0]
    found = Answers()
    found.part["name"] = _asked("Part", part["name"])
    found.part["drawing"] = _asked("Its drawing", "")
    found.part["cte_per_k"] = _asked("Its coefficient of thermal expansion, 1/K", str(part["cte_per_k"]), float)
    say("The machine is stated by its certificate (PDF), or by the folder that its report wrote.")
    stated = "Certificate of the machine, empty to put it in later"
    found.machine = _asked(stated, "", lambda text: certificate_files(Path(text))) or {}
    found.stylus["diameter_mm"] = _asked("Diameter of the stylus tip in mm", str(stylus["diameter_mm"]), float)
    found.stylus["offset_mm"] = _asked(
        "Centre of the tip from the ram, x y z in mm", _spaced(stylus["offset_mm"]), _three
    )
    found.stylus["u_diameter_um"] = _asked(
        "Standard uncertainty of its diameter in µm", str(stylus["u_diameter_um"]), float
    )
    say("Features, one after another, in coordinates of the part; those of the example where none is named.")
    while name := _asked("Name of a feature, empty for no more", "", found.free_name):
        _until_sound(partial(_feature, name), found.add_feature)
    if not found.features:
        return found
    found.alignment = _asked(f"Datums of the alignment in order, as A, B, C, or {_BEST_FIT}", _BEST_FIT, lambda text:
                             found.aligned([] if text == _BEST_FIT else _names(text)))  # fmt: skip
    say("Tolerances, one after another.")
    while name := _asked("Name or number of a tolerance, empty for no more", "", found.free_tolerance):
        _until_sound(partial(_characteristic, name), found.add_characteristic)
    return found


def _asked(question: str, default: str, read: Callable[[str], Value] | None = None) -> Any:
    """An answer as it is read; asked for again where it cannot be. An empty one that is the default stays empty."""
    while True:
        said = str(typer.prompt(question, default=default, show_default=default != "")).strip()
        if read is None or (said == default == ""):
            return said
        try:
            return read(said)
        except CmmUqError as error:
            say(f"{error.problem}. {error.fix or ''}".strip())
        except ValueError:
            say(f"{said!r} is not understood")


def _until_sound(ask: Callable[[], dict[str, Any]], take: Callable[[dict[str, Any]], None]) -> None:
    """Ask for a table until the readers of a job take it."""
    while True:
        try:
            return take(ask())
        except CmmUqError as error:
            say(f"{error.problem}. {error.fix or ''}".strip())


def _feature(name: str) -> dict[str, Any]:
    from cmm_uq.jobs.part.drawing import usual_strategy
    from cmm_uq.jobs.part.feature import DIRECTED, FEWEST, KEYS, ROUND

    kind = _asked(f"What it is: {', '.join(FEWEST)}", KEYS["width_mm"][0], _one_of(tuple(FEWEST)))
    found: dict[str, Any] = {"name": name, "kind": kind}
    found["point_mm"] = _asked("A point of it, its centre or the middle of its axis, x y z in mm", "0 0 0", _three)
    if kind in DIRECTED:
        what = "Its axis" if kind in ROUND else "Along it" if kind == "line" else "Its normal, out of the material"
        found["direction"] = _asked(f"{what}, x y z", "0 0 1", _three)
    if kind in KEYS["normal"]:
        found["normal"] = _asked("Normal of its surface, out of the material, x y z", "1 0 0", _three)
    if kind in ROUND:
        found["diameter_mm"] = _asked("Its diameter in mm", "", float)
        found["inner"] = _asked("Whether it is a hole, y or n", "y", _yes)
    if kind in KEYS["angle_deg"]:
        found["angle_deg"] = _asked("Its whole angle in °", "60", float)
    if kind in KEYS["length_mm"]:
        found["length_mm"] = _asked("Its length in mm", "20", float)
    if kind in KEYS["width_mm"]:
        found["width_mm"] = _asked("Its width in mm", "20", float)
    if kind != "point":
        usual = {"pattern": "points", "points": usual_strategy(kind, 24 if kind == "cylinder" else None)["points"]}
        found["strategy"] = {**usual, "points": _asked("Points on it, spread evenly", str(usual["points"]), int)}
    return found


def _characteristic(name: str) -> dict[str, Any]:
    from cmm_uq.jobs.part.characteristic import ASKS

    what = _asked(f"What it is: {', '.join(ASKS)}", "size", _one_of(tuple(ASKS)))
    asks, features = ASKS[what], "Its feature" if ASKS[what].features == 1 else "Its two features, as A, B"
    found: dict[str, Any] = {"name": name, "what": what, "features": _asked(features, "", _names)}
    if asks.datum_kinds:
        later = "" if asks.datums else ", empty for those of the alignment"
        datums = _asked(f"Its datums in order, as A, B or A-B for a common one{later}", "", _names)
        found |= {"datums": datums} if datums else {}
    if asks.limits == "zone":
        return {**found, "tolerance_mm": _asked("Its tolerance in mm", "0.1", float)}
    unit, sign = ("deg", "°") if asks.limits == "angles" else ("mm", "mm")
    for end in ("lower", "upper"):
        limit = _asked(f"Its {end} limit in {sign}, empty for none", "", float)
        found |= {} if limit == "" else {f"{end}_{unit}": limit}
    return found


def _one_of(known: tuple[str, ...]) -> Callable[[str], str]:
    def read(text: str) -> str:
        from cmm_uq.base.errors import suggestion

        if text not in known:
            raise CmmUqError(f"{text!r} is none of them", fix=suggestion(text, known))
        return text

    return read


def _yes(text: str) -> bool:
    if text.casefold() not in _ANSWERS:
        raise ValueError(text)
    return _ANSWERS[text.casefold()]


def _names(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _three(text: str) -> list[float]:
    found = [float(word) for word in text.replace(",", " ").split()]
    if len(found) != 3:
        raise ValueError(text)
    return found


def _spaced(numbers: list[float]) -> str:
    return " ".join(f"{number:g}" for number in numbers)
