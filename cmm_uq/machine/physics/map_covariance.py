"""What an error map leaves uncertain: the covariance of its figures, carried to the points that it corrects.

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
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.machine.physics.error_map import UNITS, ErrorMap
from cmm_uq.machine.physics.kinematics import KinematicChain, jacobian

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
        """Standard uncertainty (p,), mm, of distances between points (n, 3), mm, by R (n, 3, r) and p pairs of their rows."""
        first, second = pairs
        apart = xyz[second] - xyz[first]
        d = apart / np.linalg.norm(apart, axis=1, keepdims=True)
        common = np.einsum("pa,par->pr", d, root[second] - root[first])
        return np.asarray(np.sqrt(np.sum(common**2, axis=1) + 2 * np.sum((d * self.beside) ** 2, axis=1)))


def figure_units(error_map: ErrorMap) -> Floats:
    """(m,) unit of each figure of a map as it stands in files, in mm and rad."""
    positions = sum(len(carriage.positions) for carriage in error_map.axes)
    return np.concatenate([np.tile(UNITS, positions), np.full(3, ARCSECOND)])


def covariance_file(covariance: MapCovariance, error_map: ErrorMap) -> bytes:
    """Content of an ``.npy`` file of the factor, µm and ″."""
    file = io.BytesIO()
    np.save(file, covariance.factor / figure_units(error_map)[:, None], allow_pickle=False)
    return file.getvalue()


def parse_covariance(content: bytes, where: str, error_map: ErrorMap, beside: Floats) -> MapCovariance:
    """The covariance of a map, of the content of a file as :func:`covariance_file` writes it; ``beside``: (3,) mm."""
    units = figure_units(error_map)
    rows = len(units)
    fix = "Give the factor F of the covariance F·Fᵀ as an .npy file of 64-bit floats, (figures of the map, columns), µm and ″"
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
        problem = f"has {shape[0]} rows, the map {error_map.source} has {rows} figures with its squareness"
        raise CmmUqError(problem, where=where, fix="Name the map that the covariance was written with")
    if not 1 <= shape[1] <= _WIDEST or len(values) != 8 * rows * shape[1]:
        problem = f"{len(values)} bytes hold no {rows} × {shape[1]} numbers"
        raise CmmUqError(problem, where=where, fix=f"Write the file again; a factor has 1 to {_WIDEST} columns")
    factor = np.frombuffer(values, dtype="<f8").reshape(shape)
    if not np.isfinite(factor).all():
        row, column = np.argwhere(~np.isfinite(factor))[0]
        raise CmmUqError(
            f"row {row + 1}, column {column + 1} is no finite number", where=where, fix="Write the file again"
        )
    return MapCovariance(factor * units[:, None], beside)


def uncertain_map(maps: Sequence[ErrorMap]) -> tuple[ErrorMap, MapCovariance] | None:
    """The map that corrects a machine, and its covariance, where it is stated."""
    first = maps[0]
    return None if first.covariance is None else (first, first.covariance)


class SampledPoints:
    """Some of the corrected points, evenly through however many there are, and how uncertain distances between them are."""

    def __init__(self, most: int) -> None:
        self._most, self._every, self._seen = most, 1, 0
        self._rows: list[Floats] = []  # readings, coordinates and tip of each that is kept, (9,)

    def add(self, readings: Floats, xyz: Floats, tip: Floats | None = None) -> None:
        """Points (n, 3), mm, where the scales stood and where they are; ``tip``: see :func:`kinematics.carried_offset`."""
        tips = np.broadcast_to(np.zeros(3) if tip is None else tip, xyz.shape)
        for i in range(-self._seen % self._every, len(xyz), self._every):
            self._rows.append(np.concatenate([readings[i], xyz[i], tips[i]]))
        self._seen += len(xyz)
        while len(self._rows) > self._most:
            self._rows, self._every = self._rows[::2], 2 * self._every

    def distances(self, error_map: ErrorMap, covariance: MapCovariance, chain: str | KinematicChain) -> list[Figures]:
        """Standard uncertainty, µm, of distances between them, for eighths of their pairs from the shortest on."""
        if len(self._rows) < 2:
            return []
        readings, xyz, tip = np.hsplit(np.array(self._rows), 3)
        first, second = np.triu_indices(len(xyz), 1)
        lengths = np.linalg.norm(xyz[second] - xyz[first], axis=1)
        apart = lengths > 0
        first, second, lengths = first[apart], second[apart], lengths[apart]
        root = covariance.root(error_map, readings, tip=tip, chain=chain)
        found = []
        for part in np.array_split(np.argsort(lengths, kind="stable"), min(8, len(lengths))):
            u = covariance.of_distances(root, xyz, (first[part], second[part])) / MICROMETRE
            of = {"up_to_mm": lengths[part[-1]], "u_um": np.median(u), "largest_u_um": u.max()}
            found.append({name: float(f"{value:.4g}") for name, value in of.items()})
        return found
