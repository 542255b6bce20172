"""From indicated to true coordinates by the machine's error maps, and back.

``compensate`` adds e; ``indicated_from_true`` finds the coordinates that the machine would indicate, by iteration: the map
changes by far less than it is displaced, so every round gains three digits or more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.machine.physics.kinematics import Chain, exact, on_leaning_axes
from cmm_uq.machine.physics.map_interpolation import Beyond, ErrorMaps

SETTLED = 1e-10
"""Change of a coordinate, mm, at which the inverse is found."""
MAX_ROUNDS = 50
BLOCK = 8192
"""Points computed at a time: as many as a processor's cache holds with all that is between."""


@dataclass(frozen=True, eq=False)
class Circumstances:
    """What the error of a point depends on beside its coordinates.

    Parameters
    ----------
    tip : (n, 3) or (3,) stylus tip offset from the end of the ram, mm.
    temperatures : of the scales, (n, 3) or (3,), or of all, °C; see :meth:`ErrorMaps.at`.
    lines : (n,) of the points in their file, for messages.
    """

    tip: Floats | None = None
    temperatures: Floats | float | None = None
    lines: Ints | None = None

    def of(self, rows: slice) -> Circumstances:
        """The circumstances of some of the points."""
        tip = self.tip[rows] if self.tip is not None and self.tip.ndim == 2 else self.tip
        each = isinstance(self.temperatures, np.ndarray) and self.temperatures.ndim == 2
        temperatures = np.asarray(self.temperatures)[rows] if each else self.temperatures
        return Circumstances(tip, temperatures, self.lines[rows] if self.lines is not None else None)


NOMINAL = Circumstances()


@dataclass(frozen=True, eq=False)
class Compensation:
    """How the readings of one machine become true coordinates.

    Parameters
    ----------
    maps : its error maps.
    chain : its carriages; see :meth:`cmm_uq.machine.physics.kinematics.Chain.of`.
    origin : (3,) scale reading = coordinate + origin, mm.
    rigid : True for exact rigid transformations; False to first order in displacements and rotations (Harris 2004
        eq. 10–13), on axes that lean exactly.
    beyond : what to do beyond the mapped positions and temperatures.
    """

    maps: ErrorMaps
    chain: str | Chain = "XYZ"
    origin: Floats | tuple[float, float, float] = (0.0, 0.0, 0.0)
    rigid: bool = False
    beyond: Beyond = "refuse"

    def error(self, indicated: Floats, when: Circumstances = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """Error e (n, 3) in mm of indicated coordinates, and which points (n,) were extrapolated.

        Parameters
        ----------
        indicated : (n, 3) mm.
        when : tip, temperatures.

        Raises
        ------
        CmmUqError : a point lies beyond the maps and ``beyond`` is "refuse".
        """
        readings = indicated + np.asarray(self.origin)
        form = exact if self.rigid else on_leaning_axes
        e, extrapolated = np.empty(readings.shape), np.empty(len(readings), dtype=bool)
        for start in range(0, len(readings), BLOCK):
            rows = slice(start, start + BLOCK)
            here, part = when.of(rows), readings[rows]
            found = self.maps.at(part, here.temperatures, beyond=self.beyond, lines=here.lines, first=start + 1)
            e[rows] = form(part, found.errors, found.squareness, tip=here.tip, chain=self.chain)
            extrapolated[rows] = found.extrapolated
        return e, extrapolated

    def compensate(self, indicated: Floats, when: Circumstances = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """True coordinates (n, 3) in mm, and which points (n,) were extrapolated; parameters as :meth:`error`."""
        e, extrapolated = self.error(indicated, when)
        return indicated + e, extrapolated

    def indicated_from_true(self, true: Floats, when: Circumstances = NOMINAL) -> tuple[Floats, NDArray[np.bool_]]:
        """Coordinates (n, 3) in mm that the machine indicates at true coordinates; the inverse of :meth:`compensate`.

        Raises
        ------
        CmmUqError : a point lies beyond the maps and ``beyond`` is "refuse", or the map is too steep to be turned round.
        """
        # on the way a point of the edge may lie outside by its own error; where it ends is what counts
        onward = replace(self, beyond="extrapolate")
        indicated = np.array(true, dtype=np.float64)
        for _ in range(MAX_ROUNDS):
            e, _ = onward.error(indicated, when)
            change = float(np.abs(true - e - indicated).max(initial=0.0))
            indicated = true - e
            if change <= SETTLED:
                _, extrapolated = self.error(indicated, when)
                return indicated, extrapolated
            if not np.isfinite(change):
                break
        raise CmmUqError(
            "no indicated coordinates belong to these true ones",
            fix="Give finite coordinates; if they are, an error in the map is as large as the step between its positions",
        )

    def provenance(self) -> dict[str, object]:
        """What a compensated recording says of how it came about: maps with their SHA-256, squareness, chain, form."""
        return {
            "error_maps": [
                {
                    "file": m.source,
                    "sha256": m.sha256,
                    "temperature_c": m.temperature,
                    "squareness_arcsec": m.squareness_arcsec,
                }
                for m in self.maps.maps
            ],
            "chain": Chain.of(self.chain).letters,
            "origin_mm": [float(o) for o in self.origin],
            "form": "rigid transformations" if self.rigid else "first order on exact axes",
            "sign": "true = indicated + e",
            "beyond_the_maps": "refused" if self.beyond == "refuse" else "extrapolated",
        }


def compensate_points(points: Points, compensation: Compensation) -> Points:
    """A recording at its true coordinates, with tip offsets and temperatures of the scales where it has their columns.

    Points beyond the maps, where they are allowed, are marked by 1 in the column ``extrapolated``.

    Raises
    ------
    CmmUqError : see :meth:`Compensation.error`.
    """
    xyz, extrapolated = compensation.compensate(points.xyz, circumstances(points))
    return _moved(points, xyz, extrapolated)


def machine_compensation(
    points: Points, maps: ErrorMaps, *, rigid: bool = False, beyond: Beyond = "refuse"
) -> Compensation:
    """Compensation of the machine that read the points, after a check that every map covers its travel.

    Raises
    ------
    CmmUqError : a map does not cover the travel.
    """
    for error_map in maps.maps:
        error_map.covers(points.machine)
    return Compensation(maps, points.machine.chain, points.machine.origin_mm, rigid, beyond)


def circumstances(points: Points) -> Circumstances:
    """Tip offsets and temperatures of the scales, where the recording has their columns.

    Raises
    ------
    CmmUqError : a column is there for some axes only.
    """
    return Circumstances(_three(points.columns, "tip_{}_mm"), _three(points.columns, "temp_{}_c"), points.lines)


def _three(columns: Mapping[str, Floats], pattern: str) -> Floats | None:
    """Columns (n, 3) of the three axes, or None where none is recorded."""
    names = [pattern.format(axis) for axis in AXES]
    given = [name for name in names if name in columns]
    if given and len(given) < 3:
        missing = next(name for name in names if name not in columns)
        raise CmmUqError(f"the recording has {given[0]} but not {missing}", fix="Record all three, or none")
    return np.column_stack([columns[name] for name in names]) if given else None


def _moved(points: Points, xyz: Floats, extrapolated: NDArray[np.bool_]) -> Points:
    columns = dict(points.columns)
    if extrapolated.any():
        columns["extrapolated"] = extrapolated.astype(np.float64)
    return replace(points, xyz=xyz, columns=columns)
