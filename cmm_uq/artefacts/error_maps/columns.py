"""Error maps of one machine side by side: each error of each carriage in every map, and what is odd among their figures.

A figure that stands in several maps was measured once; it says nothing of how the maps differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.artefacts.error_maps.copies import copies
from cmm_uq.artefacts.error_maps.spikes import DAMAGED, spikes
from cmm_uq.base.messages import Text, Verbatim, commas, listed, number, say, signed
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, Unit, unit
from cmm_uq.machine.physics.error_map import COLUMNS, ErrorMap

LEAST_POSITIONS = 4  # positions that the maps of a column must share
_TURNED = 0.3  # part of the misfit that is left when a column with the wrong sign is turned


@dataclass(frozen=True, eq=False)
class MapColumn:
    """One error of one carriage in k maps, at the p positions that they share."""

    axis: str  # the carriage
    component: int  # 0 … 5: displacements along x, y, z, rotations about x, y, z
    positions: Floats  # (p,) mm
    values: Floats  # (k, p) mm; of rotations the displacement at a lever of one metre
    temperatures: Floats  # (k,) °C

    @property
    def title(self) -> Text:
        return title_of(self.axis, self.component)

    @property
    def is_scale(self) -> bool:
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


@dataclass(frozen=True, eq=False)
class _Looked:
    """One error of one carriage as it stands in all maps: what of it can be compared, and what is odd."""

    title: Text
    column: MapColumn | None  # is ``None`` where too little is left
    copied: tuple[tuple[int, ...], ...]  # are the groups of maps with the same figures
    findings: tuple[Finding, ...]
    measured: bool


def columns_of(maps: Sequence[ErrorMap]) -> tuple[list[MapColumn], list[Finding]]:
    """Errors that at least two maps give with figures of their own, and all that is odd; spikes are left out.

    Where several maps have one column's figures, they are counted once; of a scale not at all, for at which of the
    temperatures it was measured decides how it expands, and nobody knows.
    """
    columns: list[MapColumn] = []
    findings: list[Finding] = []
    same: dict[tuple[float, ...], list[Text]] = {}
    unmeasured: list[Text] = []
    for axis, carriage in enumerate(AXES):
        shared = _shared([m.axes[axis].positions for m in maps])
        for component in range(6):
            looked = _looked_at(maps, axis, component, shared)
            for group in looked.copied:
                same.setdefault(tuple(maps[k].temperature for k in group), []).append(looked.title)
            unmeasured += [] if looked.measured else [looked.title]
            columns += [] if looked.column is None else [looked.column]
            findings += looked.findings
        if len(shared) < LEAST_POSITIONS:
            why = say(
                "the maps share {count} positions of axis {carriage}: they are not compared. Map the same positions",
                count=len(shared),
                carriage=Verbatim(carriage),
            )
            findings.append(Finding("positions", (), (), why))
    return columns, [*_alike(same, unmeasured), *findings]


def _looked_at(maps: Sequence[ErrorMap], axis: int, component: int, shared: Floats) -> _Looked:
    carriage, size = AXES[axis], MICROMETRE if component < 3 else ARCSECOND * METRE
    title, lever = title_of(carriage, component), 1.0 if component < 3 else METRE
    values = np.array([
        lever * m.axes[axis].errors[np.isin(m.axes[axis].positions, shared), component] for m in maps
    ]).reshape(len(maps), -1)  # fmt: skip
    measured = [k for k in range(len(maps)) if np.any(values[k])]
    copied = tuple(copies(values, size))
    again = {k for group in copied for k in (group if component == axis else group[1:])}
    own = np.array([k for k in measured if k not in again], dtype=np.int64)
    if len(own) < 2 or len(shared) < LEAST_POSITIONS:
        return _Looked(title, None, copied, (), bool(measured))
    found = spikes(shared, values[own], size)
    damaged = found.mean(axis=1) > DAMAGED
    findings = [_damaged(title, maps[k]) for k in own[damaged]]
    findings += [
        _stray(title, shared[i], maps[own[k]], values[own[k], i] / size, COLUMNS[component])
        for k, i in zip(*np.nonzero(found & ~damaged[:, None]), strict=True)
    ]
    kept, left = ~found[~damaged].any(axis=0), own[~damaged]
    column = None
    if len(left) > 1 and kept.sum() >= LEAST_POSITIONS:
        temperatures = np.array([maps[k].temperature for k in left])
        column = MapColumn(carriage, component, shared[kept], values[left][:, kept], temperatures)
    return _Looked(title, column, copied, tuple(findings), bool(measured))


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


def _stray(title: Text, position: float, error_map: ErrorMap, value: float, column: str) -> Finding:
    why = say(
        "the {title} at {position} mm in the map at {temperature:g} °C, {value}, jumps off its neighbours and off the "
        "other maps; the position is left out. Measure it again",
        title=title,
        position=signed(position, "g"),
        temperature=error_map.temperature,
        value=signed(value, ".4g"),
    )
    return Finding("outlier", (), (), why, column=column, set_aside=True)


def _damaged(title: Text, error_map: ErrorMap) -> Finding:
    why = say(
        "the {title} jumps in more than a quarter of its readings in the map at {temperature:g} °C; that map's is left out. "
        "Measure it again",
        title=title,
        temperature=error_map.temperature,
    )
    return Finding("outlier", (), (), why, set_aside=True)


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
