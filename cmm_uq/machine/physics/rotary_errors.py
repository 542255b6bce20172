"""Errors of a machine with rotary axes as a calibration found them, with their covariance: what corrects such a machine.

They are coefficients c of effects that follow from where the axes stand: true = indicated + B·c, B along the axes of the
coordinates. With F·Fᵀ the covariance of c, u of a corrected coordinate is the length of its row of B·F.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import csv_table
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.map_interpolation import factor_of
from cmm_uq.machine.physics.superposition import Superposition

HEADER = ("effect", "coefficient", "value", "u")
_BLOCK = 1024  # points computed at a time
_WRITE_AGAIN = "Write the file again: cmm-uq compensate --new-map"


@dataclass(frozen=True, eq=False)
class RotaryErrors:
    effects: tuple[Effect, ...]
    values: Floats  # (k,) of their coefficients, in the units of these
    factor: Floats  # (k, r)
    source: str = ""  # file that they were read from
    sha256: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the recording, or of the cloud, by which they go."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect.columns))

    def errors(self, points: Points) -> Floats:
        """(n, 3) true less indicated, mm, along the axes of the coordinates."""
        return points.on_artefact(self._acting.errors(points, self.values)[:, :, None])[:, :, 0]

    def root(self, points: Points) -> Floats:
        """B·F (n, 3, r), mm, along the axes of the coordinates."""
        change = self._acting.derivatives(self._acting.about(points, self.values))
        return np.asarray(points.on_artefact(change @ self.factor))

    def standard_uncertainty(self, points: Points) -> Floats:
        """(n, 3), mm, of each corrected coordinate."""
        parts = (self.root(points.select(rows)) for rows in blocks(len(points)))
        return np.concatenate([np.zeros((0, 3)), *(np.linalg.norm(part, axis=2) for part in parts)])

    def csv(self) -> str:
        u, rows = np.linalg.norm(self.factor, axis=1), [",".join(HEADER)]
        named = [(effect.name, one.name) for effect in self.effects for one in effect.coefficients]
        for (effect, name), value, own in zip(named, self.values.tolist(), u.tolist(), strict=True):
            rows.append(f"{effect},{name},{value!r},{own:.6g}")
        return "\n".join(rows) + "\n"

    @property
    def _acting(self) -> Superposition:
        return Superposition(self.effects)


def blocks(count: int) -> Iterator[Ints]:
    for start in range(0, count, _BLOCK):
        yield np.arange(start, min(start + _BLOCK, count))


def parse_rotary_errors(content: bytes, factor: bytes, where: str, at: str, source: str) -> RotaryErrors:
    """Of the contents of two files as ``compensate --new-map`` writes them; ``where``, ``at``: of each, for messages."""
    table = csv_table(content, where, HEADER)
    names, coefficients = table.texts("effect"), table.texts("coefficient")
    found = effects(list(dict.fromkeys(names)), where=where)
    if shaped := next((effect.name for effect in found if effect.shape or not of_axes(effect)), None):
        raise CmmUqError(f"{shaped} is no error that such a file corrects", where=where, fix=_WRITE_AGAIN)
    asked = [(effect.name, one.name) for effect in found for one in effect.coefficients]
    given = list(zip(names, coefficients, strict=True))
    if asked != given:
        row = next((i for i, (a, b) in enumerate(zip(asked, given, strict=False)) if a != b), len(given) - 1)
        problem = f"the coefficients of {given[row][0]} are not all there in their order"
        raise CmmUqError(problem, where=table.at(row), fix=_WRITE_AGAIN)
    values = table.numbers("value")
    whose = f"the file {source} has {len(values)} coefficients"
    root = factor_of(factor, at, len(values), whose, "file of errors")
    return RotaryErrors(found, values, root, source, hashlib.sha256(content).hexdigest())


def of_axes(effect: Effect) -> bool:
    """Whether an effect is an error of carriages or rotary axes, and not of an artefact or of the probe."""
    return effect.mechanism not in ("artefact", "probe") and not effect.of_artefact
