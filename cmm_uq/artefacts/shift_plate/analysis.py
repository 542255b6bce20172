"""A plate shifted and turned in a plane, carried from data to result: read, check, fit all placings, make the table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.artefacts.shift_axis.analysis import check_facts, check_known, known_points
from cmm_uq.artefacts.shift_axis.curve import Curve
from cmm_uq.artefacts.shift_axis.integration import KnownSpan
from cmm_uq.artefacts.shift_plate.placed_plate import PlacedPlate, placed_plate
from cmm_uq.artefacts.shift_plate.plane import PlaneEstimate, estimate_plane
from cmm_uq.artefacts.shifting.correction_table import plane_correction_table
from cmm_uq.artefacts.shifting.found import Reported, ShiftFound, listed_draws, peak_to_valley
from cmm_uq.artefacts.shifting.kind import KnownLength, shift_facts
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, Unit, unit
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of

PEAK_TO_VALLEY = "peak_to_valley_um"


@dataclass(frozen=True, eq=False)
class PlaneShiftResult(ShiftFound):
    """All that is known of a plate's placings after their analysis."""

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
    def rotations(self) -> dict[str, Curve]:
        """Rotation of each carriage that carries the other axis, by name, rad."""
        normal = AXES[3 - sum(self.estimate.plate.axes)]
        return {ROTATION[AXES[axis], normal].name: curve for axis, curve in self.estimate.rotations.items()}

    @cached_property
    def scalars(self) -> dict[str, dict[str, Quantity]]:
        """Squareness, scales and sizes of the curves, by name and parameter; what is not determined is left out."""
        found: dict[str, dict[str, Quantity]] = {}
        for (name, parameter), (draws, own) in self._draws.items():
            found.setdefault(name, {})[parameter] = Quantity.of_draws(draws, own)
        for name, sized in self._sized.items():
            found.setdefault(name, {})[PEAK_TO_VALLEY] = peak_to_valley(sized)
        return {name: self.stating.all(name, quantities) for name, quantities in found.items()}

    @cached_property
    def reported(self) -> Reported:
        sizes = {
            (name, PEAK_TO_VALLEY): (np.ptp(d, axis=1) / MICROMETRE, unit("µm")) for name, d in self._sized.items()
        }
        return {".".join(key): drawn for key, drawn in (self._draws | sizes).items()}

    @cached_property
    def listed(self) -> Reported:
        found: dict[str, tuple[Floats, str]] = {}
        for name, curve in self.curves.items():
            found |= listed_draws(f"curves.{name}.error_um", curve.draws / MICROMETRE, "µm")
        for name, curve in self.rotations.items():
            found |= listed_draws(f"curves.{name}.error_arcsec", curve.draws / ARCSECOND, "″")
        for k, name in enumerate(("first_mm", "second_mm")):
            found |= listed_draws(f"artefact.{name}", self.estimate.balls[:, :, k], "mm")
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


def analyse_plane(job: Job, *, seed: int = 0, progress: Progress | None = None) -> PlaneShiftResult:
    """Analyse a shift job with a plate in a plane.

    ``[artefact] plane`` says which plane; all else as :func:`~cmm_uq.artefacts.shift_axis.analysis.analyse_shift`.
    """
    stated = job.facts.recording.u_coordinate_um
    plate, known = checked_plate(job)
    sigma = None if stated is None else stated * MICROMETRE
    return PlaneShiftResult(
        job, estimate_plane(plate, known, chain=job.facts.machine.chain, sigma=sigma, seed=seed, progress=progress)
    )


def checked_plate(job: Job) -> tuple[PlacedPlate, KnownSpan | None]:
    check_facts(job)
    facts = shift_facts(job)
    plate = placed_plate(job.points, str(facts.plane), job.recording_path)
    return plate, None if facts.known is None else _known(facts.known, plate)


def _known(given: KnownLength, plate: PlacedPlate) -> KnownSpan:
    first, last = known_points(given, plate.numbers)
    check_known(given, float(np.linalg.norm(plate.balls[last] - plate.balls[first])))
    return KnownSpan(first, last, given.length_mm, given.u_um * MICROMETRE)
