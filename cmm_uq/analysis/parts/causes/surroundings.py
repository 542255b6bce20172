"""Temperatures, the fixture and operators among the causes.

The fixture among the causes: a part that moves while it is measured.

Where a part lies is no error, but that it moves is one: what is probed later has moved farther. Movement is taken as even over
the measurement, in the order in which points are probed.

Temperatures among the causes: expansion of the part and of the scales, bending of the part by a gradient.

A part is measured at 20 °C (ISO 1), or reduced to it by an expansion coefficient and a temperature that both are uncertain:
what remains is the difference of two products, drawn as such. A warm scale reads too little.

Operators among the causes: what repeats by different people, days or set-ups scatter by beyond everything else.

Stated, not computed: from repeats of one's own. It is common to a measurement, however often each point is read, and drawn
again in the next measurement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cmm_uq.analysis.parts.causes.cause import CommonCause, PartCause, PointScatter, normal
from cmm_uq.analysis.parts.placing import PartPose
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, REFERENCE_TEMPERATURE

FIXTURE = "fixture"


def moving_part(plan: Plan, u_shift_um: float, u_turn_arcsec: float = 0.0) -> CommonCause:
    """A part that has shifted and turned evenly by the end of its measurement."""
    about = plan.points - plan.points.mean(axis=0)
    done = elapsed(plan)[:, None]
    shifts = [MICROMETRE * done * axis for axis in np.eye(3)]
    turns = [ARCSECOND * done * np.cross(axis, about) for axis in np.eye(3)]
    sd = np.repeat([u_shift_um, u_turn_arcsec], 3)
    return CommonCause(
        name=FIXTURE, factors=("movement of the part",) * 6, draw=normal(sd), basis=np.array([*shifts, *turns])
    )


def elapsed(plan: Plan) -> Floats:
    """(n,) part of the measurement that is over at each point, by its times or else by its order."""
    n = len(plan.points)
    if len(plan.times_s):
        since = plan.times_s - plan.times_s.min()
        return np.asarray(since / (since.max() or 1.0))
    place = np.empty(n)
    place[plan.order if len(plan.order) else np.arange(n)] = np.arange(n)
    return place / max(n - 1, 1)


TEMPERATURE = "temperature"


@dataclass(frozen=True)
class Expansion:
    """A body that expands, and what is known of it."""

    # cte_per_k, u_cte_per_k: coefficient of thermal expansion, and its standard uncertainty
    cte_per_k: float = 0.0
    u_cte_per_k: float = 0.0
    # temperature_c, u_temperature_k: as measured, and its standard uncertainty
    temperature_c: float = REFERENCE_TEMPERATURE
    u_temperature_k: float = 0.0
    corrected: bool = True  # whether results are reduced to 20 °C with these
    # temperature at which its size is known: 20 °C; of scales that of the machine's calibration, where the errors that it
    # found are those of then
    known_at_c: float = REFERENCE_TEMPERATURE

    @property
    def excess(self) -> float:
        """K by which it is warmer than where its size is known."""
        return self.temperature_c - self.known_at_c

    @property
    def left(self) -> float:
        """Relative expansion that is not corrected, as far as it is known."""
        return 0.0 if self.corrected else self.cte_per_k * self.excess

    @property
    def uncertain(self) -> bool:
        """Whether anything of it is."""
        return bool(self.u_cte_per_k or (self.u_temperature_k and (self.cte_per_k or self.u_cte_per_k)))

    def drawn(self, cte: Floats, kelvin: Floats) -> Floats:
        """(N,) relative expansion about its mean, for standard normal draws of the coefficient and of the temperature."""
        true = (self.cte_per_k + self.u_cte_per_k * cte) * (self.excess + self.u_temperature_k * kelvin)
        return np.asarray(true - self.cte_per_k * self.excess)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Temperatures at the measurement of a part."""

    part: Expansion = Expansion()  # the part
    # of x, y, z, of one material: what is not known of their coefficient is common to them. Without uncertainty by default,
    # as it is right where the machine's certificate models their expansion.
    scales: tuple[Expansion, Expansion, Expansion] = (Expansion(), Expansion(), Expansion())
    # (3,) standard uncertainty of the temperature's gradient in the part along the axes of the machine
    u_gradient_k_per_m: Floats = field(default_factory=lambda: np.zeros(3))
    # standard uncertainty of how much the part, and each scale, has warmed from the first point to the last, evenly in the
    # order of probing
    u_drift_k: float = 0.0
    # temperatures by their columns, for effects of the machine that need some
    columns: dict[str, float] = field(default_factory=dict)

    def since(self, calibrated_c: float | None) -> Surroundings:
        """With scales that are known at the temperature of the machine's calibration; ``None`` leaves them at 20 °C."""
        if calibrated_c is None:
            return self
        x, y, z = (replace(scale, known_at_c=calibrated_c) for scale in self.scales)
        return replace(self, scales=(x, y, z))


def mean_expansion(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> Floats:
    """(n, 3) displacements by what is not corrected of temperatures, without any draw, mm."""
    scales = np.array([scale.left for scale in surroundings.scales])
    return surroundings.part.left * _about(plan) - pose.back(scales * points.carriages)


def temperatures(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> list[PartCause]:
    """Expansion of part and scales, and bending of the part in a gradient."""
    part, found = surroundings.part, list[PartCause]()
    if part.uncertain:

        def of_part(random: np.random.Generator, n: int) -> Floats:
            return part.drawn(random.standard_normal(n), random.standard_normal(n))[:, None]

        found.append(CommonCause(name=TEMPERATURE, factors=("part",), draw=of_part, basis=_about(plan)[None]))
    if any(scale.uncertain for scale in surroundings.scales):

        def of_scales(random: np.random.Generator, n: int) -> Floats:
            cte = random.standard_normal(n)
            return np.column_stack([s.drawn(cte, random.standard_normal(n)) for s in surroundings.scales])

        along = np.stack([-points.carriages[:, [i]] * np.eye(3)[i] for i in range(len(AXES))])
        factors = tuple(f"scale {axis}" for axis in AXES)
        found.append(CommonCause(name=TEMPERATURE, factors=factors, draw=of_scales, basis=pose.back(along)))
    if np.any(surroundings.u_gradient_k_per_m) and part.cte_per_k:
        basis = part.cte_per_k * _bent(_about(plan), pose.back(np.eye(3))) / METRE
        draw = normal(surroundings.u_gradient_k_per_m)
        found.append(CommonCause(name=TEMPERATURE, factors=("gradient in the part",) * 3, draw=draw, basis=basis))
    return [*found, *_warming(surroundings, plan, points, pose)]


def _warming(surroundings: Surroundings, plan: Plan, points: Points, pose: PartPose) -> list[PartCause]:
    """Expansion of part and scales while points are probed: what is probed later is warmer."""
    kelvin, done = surroundings.u_drift_k, elapsed(plan)[:, None]
    bases = {"warming of the part": surroundings.part.cte_per_k * done * _about(plan)}
    for i, (axis, scale) in enumerate(zip(AXES, surroundings.scales, strict=True)):
        bases[f"warming of scale {axis}"] = pose.back(-scale.cte_per_k * done * points.carriages[:, [i]] * np.eye(3)[i])
    return [
        CommonCause(name=TEMPERATURE, factors=(factor,), draw=normal([kelvin]), basis=basis[None])
        for factor, basis in bases.items()
        if kelvin and np.any(basis)
    ]


def _about(plan: Plan) -> Floats:
    """(n, 3) points about their middle: where the part is held, an alignment takes away."""
    return np.asarray(plan.points - plan.points.mean(axis=0))


def _bent(about: Floats, directions: Floats) -> Floats:
    """(3, n, 3) of a free body in a linear field of temperature along each direction: (g·r)r − ½r²g, without stress.

    Boley and Weiner, Theory of Thermal Stresses, 1960: a linear field leaves a simply connected free body without stress.
    """
    square = np.einsum("ni,ni->n", about, about)
    return np.stack([(about @ g)[:, None] * about - 0.5 * square[:, None] * g for g in directions])


OPERATOR = "operator"


@dataclass(frozen=True, eq=False, kw_only=True)
class Reproducibility(PartCause):
    """What changes characteristics and moves no point."""

    adds: Floats  # (K, c) change of each characteristic for one unit of each coefficient, mm or rad
    count: int  # of the plan's points

    def through(self, derivative: Floats) -> Floats:
        return np.zeros((len(self.factors), len(derivative)))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        return np.zeros((len(coefficients), len(range(*rows.indices(self.count))), 3))


def reproducibility(plan: Plan, u: Mapping[str, float]) -> Reproducibility:
    """A standard uncertainty of some characteristics, each on its own.

    ``u``: by name of the characteristic, mm or rad.
    """
    names = [one.name for one in plan.characteristics]
    for name in u:
        if name not in names:
            raise CmmUqError(
                f"there is no characteristic {name!r}", where="reproducibility", fix=suggestion(name, names)
            )
    adds = np.zeros((len(u), len(names)))
    adds[np.arange(len(u)), [names.index(name) for name in u]] = 1.0
    return Reproducibility(
        name=OPERATOR,
        factors=tuple(f"reproducibility of {name}" for name in u),
        draw=normal(list(u.values())),
        adds=adds,
        count=len(plan.points),
    )


def of_points(plan: Plan, u_um: float) -> PointScatter:
    """A standard uncertainty of each coordinate of each point, common to its repeats."""
    return PointScatter.of(OPERATOR, "reproducibility of points", np.full((len(plan.points), 3), MICROMETRE * u_um))
