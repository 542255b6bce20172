"""The machine among the causes: its errors as drawn by its certificate, errors nobody modelled, noise of its readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.analysis.parts.causes.cause import CommonCause, Draw, Drawn, PartCause, PointScatter, Rows, field_along
from cmm_uq.analysis.parts.causes.stylus import Qualified
from cmm_uq.analysis.parts.machine.periods import GivenPeriod
from cmm_uq.analysis.parts.machine.state import MachineState, Unmodelled
from cmm_uq.analysis.parts.placing import PartPose
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.superposition import About, Superposition

MACHINE, NOISE = "machine", "noise"
# mm: the last step towards where the machine indicates; what is left is smaller by what errors change over a millimetre
_SETTLED = 1e-7
_ROUNDS = 12


def mean_errors(state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None = None) -> Floats:
    """(n, 3) by how much the machine displaces points without any draw, in the frame of the part, mm.

    Solves indicated + e(indicated) = true for the mean of what is known, and adds what the machine corrects.
    """
    if np.array_equal(state.corrects, state.mean):
        return _mean_periodic(state, qualified, pose, measured)
    points = qualified.both
    indicated = points.xyz.copy()
    acting, mean, corrects = _plain(state)
    for _ in range(_ROUNDS):
        change = points.xyz - acting.errors(points.at(indicated), mean) - indicated
        indicated += change
        if np.abs(change).max(initial=0.0) < _SETTLED:
            break
    indicated = indicated + acting.errors(points.at(indicated), corrects)
    plain = pose.back(qualified.left((indicated - points.xyz)[:, :, None])[:, :, 0])
    return plain + _mean_periodic(state, qualified, pose, measured)


def _plain(state: MachineState) -> tuple[Superposition, Floats, Floats]:
    """The effects whose errors do not go by the reading of a scale to less than a millimetre; mean and what is corrected."""
    kept = np.array([not isinstance(one, GivenPeriod) for one in state.effects for _ in one.coefficients], dtype=bool)
    effects = tuple(one for one in state.effects if not isinstance(one, GivenPeriod))
    return Superposition(effects, state.shapes), state.mean[kept], state.corrects[kept]


def _mean_periodic(state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None) -> Floats:
    """(n, 3) displacements by the means of errors with a period, which no machine corrects."""
    given = [isinstance(effect, GivenPeriod) for effect in state.effects]
    if not any(given):
        return np.zeros_like(qualified.part.xyz)
    read, about = _read(state, qualified, pose, measured), _about(state, qualified)
    e = np.zeros((len(qualified.both), 3))
    start = 0
    for effect in state.effects:
        own = state.mean[start : start + len(effect.coefficients)]
        start += len(effect.coefficients)
        if isinstance(effect, GivenPeriod):
            e += _as_read(about, read).columns(effect) @ own
    return -pose.back(qualified.left(e[:, :, None])[:, :, 0])


def _about(state: MachineState, qualified: Qualified) -> About:
    acting, mean, _ = _plain(state)
    return acting.about(qualified.both, mean)


def _as_read(about: About, read: Points) -> About:
    """The same with what scales read, by which errors with a period go."""
    return replace(about, points=replace(read, directions=about.points.directions))


def _read(state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None) -> Points:
    """Points of part and spheres as the scales read them: what was measured less what the machine corrected."""
    points, n = qualified.both, len(qualified.part)
    shown = points.xyz.copy()
    if measured is not None:
        shown[:n] += pose.turned(measured)
    indicated, (acting, _, corrects) = shown.copy(), _plain(state)
    for _ in range(_ROUNDS if corrects.any() else 0):
        change = shown - acting.errors(points.at(indicated), corrects) - indicated
        indicated += change
        if np.abs(change).max(initial=0.0) < _SETTLED:
            break
    return points.at(indicated)


def modelled(state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None = None) -> CommonCause:
    """What the calibration modelled: differences of whole draws of its posterior from their mean, and drift since then.

    The columns are those of small changes about the mean (:meth:`Superposition.about`), axes leaning as they do.

    ``measured``: (n, 3) by how much points were measured beside the plan's, in the frame of the part: what scales read there
    says the phase of a short period.
    """
    about = _about(state, qualified)
    given = any(isinstance(effect, GivenPeriod) for effect in state.effects)
    read = _read(state, qualified, pose, measured) if given else qualified.both
    columns = np.concatenate([
        np.zeros((len(qualified.both), 3, 0)),
        *(
            _as_read(about, read).columns(effect) if isinstance(effect, GivenPeriod)
            else about.columns(effect, state.shapes.get(effect.name, ()))
            for effect in state.effects
        ),
    ], axis=2)  # fmt: skip
    factors = [effect.name for effect in state.effects for _ in effect.coefficients]
    deviations = state.draws - state.mean
    drift = np.append(state.drift, np.zeros(len(factors) - len(state.drift)))

    def draw(random: np.random.Generator, n: int) -> Drawn:
        drawn = Rows(deviations, random.integers(len(deviations), size=n))
        if not state.drift.any():
            return drawn
        return np.asarray(drawn) + random.standard_normal((n, len(drift))) * drift

    why = dict.fromkeys(state.free, say("the calibration left it to what physics allows"))
    return CommonCause(name=MACHINE, factors=tuple(factors), draw=draw, named=why,
                  basis=-_in_part(qualified.left(columns), pose))  # fmt: skip


def not_modelled(state: MachineState, qualified: Qualified, pose: PartPose) -> tuple[list[PartCause], dict[str, str]]:
    """What the calibration did not model, an independent cause each; and what cannot be drawn, with the column it lacks.

    Of an effect with a period, draws have one of its trial periods each, as its prior has them: evenly in their logarithm.
    """
    causes, lacking = list[PartCause](), dict[str, str]()
    for one in state.unmodelled:
        missing = [name for name in one.effect.columns if name not in qualified.part.columns]
        if missing:
            lacking[one.effect.name] = missing[0]
            continue
        causes.append(_unmodelled(one, qualified, pose))
    return causes, lacking


def _unmodelled(one: Unmodelled, qualified: Qualified, pose: PartPose) -> CommonCause:
    trials = list(one.effect.trials())
    columns = np.concatenate([About(qualified.both).columns(one.effect, shape) for shape in trials], axis=2)
    k, count = len(one.sd), len(trials)

    def draw(random: np.random.Generator, n: int) -> Floats:
        found = np.zeros((n, count, k))
        found[np.arange(n), random.integers(count, size=n)] = random.standard_normal((n, k)) * one.sd
        return found.reshape(n, -1)

    name = one.effect.name
    why = {
        name: say("the calibration did not model it; as large as its recording would not have shown")
        if one.bounded
        else say("the calibration did not model it; as large as physics allows")
    }
    return CommonCause(name=MACHINE, factors=(name,) * (k * count), draw=draw, named=why,
                  basis=-_in_part(qualified.left(columns), pose))  # fmt: skip


def noise(state: MachineState, points: Points, pose: PartPose, repeats: int = 1, first: int = 0) -> list[PartCause]:
    """Noise of readings, what a set-up adds to each point, what grows with distance, and slow noise where times are known.

    ``repeats``: of each point, of whose readings the mean is taken; they share the set-up and the moment.
    """
    stated, n, found = state.noise, len(points), list[PartCause]()
    usual = stated.usual_mm
    if usual.any():
        ratio = np.atleast_2d(stated.coordinate_mm) / np.where(usual > 0, usual, 1.0)
        size = np.tile(usual / np.sqrt(repeats), (n, 1))
        found.append(PointScatter.of(NOISE, "reading", size, pose.back(np.eye(3)), _one_of(ratio)))
    found += _scattered("set-up", stated.placing_mm, np.ones(n))
    far = (
        np.linalg.norm(points.xyz - points.xyz[first], axis=1) / stated.longest_mm if stated.longest_mm else np.ones(n)
    )
    found += _scattered("growing", stated.growth_mm, far / np.sqrt(repeats))
    if np.any(stated.slow_mm) and "time_s" in points.columns:
        kernel = stated.slow_kernel(points.column("time_s"))
        found += [field_along(NOISE, "slow", kernel, np.tile(axis, (n, 1))) for axis in np.eye(3)]
    return found


def _scattered(factor: str, size_mm: Floats | float, part: Floats) -> list[PartCause]:
    """Every coordinate on its own, by parts (n,) of a size of which draws are given; none where it is zero."""
    drawn = np.atleast_1d(np.asarray(size_mm, dtype=np.float64))
    usual = float(np.sqrt(np.mean(drawn**2)))
    if not usual:
        return []
    size = np.repeat(usual * part[:, None], 3, axis=1)
    return [PointScatter.of(NOISE, factor, size, scale=_one_of(np.repeat(drawn[:, None] / usual, 3, axis=1)))]


def _one_of(ratio: Floats) -> Draw | None:
    """One of rows (M, 3) a draw; nothing where there is only one."""
    if len(ratio) == 1:
        return None
    return lambda random, count: np.asarray(ratio[random.integers(len(ratio), size=count)])


def _in_part(columns: Floats, pose: PartPose) -> Floats:
    """Columns (n, 3, k) of the machine as displacements (k, n, 3) in the frame of the part."""
    return pose.back(np.moveaxis(columns, 2, 0))
