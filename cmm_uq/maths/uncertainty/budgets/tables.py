"""``[budget]`` of a budget file: a standard's or a measurement's budget by its name, and the figures that it takes.

Each table says in its fields what is asked for, and makes the budgets of that. Units stand in the names of the keys; inside
everything is in millimetres.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from math import sqrt
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Length, Position, Temperature, Triple, Uncertainty, key, required
from cmm_uq.base.messages import NOTHING, Text, Verbatim, foreign, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import ARCSECOND, MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.maths.geometry import cap_directions
from cmm_uq.maths.geometry.feature import BallForm
from cmm_uq.maths.uncertainty.budget import JUDGEMENT, Budget, BudgetLine
from cmm_uq.maths.uncertainty.budgets import machine, measurements

Coefficient = Annotated[float, Field(ge=0, le=1e-3)]  # of expansion, or its standard uncertainty, 1/K
Kelvin = Annotated[float, Field(ge=0, le=100)]  # a standard uncertainty of a temperature
Readings = Annotated[list[Position], Field(max_length=LISTED.most)]
Squarenesses = Annotated[list[Annotated[float, Field(ge=0, le=36_000)]], Field(min_length=3, max_length=3)]
Three = Annotated[list[Uncertainty], Field(min_length=3, max_length=3)]  # of x, y, z


class BudgetTable(JobTable):
    """What every ready budget has: its name, a title, and what the method is for (``meaning``)."""

    meaning: ClassVar[Text] = NOTHING
    title: str = key("", "Title of the page; the file's name where it is left out.")

    @abstractmethod
    def budgets(self) -> Mapping[str, Budget]:
        """By the name of the output, mm."""

    def correlation(self) -> Floats:
        return np.eye(len(self.budgets()))

    def remarks(self) -> Mapping[str, float]:
        """Further figures that the standard asks for, by a name with its unit."""
        return {}


class _OfUse(BudgetTable):
    def remarks(self) -> Mapping[str, float]:
        """U + |b|, of results that are not corrected."""
        (budget,) = self.budgets().values()
        return {"U_without_correction_mm": machine.expanded_without_correction(budget)}


class CalibratedWorkpiece(_OfUse):
    """``method = "ISO 15530-3"``."""

    meaning = say("ISO 15530-3:2011: uncertainty of measuring workpieces, from readings of a calibrated one.")

    method: Literal["ISO 15530-3"] = required("Name of the ready budget.")
    readings_mm: Readings = required("Readings of the calibrated workpiece.")
    calibrated_mm: Length = required("Calibrated value of the workpiece.")
    u_calibration_um: Uncertainty = required("Standard uncertainty of the calibrated value.")
    temperature_c: Temperature = key(REFERENCE_TEMPERATURE, "Temperature of the workpiece during the readings.")
    u_cte_calibrated_per_k: Coefficient = 0.0
    """Standard uncertainty of the calibrated workpiece's coefficient of expansion, 1/K."""
    u_cte_workpieces_per_k: Coefficient = 0.0
    """Standard uncertainty of the coefficient of expansion of the workpieces to be measured, 1/K."""
    u_form_um: Uncertainty = key(0.0, "Standard uncertainty by form and roughness of the workpieces to be measured.")

    def budgets(self) -> Mapping[str, Budget]:
        return {
            "systematic_error": machine.use_by_calibrated_workpiece(
                self.readings_mm, self.calibrated_mm, self.u_calibration_um * MICROMETRE, temperature_c=self.temperature_c,
                u_cte_calibrated_per_k=self.u_cte_calibrated_per_k, u_cte_workpieces_per_k=self.u_cte_workpieces_per_k,
                u_form_mm=self.u_form_um * MICROMETRE,
            )
        }  # fmt: skip


class NotSimulated(JobTable):
    """A contribution that a simulation leaves out."""

    name: Annotated[str, Field(min_length=1)] = required("What it is, in words.")
    u_um: Uncertainty = required("Its standard uncertainty.")
    source: str = key(JUDGEMENT, "Where the figure comes from.")


class SimulatedTask(_OfUse):
    """``method = "ISO 15530-4"``."""

    meaning = say("ISO/TS 15530-4:2008: uncertainty of a measurement task, from simulated measurements of it.")

    method: Literal["ISO 15530-4"] = required("Name of the ready budget.")
    simulated_errors_um: Annotated[list[float], Field(max_length=LISTED.most)]
    """Errors of the simulated measurements of the task."""
    not_simulated: Annotated[list[NotSimulated], Field(max_length=LISTED.most)] = Field(default_factory=list)
    """Contributions that the simulation leaves out."""

    def budgets(self) -> Mapping[str, Budget]:
        lines = [
            BudgetLine(Verbatim(one.name), one.u_um * MICROMETRE, foreign(one.source), unit=unit("mm"))
            for one in self.not_simulated
        ]
        return {"error": machine.use_by_simulation(np.array(self.simulated_errors_um) * MICROMETRE, lines)}


class LengthTest(BudgetTable):
    """``method = "ISO/TS 23165 length"``."""

    meaning = say("ISO/TS 23165:2006: test uncertainty of an error of length measurement E.")

    error_um: float = required("Error that the test found.")
    method: Literal["ISO/TS 23165 length"] = required("Name of the ready budget.")
    length_mm: Length = required("Calibrated length of the artefact.")
    u_calibration_um: Uncertainty = required("Standard uncertainty of that length.")
    temperature_c: Temperature = key(REFERENCE_TEMPERATURE, "Temperature of the artefact during the test.")
    cte_per_k: Coefficient = key(0.0, "Coefficient of thermal expansion of the artefact, 1/K.")
    u_cte_per_k: Coefficient = key(0.0, "Standard uncertainty of that coefficient, 1/K.")
    u_temperature_k: Kelvin = key(0.0, "Standard uncertainty of the artefact's temperature.")
    u_alignment_um: Uncertainty = key(0.0, "Standard uncertainty of the length by misalignment.")
    u_fixturing_um: Uncertainty = key(0.0, "Standard uncertainty of the length by the clamping.")

    def budgets(self) -> Mapping[str, Budget]:
        budget = machine.length_test_uncertainty(
            self.length_mm, self.u_calibration_um * MICROMETRE, temperature_c=self.temperature_c, cte_per_k=self.cte_per_k,
            u_cte_per_k=self.u_cte_per_k, u_temperature_k=self.u_temperature_k,
            u_alignment_mm=self.u_alignment_um * MICROMETRE, u_fixturing_mm=self.u_fixturing_um * MICROMETRE,
        )  # fmt: skip
        return {"E": budget.of(self.error_um * MICROMETRE)}


class ProbingTest(BudgetTable):
    """``method = "ISO/TS 23165 probing"``."""

    meaning = say("ISO/TS 23165:2006: test uncertainty of a probing error P.")

    error_um: float = required("Error that the test found.")
    method: Literal["ISO/TS 23165 probing"] = required("Name of the ready budget.")
    form_um: Uncertainty = required("Form deviation of the test sphere by its certificate.")
    u_form_um: Uncertainty = required("Standard uncertainty of that form deviation.")

    def budgets(self) -> Mapping[str, Budget]:
        budget = machine.probing_test_uncertainty(self.form_um * MICROMETRE, self.u_form_um * MICROMETRE)
        return {"P": budget.of(self.error_um * MICROMETRE)}


class BallbarBudget(BudgetTable):
    """``method = "ballbar length"``."""

    meaning = say("Length of a ballbar from one position of it, or from the mean of several.")

    method: Literal["ballbar length"] = required("Name of the ready budget.")
    length_mm: Length = required("Length of the bar.")
    direction: Triple = required("Direction of the bar, of any length.")
    u_centre_um: Three = required("Standard uncertainties along x, y, z of the centre of a ball.")
    form_shift_um: Uncertainty = key(0.0, "Largest shift of a centre by the form of its ball.")
    probe_um: Uncertainty = key(0.0, "Largest systematic shift of a ball by the probe.")
    probe_common: Annotated[float, Field(ge=-1, le=1)] = 0.0
    """Correlation of that shift between the two balls: 1 where both are seen the same way."""
    scale_um: Three = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Largest errors of the scales over the bar along x, y, z."""
    u_squareness_arcsec: Squarenesses = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Standard uncertainties of the squareness xy, yz, zx."""
    u_temperature_k: Kelvin = key(0.0, "Standard uncertainty of the bar's temperature.")
    cte_per_k: Coefficient = key(0.0, "Coefficient of thermal expansion of the bar, 1/K.")
    repetitions: Annotated[int, Field(ge=1, le=10_000)] = key(1, "Number of positions whose mean is stated.")

    def problems(self) -> Iterable[str]:
        if not any(self.direction):
            yield "direction = [0, 0, 0] points nowhere"

    def budgets(self) -> Mapping[str, Budget]:
        """Of the length; what repetitions do not share is divided by the root of their number."""
        direction = np.array(self.direction)
        one = measurements.ballbar_length(measurements.BallbarPosition(
            self.length_mm, direction / np.linalg.norm(direction), np.diag(np.square(self.u_centre_um)) * MICROMETRE**2,
            self.form_shift_um * MICROMETRE, self.probe_um * MICROMETRE, self.probe_common,
            [limit * MICROMETRE for limit in self.scale_um], [u * ARCSECOND for u in self.u_squareness_arcsec],
            self.u_temperature_k, self.cte_per_k,
        ))  # fmt: skip
        if self.repetitions == 1:
            return {"length": one}
        mean = say("mean length of the ballbar, {count} repetitions", count=self.repetitions)
        return {"length": one.mean_of(self.repetitions, mean)}


class FittedSphere(BudgetTable):
    """``method = "sphere fit"``."""

    meaning = say(
        "Centre and radius of a sphere fitted to points spread evenly over a cap about +z, form of the ball included."
    )

    method: Literal["sphere fit"] = required("Name of the ready budget.")
    centre_mm: Triple = required("Centre of the sphere.")
    radius_mm: Length = required("Radius of the sphere.")
    points: Annotated[int, Field(ge=4, le=1_000_000)] = required("Number of points, spread evenly.")
    cap_deg: Annotated[float, Field(gt=0, le=180)]
    """Angle from +z to the edge of the cap that the points cover: 90 for a hemisphere."""
    u_point_um: Uncertainty = required("Standard uncertainty of a point along its normal.")
    sphericity_um: Uncertainty = key(0.0, "Form deviation of the ball.")

    def budgets(self) -> Mapping[str, Budget]:
        """Of x, y, z and radius; the ball's axis may point anywhere."""
        scatter, form = self._covariances()
        # a budget takes the limits of a rectangular distribution, √3 times its standard uncertainty
        limits = sqrt(3.0) * np.sqrt(np.diag(form))
        return measurements.sphere_budgets([*self.centre_mm, self.radius_mm], scatter, limits)

    def correlation(self) -> Floats:
        scatter, form = self._covariances()
        u = np.sqrt(np.diag(scatter + form))
        return np.asarray((scatter + form) / np.outer(u, u))

    def _covariances(self) -> tuple[Floats, Floats]:
        directions = cap_directions(np.radians(self.cap_deg), self.points)
        form = BallForm(self.sphericity_um * MICROMETRE).covariance(directions)
        return measurements.sphere_covariance(directions, self.u_point_um * MICROMETRE), form


TABLES: Mapping[str, type[BudgetTable]] = {
    "ISO 15530-3": CalibratedWorkpiece, "ISO 15530-4": SimulatedTask, "ISO/TS 23165 length": LengthTest,
    "ISO/TS 23165 probing": ProbingTest, "ballbar length": BallbarBudget, "sphere fit": FittedSphere,
}  # fmt: skip
"""By ``method``."""
