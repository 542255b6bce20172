"""A machine as its job describes it: what rides on what, which way readings count, where a table's axis and joints are."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.arm import ALPHA, THETA, A, Arm, D
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say, semicolons, signed
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.rotary import ROTARY
from cmm_uq.certificate.document import Plot, Section
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.style import ACCENT, INK, MUTED, RULE, TINT, TINY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT, _SCENE = 84.0, 0.6  # mm; share of the width that the scene takes
# to the right and up of the picture: x to the right and a little down, y into it
_AZIMUTH, _ELEVATION = np.radians((32.0, 22.0))
_VIEW = np.array(
    [
        [np.cos(_AZIMUTH), np.sin(_AZIMUTH), 0.0],
        [-np.sin(_AZIMUTH) * np.sin(_ELEVATION), np.cos(_AZIMUTH) * np.sin(_ELEVATION), np.cos(_ELEVATION)],
    ]
)
_UNSTATED = ((0.0, 1.0), (0.0, 1.4), (0.0, 0.8))  # proportions of a volume that no travel says
_ARC = np.linspace(0.0, 1.5 * np.pi, 40)

_ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": ACCENT, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}

Step = tuple[Text, Text]  # what rides on what is before it: its name, and what it does


def machine_plot(machine: Machine) -> Plot:
    """The machine seen from the front right, and beside it what rides on what, from the ground up."""
    with style.house_style():
        figure = style.new_figure(_HEIGHT)
        ax = figure.add_axes((0.0, 0.02, _SCENE, 0.96))
        columns = _arm(ax, machine) if isinstance(machine, Arm) else _carriages(ax, machine)
        ax.set_aspect("equal")
        ax.margins(0.08)
        ax.axis("off")
        for i, steps in enumerate(columns):
            _ladder(figure, steps, i, len(columns))
        words = semicolons(
            say("{name}: {what}", name=name, what=what) if what else name for steps in columns for name, what in steps
        )
        caption = say("The machine as the job describes it; arrows point to where readings grow.")
        return style.drawn(figure, caption, words, "machine")


def _carriages(ax: Axes, machine: Machine) -> list[list[Step]]:
    stated = ~np.isnan(machine.travel_mm.sum(axis=1))
    scale = float(np.ptp(machine.travel_mm[stated], axis=1).max()) if stated.any() else 1.0
    usual = machine.origin_mm[:, None] + scale * np.array(_UNSTATED)
    box = np.where(stated[:, None], machine.travel_mm, usual)
    _box(ax, box, MUTED)
    reach = 0.16 * float(np.ptp(box, axis=1).max())
    corner = np.array([box[0, 0], box[1, 0], box[2, 0]])
    for axis, name in enumerate(AXES):
        way = np.eye(3)[axis]
        beside = 0.5 * reach * np.eye(3)[0 if axis else 1]
        start = corner + way * 0.5 * (np.ptp(box[axis]) - reach) - beside
        _arrow(ax, start, start + reach * way, Verbatim(name.upper()))
    tables, head = list[Step](), list[Step]()
    for axis in rotary_axes(machine):
        point = machine.origin_mm if axis.axis_mm is None else axis.axis_mm
        turns = getattr(axis, "head", False)
        middle = box.mean(axis=1) if turns else point
        along, letter = np.eye(3)[AXES.index(ROTARY[axis.letter])], Verbatim(axis.letter.upper())
        _turn(ax, middle, along, 1.3 * reach, letter, back=axis.clockwise)
        what = _range(axis.travel_deg, "°")
        if turns:
            head.append((say("Head {axis}", axis=letter), what))
        else:
            tables.append((say("Table {axis}", axis=letter), what))
    below, bar, above = machine.chain.partition("F")
    first, then = (below[::-1], above) if bar else ("", machine.chain)
    workpiece = [*(_carriage(machine, letter.lower()) for letter in first), *tables]
    frame = (say("Frame"), NOTHING)
    probe = [frame, *(_carriage(machine, letter.lower()) for letter in then), *head, (say("Probe"), NOTHING)]
    return [[frame, *workpiece, (say("Workpiece"), NOTHING)], probe]


def _carriage(machine: Machine, axis: str) -> Step:
    return say("Carriage {axis}", axis=Verbatim(axis.upper())), _range(machine.limits_of(axis)[0], "mm")


def rotary_axes(machine: Machine) -> Sequence[Any]:
    """Its rotary axes, each with its letter, a point of it, its travel, its sense, and whether it is the head's."""
    own = getattr(machine, "rotary", None)
    return own if own is not None else [machine] if hasattr(machine, "letter") else []


def _range(limits: Floats, unit: str) -> Text:
    if np.isnan(limits).any():
        return say("travel not stated")
    low, high = (signed(value, ".6g") for value in limits.tolist())
    return say("{low} to {high} {unit}", low=low, high=high, unit=Verbatim(unit))


def _arm(ax: Axes, arm: Arm) -> list[list[Step]]:
    """At the middle of the travels, of a joint without one at 0."""
    pose = arm.at(np.nan_to_num(arm.limits.mean(axis=1))[None])
    path = pose.path[0]
    size = float(np.linalg.norm(np.ptp(path, axis=0))) or 1.0
    _ground(ax, path, size)
    _line(ax, path[:-1], RULE, 5.0)
    _line(ax, path[-2:], ACCENT, 2.0)
    _dot(ax, path[-1], ACCENT)
    _triad(ax, np.zeros(3), np.eye(3), 0.14 * size)
    _triad(ax, path[-1], pose.flange[0], 0.09 * size)
    after = np.concatenate([pose.origins[0, 1:, ALPHA], path[-2:-1]]) if arm.modified else pose.origins[0, :, A]
    for joint, (name, turns) in enumerate(zip(arm.joints, arm.revolute, strict=True)):
        axis = pose.axes[0, joint, THETA if turns else D]
        middle = 0.5 * (pose.origins[0, joint, D] + after[joint])
        back = arm.sense[joint] < 0
        if turns:
            _turn(ax, middle, axis, 0.06 * size, Verbatim(name.upper()), back=back)
        else:
            way = -axis if back else axis
            _arrow(ax, middle - 0.06 * size * way, middle + 0.06 * size * way, Verbatim(name.upper()))
    steps = [(say("Base"), NOTHING)]
    for name, turns, limits, sense in zip(arm.joints, arm.revolute, arm.limits, arm.sense, strict=True):
        what, letter = _range(limits, "°" if turns else "mm"), Verbatim(name.upper())
        what = say("{range}, reversed", range=what) if sense < 0 else what
        steps.append((say("{joint} turns", joint=letter) if turns else say("{joint} shifts", joint=letter), what))
    return [[*steps, (say("Tool"), NOTHING)]]


def poses_plot(paths: Floats, boxes: Sequence[Floats], station: Floats | None, floor: float | None) -> Plot:
    """Paths (n, k, 3) of an arm at planned poses, boxes (2, 3) in their way and the tracker; obliquely, and from above."""
    with style.house_style():
        figure = style.new_figure(_HEIGHT)
        points = np.concatenate([paths.reshape(-1, 3), *boxes, *([station[None]] if station is not None else [])])
        for left, view in ((0.0, _VIEW), (0.5, np.eye(3)[:2])):
            ax = figure.add_axes((left, 0.02, 0.5, 0.88))
            if floor is not None:
                ground = np.array([[x, y, floor] for x, y in _ring(points)])
                ax.fill(*(ground @ view.T).T, color=TINT, zorder=0)
            for path in paths:
                _line(ax, path, RULE, 0.8, view)
            for low, high in boxes:
                _box(ax, np.column_stack([low, high]), INK, view)
            for path in paths:
                _dot(ax, path[-1], ACCENT, view)
                if station is not None:
                    _line(ax, np.array([path[-1], station]), ACCENT, 0.15, view)
            if station is not None:
                at = view @ station
                ax.plot(*at, marker="^", color=INK, ms=6, zorder=6)
                ax.annotate(
                    say("Tracker"), _xy(at), (0, 6), textcoords="offset points", ha="center", fontsize=TINY, color=INK
                )
            ax.set_aspect("equal")
            ax.margins(0.06)
            ax.axis("off")
        figure.text(0.01, 0.94, say("From the front right"), fontsize=TINY, color=MUTED)
        figure.text(0.51, 0.94, say("From above"), fontsize=TINY, color=MUTED)
        caption = say(
            "All {count} poses: links, the place of the reflector (●) and what stands in the way.", count=len(paths)
        )
        return style.drawn(figure, caption, caption, "poses")


def _ring(points: Floats) -> list[tuple[float, float]]:
    (low_x, low_y), (high_x, high_y) = points[:, :2].min(axis=0).tolist(), points[:, :2].max(axis=0).tolist()
    return [(low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)]


def _ladder(figure: Figure, steps: Sequence[Step], column: int, columns: int) -> None:
    """Boxes from the ground up, each standing on the one below."""
    from matplotlib.patches import Rectangle

    width, room = (1 - _SCENE - 0.02) / columns, 0.94
    left, height = _SCENE + column * width, min(room / len(steps), 0.13)
    for i, (name, what) in enumerate(steps):
        up, ends = 0.03 + i * height, i in (0, len(steps) - 1)
        box = Rectangle(
            (left + 0.004, up),
            width - 0.008,
            height - 0.012,
            lw=0.6,
            edgecolor=MUTED,
            zorder=1,
            facecolor=TINT if ends else "none",
            transform=figure.transFigure,
        )
        figure.add_artist(box)
        middle = up + 0.5 * (height - 0.012)
        looks: dict[str, Any] = {"fontsize": TINY, "va": "center"}
        figure.text(left + 0.012, middle + (0.02 if what else 0.0), name, color=INK, fontweight="bold", **looks)
        if what:
            figure.text(left + 0.012, middle - 0.022, what, color=MUTED, **looks)


def _ground(ax: Axes, path: Floats, size: float) -> None:
    low = float(min(path[:, 2].min(), 0.0))
    around = _ring(np.vstack([path + 0.1 * size, path - 0.1 * size]))
    ground = np.array([[x, y, low] for x, y in around])
    ax.fill(*(ground @ _VIEW.T).T, color=TINT, zorder=0)
    _line(ax, np.array([[0.0, 0.0, low], [0.0, 0.0, 0.0]]), RULE, 5.0)


def _line(ax: Axes, xyz: Floats, colour: str, width: float, view: Floats = _VIEW) -> None:
    ax.plot(*(xyz @ view.T).T, lw=width, color=colour, zorder=2, solid_capstyle="round", solid_joinstyle="round")


def _dot(ax: Axes, place: Floats, colour: str, view: Floats = _VIEW) -> None:
    at = view @ place
    style.dots(ax, at[:1], at[1:], 4.0, colour, zorder=5)


def _box(ax: Axes, box: Floats, colour: str, view: Floats = _VIEW) -> None:
    """Edges of a box (3, 2)."""
    corners = np.array(list(product(*box)))
    for a, b in ((i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit):
        _line(ax, corners[[a, b]], colour, 0.6, view)


def _arrow(ax: Axes, start: Floats, end: Floats, name: Text) -> None:
    a, b = _VIEW @ start, _VIEW @ end
    ax.annotate(NOTHING, _xy(b), _xy(a), arrowprops=_ARROW, zorder=6)
    ax.plot(*np.array([a, b]).T, lw=0)  # so that it is within the limits
    _name(ax, b, b - a, name)


def _turn(ax: Axes, middle: Floats, axis: Floats, radius: float, name: Text, *, back: bool) -> None:
    """The axis, and an arc about it that goes as the reading grows."""
    one = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    one = one / np.linalg.norm(one)
    other = np.cross(axis, one) * (-1.0 if back else 1.0)
    arc = middle + radius * (np.cos(_ARC)[:, None] * one + np.sin(_ARC)[:, None] * other)
    ends = np.array([middle - 1.5 * radius * axis, middle + 1.5 * radius * axis])
    ax.plot(*(ends @ _VIEW.T).T, lw=0.7, color=MUTED, ls=(0, (4, 2, 1, 2)), zorder=3)
    ax.plot(*(arc @ _VIEW.T).T, lw=1.2, color=ACCENT, zorder=4)
    a, b = _VIEW @ arc[-3], _VIEW @ arc[-1]
    ax.annotate(NOTHING, _xy(b), _xy(a), arrowprops=_ARROW, zorder=6)
    _name(ax, _VIEW @ ends[1], _VIEW @ (ends[1] - ends[0]), name)


def _xy(of: Floats) -> tuple[float, float]:
    return float(of[0]), float(of[1])


def _name(ax: Axes, at: Floats, way: Floats, name: Text, colour: str = INK) -> None:
    shift = 7 * way / (float(np.hypot(*way)) or 1.0)
    looks: dict[str, Any] = {"fontsize": TINY, "color": colour, "fontweight": "normal" if colour == MUTED else "bold"}
    ax.annotate(name, _xy(at), _xy(shift), textcoords="offset points", ha="center", va="center", zorder=7, **looks)


def _triad(ax: Axes, origin: Floats, attitude: Floats, length: float) -> None:
    for axis, name in zip(attitude.T, AXES, strict=True):
        end = origin + length * axis
        _line(ax, np.array([origin, end]), MUTED, 1.0)
        _name(ax, _VIEW @ end, _VIEW @ axis, Verbatim(name), MUTED)


def machine_section(machine: Machine) -> Section | None:
    """For a certificate of a machine of others than three straight axes."""
    if not isinstance(machine, Arm) and len(machine.axes) == len(AXES):
        return None
    return Section(say("The machine"), (machine_plot(machine),))
