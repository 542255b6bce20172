"""Error maps of one machine side by side: each error of each carriage in every map, and what is odd among their figures.

A figure that stands in several maps was measured once; it says nothing of how the maps differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.messages import Text, Verbatim, commas, listed, number, say
from cmm_uq.physics.error_map import COLUMNS, ErrorMap
from cmm_uq.points import AXES, Floats
from cmm_uq.screening.finding import Finding
from cmm_uq.units import ARCSECOND, METRE, MICROMETRE, Unit, unit

LEAST_POSITIONS = 4
"""Positions that the maps of a column must share."""

_STRAY = 8.0
"""Of its robust standard deviations, by which a reading off its neighbours is an outlier."""

_MOST_STRAY = 0.1
_FINEST = 0.3
"""Part of the last digit that no reading is better than."""

_LAST_DIGIT = 1e-9
"""mm."""

_TURNED = 0.3
"""Part of the misfit that is left when a column with the wrong sign is turned."""


@dataclass(frozen=True, eq=False)
class MapColumn:
    """One error of one carriage in k maps, at the p positions that they share.

    Parameters
    ----------
    axis : the carriage.
    component : 0 … 5: displacements along x, y, z, rotations about x, y, z.
    positions : (p,) mm.
    values : (k, p) mm; of rotations the displacement at a lever of one metre.
    temperatures : (k,) °C.
    """

    axis: str
    component: int
    positions: Floats
    values: Floats
    temperatures: Floats

    @property
    def title(self) -> Text:
        """In words."""
        return title_of(self.axis, self.component)

    @property
    def is_scale(self) -> bool:
        """Whether it is the displacement along the carriage's own axis."""
        return AXES[self.component % 3] == self.axis and self.component < 3

    @property
    def is_straightness(self) -> bool:
        """Whether it is a displacement across: measured against a straight line, whose direction is not known."""
        return self.component < 3 and not self.is_scale

    @property
    def unit(self) -> tuple[Unit, float]:
        """Unit as printed, and its size in ``values``."""
        return (unit("µm"), MICROMETRE) if self.component < 3 else (unit("″"), ARCSECOND * METRE)


def title_of(axis: str, component: int) -> Text:
    """An error of a carriage in words."""
    along = AXES[component % 3].upper()
    if component >= 3:
        return say("rotation of {axis} about {along}", axis=Verbatim(axis.upper()), along=Verbatim(along))
    return (
        say("scale error of {along}", along=Verbatim(along))
        if along == axis.upper()
        else say("straightness of {axis} along {along}", axis=Verbatim(axis.upper()), along=Verbatim(along))
    )


def columns_of(maps: Sequence[ErrorMap]) -> tuple[list[MapColumn], list[Finding]]:
    """Errors that at least two maps give with figures of their own, and all that is odd; stray readings are left out."""
    columns: list[MapColumn] = []
    findings: list[Finding] = []
    same: dict[tuple[float, ...], list[Text]] = {}
    unmeasured: list[Text] = []
    for axis, carriage in enumerate(AXES):
        shared = _shared([m.axes[axis].positions for m in maps])
        for component in range(6):
            title, size = title_of(carriage, component), MICROMETRE if component < 3 else ARCSECOND * METRE
            lever = 1.0 if component < 3 else METRE
            values = np.array([
                lever * m.axes[axis].errors[np.isin(m.axes[axis].positions, shared), component] for m in maps
            ])  # fmt: skip
            measured = [k for k in range(len(maps)) if np.any(values[k])]
            own = [k for k in measured if not any(_same(values[k], values[j]) for j in measured if j < k)]
            if not measured:
                unmeasured.append(title)
            elif len(own) < len(measured):
                copied = tuple(maps[k].temperature for k in measured if _copied(values, k, measured))
                same.setdefault(copied, []).append(title)
            if len(own) < 2 or len(shared) < LEAST_POSITIONS:
                continue
            kept, stray = _without_stray(shared, values[own], size)
            temperatures = np.array([maps[k].temperature for k in own])
            columns.append(MapColumn(carriage, component, shared[kept], values[own][:, kept], temperatures))
            findings += [
                _stray(title, shared[i], maps[own[k]], values[own][k, i] / size, COLUMNS[component]) for k, i in stray
            ]
        if len(shared) < LEAST_POSITIONS:
            why = say(
                "the maps share {count} positions of axis {carriage}: they are not compared. Map the same positions",
                count=len(shared),
                carriage=Verbatim(carriage),
            )
            findings.append(Finding("positions", (), (), why))
    return columns, [*_alike(same, unmeasured), *findings]


def turned(column: MapColumn, k: int) -> bool:
    """Whether the figures of map k would agree with the others if their sign were turned."""
    centred = column.values - column.values.mean(axis=1, keepdims=True)
    others = np.delete(centred, k, axis=0).mean(axis=0)
    return bool(np.linalg.norm(centred[k] + others) < _TURNED * np.linalg.norm(centred[k] - others))


def roughness(column: MapColumn) -> float:
    """Standard deviation of a reading about a smooth course, mm, from the second differences between the maps."""
    differences = np.diff(column.values - column.values.mean(axis=0), 2, axis=1)
    freedom = 1 - 1 / len(column.values)
    return float(np.sqrt(np.mean(differences**2) / 6 / freedom)) or MICROMETRE / 100


def _shared(positions: Sequence[Floats]) -> Floats:
    shared = positions[0]
    for others in positions[1:]:
        shared = shared[np.isin(shared, others)]
    return shared


def _copied(values: Floats, k: int, measured: Sequence[int]) -> bool:
    return any(j != k and _same(values[k], values[j]) for j in measured)


def _same(one: Floats, other: Floats) -> bool:
    """Whether two courses are one, wherever they begin."""
    return bool(np.allclose(one - one[0], other - other[0], rtol=0, atol=_LAST_DIGIT))


def _without_stray(positions: Floats, values: Floats, unit: float) -> tuple[Floats, list[tuple[int, int]]]:
    """Which positions to keep, and the stray readings (map, position): far off what its neighbours and the other maps say."""
    steps = np.abs(np.diff(np.unique(np.round(values / unit, 6))))
    finest = _FINEST * float(steps.min()) * unit if len(steps) else 0.0
    kept = np.ones(len(positions), dtype=bool)
    stray: list[tuple[int, int]] = []
    while len(stray) < _MOST_STRAY * len(positions):
        at = np.flatnonzero(kept)
        off = values[:, at] - (np.median(values[:, at], axis=0) if len(values) > 2 else values[:, at].mean(axis=0))
        between = (positions[at][1:-1] - positions[at][:-2]) / (positions[at][2:] - positions[at][:-2])
        bend = off[:, 1:-1] - (1 - between) * off[:, :-2] - between * off[:, 2:]
        scale = max(1.4826 * float(np.median(np.abs(bend))), finest)
        k, i = np.unravel_index(int(np.argmax(np.abs(bend))), bend.shape)
        if scale == 0 or abs(bend[k, i]) < _STRAY * scale:
            break
        stray.append((int(k), int(at[i + 1])))
        kept[at[i + 1]] = False
    return kept, stray


def _stray(title: Text, position: float, error_map: ErrorMap, value: float, column: str) -> Finding:
    why = say(
        "the {title} at {position:g} mm in the map at {temperature:g} °C, {value:.4g}, is far off "
        "its neighbours and the other maps; the position is left out. Measure it again",
        title=title,
        position=position,
        temperature=error_map.temperature,
        value=value,
    )
    return Finding("outlier", (), (), why, column=column, set_aside=True)


def _alike(same: dict[tuple[float, ...], list[Text]], unmeasured: list[Text]) -> Iterator[Finding]:
    for temperatures, titles in same.items():
        shown = commas(number(t, "g") for t in temperatures)
        why = say(
            "{titles}: the maps at {temperatures} °C give the same figures. They were measured once, and say "
            "nothing of how the maps differ; measure them at each temperature",
            titles=listed(titles),
            temperatures=shown,
        )
        yield Finding("copied", (), (), why, set_aside=True)
    if unmeasured:
        yield Finding(
            "not measured",
            (),
            (),
            say("{titles}: zero in every map, so they were not measured", titles=listed(unmeasured)),
            None,
            True,
        )
