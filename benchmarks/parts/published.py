"""Figures that others printed, by the engine of parts.

Run: ``python -m benchmarks.parts.published``. Each is one line: what, where it is printed, expected, found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic, PartFeature, PartPose, Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.points import Floats, Machine
from cmm_uq.maths.geometry import fit_circle

TRIALS = 100_000


@dataclass(frozen=True)
class Figure:
    """A printed figure.

    Parameters
    ----------
    what, where : it is, and is printed.
    expected, found : as printed, and by the engine.
    within : half a unit of the last printed digit, and what a simulation of :data:`TRIALS` draws scatters by.
    """

    what: str
    where: str
    expected: float
    found: float
    within: float

    @property
    def holds(self) -> bool:
        """Whether it comes out again."""
        return abs(self.found - self.expected) <= self.within


def circles() -> list[Figure]:
    """Least-squares circles of published points."""
    x, y = np.array([1.0, 2, 5, 7, 9, 3]), np.array([7.0, 6, 8, 7, 5, 7])
    found = fit_circle(np.column_stack([x, y]), u_point=1e-3)  # the arc is short against its scatter
    where = "Gander, Golub, Strebel, BIT 34 (1994) 558; seven digits by N. Chernov, geometric circle fits, test one"
    radial = np.hypot(x - found.centre[0], y - found.centre[1])
    values = (found.centre[0], found.centre[1], found.radius, np.sqrt(np.mean((radial - found.radius) ** 2)))
    printed = (4.739782, 2.983533, 4.714226, 0.4523271)
    names = ("centre x", "centre y", "radius", "root mean square distance")
    return [
        Figure(f"least-squares circle of six points, {name}", where, expected, float(value), 0.5e-6)
        for name, expected, value in zip(names, printed, values, strict=True)
    ]


def polar() -> list[Figure]:
    """A position that is off by less than its noise: the modulus of two normal quantities, u = 0.010 each."""
    up = np.array([[0.0, 0.0, 1.0]])
    around = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]) * 1e6
    # the origin has a quarter of the point's variance: planes of four points
    noise = 0.010 / np.sqrt(1.25) * np.array([1.0, 1.0, 0.0])
    state = MachineState(Machine("polar"), (), np.zeros((1, 0)), StatedNoise(noise))
    found = []
    for off, modulus, u in ((0.001, 0.0126, 0.0066), (0.010, 0.0155, 0.0078), (0.1, 0.1005, 0.0100)):
        spot = PartFeature("p", "point", np.zeros((1, 3)), up, "stylus", Nominal(np.zeros(3)))
        plan = Plan((spot, *_frame(around)), (PartCharacteristic("p", "position", ("p",), ("A", "B", "C")),))
        measured = plan.points.copy()
        measured[plan.rows["p"], 0] = off
        at = AtPose(plan, MeasurementConditions(state, measured=measured), PartPose())
        drawn = at.drawn(np.random.default_rng(9), TRIALS)
        values = 0.5 * at.read(drawn, exact=True)[:, 0]  # half of a position is the modulus
        where = "JCGM 102:2011, 9.3.2, r = 0"
        found += [
            Figure(f"modulus at x1 = {off:g}", where, modulus, float(values.mean()), 0.5e-4 + 4 * u / np.sqrt(TRIALS)),
            Figure(f"its u at x1 = {off:g}", where, u, float(values.std()), 0.5e-4 + 4 * u / np.sqrt(2 * TRIALS)),
        ]
    return found


def _frame(around: Floats) -> list[PartFeature]:
    """Three planes through the origin, of four points so far out that their noise does not turn them."""
    found = []
    for name, axis in (("A", 2), ("B", 1), ("C", 0)):
        points = np.roll(around, axis - 2, axis=1)
        normal = np.eye(3)[axis]
        found.append(
            PartFeature(
                name, "plane", points, np.tile(normal, (len(points), 1)), "stylus", Nominal(np.zeros(3), normal)
            )
        )
    return found


def arcs() -> list[Figure]:
    """u of a radius by three points: over four orders of magnitude between 120° and 1° apart."""
    sigma, radius = 1e-7, 10.0
    state = MachineState(Machine("arc"), (), np.zeros((1, 0)), StatedNoise(np.full(3, sigma)))
    u = {}
    for degrees in (120.0, 1.0):
        turn = np.radians([-degrees, 0.0, degrees])
        out = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
        nominal = Nominal(np.zeros(3), np.array([0.0, 0, 1]), 2 * radius)
        plan = Plan(
            (PartFeature("c", "circle", radius * out, out, "stylus", nominal),),
            (PartCharacteristic("c", "size", ("c",)),),
        )
        at = AtPose(plan, MeasurementConditions(state), PartPose())
        u[degrees] = 0.5 * float(at.errors(at.drawn(np.random.default_rng(3), TRIALS // 4), exact=True).std())
    return [
        Figure("orders of magnitude of u of a circle by three points, 120° against 1° apart",
               "Phillips, Borchardt, Estler, Precision Engineering 22 (1998) 87, abstract: four", 4.0,
               float(np.log10(u[1.0] / u[120.0])), 0.5),
        Figure("the same, exactly: log10 of √(½ + cos²θ)/(1 − cos θ) over 1/√3", "closed form",
               float(np.log10(np.sqrt(0.5 + np.cos(np.radians(1)) ** 2) / (1 - np.cos(np.radians(1))) * np.sqrt(3))),
               float(np.log10(u[1.0] / u[120.0])), 0.01),
    ]  # fmt: skip


def figures() -> list[Figure]:
    """All of them."""
    return [*circles(), *polar(), *arcs()]


def main() -> None:
    """Print them."""
    for one in figures():
        print(
            f"{'holds' if one.holds else 'FAILS'}  {one.what}: {one.expected:.7g} expected, {one.found:.7g} found  "
            f"[{one.where}]"
        )


if __name__ == "__main__":
    main()
