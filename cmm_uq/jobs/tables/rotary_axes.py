"""What a job says of rotary axes: which its chain has, where they lie, how they turn, and in which frame is recorded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from cmm_uq.base.files.table import JobTable, Range, Triple, key, required


def check_carriages(chain: str) -> None:
    """Refuse a chain without each of its three carriages once, or with more behind them than a head and two rotary tables."""
    carriages, head, tables = parts_of_chain(chain)
    if sorted(carriages.replace("F", "", 1)) != ["X", "Y", "Z"]:
        raise ValueError(f"chain = {chain!r}: give X, Y, Z once each, and F for the frame if the workpiece moves")
    for mark, letters, what in (
        ("-", head, "axes of a head behind the hyphen"),
        ("|", tables, "tables behind the bar"),
    ):
        if mark in chain and not (letters in ("A", "B", "C") or len(letters) == _MOST_ON_ONE_SIDE):
            raise ValueError(
                f"chain = {chain!r}: give one or two rotary {what}, A, B or C as they turn about X, Y or Z, the one that "
                f"carries the other first, such as XYZ{mark}C or XYZ{mark}AC"
            )
    if len(set(letters := head + tables)) < len(letters) or not set(letters) <= set("ABC"):
        raise ValueError(f"chain = {chain!r}: name each rotary axis once, A, B or C as it turns about X, Y or Z")


_MOST_ON_ONE_SIDE = 2


def parts_of_chain(chain: str) -> tuple[str, str, str]:
    """Carriages, axes of the head from the ram on, and tables from the bed on, of ``XYZ-B|AC``."""
    rest, _, tables = chain.partition("|")
    carriages, _, head = rest.partition("-")
    return carriages, head, tables


class RotaryAxisFacts(JobTable):
    """What is said of one rotary axis."""

    axis_mm: Triple | None = None
    """A point on its axis with all rotary axes at 0: of a table in scale readings, the origin of the recording where left out;
    of a head from the end of the ram, that where left out. Location and tilt of the axis are those at this point."""
    turns: Literal["anticlockwise", "clockwise"] = "anticlockwise"
    """How it turns while its reading grows, seen from the positive end of the axis that it is parallel to."""
    travel_deg: Range | None = key(None, "Lowest and highest reading.")


class RotaryFacts(RotaryAxisFacts):
    """One ``[[machine.rotary]]``: a rotary axis of a chain with several, or with a head."""

    name: Literal["A", "B", "C"] = required("Its letter in the chain; it reads `a_deg`, `b_deg` or `c_deg`.")


class RotaryTableFacts(RotaryAxisFacts):
    """``table``: the rotary table that a chain such as `XYZ|C` ends with, and in which frame what stands on it is recorded."""

    coordinates: Literal["table", "machine"] = "table"
    """Whether recorded coordinates are turned back by the angles of the tables, so that what stands on them keeps them, or are
    those of the machine."""
    normals: Literal["table", "machine"] | None = None
    """In which of both frames normals of probed points are recorded, where tables turned."""


class HeadFacts(JobTable):
    """``head``: the head that turns the probe, of a chain such as `XYZ-CA`."""

    stylus_mm: Triple | None = None
    """The tip from the end of the ram with the head at 0, along x, y, z; where columns `tip_x_mm`, `tip_y_mm`, `tip_z_mm` say
    how the head has turned it, only their zero."""
    coordinates: Literal["tip", "carriages"] = "tip"
    """Whether recorded coordinates follow the tip as the head turns it, as a calibrated head gives them, or are those of the
    carriages."""


class RotaryErrorsFile(JobTable):
    """``rotary_errors``: errors of a machine with rotary axes, by which `cmm-uq compensate` corrects it."""

    file: str = required("CSV of the coefficients of each effect, as `compensate --new-map` writes it.")
    covariance: str = required("Factor F of their covariance F·Fᵀ, the `.npy` file beside it.")


def rotary_problems(
    chain: str, rotary: Sequence[RotaryFacts], table: RotaryTableFacts, head: HeadFacts
) -> Iterator[str]:
    """What of the keys does not go together."""
    _, turning, tables = parts_of_chain(chain)
    names = [each.name for each in rotary]
    if head.model_fields_set and not turning:
        yield f"[machine.head] is of a head, which chain = {chain!r} has not: give it behind a hyphen, as XYZ-CA"
    if turning and head.stylus_mm is None:
        yield "a head turns the stylus: say how it stands with the head at 0, head = { stylus_mm = [x, y, z] }"
    for name in sorted({name for name in names if name not in turning + tables or names.count(name) > 1}):
        yield f"[[machine.rotary]] {name} is twice there, or not in chain = {chain!r}: leave it out, or mend the chain"
    if table.model_fields_set and not tables:
        yield f"[machine.table] is of a rotary table, which chain = {chain!r} has not: give it behind a bar, as XYZ|C"
    elif own := sorted(table.model_fields_set & set(RotaryAxisFacts.model_fields)):
        if len(tables) > 1:
            yield f"[machine.table] {own[0]} does not say of which table: give it in [[machine.rotary]], with its name"
        elif tables in names:
            yield f"table {tables} is in [machine.table] and in [[machine.rotary]]: leave {own[0]} or the entry out"
    points: dict[str, list[float] | None] = {each.name: each.axis_mm for each in rotary}
    if table.coordinates == "machine" and any(points.get(name, table.axis_mm) is None for name in tables):
        yield 'coordinates = "machine" are turned back about the table\'s axis: give a point of it, axis_mm = [x, y, z]'
