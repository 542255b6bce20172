"""Error maps looked up: linear along each axis, and between the two maps whose temperatures enclose the scale's own.

The 21 errors of the two maps are interpolated by temperature, each carriage at the temperature of its scale, squareness at
the mean of the three (Harris 2004 sections 5.6 and 6.4). Beyond the mapped range nothing is known: it is refused, or
extrapolated and marked, as asked.

What an error map leaves uncertain: the covariance of its figures, carried to the points that it corrects.

The figures m of a map have the covariance F·Fᵀ. Between two positions a map is linear, and to first order the error of a point
is linear in what is looked up there, so that at scale readings r

    e = J(r)·W(r)·m,   R = J·W·F,   cov(e₁, e₂) = R₁·R₂ᵀ

(JCGM 102, 6.2). Of a distance along the unit vector d the standard uncertainty is |(R₂ − R₁)ᵀ·d|: what two points share, as
where the map as a whole is displaced, is not in it. Errors that no map holds, as of a scale whose period is shorter than the
steps of the map, are of each point by itself.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.error_map import UNITS, AxisErrors, ErrorMap
from cmm_uq.machine.physics.kinematics import KinematicChain, jacobian

Beyond = Literal["refuse", "extrapolate"]
POSITION_MARGIN = 1e-6  # A position this far beyond the map, mm, is on its edge: it comes from rounding
TEMPERATURE_MARGIN = 1.0  # up to this far beyond the calibrated temperatures, K, the nearest map holds as it is


@dataclass(frozen=True, eq=False)
class LookedUp:
    errors: Floats  # (n, 3, 6) of carriages x, y, z, mm and rad
    squareness: Floats  # (3,) or (n, 3), rad
    extrapolated: NDArray[np.bool_]  # (n,) whether a point lies beyond the mapped positions or temperatures


@dataclass(frozen=True, eq=False)
class _Stack:
    """Errors of one carriage in every map, on common positions."""

    positions: Floats
    values: Floats  # (6, k, m) in k maps
    step: float  # Of equal positions, mm; 0 where they are not equal

    def place(self, readings: Floats) -> tuple[Ints, Floats]:
        """Interval (n,) of each reading, and how far along it (n,) the reading is; below 0 or above 1 only outside."""
        last = len(self.positions) - 2
        if self.step:
            along = (readings - self.positions[0]) * (1 / self.step)
            interval = np.clip(along, 0, last).astype(np.intp)
            along -= interval
            return interval, along
        interval = np.clip(np.searchsorted(self.positions, readings, side="right") - 1, 0, last)
        left = self.positions[interval]
        return interval, (readings - left) / (self.positions[interval + 1] - left)

    def at(self, readings: Floats, lower: Ints | int, weight: Floats | float, out: Floats) -> None:
        """Errors (6, n) at readings (n,), between map ``lower`` and the next one."""
        interval, along = self.place(readings)
        count = len(self.positions)
        if isinstance(lower, int):
            for row, tables in zip(out, self.values, strict=True):
                table = tables[lower] + weight * (tables[lower + 1] - tables[lower]) if weight else tables[lower]
                np.add(table.take(interval), along * np.diff(table).take(interval), out=row)
            return
        # the tables of all maps one behind another: four corners, between positions and between maps
        cold = lower * count + interval
        hot, cold_next, hot_next = cold + count, cold + 1, cold + count + 1
        for row, tables in zip(out, self.values, strict=True):
            table = tables.ravel()
            low, high = table.take(cold), table.take(hot)
            low += along * (table.take(cold_next) - low)
            high += along * (table.take(hot_next) - high)
            high -= low
            high *= weight
            np.add(low, high, out=row)


class ErrorMaps:
    """The error maps of one machine, one for each temperature.

    Their axes may have different positions, and the range they share counts.
    """

    def __init__(self, maps: Sequence[ErrorMap]) -> None:
        if not maps:
            raise CmmUqError("no error map", fix="Give one or more under [machine] error_map")
        self.maps = tuple(sorted(maps, key=lambda m: m.temperature))
        self.temperatures = np.array([m.temperature for m in self.maps])
        if np.any(np.diff(self.temperatures) == 0):
            same = self.temperatures[np.flatnonzero(np.diff(self.temperatures) == 0)[0]]
            where = "job.toml [machine] error_map"
            raise CmmUqError(f"two error maps at {same:g} °C", where=where, fix="Remove one of them")
        self.squareness = np.array([m.squareness for m in self.maps])
        self._axes = tuple(self._stack(i) for i in range(3))

    def span(self, axis: str) -> tuple[float, float]:
        positions = self._axes[AXES.index(axis)].positions
        return float(positions[0]), float(positions[-1])

    def at(
        self, readings: Floats, temperatures: Floats | float | None = None, *, beyond: Beyond = "refuse",
        lines: Ints | None = None, first: int = 1,
    ) -> LookedUp:  # fmt: skip
        """Errors of every carriage at scale readings (n, 3), mm.

        ``temperatures``: of the three scales, (n, 3) or (3,), or of all, °C; one map needs none. ``beyond``: what to do
        beyond the mapped positions and temperatures. ``lines``, ``first``: (n,) of the points in their file, and number of
        the first point where there are no lines, for messages.
        """
        outside = self._outside(readings)
        if beyond == "refuse" and outside.any():
            row, axis = np.argwhere(outside)[0]
            low, high = self.span(AXES[axis])
            reads = f"{AXES[axis]} reads {readings[row, axis]:.6g} mm"
            raise CmmUqError(f"{reads}, the error map reaches from {low:g} to {high:g} mm", where=_point(row, lines, first),
                             fix="Check origin_mm and the map's range, or allow it to be extrapolated")  # fmt: skip
        weights, hot = self._weights(temperatures, len(readings))
        if beyond == "refuse" and hot.any():
            self._refuse_temperature(temperatures, hot, lines, first)
        errors = np.empty((3, 6, len(readings)))
        for i, stack in enumerate(self._axes):
            lower, weight = weights[i]
            stack.at(np.ascontiguousarray(readings[:, i]), lower, weight, errors[i])
        return LookedUp(errors.transpose(2, 0, 1), self._squareness(*weights[3]), outside.any(axis=1) | hot)

    def map_at(self, temperature: float, *, beyond: Beyond = "refuse") -> ErrorMap:
        """The map that all scales at one temperature are looked up in, °C, at the positions of all maps."""
        low, high = self.temperatures[0], self.temperatures[-1]
        near = low - TEMPERATURE_MARGIN <= temperature <= high + TEMPERATURE_MARGIN
        if not near and (beyond == "refuse" or not np.isfinite(temperature)):
            problem = f"no error map at {temperature:g} °C: the error maps are from {low:g} to {high:g} °C"
            fix = "Ask for a temperature between them, add a map, or allow it to be extrapolated"
            raise CmmUqError(problem, fix=fix)
        lower, weight = self._between(np.asarray(temperature, dtype=np.float64))
        upper = min(int(lower) + 1, len(self.maps) - 1)
        x, y, z = (
            AxisErrors(s.positions, (s.values[:, lower] + weight * (s.values[:, upper] - s.values[:, lower])).T)
            for s in self._axes
        )
        return ErrorMap((x, y, z), self._squareness(lower, weight), float(temperature))

    def _squareness(self, lower: Ints | int, weight: Floats | float) -> Floats:
        """Between map ``lower`` and the next one, (3,) or (n, 3)."""
        upper = np.minimum(np.asarray(lower) + 1, len(self.maps) - 1)
        share = np.asarray(weight)[..., None]
        return np.asarray((1 - share) * self.squareness[lower] + share * self.squareness[upper])

    def _stack(self, axis: int) -> _Stack:
        carriages = [m.axes[axis] for m in self.maps]
        low, high = max(c.span[0] for c in carriages), min(c.span[1] for c in carriages)
        positions = np.unique(np.concatenate([c.positions for c in carriages]))
        positions = positions[(positions >= low) & (positions <= high)]
        if len(positions) < 2:
            fix = "Map the same travel at each temperature"
            raise CmmUqError(f"the error maps share no range of axis {AXES[axis]}", fix=fix)
        values = np.array([[np.interp(positions, c.positions, column) for column in c.errors.T] for c in carriages])
        steps = np.diff(positions)
        equal = bool(np.allclose(steps, steps[0], rtol=1e-12))
        return _Stack(positions, np.ascontiguousarray(values.swapaxes(0, 1)), float(steps[0]) if equal else 0.0)

    def _outside(self, readings: Floats) -> NDArray[np.bool_]:
        low, high = np.array([self.span(axis) for axis in AXES]).T
        # written so that what is no number counts as outside
        inside = (readings >= low - POSITION_MARGIN) & (readings <= high + POSITION_MARGIN)
        return np.asarray(~inside)

    def _weights(
        self, temperatures: Floats | float | None, n: int
    ) -> tuple[list[tuple[Ints | int, Floats | float]], NDArray[np.bool_]]:
        """Lower map and weight of the next one for carriages x, y, z and squareness; which points are too hot or cold."""
        if temperatures is None:
            if len(self.maps) > 1:
                raise CmmUqError(
                    f"the error maps are at {len(self.maps)} temperatures, and the scales' temperatures are not known",
                    fix="Record temp_x_c, temp_y_c and temp_z_c, or give a temperature log, or one map",
                )
            return [(0, 0.0)] * 4, np.zeros(n, dtype=bool)
        given = np.asarray(temperatures, dtype=np.float64)
        low, high = self.temperatures[0] - TEMPERATURE_MARGIN, self.temperatures[-1] + TEMPERATURE_MARGIN
        far = ~((given >= low) & (given <= high))
        hot = np.broadcast_to(far.any(axis=-1) if given.ndim else far, (n,))
        scales = [given if given.ndim == 0 else given[..., i] for i in range(3)]
        return [self._between(t) for t in (*scales, given if given.ndim == 0 else given.mean(axis=-1))], hot

    def _between(self, temperature: Floats) -> tuple[Ints | int, Floats | float]:
        if len(self.maps) == 1:
            return 0, 0.0
        known = self.temperatures
        # within the margin the nearest map holds, beyond it the two outermost go on
        near = (temperature > known[0] - TEMPERATURE_MARGIN) & (temperature < known[-1] + TEMPERATURE_MARGIN)
        held = np.where(near, np.clip(temperature, known[0], known[-1]), temperature)
        lower = np.clip(np.searchsorted(known, held, side="right") - 1, 0, len(known) - 2)
        weight = (held - known[lower]) / (known[lower + 1] - known[lower])
        return (int(lower), float(weight)) if np.ndim(temperature) == 0 else (lower, weight)

    def _refuse_temperature(
        self, temperatures: Floats | float | None, hot: NDArray[np.bool_], lines: Ints | None, first: int
    ) -> None:
        row = int(np.flatnonzero(hot)[0])
        all_given = np.asarray(temperatures, dtype=np.float64)
        given = np.broadcast_to(all_given, (len(hot), *all_given.shape[-1:]))[row]
        raise CmmUqError(
            f"a scale is at {np.round(given, 3)} °C, the error maps are from {self.temperatures[0]:g} to "
            f"{self.temperatures[-1]:g} °C",
            where=_point(row, lines, first),
            fix="Measure within those temperatures, add a map, or allow it to be extrapolated",
        )


def _point(row: int, lines: Ints | None, first: int) -> str:
    return f"line {lines[row]}" if lines is not None and len(lines) else f"point {row + first}"


_BLOCK = 1024  # points looked up at a time
Figures = dict[str, float]
_WIDEST = 2000  # columns of a factor: no covariance of a map has more that matter


@dataclass(frozen=True, eq=False)
class MapCovariance:
    factor: Floats  # (m, r), mm and rad; rows: the six errors at each position of x, of y, of z, then Sxy, Syz, Szx
    beside: Floats  # (3,) standard uncertainty along each axis, mm, of what no map holds

    def root(
        self, error_map: ErrorMap, readings: Floats, *, tip: Floats | None = None, chain: str | KinematicChain = "XYZ"
    ) -> Floats:
        """R (n, 3, r), mm, at scale readings (n, 3), mm; ``tip``, ``chain``: see :func:`kinematics.carried_offset`."""
        derivative, start = jacobian(readings, tip=tip, chain=chain), 0
        found = derivative[:, :, 18:] @ self.factor[-3:]
        for i, carriage in enumerate(error_map.axes):
            count = len(carriage.positions)
            table = self.factor[start : start + 6 * count].reshape(count, 6, -1)
            start += 6 * count
            left = np.clip(np.searchsorted(carriage.positions, readings[:, i], side="right") - 1, 0, count - 2)
            ends = carriage.positions[left], carriage.positions[left + 1]
            along = ((readings[:, i] - ends[0]) / (ends[1] - ends[0]))[:, None, None]
            here = table[left] + along * (table[left + 1] - table[left])
            found += derivative[:, :, 6 * i : 6 * i + 6] @ here
        return np.asarray(found)

    def standard_uncertainty(
        self, error_map: ErrorMap, readings: Floats, *, tip: Floats | None = None, chain: str | KinematicChain = "XYZ"
    ) -> Floats:
        """(n, 3), mm, of each coordinate; parameters as :meth:`root`."""
        u = np.empty(readings.shape)
        for start in range(0, len(readings), _BLOCK):
            rows = slice(start, start + _BLOCK)
            of = None if tip is None else np.broadcast_to(tip, readings.shape)[rows]
            root = self.root(error_map, readings[rows], tip=of, chain=chain)
            u[rows] = np.sqrt(np.einsum("nar,nar->na", root, root) + self.beside**2)
        return u

    def of_distances(self, root: Floats, xyz: Floats, pairs: tuple[Ints, Ints]) -> Floats:
        """As :func:`of_distances`, by R (n, 3, r)."""
        return of_distances(root, np.broadcast_to(np.diag(self.beside), (len(xyz), 3, 3)), xyz, pairs)


def of_distances(root: Floats, beside: Floats, xyz: Floats, pairs: tuple[Ints, Ints]) -> Floats:
    """Standard uncertainty (p,), mm, of distances between points (n, 3), mm, of which p pairs of rows are given.

    ``root``: R (n, 3, r) of what all points share, R·Rᵀ its covariance; ``beside``: (n, 3, b) the same of each point alone.
    """
    first, second = pairs
    apart = xyz[second] - xyz[first]
    d = apart / np.linalg.norm(apart, axis=1, keepdims=True)
    common = np.einsum("pa,par->pr", d, root[second] - root[first])
    alone = sum(np.sum(np.einsum("pa,pab->pb", d, beside[end]) ** 2, axis=1) for end in pairs)
    return np.asarray(np.sqrt(np.sum(common**2, axis=1) + alone))


def figure_units(error_map: ErrorMap) -> Floats:
    """(m,) unit of each figure of a map as it stands in files, in mm and rad."""
    positions = sum(len(carriage.positions) for carriage in error_map.axes)
    return np.concatenate([np.tile(UNITS, positions), np.full(3, ARCSECOND)])


def covariance_file(covariance: MapCovariance, error_map: ErrorMap) -> bytes:
    """Content of an ``.npy`` file of the factor, µm and ″."""
    return factor_file(covariance.factor / figure_units(error_map)[:, None])


def factor_file(factor: Floats) -> bytes:
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(factor), allow_pickle=False)
    return file.getvalue()


def parse_covariance(content: bytes, where: str, error_map: ErrorMap, beside: Floats) -> MapCovariance:
    """The covariance of a map, of the content of a file as :func:`covariance_file` writes it; ``beside``: (3,) mm."""
    units, name = figure_units(error_map), f"the map {error_map.source}"
    factor = factor_of(content, where, len(units), f"{name} has {len(units)} figures with its squareness", "map")
    return MapCovariance(factor * units[:, None], beside)


def factor_of(content: bytes, where: str, rows: int, whose: str, of: str) -> Floats:
    """(rows, r) of an ``.npy`` file that holds the factor of a covariance."""
    fix = f"Give the factor F of the covariance F·Fᵀ as an .npy file of 64-bit floats, (figures of the {of}, columns)"
    file = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        if version != (1, 0):
            raise ValueError(f"version {version} of the format")
        shape, fortran, kind = np.lib.format.read_array_header_1_0(file)
    except (ValueError, EOFError, SyntaxError, TypeError, RecursionError, MemoryError) as error:
        raise CmmUqError("is no .npy file", where=where, fix=fix) from error
    values = memoryview(content)[file.tell() :]
    if kind != np.dtype("<f8") or fortran or len(shape) != 2:
        raise CmmUqError(f"holds an array {shape} of {kind}, not rows of 64-bit floats", where=where, fix=fix)
    if shape[0] != rows:
        problem = f"has {shape[0]} rows, {whose}"
        raise CmmUqError(problem, where=where, fix=f"Name the {of} that the covariance was written with")
    if not 1 <= shape[1] <= _WIDEST or len(values) != 8 * rows * shape[1]:
        problem = f"{len(values)} bytes hold no {rows} × {shape[1]} numbers"
        raise CmmUqError(problem, where=where, fix=f"Write the file again; a factor has 1 to {_WIDEST} columns")
    factor = np.frombuffer(values, dtype="<f8").reshape(shape)
    if not np.isfinite(factor).all():
        row, column = np.argwhere(~np.isfinite(factor))[0]
        raise CmmUqError(
            f"row {row + 1}, column {column + 1} is no finite number", where=where, fix="Write the file again"
        )
    return factor


def uncertain_map(maps: Sequence[ErrorMap]) -> tuple[ErrorMap, MapCovariance] | None:
    """The map that corrects a machine, and its covariance, where it is stated."""
    first = maps[0]
    return None if first.covariance is None else (first, first.covariance)


class SampledPoints:
    """Some of the corrected points, evenly through however many there are, and how uncertain distances between them are."""

    def __init__(self, most: int) -> None:
        self._most, self._every, self._seen = most, 1, 0
        self._rows: list[Floats] = []

    def add(self, readings: Floats, xyz: Floats, tip: Floats | None = None) -> None:
        """Points (n, 3), mm, where the scales stood and where they are; ``tip``: see :func:`kinematics.carried_offset`."""
        self.keep(np.hstack([readings, xyz, np.broadcast_to(np.zeros(3) if tip is None else tip, xyz.shape)]))

    def keep(self, rows: Floats) -> None:
        """Some of rows (n, k) that say all of a point each."""
        self._rows += list(rows[-self._seen % self._every :: self._every])
        self._seen += len(rows)
        while len(self._rows) > self._most:
            self._rows, self._every = self._rows[::2], 2 * self._every

    @property
    def kept(self) -> Floats:
        return np.array(self._rows)

    def distances(self, error_map: ErrorMap, covariance: MapCovariance, chain: str | KinematicChain) -> list[Figures]:
        """Standard uncertainty, µm, of distances between them; see :func:`uncertain_distances`."""
        if len(self._rows) < 2:
            return []
        readings, xyz, tip = np.hsplit(self.kept, 3)
        root = covariance.root(error_map, readings, tip=tip, chain=chain)
        return uncertain_distances(root, np.broadcast_to(np.diag(covariance.beside), (len(xyz), 3, 3)), xyz)


def uncertain_distances(root: Floats, beside: Floats, xyz: Floats) -> list[Figures]:
    """Standard uncertainty, µm, of distances between points, for eighths of their pairs from the shortest on.

    Parameters as :func:`of_distances`.
    """
    first, second = np.triu_indices(len(xyz), 1)
    lengths = np.linalg.norm(xyz[second] - xyz[first], axis=1)
    apart = lengths > 0
    first, second, lengths = first[apart], second[apart], lengths[apart]
    found = []
    for part in np.array_split(np.argsort(lengths, kind="stable"), min(8, len(lengths)) or 1):
        if not len(part):
            continue
        u = of_distances(root, beside, xyz, (first[part], second[part])) / MICROMETRE
        of = {"up_to_mm": lengths[part[-1]], "u_um": np.median(u), "largest_u_um": u.max()}
        found.append({name: float(f"{value:.4g}") for name, value in of.items()})
    return found
