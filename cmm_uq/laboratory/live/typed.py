"""What the operator types: coordinates, a distance, nothing (take the point now), or a word with what belongs to it."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.numbers import number_problem
from cmm_uq.base.files.table import LONGEST_MM

WORDS = {
    "undo": "takes the last point back: undo REASON",
    "repeat": "measures the last set-up once more",
    "skip": "leaves the set-up out: skip REASON",
    "go": "goes on with a measurement: go 5",
    "note": "writes something down: note TEXT",
    "clear": "lets a machine go on after an error that you have looked at",
    "pause": "stops taking points: pause REASON",
    "resume": "goes on taking points",
    "help": "says all this",
    "quit": "ends; the same command goes on later",
}
"""What each does."""

WITH_TEXT = ("undo", "skip", "note")
"""Those that say nothing without a text."""


@dataclass(frozen=True)
class Typed:
    """A line, understood.

    Parameters
    ----------
    word : of :data:`WORDS`, ``take``, or ``point``.
    text : that follows.
    numbers : three coordinates, or one distance, mm.
    """

    word: str
    text: str = ""
    numbers: tuple[float, ...] = ()


def understood(line: str) -> Typed:
    """A line.

    Raises
    ------
    CmmUqError : it is none of them.
    """
    parts = line.replace(";", " ").split()
    if not parts:
        return Typed("take")
    if parts[0][0] in "+-.0123456789":
        return Typed("point", line.strip(), _numbers(parts))
    word = parts[0].lower()
    found = [name for name in WORDS if name == word] or [name for name in WORDS if name.startswith(word)]
    if len(found) != 1:
        raise CmmUqError(f"{parts[0]!r} is no word of this screen", fix=suggestion(word, WORDS))
    text = line.strip()[len(parts[0]) :].strip()
    if found[0] in WITH_TEXT and not text:
        raise CmmUqError(f"{found[0]} without a text", fix=f"It {WORDS[found[0]]}")
    return Typed(found[0], text)


def _numbers(parts: list[str]) -> tuple[float, ...]:
    if len(parts) not in (1, 3):
        raise CmmUqError(
            f"{len(parts)} numbers", fix="Type three coordinates x y z, or one distance from the first point, in mm"
        )
    for part in parts:
        if problem := number_problem(part):
            raise CmmUqError(problem[0], fix=problem[1])
        if abs(float(part)) > LONGEST_MM:
            raise CmmUqError(f"{part} mm is more than anything that is measured", fix="Type mm")
    return tuple(map(float, parts))
