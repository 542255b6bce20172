"""Poses that were commanded again and again: accuracy and repeatability of places and of orientations (ISO 9283).

    AP = |barycentre − commanded|    RP = l̄ + 3·S of the distances l    AP_a = ā − a commanded    RP_a = 3·S of the angles a

and b, c likewise (as Slamani, Nubiola, Bonev, Ind. Robot 39 (2012) 57 evaluate them). a, b, c turn about x, y, z of the base,
in this order: R = Rz(c)·Ry(b)·Rx(a). They are recorded (``reference_a_deg``, …), or follow from three or more reflectors by
the rotation that carries them, as they sit on the flange (``tip_x_mm``, …), to where they were seen (Kabsch, Acta Cryst. A 32
(1976) 922). Where ``commanded_a_deg``, … are not recorded, the commanded places of these reflectors say it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.robots import ANGLES, METRE_ARC, counting
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Table, figure_columns, table
from cmm_uq.machine.model.artefact import ArtefactFigure, Placings
from cmm_uq.maths.geometry.feature import nearest_rotations
from cmm_uq.maths.uncertainty.quantity import rounded

ARC = ARCSECOND * METRE_ARC  # of one arc second, mm
Bools = NDArray[np.bool_]
_ANGLES = tuple(f"_{angle}" for angle in ANGLES)
_TIPS = tuple(f"tip_{axis}_mm" for axis in AXES)
_ONE_ANGLE = 10.0  # ° of b from ±90°, within which a and c are no two angles
_APART_MM = 1.0  # by which reflectors lie beside a line, root mean square, so that they show how the flange is turned


def place_figures(points: Points, seen: Floats, counts: Bools, u_mm: float | None) -> dict[str, ArtefactFigure]:
    """RP of each pose and reflector that was commanded again; AP where places are in the frame of the base, with ``u_mm``."""
    tips = np.unique(_tips(points), axis=0, return_inverse=True)[1].ravel()
    _, of = np.unique(np.column_stack([points.measurement, points.point, tips]), axis=0, return_inverse=True)
    each = [own for rows in Placings.of(of.ravel()).rows if len(own := rows[counts[rows]]) > 1]
    if not each:
        return {}
    middles = np.array([seen[own].mean(axis=0) for own in each])
    away = [np.linalg.norm(seen[own] - middle, axis=1) for own, middle in zip(each, middles, strict=True)]
    commanded = np.array([points.machine_xyz[own].mean(axis=0) for own in each])
    rows = np.array([np.resize(own, len(points)) for own in each])
    several = len(np.unique(tips)) > 1
    names = tuple(_named(points, own[0], int(tips[own[0]]) + 1 if several else None) for own in each)
    lengths = np.linalg.norm(commanded, axis=1)
    repeated = np.array([one.mean() + 3 * one.std(ddof=1) for one in away])
    found = {"RP": ArtefactFigure(repeated, rows, lengths, names=names)}
    if u_mm is not None:
        accuracy = np.linalg.norm(middles - commanded, axis=1)
        found["AP"] = ArtefactFigure(accuracy, rows, lengths, np.full(len(each), u_mm), names)
    return found


def _named(points: Points, row: int, reflector: int | None) -> Text:
    pose = int(points.point[row])
    if reflector is None:
        return say("pose {number}", number=pose)
    return say("pose {number}, reflector {reflector}", number=pose, reflector=reflector)


def _tips(points: Points) -> Floats:
    return np.column_stack([points.columns.get(name, np.zeros(len(points))) for name in _TIPS])


@dataclass(frozen=True, eq=False)
class _Oriented:
    """One pose at one cycle."""

    rows: Ints
    attained: Floats  # (3, 3)
    commanded: Floats | None  # (3, 3), or nobody says


def angle_figures(
    points: Points, seen: Floats, counts: Bools, to_base: Floats, *, in_base: bool
) -> dict[str, ArtefactFigure]:
    """RP_a, RP_b, RP_c of each pose, and AP_a, AP_b, AP_c ``in_base`` where the commanded orientation is known.

    ``to_base``: (n, 3, 3) from the frame of the reference instrument. Values are arcs over a metre. Poses of which b is ±90°
    have none, for there a and c are no two angles.
    """
    poses: dict[tuple[int, int], list[_Oriented]] = {}
    for one in _oriented(points, seen, counts, to_base):
        poses.setdefault((int(points.measurement[one.rows[0]]), int(points.point[one.rows[0]])), []).append(one)
    repeated, off, rows = list[Floats](), list[Floats](), list[Ints]()
    for cycles in poses.values():
        angles = angles_of(np.array([one.attained for one in cycles]))
        if len(cycles) < 2 or np.any(np.abs(angles[:, 1]) > np.pi / 2 - np.radians(_ONE_ANGLE)):
            continue
        about = angles[0] + _within_half_a_turn(angles - angles[0])
        commanded = [one.commanded for one in cycles if one.commanded is not None]
        repeated.append(3 * about.std(axis=0, ddof=1))
        rows.append(np.resize(np.concatenate([one.rows for one in cycles]), len(points)))
        wanted = angles_of(np.array(commanded))[0] if len(commanded) == len(cycles) else np.full(3, np.nan)
        off.append(_within_half_a_turn(about.mean(axis=0) - wanted))
    if not repeated:
        return {}
    found = dict(_figures(points, "RP", np.array(repeated), np.array(rows)))
    known = ~np.isnan(np.array(off)[:, 0])
    if in_base and known.any():
        found |= _figures(points, "AP", np.array(off)[known], np.array(rows)[known])
    return found


def _figures(points: Points, name: str, values: Floats, rows: Ints) -> Iterator[tuple[str, ArtefactFigure]]:
    names, lengths = tuple(_named(points, own[0], None) for own in rows), np.full(len(rows), METRE_ARC)
    for k, angle in enumerate(ANGLES):
        yield f"{name}_{angle}", ArtefactFigure(values[:, k] * METRE_ARC, rows, lengths, names=names)


def _oriented(points: Points, seen: Floats, counts: Bools, to_base: Floats) -> Iterator[_Oriented]:
    """Every pose at every cycle of which all readings count, where its orientation was recorded."""
    commanded = _recorded(points, "commanded")
    attained, own = _recorded(points, "reference"), _tips(points)
    _, of = np.unique(np.column_stack([points.measurement, points.point, points.repeat]), axis=0, return_inverse=True)
    for rows in Placings.of(of.ravel()).rows:
        wanted = None if commanded is None else commanded[rows[0]]
        if attained is not None:
            if counts[rows[0]]:
                yield _Oriented(rows, to_base[rows[0]] @ attained[rows[0]], wanted)
            continue
        there = rows[counts[rows]]
        if (turned := _carried(own[there], seen[there])) is not None:
            by_places = _carried(own[there], points.machine_xyz[there]) if wanted is None else wanted
            yield _Oriented(there, to_base[there[0]] @ turned, by_places)


def _recorded(points: Points, which: str) -> Floats | None:
    """(n, 3, 3) of recorded angles."""
    names = [f"{which}_{angle}_deg" for angle in ANGLES]
    if any(name not in points.columns for name in names):
        return None
    a, b, c = (np.radians(points.columns[name]) for name in names)
    (sa, sb, sc), (ca, cb, cc) = np.sin([a, b, c]), np.cos([a, b, c])
    x = [cc * cb, sc * cb, -sb]
    y = [cc * sb * sa - sc * ca, sc * sb * sa + cc * ca, cb * sa]
    z = [cc * sb * ca + sc * sa, sc * sb * ca - cc * sa, cb * ca]
    return np.asarray(np.array([x, y, z]).transpose(2, 1, 0))


def _carried(body: Floats, places: Floats) -> Floats | None:
    """(3, 3) the rotation that carries points (n, 3) of a body to their places; ``None`` where these lie along a line."""
    if len(body) < 3:
        return None
    about, there = body - body.mean(axis=0), places - places.mean(axis=0)
    if min(np.linalg.svd(each)[1][1] for each in (about, there)) < _APART_MM * np.sqrt(len(body)):
        return None
    return np.asarray(nearest_rotations((there.T @ about)[None])[0])


def angles_of(turned: Floats) -> Floats:
    """(n, 3) a, b, c of rotations (n, 3, 3), rad."""
    across = np.hypot(turned[:, 2, 1], turned[:, 2, 2])
    pairs = (turned[:, 2, 1], turned[:, 2, 2]), (-turned[:, 2, 0], across), (turned[:, 1, 0], turned[:, 0, 0])
    return np.column_stack([np.arctan2(*pair) for pair in pairs])


def _within_half_a_turn(angles: Floats) -> Floats:
    return np.asarray((angles + np.pi) % (2 * np.pi) - np.pi)


def poses_data(
    points: Points, figures_of: Callable[[Bools], Mapping[str, ArtefactFigure]]
) -> dict[str, list[dict[str, float]]]:
    """For results.json: ``poses``, places of each, and ``orientations``; copied readings do not count."""
    found: dict[str, list[dict[str, float]]] = {}
    tips = np.unique(_tips(points), axis=0, return_inverse=True)[1].ravel()
    for key, angles, suffix, scale in (("poses", ("",), "um", MICROMETRE), ("orientations", _ANGLES, "arcsec", ARC)):
        figures = figures_of(counting(points, angles=key == "orientations"))
        by_pose: dict[tuple[int, ...], dict[str, float]] = {}
        for name in (f"{of}{angle}" for of in ("RP", "AP") for angle in angles):
            each = figures.get(name)
            for rows, value in () if each is None else zip(each.rows, each.values, strict=True):
                one = by_pose.setdefault(tuple(np.unique(rows)), {"measurement": int(points.measurement[rows[0]])})
                one |= {"point": int(points.point[rows[0]]), "cycles": len(np.unique(points.repeat[rows]))}
                if key == "poses" and tips.any():
                    one["reflector"] = int(tips[rows[0]]) + 1
                one[f"{name}_{suffix}"] = float(value / scale)
        if by_pose:
            found[key] = list(by_pose.values())
    return found


def pose_tables(data: Mapping[str, list[dict[str, float]]], finest_um: float) -> Iterator[Table | None]:
    """Of places, and of orientations; figures to the digits of ``finest_um``."""
    for key, angles, of, finest in (("poses", ("",), "um", finest_um), ("orientations", _ANGLES, "arcsec", 1.0)):
        if not (rows := data.get(key)):
            continue
        names = [f"{one}{angle}" for one in ("AP", "RP") for angle in angles]
        there = [name for name in names if any(f"{name}_{of}" in one for one in rows)]
        cells = []
        for one in rows:
            pose = Verbatim(f"{one['point']} ({one['reflector']})") if "reflector" in one else number(one["point"])
            values = [one.get(f"{name}_{of}") for name in there]
            shown = (Verbatim("–") if value is None else rounded(value, finest)[0] for value in values)
            cells.append((pose, number(one["cycles"]), *shown))
        heads = figure_columns(*map(Verbatim, there), unit=unit("µm" if of == "um" else "″"))
        title, note = _TITLES[key]
        yield table(title, [say("Pose"), say("Cycles"), *heads], cells, note)


_TITLES = {
    "poses": (
        say("Pose accuracy and repeatability"),
        say(
            "RP: mean distance from the barycentre of all cycles and three standard deviations. AP: distance of the "
            "barycentre from the commanded place, where the reference instrument's places are in the frame of the base "
            "(ISO 9283)."
        ),
    ),
    "orientations": (
        say("Orientation accuracy and repeatability"),
        say(
            "a, b, c: angles about x, y, z of the base, in this order. RP: three standard deviations. AP: mean less the "
            "commanded angle, where the reference instrument's places are in the frame of the base (ISO 9283)."
        ),
    ),
}
