"""Ready plans, scaled to the machine's volume.

The twenty positions of a ballbar follow figure 26 of ASME B89.4.1-1997 as the recording of Harris (2004, figures C 1 and
C 2) carries them out; its position 18, which repeats 14 there, is taken between 14 and 11. Lines of a step gauge follow
ISO 10360-2:2009, 6.3: the four space diagonals and the three axes, five lengths each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from types import MappingProxyType

import numpy as np

from cmm_uq.artefacts.triangle_placings import PLANES, SEVEN_PLACINGS, placed_triangle
from cmm_uq.artefacts.triangle_standard import TriangleStandard
from cmm_uq.conformity.plans import B89
from cmm_uq.errors import CmmUqError
from cmm_uq.planning import patterns
from cmm_uq.planning.directions import PRINCIPAL_PLANES, words
from cmm_uq.planning.placing import Pattern, Placing, along, split
from cmm_uq.planning.setting import Setting
from cmm_uq.planning.swept import swept
from cmm_uq.planning.volume import Volume
from cmm_uq.points import AXES, Floats

_MIDDLE = (0.5, 0.5, 0.5)
_DIAGONALS = (
    (1, 1, 0), (1, -1, 0), (0, 1, -1), (0, 1, 1), (1, 0, -1), (1, 0, 1),
    (1, 1, 1), (1, 1, -1), (1, -1, -1), (1, -1, 1),
)  # fmt: skip
_PARALLELS = (
    ((0, 1, 0), (0.6, 0.5, 0.5)), ((1, 0, 0), (0.5, 0.85, 0.5)), ((1, 0, 0), (0.5, 0.25, 0.5)),
    ((0, 1, 0), (0.3, 0.5, 0.5)), ((0, 1, 0), (0.7, 0.5, 0.5)), ((1, 0, 0), (0.65, 0.1, 0.5)),
    ((1, 0, 0), (0.5, 0.5, 0.5)), ((0, 1, 0), (0.4, 0.5, 0.5)), ((0, 0, 1), (0.65, 0.55, 0.5)),
    ((0, 0, 1), (0.45, 0.3, 0.5)),
)  # fmt: skip

_ACROSS = {"plate": " (across it)", "triangle": " (across it)"}


def ready_plan(setting: Setting) -> tuple[str, tuple[Placing, ...]]:
    """Name and placings of the ready plan that a job asks for, or of the usual one for its artefact.

    Raises
    ------
    CmmUqError : the plan is for another artefact, does not fit the volume, or no fixture holds it.
    """
    kind = setting.artefact.kind
    name = setting.plan.ready or USUAL[kind]
    make, kinds = READY[name]
    if kind not in kinds:
        raise CmmUqError(f"{name!r} is a plan for {' or '.join(kinds)}, not for {kind}",
                         where="job.toml [plan] ready", fix=f"Leave it out: the usual plan is {USUAL[kind]!r}")  # fmt: skip
    return name, make(setting)


def ballbar_positions(setting: Setting) -> tuple[Placing, ...]:
    """Twenty positions for a nearly cubic volume; in a longer one ten diagonals more for each further cube along it."""
    pattern = patterns.ballbar(setting.artefact, setting.plan)
    sections = _sections(setting.volume)
    wanted = [(d, _MIDDLE) for d in _DIAGONALS] + list(_PARALLELS)
    placings = _lines(setting, sections[0], pattern, wanted)
    for section in sections[1:]:
        placings += _lines(setting, section, pattern, wanted[: len(_DIAGONALS)])
    return tuple(placings)


def _lines(
    setting: Setting, volume: Volume, pattern: Pattern,
    wanted: list[tuple[tuple[int, int, int], tuple[float, float, float]]],
) -> list[Placing]:  # fmt: skip
    found = []
    for direction, place in wanted:
        u = np.array(direction, dtype=np.float64)
        _allowed(setting, u)
        found.append(volume.set_up(pattern, along(u), place, words(u)))
    return found


def _allowed(setting: Setting, direction: Floats) -> None:
    if not setting.volume.allows(direction):
        raise CmmUqError(
            f"no fixture holds the artefact {words(direction)}{_ACROSS.get(setting.artefact.kind, '')}, which this plan wants",
            where="job.toml [plan.fixtures] directions",
            fix='Allow the direction, or leave out ready and ask for number = 20 placings by criterion = "D"',
        )  # fmt: skip


def _sections(volume: Volume) -> list[Volume]:
    """Nearly cubic parts of the volume, overlapping by no more than they must."""
    size = volume.size
    counts = B89.cubes(size)
    edge = B89.nearly_cubic * size.min()
    found = []
    for at in product(*(range(count) for count in counts)):
        length = np.minimum(size, np.where(np.array(counts) > 1, edge, size))
        start = volume.box[:, 0] + (size - length) * np.array(
            [i / (count - 1) if count > 1 else 0.0 for i, count in zip(at, counts, strict=True)]
        )
        found.append(replace(volume, box=np.column_stack([start, start + length])))
    return found


def gauge_lines(setting: Setting) -> tuple[Placing, ...]:
    """Four space diagonals and three axes through the middle of the volume, five lengths on each."""
    volume, plan = setting.volume, setting.plan
    size = volume.size
    diagonals = [size * signs for signs in ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1))]
    lengths = patterns.distances(setting.artefact, plan)
    found = []
    for direction in (*diagonals, *np.eye(3)):
        _allowed(setting, direction)
        fitting = patterns.five_of(lengths, volume.chord(direction))
        if not len(fitting):
            raise volume.too_small(np.outer([-0.5, 0.5], lengths[0] * along(direction)[:, 0]), words(direction))
        shapes = (
            [patterns.block(float(length), plan) for length in fitting]
            if setting.artefact.kind == "gauge_blocks"
            else [patterns.gauge(fitting, plan)]
        )
        found += [volume.set_up(shape, along(direction), _MIDDLE, words(direction)) for shape in shapes]
    return tuple(found)


def plate_placings(setting: Setting) -> tuple[Placing, ...]:
    """Flat at two heights, upright along X front and back, upright along Y left and right."""
    volume = setting.volume
    pattern = patterns.plate(setting.artefact, setting.plan, float(volume.size.min()))
    found = []
    for (title, attitude), places in zip(PRINCIPAL_PLANES, (
        ((0.5, 0.5, 0.0), (0.5, 0.5, 1.0)), ((0.5, 0.0, 0.5), (0.5, 1.0, 0.5)), ((0.0, 0.5, 0.5), (1.0, 0.5, 0.5)),
    ), strict=True):  # fmt: skip
        _allowed(setting, attitude[:, 2])
        found += [volume.set_up(pattern, attitude, place, title) for place in places]
    return tuple(found)


def triangle_placings(setting: Setting) -> tuple[Placing, ...]:
    """The seven placings of the triangle standard."""
    sides = TriangleStandard.of(setting.artefact).sides
    machine = replace(setting.machine, travel_mm=setting.volume.box)
    for placing in SEVEN_PLACINGS:
        _allowed(setting, np.eye(3)[3 - sum(PLANES[placing.plane])])
    points = placed_triangle(machine, sides, repeats=setting.plan.repeats)
    return tuple(
        Placing(placing.title, replace(some.points, machine=setting.machine))
        for placing, some in zip(SEVEN_PLACINGS, split(points), strict=True)
    )


def sphere_places(setting: Setting) -> tuple[Placing, ...]:
    """Once in the middle of the volume."""
    pattern = patterns.sphere(setting.artefact, setting.plan)
    return (setting.volume.set_up(pattern, np.eye(3), _MIDDLE, "in the middle"),)


def surface_places(setting: Setting) -> tuple[Placing, ...]:
    """A grid over the lower face of the volume."""
    pattern = patterns.surface(setting.artefact, setting.plan, setting.volume.size[:2])
    return (setting.volume.set_up(pattern, np.eye(3), (0.5, 0.5, 0.0), "flat"),)


def swept_bar(setting: Setting) -> tuple[Placing, ...]:
    """As many swept positions as the plan's grid has points, all around the fixed ball."""
    count = setting.plan.number or setting.plan.grid[0] * setting.plan.grid[1]
    return swept(setting.volume, patterns.length_of(setting.artefact, setting.plan), count, setting.plan.repeats)


def shift_series(setting: Setting) -> tuple[Placing, ...]:
    """The artefact's points along its axis, once for each shift.

    Raises
    ------
    CmmUqError : the job names no axis or no shifts, or the farthest shift leaves the volume.
    """
    facts, plan, volume = setting.artefact, setting.plan, setting.volume
    if facts.axis is None or not facts.shifts_mm:
        raise CmmUqError("axis and shifts_mm are needed", where="job.toml [artefact]",
                         fix='Give axis = "x" and shifts_mm = [0.0, 20.0], one shift a series')  # fmt: skip
    known = facts.known.length_mm if facts.known else plan.length_mm
    if known is None and not plan.lengths_mm:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it, with pitch_mm, or all distances as lengths_mm")  # fmt: skip
    faces = patterns.distances(facts, plan.model_copy(update={"length_mm": known}))
    places = np.concatenate([[0.0], faces])
    i = AXES.index(facts.axis)
    reach = float(places[-1] + np.ptp(facts.shifts_mm))
    if reach > volume.size[i]:
        raise volume.too_small(np.outer([0.0, reach], np.eye(3)[i]), "with its farthest shift")
    start = volume.box.mean(axis=1)
    start[i] = volume.box[i, 0] - min(facts.shifts_mm)
    n = len(places)
    body = np.outer(places, np.eye(3)[i])
    pattern = Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64)).repeated(plan.repeats)
    return tuple(
        pattern.placed(setting.machine, np.eye(3), start + shift * np.eye(3)[i], f"shifted by {shift:g} mm")
        for shift in facts.shifts_mm
    )


READY: Mapping[str, tuple[Callable[[Setting], tuple[Placing, ...]], tuple[str, ...]]] = MappingProxyType({
    "ASME B89.4.1": (ballbar_positions, ("ballbar",)),
    "ISO 10360-2": (gauge_lines, ("step_gauge", "gauge_blocks")),
    "ISO 10360-5": (sphere_places, ("sphere",)),
    "plate placings": (plate_placings, ("plate",)),
    "triangle placings": (triangle_placings, ("triangle",)),
    "surface plate": (surface_places, ("plane",)),
    "swept bar": (swept_bar, ("bryan",)),
    "shift series": (shift_series, ("shift",)),
})  # fmt: skip
"""Ready plans by name, and the artefacts that they are for."""

USUAL: Mapping[str, str] = MappingProxyType({kind: name for name, (_, kinds) in READY.items() for kind in kinds})
