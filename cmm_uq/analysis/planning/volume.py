"""Where an artefact may stand: the machine's volume, a margin, what the fixtures allow; and turned about its own axes.

A bar or gauge changes ends; a plate is turned by quarters about its normal, and over. (Reversal: Evans, Hocken & Estler 1996,
*Self-calibration: reversal, redundancy, error separation, and absolute testing*.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.jobs.tables.plan import PlanFacts

_ALONG = np.cos(np.radians(3.0))  # cosine from which on a direction is one that a fixture allows
_ROUNDING = 1e-6
_FLAT = 1e-3  # extent across an artefact, over its length, below which it has none


@dataclass(frozen=True, eq=False)
class Volume:
    """Room for set-ups."""

    machine: Machine
    box: Floats  # (3, 2) lowest and highest reading of each axis that points may have, mm
    heights: tuple[float, float] = (-np.inf, np.inf)  # of the artefact's middle, z readings, mm
    # (d, 3) unit vectors that fixtures allow; none means any
    directions: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def of(cls, machine: Machine, plan: PlanFacts, recorded: Floats | None = None) -> Volume:
        """What a job says: ``[plan] volume_mm``, else the machine's travel, else where points were recorded (n, 3)."""
        box = np.empty((3, 2))
        for i, axis in enumerate(AXES):
            low, high = machine.travel_mm[i]
            if axis in plan.volume_mm:
                box[i] = plan.volume_mm[axis]
                if box[i, 0] < low - _ROUNDING or box[i, 1] > high + _ROUNDING:  # false where the travel is not known
                    raise CmmUqError(
                        f"{axis} = [{box[i, 0]:g}, {box[i, 1]:g}] mm goes beyond the travel of {low:g} to {high:g} mm",
                        where="job.toml [plan] volume_mm", fix="Keep inside the travel, or mend [machine] travel_mm",
                    )  # fmt: skip
            elif recorded is not None and not np.all(np.isfinite(machine.travel_mm[i])):
                box[i] = recorded[:, i].min() - plan.margin_mm, recorded[:, i].max() + plan.margin_mm
            else:
                box[i] = machine.travel(axis)
        box = box + plan.margin_mm * np.array([1.0, -1.0])
        if np.any(box[:, 0] > box[:, 1]):
            axis = AXES[int(np.argmax(box[:, 0] > box[:, 1]))]
            raise CmmUqError(f"a margin of {plan.margin_mm:g} mm leaves nothing of the volume along {axis.upper()}",
                             where="job.toml [plan] margin_mm", fix="Make it smaller, or the volume larger")  # fmt: skip
        given = np.array(plan.fixtures.directions, dtype=np.float64).reshape(-1, 3)
        units = given / np.linalg.norm(given, axis=1, keepdims=True) if len(given) else given
        low, high = plan.fixtures.heights_mm or (-np.inf, np.inf)
        return cls(machine, box, (low, high), units)

    @property
    def size(self) -> Floats:
        """(3,) mm."""
        return self.box[:, 1] - self.box[:, 0]

    def chord(self, direction: Floats) -> float:
        """Longest length along a direction through the middle of the box, mm."""
        u = np.abs(direction) / np.linalg.norm(direction)
        moving = u > _ROUNDING
        return float((self.size[moving] / u[moving]).min())

    def allows(self, direction: Floats) -> bool:
        """Whether a fixture holds an artefact along this direction, either way."""
        if not len(self.directions):
            return True
        u = direction / np.linalg.norm(direction)
        return bool(np.any(np.abs(self.directions @ u) > _ALONG))

    def room(self, turned: Floats) -> Floats | None:
        """Range (3, 2) of the middle of a body (n, 3) that keeps it inside; ``None`` where it does not fit."""
        low, high = self.box[:, 0] - turned.min(axis=0), self.box[:, 1] - turned.max(axis=0)
        if np.any(high - low < -_ROUNDING):
            return None
        room = np.column_stack([low, np.maximum(low, high)])
        room[2] = max(room[2, 0], self.heights[0]), min(room[2, 1], self.heights[1])
        return room if room[2, 0] <= room[2, 1] + _ROUNDING else None

    def set_up(self, pattern: Pattern, attitude: Floats, place: Sequence[float], title: Text) -> SetUp:
        """A pattern at a place (3,) of its room, 0 … 1 along each axis."""
        turned = pattern.turned(attitude)
        room = self.room(turned)
        if room is None:
            raise self.too_small(turned, title)
        middle = room[:, 0] + (room[:, 1] - room[:, 0]) * np.asarray(place, dtype=np.float64)
        return pattern.placed(self.machine, attitude, middle, title)

    def too_small(self, turned: Floats, title: Text) -> CmmUqError:
        """Why a body (n, 3) has no room."""
        extent = np.ptp(turned, axis=0)
        axis = int(np.argmax(extent - self.size))
        if extent[axis] - self.size[axis] <= _ROUNDING:
            return CmmUqError(
                f"no height of {self.heights[0]:g} to {self.heights[1]:g} mm leaves room for it ({title})",
                where="job.toml [plan.fixtures] heights_mm", fix="Allow other heights, or name another plan",
            )  # fmt: skip
        return CmmUqError(
            f"the artefact is {extent[axis]:.4g} mm long along {AXES[axis].upper()} ({title}), of which the volume has "
            f"{self.size[axis]:.4g} mm", where="job.toml [plan] volume_mm or [machine] travel_mm",
            fix="Use a smaller artefact, another plan, or a smaller margin_mm",
        )  # fmt: skip


def turned_set_ups(placings: Sequence[SetUp], volume: Volume) -> Iterator[SetUp]:
    """Each set-up with the artefact turned about its own axes, where it then fits."""
    for placing in placings:
        pattern, attitude, _ = Pattern.of_recording(placing.points)
        for words, turn in _turns(pattern.body):
            wanted = attitude @ turn
            room = volume.room(pattern.turned(wanted))
            thin = np.ptp(pattern.body, axis=0)[1] < _FLAT * np.ptp(pattern.body, axis=0)[0]
            if room is None or not volume.allows(wanted[:, 0] if thin else wanted[:, 2]):
                continue
            middle = np.clip(placing.points.machine_xyz.mean(axis=0), room[:, 0], room[:, 1])
            title = say("{title}, {turned}", title=placing.title, turned=words)
            yield pattern.placed(volume.machine, wanted, middle, title)


def _turns(body: Floats) -> list[tuple[Text, Floats]]:
    """Turns (3, 3) about an artefact's own axes that its shape (n, 3) allows, in words."""
    extent = np.ptp(body, axis=0)
    if extent[0] == 0:
        return []
    ends: list[tuple[Text, Floats]] = [(say("ends exchanged"), _about(2, 2))]
    if extent[1] < _FLAT * extent[0]:
        return ends
    # quarters about the normal
    angles = [(say("turned by {angle:.0f}°", angle=90.0 * quarter), _about(2, quarter)) for quarter in (1, 2, 3)]
    return [*angles, (say("turned over"), _about(0, 2))]


def _about(axis: int, quarters: int) -> Floats:
    """Turn (3, 3) about an own axis by quarters."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    turn[u, u] = turn[v, v] = cosine
    turn[v, u], turn[u, v] = sine, -sine
    return turn
