"""The machine and its styli among the causes.

Of the machine its errors as drawn by its certificate, errors nobody modelled, and noise of its readings. Of each stylus what
its qualification left open, common to all points that it probes.

On a sphere the qualification finds a tip's size and offset, so what remains of its pre-travel (lobing) has neither: a random
field over directions of probing without terms of degree 0 and 1, stationary over directions. Its covariance at an angle γ is
lobing² times the mean of the Legendre polynomials P_l(cos γ) of degrees 2 to 6 (addition theorem of spherical harmonics).

Errors that act on the reference sphere as on the part (play of an axis, a rotation that moves a long stylus) end in the tip's
effective size and offset, and so do not act on the part again. The sphere is probed at 25 points of its upper half (ISO
10360-5:2010, 6.2.3), its least-squares radius and centre are what is taken out.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
from scipy.special import eval_legendre

from cmm_uq.analysis.machine.state import MachineState, Unmodelled
from cmm_uq.analysis.parts.causes.cause import (
    CommonCause,
    Draw,
    Drawn,
    PartCause,
    PointScatter,
    Rows,
    components,
    field_along,
    field_components,
    normal,
)
from cmm_uq.analysis.parts.plan import OWN_COLUMNS, PartPose, Plan, probed
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.field import GivenPeriod
from cmm_uq.machine.physics.effects.drives import PeriodicScale
from cmm_uq.machine.physics.superposition import About, Superposition

MACHINE, NOISE, STYLUS = "machine", "noise", "stylus"
# by which pre-travel varies with direction: two and three lobes of triggering and bending, up to six of a tip's form
DEGREES = (2, 3, 4, 5, 6)
SPHERE_MM = 25.0  # diameter of the reference sphere; errors hardly change over it
# height above the equator, points, and the first one's angle, in degrees
_LATITUDES = ((90.0, 1, 0.0), (67.5, 4, 0.0), (45.0, 8, 22.5), (22.5, 4, 45.0), (0.0, 8, 0.0))
# mm: the last step towards where the machine indicates; what is left is smaller by what errors change over a millimetre
_SETTLED = 1e-7
_ROUNDS = 12
_TURNED = 60_000  # components that are turned at once: they stay in the cache of a core


def styli(plan: Plan, pose: PartPose) -> list[PartCause]:
    """Size, offset and lobing of every stylus that leaves some open.

    A tip that is effectively larger than thought finds every surface by half of the difference outside.
    """
    found: list[PartCause] = []
    for place, stylus in enumerate(plan.styli):
        its = plan.stylus_of == place
        if stylus.u_diameter_um:
            basis = (0.5 * MICROMETRE * its[:, None] * plan.normals)[None]
            size = (f"tip size {stylus.name}",)
            found.append(CommonCause(name=STYLUS, factors=size, draw=normal([stylus.u_diameter_um]), basis=basis))
        if np.any(stylus.u_offset_um):
            basis = MICROMETRE * its[:, None] * pose.back(np.eye(3))[:, None, :]
            factors = (f"tip offset {stylus.name}",) * len(AXES)
            found.append(CommonCause(name=STYLUS, factors=factors, draw=normal(stylus.u_offset_um), basis=basis))
        if stylus.lobing_um:
            found.append(field_along(STYLUS, f"lobing {stylus.name}", _lobed(plan, place), plan.normals))
    return found


@lru_cache(maxsize=8)
def _lobed(plan: Plan, place: int) -> Floats:
    """(K, n) of the lobing of one stylus: the same wherever the part lies, and so looked up."""
    variance, its = (MICROMETRE * plan.styli[place].lobing_um) ** 2, plan.stylus_of == place

    def lobing(some: slice) -> Floats:
        cosine = np.clip(plan.normals[some] @ plan.normals.T, -1.0, 1.0)
        mean = np.mean([eval_legendre(degree, cosine) for degree in DEGREES], axis=0)
        return np.asarray(variance * mean * np.outer(its[some], its))

    return field_components(lobing, np.where(its, variance, 0.0))


def directions() -> Floats:
    """(25, 3) unit vectors to the points on the sphere."""
    found = []
    for height, count, start in _LATITUDES:
        for angle in np.radians(start + 360.0 * np.arange(count) / count):
            level = np.cos(np.radians(height))
            found.append((level * np.cos(angle), level * np.sin(angle), np.sin(np.radians(height))))
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Qualified:
    """A part and the reference sphere, measured by the same tips."""

    part: Points  # the points of the part
    sphere: Points  # those of the sphere, for each stylus whose place of qualification is known, one after the other
    styli: Ints  # (s,) which styli these are
    of: Ints  # (n,) stylus of each point of the part

    @classmethod
    def on(cls, plan: Plan, part: Points, machine: Machine) -> Qualified:
        """The sphere where the styli were qualified, with what is recorded of the surroundings of the part's points."""
        which = [i for i, stylus in enumerate(plan.styli) if stylus.qualified_at_mm is not None and i in plan.stylus_of]
        toward = directions()
        q = len(toward)
        places = [np.asarray(plan.styli[i].qualified_at_mm) + 0.5 * SPHERE_MM * toward for i in which]
        tips = [np.tile(plan.styli[i].offset_mm, (q, 1)) for i in which]
        radii = np.repeat([0.5 * plan.styli[i].diameter_mm for i in which], q)
        none = np.zeros((0, 3))
        # before the part: at the first of its times, with what else is recorded as it is then
        start = int(np.argmin(part.columns["time_s"])) if "time_s" in part.columns else 0
        columns = {name: np.full(q * len(which), float(values[start])) for name, values in part.columns.items()
                   if name not in OWN_COLUMNS}  # fmt: skip
        sphere = probed(np.concatenate([none, *places]), np.tile(toward, (len(which), 1)), np.concatenate([none, *tips]),
                        radii, machine, columns)  # fmt: skip
        return cls(part, sphere, np.array(which, dtype=np.int64), plan.stylus_of)

    @cached_property
    def both(self) -> Points:
        """Points of the part, and then those of the spheres."""
        part, sphere = self.part, self.sphere
        columns = {name: np.concatenate([values, sphere.columns[name]]) for name, values in part.columns.items()}
        n = len(part) + len(sphere)
        ones = np.ones(n, dtype=np.int64)
        return replace(part, xyz=np.vstack([part.xyz, sphere.xyz]), measurement=ones, point=np.arange(1, n + 1),
                       repeat=ones, columns=columns)  # fmt: skip

    def left(self, columns: Floats) -> Floats:
        """(n, 3, k) of the part that a qualification leaves of displacements (n + q, 3, k) in the frame of the machine."""
        n, q = len(self.part), len(directions())
        found = columns[:n].copy()
        normals = np.column_stack([self.part.columns[f"n{axis}"] for axis in "xyz"])
        toward = directions()
        solve = np.linalg.pinv(np.column_stack([toward, np.ones(q)]))
        for place, stylus in enumerate(self.styli):
            own = columns[n + place * q : n + (place + 1) * q]
            sphere = solve @ np.einsum("qi,qik->qk", toward, own)
            its = self.of == stylus
            found[its] -= sphere[None, :3] + normals[its][:, :, None] * sphere[3]
        return found


def modelled(
    state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None = None
) -> tuple[CommonCause, Floats]:
    """What the calibration modelled, and by how much (n, 3) the machine displaces points without any draw, mm.

    Draws are differences of whole draws of its posterior from their mean, and drift since then.

    ``measured``: (n, 3) by how much points were measured beside the plan's, in the frame of the part: what scales read there
    says the phase of a short period.
    """
    acting, mean, _ = _plain(state)
    about = read = acting.about(qualified.both, mean)
    if len(acting.effects) < len(state.effects):  # errors with a period go by what scales read
        shown = _read(state, qualified, pose, measured)
        read = replace(about, points=replace(shown, directions=about.points.directions))
    basis, e, start = np.empty((len(state.mean), len(qualified.part), 3)), np.zeros((len(qualified.both), 3)), 0
    for effect in state.effects:  # one after the other: the columns of all together are hundreds of megabytes
        own, period = slice(start, start := start + len(effect.coefficients)), isinstance(effect, GivenPeriod)
        columns = read.columns(effect) if period else about.columns(effect, state.shapes.get(effect.name, ()))
        basis[own] = _in_part(qualified.left(columns), pose)
        if period:
            e += np.ascontiguousarray(columns) @ state.mean[own]
    factors = [effect.name for effect in state.effects for _ in effect.coefficients]
    drift = np.append(state.drift, np.zeros(len(factors) - len(state.drift)))

    def draw(random: np.random.Generator, n: int) -> Drawn:
        drawn = Rows(state.draws, state.mean, random.integers(len(state.draws), size=n))
        if not state.drift.any():
            return drawn
        return np.asarray(drawn) + random.standard_normal((n, len(drift))) * drift

    why = dict.fromkeys(state.free, say("the calibration left it to what physics allows"))
    said = say("the calibration shows little of it; as large as the bound that is stated allows")
    why |= {effect.name: said for effect in state.effects if effect.stated and effect.name in why}
    as_others = say("the calibration shows little of it; as large as it shows errors of this kind to be")
    why |= dict.fromkeys(state.as_family, as_others)
    machine = CommonCause(name=MACHINE, factors=tuple(factors), draw=draw, named=why, basis=basis)
    return machine, _mean_errors(state, qualified, pose, e)


def _mean_errors(state: MachineState, qualified: Qualified, pose: PartPose, e: Floats) -> Floats:
    """(n, 3) by how much the machine displaces points without any draw, in the frame of the part, mm.

    Where the machine indicates by the mean of what is known, and what it corrects there; of errors ``e`` with a period, of
    points and spheres, it corrects none.
    """
    periodic = -pose.back(qualified.left(e[:, :, None])[:, :, 0])
    if np.array_equal(state.corrects, state.mean):
        return periodic
    points, (acting, mean, corrects) = qualified.both, _plain(state)
    indicated = _indicated(acting, mean, points, points.xyz)
    indicated = indicated + acting.errors(points.at(indicated), corrects)
    return pose.back(qualified.left((indicated - points.xyz)[:, :, None])[:, :, 0]) + periodic


def _plain(state: MachineState) -> tuple[Superposition, Floats, Floats]:
    """The effects whose errors do not go by the reading of a scale to less than a millimetre; mean and what is corrected."""
    kept = np.array([not isinstance(one, GivenPeriod) for one in state.effects for _ in one.coefficients], dtype=bool)
    effects = tuple(one for one in state.effects if not isinstance(one, GivenPeriod))
    return Superposition(effects, state.shapes), state.mean[kept], state.corrects[kept]


def _read(state: MachineState, qualified: Qualified, pose: PartPose, measured: Floats | None) -> Points:
    """Points of part and spheres as the scales read them: what was measured less what the machine corrected."""
    points, n = qualified.both, len(qualified.part)
    shown = points.xyz.copy()
    if measured is not None:
        shown[:n] += pose.turned(measured)
    acting, _, corrects = _plain(state)
    return points.at(_indicated(acting, corrects, points, shown) if corrects.any() else shown)


def _indicated(acting: Superposition, coefficients: Floats, points: Points, true: Floats) -> Floats:
    """(n, 3) what solves indicated + e(indicated) = true, mm."""
    indicated = true.copy()
    for _ in range(_ROUNDS):
        change = true - acting.errors(points.at(indicated), coefficients) - indicated
        indicated += change
        if np.abs(change).max(initial=0.0) < _SETTLED:
            break
    return indicated


def not_modelled(state: MachineState, qualified: Qualified, pose: PartPose) -> tuple[list[PartCause], dict[str, str]]:
    """What the calibration did not model, an independent cause each; and what cannot be drawn, with the column it lacks.

    Of an effect with a period, draws have one of its trial periods each, as its prior has them: evenly in their logarithm.
    """
    causes, lacking = list[PartCause](), dict[str, str]()
    for one in state.unmodelled:
        if missing := [name for name in one.effect.columns if name not in qualified.part.columns]:
            lacking[one.effect.name] = missing[0]
        else:
            causes.append(_unmodelled(one, qualified, pose))
    return causes, lacking


def _unmodelled(one: Unmodelled, qualified: Qualified, pose: PartPose) -> CommonCause:
    about, k = About(qualified.both), len(one.sd)
    if isinstance(one.effect, PeriodicScale) and one.effect.errors:  # the sum of several, each of a size by its period
        every = GivenPeriod(one.effect, np.zeros(0), np.zeros((0, 0)))
        columns = about.columns(every)
        sd = np.array([c.prior_sd for c in every.coefficients]) * one.sd[0] / one.effect.coefficients[0].prior_sd
    else:
        trials = list(one.effect.trials())
        columns = np.concatenate([about.columns(one.effect, shape) for shape in trials], axis=2)
        every = None

    def draw(random: np.random.Generator, n: int) -> Floats:
        if every is not None:
            return np.asarray(every.beforehand(random, n) * sd)
        found = np.zeros((n, len(trials), k))
        found[np.arange(n), random.integers(len(trials), size=n)] = random.standard_normal((n, k)) * one.sd
        return found.reshape(n, -1)

    as_shown = say("the calibration did not model it; as large as its recording would not have shown")
    as_allowed = say("the calibration did not model it; as large as physics allows")
    name, basis = one.effect.name, _in_part(qualified.left(columns), pose)
    as_stated = say("the calibration did not show it; as large as the bound that is stated allows")
    why = {name: as_stated if one.effect.stated else as_shown if one.bounded else as_allowed}
    return CommonCause(name=MACHINE, factors=(name,) * columns.shape[2], draw=draw, named=why, basis=basis)


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
    far = np.ones(n)
    if stated.longest_mm:
        far = np.linalg.norm(points.xyz - points.xyz[first], axis=1) / stated.longest_mm
    found += _scattered("growing", stated.growth_mm, far / np.sqrt(repeats))
    if np.any(stated.slow_mm) and "time_s" in points.columns:
        kernel = stated.slow_kernel(points.column("time_s"))
        found += [field_along(NOISE, "slow", components(kernel), np.tile(axis, (n, 1))) for axis in np.eye(3)]
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
    """Errors (n, 3, k) of the machine as displacements (k, n, 3) in the frame of the part."""
    found = np.empty((columns.shape[2], *columns.shape[:2]))
    step = max(1, _TURNED // max(1, 3 * len(found)))
    for start in range(0, len(columns), step):
        rows = slice(start, start + step)
        found[:, rows] = -np.moveaxis(pose.rotation.T @ columns[rows], 2, 0)
    return found
