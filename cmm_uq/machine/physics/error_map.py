"""Error maps: the six errors of each carriage, tabulated along its travel at one temperature.

Inside, displacements are mm and rotations rad, true = indicated + e. Files carry µm and arc seconds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.csv_table import CsvTable, csv_table
from cmm_uq.base.files.limits import MAP_BYTES, MAP_ROWS
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE

COLUMNS = ("dx_um", "dy_um", "dz_um", "rx_arcsec", "ry_arcsec", "rz_arcsec")
UNITS = np.array([MICROMETRE] * 3 + [ARCSECOND] * 3)
"""Unit of each column, in mm and rad."""

FINE_UM, STEP_UM = 0.5, 0.01
"""A map with no displacement above the one and some below the other was not written in µm."""


@dataclass(frozen=True, eq=False)
class AxisErrors:
    """Errors of one carriage.

    Parameters
    ----------
    positions : (m,) scale readings, mm, increasing.
    errors : (m, 6) displacements along x, y, z in mm and rotations about x, y, z in rad.
    """

    positions: Floats
    errors: Floats

    @property
    def span(self) -> tuple[float, float]:
        """First and last position, mm."""
        return float(self.positions[0]), float(self.positions[-1])


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """Errors of carriages x, y, z, and the squareness of the axes, at one temperature.

    Parameters
    ----------
    axes : carriages x, y, z.
    squareness : (3,) Sxy, Syz, Szx, rad.
    temperature : at which it was taken, °C.
    source : where it comes from.
    sha256 : of the file, where it comes from one.
    """

    axes: tuple[AxisErrors, AxisErrors, AxisErrors]
    squareness: Floats = field(default_factory=lambda: np.zeros(3))
    temperature: float = 20.0
    source: str = ""
    sha256: str = ""

    def with_squareness_arcsec(self, xy: float, yz: float, zx: float) -> ErrorMap:
        """The map with squareness errors in ″, in the project's sign: e_x = −Sxy·y, e_y = −Syz·z, e_x = −Szx·z."""
        return replace(self, squareness=ARCSECOND * np.array([xy, yz, zx]))

    @property
    def squareness_arcsec(self) -> dict[str, float]:
        """Sxy, Syz, Szx in ″ by their pair of axes, as they were stated."""
        return {
            pair: round(float(s) / ARCSECOND, 9) for pair, s in zip(("xy", "yz", "zx"), self.squareness, strict=True)
        }

    def covers(self, machine: Machine) -> None:
        """Check that the map reaches over the machine's travel.

        Raises
        ------
        CmmUqError : it does not, where the machine's travel is known.
        """
        for axis, carriage in zip(AXES, self.axes, strict=True):
            low, high = machine.travel_mm[AXES.index(axis)]
            first, last = carriage.span
            if first > low or last < high:
                raise CmmUqError(
                    f"axis {axis} is mapped from {first:g} to {last:g} mm, the travel is {low:g} to {high:g} mm",
                    where=self.source or None,
                    fix=_travel_advice(last - first, high - low),
                )


def read_error_map(path: Path, *, temperature: float = 20.0, units_checked: bool = True) -> ErrorMap:
    """Error map from a CSV file; see :func:`parse_error_map`."""
    content = content_of(path, MAP_BYTES, "Check the name of the map")
    return parse_error_map(content, str(path), temperature=temperature, units_checked=units_checked)


def parse_error_map(content: bytes, where: str, *, temperature: float = 20.0, units_checked: bool = True) -> ErrorMap:
    """Error map from the content of a CSV file with ``axis, position_mm`` and :data:`COLUMNS`.

    Parameters
    ----------
    content : of the file, UTF-8.
    where : its name, for messages.
    temperature : at which the map was taken, °C.
    units_checked : refuse numbers that cannot be µm and arc seconds.

    Raises
    ------
    CmmUqError : what is wrong, with its line.
    """
    table = csv_table(content, where, ("axis", "position_mm", *COLUMNS), most_rows=MAP_ROWS)
    unknown = [name for name in table.header if name not in ("axis", "position_mm", *COLUMNS)]
    if unknown:
        raise CmmUqError(
            f"unknown column {unknown[0]!r}", where=where, fix=f"Known: axis, position_mm, {', '.join(COLUMNS)}"
        )
    rows_of: dict[str, list[int]] = {axis: [] for axis in AXES}
    for row in range(len(table.rows)):
        axis = table.rows[row][table.header.index("axis")].lower()
        if axis not in rows_of:
            raise CmmUqError(f"axis {axis!r}", where=table.at(row), fix="The moving carriage is x, y or z")
        rows_of[axis].append(row)
    carriages = []
    for axis, rows in rows_of.items():
        positions = [table.number(row, "position_mm") for row in rows]
        check_positions(axis, positions, [table.at(row) for row in rows], where)
        carriages.append(_carriage(table, rows, positions))
    if units_checked:
        check_units(carriages, where)
    x, y, z = carriages
    return ErrorMap((x, y, z), temperature=temperature, source=where, sha256=hashlib.sha256(content).hexdigest())


def write_error_map(error_map: ErrorMap, path: Path) -> None:
    """Write the carriages' errors as CSV; squareness and temperature belong to the job that names the file."""
    lines = [",".join(("axis", "position_mm", *COLUMNS))]
    for axis, carriage in zip(AXES, error_map.axes, strict=True):
        for position, errors in zip(carriage.positions, carriage.errors / UNITS, strict=True):
            lines.append(",".join([axis, f"{position:.12g}", *(f"{value:.12g}" for value in errors)]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def check_positions(axis: str, positions: Sequence[float], places: Sequence[str], where: str) -> None:
    """Refuse positions that are too few, unsorted or there twice.

    Parameters
    ----------
    places : file and line of each position.

    Raises
    ------
    CmmUqError : with the place of the first that is wrong.
    """
    if len(positions) < 2:
        raise CmmUqError(f"axis {axis} has {len(positions)} positions", where=where, fix="An axis needs two or more")
    seen = set(positions[:1])
    for i in range(1, len(positions)):
        if positions[i] in seen:
            raise CmmUqError(
                f"axis {axis}: position {positions[i]:g} mm is there twice", where=places[i], fix="Remove one"
            )
        if positions[i] < positions[i - 1]:
            raise CmmUqError(
                f"axis {axis}: position {positions[i]:g} mm comes after {positions[i - 1]:g} mm",
                where=places[i],
                fix="Sort the positions of each axis, lowest first",
            )
        seen.add(positions[i])


def check_units(carriages: Sequence[AxisErrors], where: str) -> None:
    """Refuse a map whose numbers cannot be µm and arc seconds: a thousand times too small, or far too large.

    Raises
    ------
    CmmUqError : they cannot, and which unit they seem to have.
    """
    displacements = np.abs(np.concatenate([c.errors[:, :3].ravel() for c in carriages])) / MICROMETRE
    rotations = np.abs(np.concatenate([c.errors[:, 3:].ravel() for c in carriages])) / ARCSECOND
    fix = "Convert displacements to µm and rotations to arc seconds"
    if 0 < displacements.max() < FINE_UM and displacements[displacements > 0].min() < STEP_UM:
        raise CmmUqError(
            f"the largest displacement is {displacements.max():.3g} µm: the map seems to be in mm, 1000 times off",
            where=where,
            fix=fix,
        )
    if displacements.max() > 20_000:
        raise CmmUqError(f"a displacement of {displacements.max():.3g} µm: the map is not in µm", where=where, fix=fix)
    if 0 < rotations.max() < 1e-3:
        raise CmmUqError(
            f"the largest rotation is {rotations.max():.3g}″: the map seems to be in rad or mm/m", where=where, fix=fix
        )
    if rotations.max() > 3600:
        raise CmmUqError(f"a rotation of {rotations.max():.3g}″: the map is not in arc seconds", where=where, fix=fix)


def _carriage(table: CsvTable, rows: Sequence[int], positions: Sequence[float]) -> AxisErrors:
    values = np.array([[table.number(row, column) for column in COLUMNS] for row in rows])
    return AxisErrors(np.array(positions), values * UNITS)


def _travel_advice(mapped: float, travel: float) -> str:
    for factor, unit in ((1e-3, "m"), (1e3, "µm"), (1 / 25.4, "inches")):
        if abs(mapped / travel / factor - 1) < 0.2:
            return f"The positions seem to be in {unit}: convert them to mm"
    return "Map the whole travel, or give the travel that is used"
