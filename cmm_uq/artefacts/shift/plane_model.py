"""What a plate in several placings reads on a machine with errors in its plane, and what placings leave open.

    reading + e(reading) = shift_s + R(turn_s) · ball_p + noise
    e_i = scale_i·r_i + linearity_i(r_i) + straightness_j_i(r_j) + c·r_j,
    e_j = scale_j·r_j + linearity_j(r_j) + straightness_i_j(r_i),

of axes i and j (Schwenke et al. 2008, "Geometric error measurement and compensation of machines", 2.3, to first order), and
the rotation about the normal of each carriage that carries another one of the plane. Positions and levers are counted from
the middle of what was read. A plate that is only shifted shears and stretches as well as the machine; turned by 90° it
parts them, but for the common scale. A bow with the rotation that belongs to it looks like a turned placing while the plate
moves along it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import linalg

from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.placed_plate import PlacedPlate, rotations
from cmm_uq.artefacts.shift.series import common_period
from cmm_uq.artefacts.shift.smooth import SmoothFunction, SmoothModel
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS
from cmm_uq.machine.physics.kinematics import carried_offset

SCALE_SD, SQUARENESS_SD = 300 * PPM, 500 * ARCSECOND  # what physics allows, as in the effects of the same names
_TYPICAL, _TYPICAL_ROTATION = 5 * MICROMETRE, 5 * ARCSECOND
_SHORTEST = 1 / 8  # shortest correlation length as a part of the range
_ROUNDS = 4
_MICRO_PRIOR = 1e-3  # noise over prior in the start's least squares, mm


@dataclass(frozen=True, eq=False)
class PlaneModel:
    """The linear model about a start, and how its coefficients make balls."""

    smooth: SmoothModel  # observations: all of the first axis, then all of the second, minus the start
    balls: Floats  # (p, 2) start, mm
    to_balls: Floats  # (2p, q) change of the balls' coordinates by the last q flat coefficients
    # index of the carriages that have a rotation, in the order of the functions after the fourth
    turning: tuple[int, ...]
    # (2, 2) of each such carriage: whether its lever has the readings of the first and of the second axis
    lever: tuple[tuple[bool, bool], ...]
    # (2p,) change of the balls by the last of the columns; ``None`` where no length is known within a u
    known_column: Floats | None


def plane_model(plate: PlacedPlate, known: KnownSpan | None, chain: str, sigma: float | None) -> PlaneModel:
    """The model linearised where least squares with scales and squareness puts plate and placings.

    ``sigma`` standard uncertainty of one reading, mm; ``None`` when it is to be estimated.
    """
    balls, turned, moved = plate.balls, plate.turned, plate.moved
    turning, lever = _turning(plate, chain)
    i, j = (plate.flat - plate.middle[list(plate.axes)]).T
    of_machine = [
        np.r_[-i, 0 * i],
        np.r_[0 * j, -j],
        np.r_[-j, 0 * j],
    ]  # −e for one unit of scale of both axes and of c
    functions = _functions(plate, turning, chain)
    noise = np.tile(plate.noise_scale, 2)
    for round_ in range(_ROUNDS):
        tied, held, column = _tie(balls, known)
        placings, to_readings = _rigid_columns(plate, balls, turned)
        flat = np.hstack([placings, to_readings @ tied])
        extra = [] if column is None else [to_readings @ column]
        columns = np.column_stack([*of_machine, *extra])
        sd = np.array([SCALE_SD, SCALE_SD, SQUARENESS_SD, *([known.u] if known and extra else [])])
        expected = moved[plate.placing] + np.einsum("nij,nj->ni", rotations(turned)[plate.placing], balls[plate.ball])
        observed = (plate.flat - expected).T.ravel() - to_readings @ held
        if round_ == _ROUNDS - 1:
            break
        found = _least_squares(flat, columns, sd, observed, noise)
        change = found[: placings.shape[1]].reshape(-1, 3)
        moved, turned = moved + np.vstack([np.zeros(2), change[:, :2]]), turned + np.r_[0.0, change[:, 2]]
        balls = balls + (held + tied @ found[placings.shape[1] : flat.shape[1]]).reshape(-1, 2)
    smooth = SmoothModel(observed, noise, flat, columns, sd, functions, None if sigma else plate.scatter, sigma)
    return PlaneModel(smooth, balls + held.reshape(-1, 2), tied, turning, lever, column)


def _least_squares(flat: Floats, columns: Floats, sd: Floats, observed: Floats, noise: Floats) -> Floats:
    design = np.hstack([flat, columns]) / noise[:, None]
    prior = np.hstack([np.zeros((len(sd), flat.shape[1])), np.diag(_MICRO_PRIOR / sd)])
    wanted = np.r_[observed / noise, np.zeros(len(sd))]
    return np.asarray(np.linalg.lstsq(np.vstack([design, prior]), wanted, rcond=None)[0])


def _tie(balls: Floats, known: KnownSpan | None) -> tuple[Floats, Floats, Floats | None]:
    """Free changes of the balls (2p, q), the change (2p,) to the known length, and (2p,) for one mm of its error.

    Along the known length the last ball follows the first; all else is free.
    """
    count = 2 * len(balls)
    free = np.eye(count)
    if known is None:
        return free, np.zeros(count), None
    way = balls[known.last] - balls[known.first]
    along = way / np.linalg.norm(way)
    rows = slice(2 * known.last, 2 * known.last + 2)
    column = np.zeros(count)
    column[rows] = along
    first = slice(2 * known.first, 2 * known.first + 2)
    free[rows, first] = np.outer(along, along)
    free[rows, 2 * known.last] = (-along[1], along[0])
    held = column * (known.length - np.linalg.norm(way))
    return np.delete(free, 2 * known.last + 1, axis=1), held, column if known.u > 0 else None


def _rigid_columns(plate: PlacedPlate, balls: Floats, turned: Floats) -> tuple[Floats, Floats]:
    """Change of the readings (2n, ·) by shifts and turns of all placings but the first, and by the balls (2n, 2p)."""
    n, count = len(plate.ball), len(plate.placings)
    R = rotations(turned)[plate.placing]
    placings, to_readings = np.zeros((2, n, count, 3)), np.zeros((2, n, len(balls), 2))
    rows = np.arange(n)
    arm = np.einsum("nij,nj->ni", R, balls[plate.ball])
    for k, sign in ((0, -1.0), (1, 1.0)):
        placings[k, rows, plate.placing, k] = 1.0
        placings[k, rows, plate.placing, 2] = sign * arm[:, 1 - k]
        to_readings[k, rows, plate.ball] = R[:, k]
    return placings[:, :, 1:].reshape(2 * n, -1), to_readings.reshape(2 * n, -1)


def _turning(plate: PlacedPlate, chain: str) -> tuple[tuple[int, ...], tuple[tuple[bool, bool], ...]]:
    """Carriages whose rotation shows, and which of the two readings their levers have."""
    one = np.ones((1, 3))
    levers = {a: carried_offset(AXES[a], one, chain=chain)[0, list(plate.axes)] > 0 for a in plate.axes}
    shown = tuple(a for a in plate.axes if levers[a].any())
    return shown, tuple((bool(levers[a][0]), bool(levers[a][1])) for a in shown)


def _functions(plate: PlacedPlate, turning: tuple[int, ...], chain: str) -> tuple[SmoothFunction, ...]:
    """Linearity of i and j, straightness of i along j and of j along i, then the rotations."""
    i, j = plate.axes
    n = len(plate.ball)
    first, second = np.r_[-np.ones(n), np.zeros(n)], np.r_[np.zeros(n), -np.ones(n)]
    a, b = AXES[i], AXES[j]
    shown = [
        (i, f"linearity_{a}", first, _TYPICAL), (j, f"linearity_{b}", second, _TYPICAL),
        (i, STRAIGHTNESS[a, b].name, second, _TYPICAL), (j, STRAIGHTNESS[b, a].name, first, _TYPICAL),
    ]  # fmt: skip
    for axis in turning:
        offset = carried_offset(AXES[axis], plate.reading - plate.middle, chain=chain)[:, [i, j]]
        shown.append(
            (axis, ROTATION[AXES[axis], AXES[3 - i - j]].name, np.r_[offset[:, 1], -offset[:, 0]], _TYPICAL_ROTATION)
        )
    return tuple(
        SmoothFunction(
            name, *plate.span(axis), _SHORTEST * (plate.span(axis)[1] - plate.span(axis)[0]),
            np.tile(plate.reading[:, axis], 2), factor, typical,
        )
        for axis, name, factor, typical in shown
    )  # fmt: skip


_ALIKE = 0.02  # what changes the readings by less than this part of its own size is not determined by them
_SQUARE_DEG = 5.0  # placings turned by less than this against each other are shifts of each other


@dataclass(frozen=True, eq=False)
class FreeInPlane:
    """What the readings by themselves leave free."""

    # names of what can change together, or alone, without changing any reading
    combinations: tuple[tuple[str, ...], ...]
    # of each axis, mm: functions of this period, and of a half, a third, … of it, show in no reading; ``None``
    # where the turned placings see them
    periods: tuple[float | None, float | None]

    @property
    def names(self) -> frozenset[str]:
        return frozenset(name for combination in self.combinations for name in combination)

    def determines(self, effects: Mapping[Any, Effect]) -> bool:
        """Whether all of these effects are determined, each by itself."""
        return self.names.isdisjoint(effect.name for effect in effects.values())


def free_in_plane(plate: PlacedPlate, model: PlaneModel) -> FreeInPlane:
    """By the singular values of what low-order errors change of the readings beyond balls and placings."""
    # names, and change of the readings (2n, ·), of scales, squareness, and a bow or slope of each function
    names = [*(SCALE[AXES[a]].name for a in plate.axes), SQUARENESS[plate.plane].name]
    columns = [*model.smooth.columns.T[:3]]
    for index, f in enumerate(model.smooth.functions):
        place = (2 * f.position - f.low - f.high) / f.range
        names.append(f.name)
        columns.append(f.factor * (place if index >= 4 else place**2))
    effects = np.column_stack(columns)
    effects = effects / np.linalg.norm(effects, axis=0)
    basis = linalg.orth(model.smooth.flat)
    rest = effects - basis @ (basis.T @ effects)
    _, sizes, right = np.linalg.svd(rest, full_matrices=False)
    return FreeInPlane(_combinations(names, right[sizes < _ALIKE]), _periods(plate))


def _combinations(names: list[str], free: Floats) -> tuple[tuple[str, ...], ...]:
    """Sparse basis of the rows of ``free`` by Gaussian elimination, as names."""
    rows, pivot = free.copy(), 0
    for column in range(rows.shape[1]):
        if pivot == len(rows):
            break
        best = pivot + int(np.argmax(np.abs(rows[pivot:, column])))
        if abs(rows[best, column]) < 0.1:
            continue
        rows[[pivot, best]] = rows[[best, pivot]]
        rows[pivot] /= rows[pivot, column]
        others = np.arange(len(rows)) != pivot
        rows[others] -= np.outer(rows[others, column], rows[pivot])
        pivot += 1
    return tuple(
        tuple(n for n, weight in zip(names, row / np.abs(row).max(), strict=True) if abs(weight) > 0.1) for row in rows
    )


def _periods(plate: PlacedPlate) -> tuple[float | None, float | None]:
    """Common period of the shifts along each axis among placings that are not turned against each other."""
    if np.any(np.abs(plate.turned_deg) > _SQUARE_DEG):
        return None, None
    each = (np.unique(np.round(shifts, 1)) for shifts in plate.middles.T)
    i, j = (shifts[np.r_[True, np.diff(shifts) > 1.0]] for shifts in each)
    return common_period(i) if len(i) > 1 else None, common_period(j) if len(j) > 1 else None


def title(name: str) -> Text:
    """A name in words, as of an effect: ``straightness_x_y`` is the straightness of X along Y."""
    kind, first, *second = name.split("_")
    axis, other = Verbatim(first.upper()), Verbatim("".join(second).upper())
    return {
        "scale": say("scale of {axis}", axis=axis),
        "squareness": say("squareness {plane}", plane=Verbatim("–".join(axis))),
        "straightness": say("straightness of {axis} along {direction}", axis=axis, direction=other),
        "rotation": say("rotation of {axis} about {about}", axis=axis, about=other),
        "linearity": say("linearity of {axis}", axis=axis),
    }[kind]
