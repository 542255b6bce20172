"""The errors of two axes and of the plate between them from all its placings at once, with their posterior.

Reported are: linearity of each axis, along the line through the middle of what was read; straightness of each, about the
line through its ends; squareness, of these lines; the rotation of a carriage that carries another one, about its mean.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts.shift import result as shared
from cmm_uq.artefacts.shift.axis import check_facts, known_span
from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.placed_plate import PlacedPlate, placed_plate
from cmm_uq.artefacts.shift.plane_model import FreeInPlane, PlaneModel, free_in_plane, plane_model, title
from cmm_uq.artefacts.shift.result import Curve, Reported, ShiftFound
from cmm_uq.artefacts.shift.smooth import sampled
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, Unit, unit
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.artefact import ArtefactFigure
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.machine.physics.kinematics import carried_offset
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of

_FINE = 41
_LEAST_LEFT = 6  # coordinates beyond balls and placings that must be left to tell of the machine


@dataclass(frozen=True, eq=False)
class PlaneEstimate(shared.Estimated):
    plate: PlacedPlate  # plate, known: what it was made from
    known: KnownSpan | None
    model: PlaneModel  # linear model about its start
    free: FreeInPlane  # what the placings leave open

    @cached_property
    def positions(self) -> tuple[Floats, ...]:
        """Evenly spaced readings of each axis over what was read, mm."""
        return tuple(np.linspace(*self.plate.span(axis), _FINE) for axis in self.plate.axes)

    def _on(self, index: int) -> tuple[Floats, Floats, int]:
        """Positions and draws (N, m) of one function, and which of the two axes it belongs to."""
        axes = self.plate.axes
        which = (0, 1, 0, 1, *(axes.index(a) for a in self.model.turning))[index]
        return self.positions[which], self.coefficients.function(index, self.positions[which]), which

    def _slope(self, index: int) -> Floats:
        x, values, _ = self._on(index)
        return np.asarray((values[:, -1] - values[:, 0]) / (x[-1] - x[0]))

    @cached_property
    def scales(self) -> tuple[Floats, ...]:
        """(N,) draws of the error of each axis over what was read, from end to end, along its own motion."""
        return tuple(np.asarray(np.linalg.norm(motion, axis=0) - 1) for motion in self._motions)

    @cached_property
    def squareness(self) -> Floats:
        """(N,) draws of S, rad: the angle between the axes' end lines less 90°."""
        i, j = self._motions
        return np.asarray(-np.arcsin(np.sum(i * j, axis=0) / np.linalg.norm(i, axis=0) / np.linalg.norm(j, axis=0)))

    @cached_property
    def _motions(self) -> tuple[Floats, Floats]:
        """(2, N) draws of where each axis moves, from end to end, for one mm read."""
        i, j = (1 + self.coefficients.columns[:, k] + self._slope(k) for k in range(2))
        return np.stack([i, self._slope(3)]), np.stack([self.lean - self._slope(3), j])

    @cached_property
    def lean(self) -> Floats:
        """(N,) draws of how far the second axis moves along the first for one mm read, over what a right angle has."""
        c = self.coefficients.columns[:, 2] + self._slope(2) + self._slope(3)
        for index, lever in enumerate(self.model.lever, 4):
            c = c + (float(lever[0]) - float(lever[1])) * self._on(index)[1].mean(axis=1)
        return np.asarray(c)

    @cached_property
    def linearity(self) -> tuple[Curve, ...]:
        """Of each axis, zero at its lowest reading; at its highest too where its scale is not determined."""
        found = []
        for which, axis in enumerate(self.plate.axes):
            x, values, _ = self._on(which)
            values = values + self.coefficients.columns[:, which : which + 1] * (x - x[0])
            values -= values[:, :1]
            if SCALE[AXES[axis]].name in self.free.names:
                values -= (values[:, -1:] / (x[-1] - x[0])) * (x - x[0])
            found.append(Curve(x, values))
        return tuple(found)

    @cached_property
    def straightness(self) -> tuple[Curve, ...]:
        """Of the first axis along the second, and the reverse."""
        found = []
        for index in (2, 3):
            x, values, _ = self._on(index)
            found.append(Curve(x, values - values[:, :1] - self._slope(index)[:, None] * (x - x[0])))
        return tuple(found)

    @cached_property
    def rotations(self) -> dict[int, Curve]:
        """About the plane's normal, of each carriage that carries the other, rad, mean zero."""
        found = {}
        for index, axis in enumerate(self.model.turning, 4):
            x, values, _ = self._on(index)
            found[axis] = Curve(x, values - values.mean(axis=1, keepdims=True))
        return found

    @cached_property
    def balls(self) -> Floats:
        """(N, p, 2) draws of the balls, mm, from the first, as they lay in the first placing.

        All draws are laid over each other by best fit, to one size where no length is known.
        """
        c, model = self.coefficients, self.model
        change = c.flat[:, -model.to_balls.shape[1] :] @ model.to_balls.T
        if model.known_column is not None:
            change += c.columns[:, -1:] * model.known_column
        places = model.balls + change.reshape(len(change), -1, 2)
        middle = model.balls - model.balls.mean(axis=0)
        centred = places - places.mean(axis=1, keepdims=True)
        turn = np.arctan2(
            np.sum(middle[:, 0] * centred[..., 1] - middle[:, 1] * centred[..., 0], axis=1),
            np.sum(middle * centred, axis=(1, 2)),
        )
        size = np.ones(len(places))
        if not self.free.determines(SCALE):
            size = np.linalg.norm(middle) / np.linalg.norm(centred, axis=(1, 2))
        laid = size[:, None] * np.exp(-1j * turn)[:, None] * (centred[..., 0] + 1j * centred[..., 1])
        laid -= laid[:, 0].mean()
        return np.stack([laid.real, laid.imag], axis=-1)

    @cached_property
    def residuals(self) -> tuple[Floats, Floats]:
        """(n, 2) what does not fit, mm: with scales and squareness alone, and with the curves."""
        before = self.model.smooth.without_functions(float(self.sigma.mean()))
        return before.reshape(2, -1).T, self.coefficients.left.reshape(2, -1).T


def estimate_plane(
    plate: PlacedPlate, known: KnownSpan | None = None, *, chain: str = "XYZ", sigma: float | None = None, seed: int = 0,
    progress: Progress | None = None,
) -> PlaneEstimate:  # fmt: skip
    """Fit all placings at once.

    ``sigma`` standard uncertainty of one coordinate of one reading, mm; from repeats and residuals when left out.
    """
    model = plane_model(plate, known, chain, sigma)
    if (left := len(model.smooth.observed) - model.smooth.flat.shape[1]) < _LEAST_LEFT:
        raise CmmUqError(f"{len(plate.ball)} readings of {len(plate.numbers)} balls leave {left} coordinates to compare",
                         fix="Read more balls in each placing, or one more placing")  # fmt: skip
    return PlaneEstimate(*sampled(model.smooth, seed, progress), seed, plate, known, model, free_in_plane(plate, model))


PEAK_TO_VALLEY = "peak_to_valley_um"


class PrintedCurve(NamedTuple):
    """A curve by its name in results.json, with the unit that it is printed in, its size and its suffix there."""

    name: str
    curve: Curve
    size: float
    unit: Unit
    suffix: str

    @property
    def axis(self) -> str:
        return self.name.split("_")[1]


@dataclass(frozen=True, eq=False)
class PlaneShiftResult(ShiftFound):
    estimate: PlaneEstimate

    @property
    def plane(self) -> str:
        return self.estimate.plate.plane

    @cached_property
    def curves(self) -> dict[str, Curve]:
        """Linearity and straightness by their names in results.json, mm."""
        a, b = (AXES[axis] for axis in self.estimate.plate.axes)
        names = (f"linearity_{a}", f"linearity_{b}", STRAIGHTNESS[a, b].name, STRAIGHTNESS[b, a].name)
        return dict(zip(names, (*self.estimate.linearity, *self.estimate.straightness), strict=True))

    @cached_property
    def printed(self) -> tuple[PrintedCurve, ...]:
        """These, and the rotation of each carriage that carries the other axis."""
        normal = AXES[3 - sum(self.estimate.plate.axes)]
        rotations = [(ROTATION[AXES[a], normal].name, curve) for a, curve in self.estimate.rotations.items()]
        return (
            *(PrintedCurve(name, curve, MICROMETRE, unit("µm"), "um") for name, curve in self.curves.items()),
            *(PrintedCurve(name, curve, ARCSECOND, unit("″"), "arcsec") for name, curve in rotations),
        )

    @cached_property
    def scalars(self) -> dict[str, dict[str, Quantity]]:
        """Squareness, scales and sizes of the curves, by name and parameter; what is not determined is left out."""
        found: dict[str, dict[str, Quantity]] = {}
        for (name, parameter), (draws, own) in self._draws.items():
            found.setdefault(name, {})[parameter] = Quantity.of_draws(draws, own)
        for name, sized in self._sized.items():
            found.setdefault(name, {})[PEAK_TO_VALLEY] = shared.peak_to_valley(sized)
        return {name: self.stating.all(name, quantities) for name, quantities in found.items()}

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        spans = [float(np.ptp(x)) for x in self.estimate.positions]
        square, found = SQUARENESS[self.plane], dict[str, ArtefactFigure]()
        for figure, names in (("linearity", list(self.curves)[:2]), ("straightness", list(self.curves)[2:])):
            known = [i for i, name in enumerate(names) if PEAK_TO_VALLEY in self.scalars.get(name, {})]
            each = [(self.scalars[names[i]][PEAK_TO_VALLEY], MICROMETRE, title(names[i])) for i in known]
            found[figure] = shared.figure_of(self.job.points, each, [spans[i] for i in known])
        if angle := self.scalars.get(square.name, {}).get("angle_arcsec"):
            arm = min(spans)
            found["squareness"] = shared.figure_of(
                self.job.points, [(angle, ARCSECOND * arm, title(square.name))], [arm]
            )
        return shared.decided(self, found)

    @cached_property
    def reported(self) -> Reported:
        sizes = {
            (name, PEAK_TO_VALLEY): (np.ptp(d, axis=1) / MICROMETRE, unit("µm")) for name, d in self._sized.items()
        }
        return {".".join(key): drawn for key, drawn in (self._draws | sizes).items()}

    @cached_property
    def listed(self) -> Reported:
        found: dict[str, tuple[Floats, str]] = {}
        for c in self.printed:
            found |= shared.listed_draws(f"curves.{c.name}.error_{c.suffix}", c.curve.draws / c.size, c.unit)
        for k, name in enumerate(("first_mm", "second_mm")):
            found |= shared.listed_draws(f"artefact.{name}", self.estimate.balls[:, :, k], "mm")
        return found

    @cached_property
    def _sized(self) -> dict[str, Floats]:
        """Draws (N, m), mm, of the curves whose peak to valley is stated."""
        found = {}
        for name, curve in self.curves.items():
            if name not in self.estimate.free.names:
                part = 0.0
                if name.startswith("linearity"):  # its own end line is the scale, stated by itself
                    part = curve.draws[:, -1:] * (curve.position - curve.position[0]) / np.ptp(curve.position)
                found[name] = curve.draws - part
        return found

    @cached_property
    def _draws(self) -> dict[tuple[str, str], tuple[Floats, Unit]]:
        """Draws (N,), and unit."""
        free = self.estimate.free.names
        found: dict[tuple[str, str], tuple[Floats, Unit]] = {}
        square = SQUARENESS[self.plane].name
        if square not in free:
            found[square, "angle_arcsec"] = self.estimate.squareness / ARCSECOND, unit("″")
        axes = [AXES[axis] for axis in self.estimate.plate.axes]
        for axis, draws in zip(axes, self.estimate.scales, strict=True):
            if SCALE[axis].name not in free:
                found[SCALE[axis].name, "ppm"] = draws / PPM, unit("ppm")
        if (SCALE[axes[0]].name, SCALE[axes[1]].name) in self.estimate.free.combinations:
            difference = self.estimate.scales[1] - self.estimate.scales[0]
            found[f"{SCALE[axes[1]].name}_minus_{axes[0]}", "ppm"] = difference / PPM, unit("ppm")
        return found

    @cached_property
    def balls(self) -> tuple[Floats, Floats, Floats]:
        """(p, 2) places of the balls from the first, mm, with u and U of each."""
        draws = self.estimate.balls
        mean = draws.mean(axis=0)
        return mean, draws.std(axis=0, ddof=1), expanded_of(draws, mean)

    @cached_property
    def table(self) -> ErrorMap:
        return plane_correction_table(self.estimate, self.job.points.machine)


def plane_correction_table(estimate: PlaneEstimate, machine: Machine) -> ErrorMap:
    """Error map of the two carriages of a plane; the squareness stands in it as a slope of the second axis' straightness.

    A map counts levers from the scales' zero, the estimate from the middle of what was read: the difference goes into the
    displacements. Scales that the placings leave open are left as they are.
    """
    found: dict[int, tuple[Floats, Floats]] = {}
    axes, normal = estimate.plate.axes, 3 - sum(estimate.plate.axes)
    for which, axis in enumerate(axes):
        x = estimate.positions[which]
        errors = np.zeros((len(x), 6))
        errors[:, axis] = estimate.linearity[which].error
        errors[:, axes[1 - which]] = estimate.straightness[which].error
        if axis in estimate.rotations:
            turn = estimate.rotations[axis].error
            arm = carried_offset(AXES[axis], estimate.plate.middle[None], chain=machine.chain)[0, list(axes)]
            errors[:, axes[0]] += arm[1] * turn
            errors[:, axes[1]] -= arm[0] * turn
            errors[:, 3 + normal] = turn
        found[axis] = x, errors
    if SQUARENESS[estimate.plate.plane].name not in estimate.free.names:
        y, errors = found[axes[1]]
        errors[:, axes[0]] += estimate.lean.mean() * (y - y[0])
    return shared.error_map_of(found, machine)


def analyse_plane(job: Job, *, seed: int = 0, progress: Progress | None = None) -> PlaneShiftResult:
    """Analyse a shift job with a plate in a plane.

    ``[artefact] plane`` says which plane; all else as :func:`~cmm_uq.artefacts.shift.axis.analyse_shift`.
    """
    stated, chain = job.facts.recording.u_coordinate_um, job.facts.machine.chain
    plate, known = checked_plate(job)
    sigma = None if stated is None else stated * MICROMETRE
    return PlaneShiftResult(job, estimate_plane(plate, known, chain=chain, sigma=sigma, seed=seed, progress=progress))


def checked_plate(job: Job) -> tuple[PlacedPlate, KnownSpan | None]:
    check_facts(job)
    facts = shared.shift_facts(job)
    plate = placed_plate(job.points, str(facts.plane), job.recording_path)

    def apart(first: int, last: int) -> float:
        return float(np.linalg.norm(plate.balls[last] - plate.balls[first]))

    return plate, None if facts.known is None else known_span(facts.known, plate.numbers, apart)
