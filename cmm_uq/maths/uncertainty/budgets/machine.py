"""Two different uncertainties of a coordinate measuring machine: that of its test, and that of using it.

The test uncertainty (ISO/TS 23165, ISO 14253-5) says how well a test value is known: what the calibrated artefact, its
temperature and its mounting leave open. The machine's own errors are what is tested, so they are not in it. The
uncertainty of a measurement made with the machine (ISO 15530) contains them. Neither stands in for the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import REFERENCE_TEMPERATURE, unit
from cmm_uq.maths.uncertainty.budget import CERTIFICATE, JUDGEMENT, REPEATS, Budget, BudgetLine

FACTOR = 2.0  # coverage factor that ISO/TS 23165 and ISO 15530-3 prescribe
SIMULATION = say("simulation")
FEWEST_READINGS = 20  # of the calibrated workpiece, in ten cycles or more (ISO 15530-3:2011)

TEST = say(
    "Test uncertainty (ISO/TS 23165): of the test value. The machine's own errors are what is "
    "tested and are not in it; it is not the uncertainty of a measurement made with the machine."
)


def _use(source: Text) -> Text:
    return say(
        "Uncertainty of measurements made with the machine ({source}): valid for the same task, machine, strategy and "
        "conditions. It is not the test uncertainty of an acceptance or verification test.",
        source=source,
    )


def length_test_uncertainty(
    length_mm: float, u_calibration_mm: float, *, temperature_c: float = REFERENCE_TEMPERATURE, cte_per_k: float = 0.0,
    u_cte_per_k: float = 0.0, u_temperature_k: float = 0.0, u_alignment_mm: float = 0.0, u_fixturing_mm: float = 0.0,
    u_beside_mm: float = 0.0,
) -> Budget:  # fmt: skip
    """Test uncertainty of an error of length measurement E (ISO/TS 23165:2006), mm.

    ``u_fixturing_mm``: by what the clamping does to the length. ``u_beside_mm``: of the short gauge measured beside lengths
    that are not bidirectional by themselves; no line where 0.
    """
    mm, slope, warm = unit("mm"), length_mm * cte_per_k, say("temperature of the artefact")
    lines = [
        BudgetLine(say("calibration of the artefact"), u_calibration_mm, CERTIFICATE, unit=mm),
        _expansion(say("expansion coefficient of the artefact"), u_cte_per_k, length_mm, temperature_c),
        BudgetLine(warm, u_temperature_k, JUDGEMENT, temperature_c, unit("K"), sensitivity=slope),
        BudgetLine(say("alignment of the artefact"), u_alignment_mm, JUDGEMENT, unit=mm),
        BudgetLine(say("fixturing of the artefact"), u_fixturing_mm, JUDGEMENT, unit=mm),
    ]
    if u_beside_mm:
        lines.append(BudgetLine(say("calibration of the short gauge"), u_beside_mm, CERTIFICATE, unit=mm))
    measurand = say("test value of the error of length measurement, {length_mm:g} mm", length_mm=length_mm)
    return Budget(measurand, lines, unit=mm, factor=FACTOR, statement=TEST)


def probing_test_uncertainty(form_mm: float, u_form_mm: float) -> Budget:
    """Test uncertainty of a probing error P from the test sphere's form F (ISO/TS 23165:2006), mm."""
    lines = [
        BudgetLine(say("form of the test sphere, F/2"), form_mm / 2, CERTIFICATE, unit=unit("mm")),
        BudgetLine(say("calibration of the form"), u_form_mm, CERTIFICATE, unit=unit("mm")),
    ]
    return Budget(say("test value of the probing error"), lines, unit=unit("mm"), factor=FACTOR, statement=TEST)


def use_by_calibrated_workpiece(
    readings_mm: Sequence[float] | Floats, calibrated_mm: float, u_calibration_mm: float, *,
    temperature_c: float = REFERENCE_TEMPERATURE, u_cte_calibrated_per_k: float = 0.0,
    u_cte_workpieces_per_k: float = 0.0, u_form_mm: float = 0.0, expanding_mm: float | None = None, angle: bool = False,
) -> Budget:  # fmt: skip
    """Uncertainty of using the machine, from readings of a calibrated workpiece (ISO 15530-3:2011), mm.

    The value is the systematic error b = mean reading − calibrated value, by which results are corrected; where they
    are not, :func:`expanded_without_correction` says what to state.

    ``readings_mm``: of the calibrated workpiece, as workpieces are measured, at a mean ``temperature_c``. ``u_form_mm``: by
    what differs between workpieces: form, roughness, elasticity. ``expanding_mm``: length whose expansion counts, where it is
    not the calibrated value. ``angle``: whether values and uncertainties are in rad.
    """
    readings = np.asarray(readings_mm, dtype=np.float64)
    if len(readings) < FEWEST_READINGS:
        fix = f"ISO 15530-3 asks for {FEWEST_READINGS} in ten cycles or more"
        raise CmmUqError(f"{len(readings)} readings of the calibrated workpiece", fix=fix)
    length_unit = unit("rad" if angle else "mm")
    length = calibrated_mm if expanding_mm is None else abs(expanding_mm)
    scatter, dof = float(readings.std(ddof=1)), len(readings) - 1.0
    calibrated = say("expansion coefficient of the calibrated workpiece")
    lines = [
        BudgetLine(say("calibration of the workpiece"), u_calibration_mm, CERTIFICATE, unit=length_unit),
        BudgetLine(say("scatter of the process"), scatter, REPEATS, unit=length_unit, dof=dof),
        _expansion(calibrated, u_cte_calibrated_per_k, length, temperature_c),
        _expansion(say("expansion coefficient of the workpieces"), u_cte_workpieces_per_k, length, temperature_c),
        BudgetLine(say("form and surface of the workpieces"), u_form_mm, JUDGEMENT, unit=length_unit),
    ]
    bias, measurand = float(readings.mean()) - calibrated_mm, say("systematic error of the measurement process")
    statement = _use(say("ISO 15530-3, by a calibrated workpiece"))
    return Budget(measurand, lines, bias, length_unit, factor=FACTOR, statement=statement)


def expanded_without_correction(budget: Budget) -> float:
    """Expanded uncertainty U + |b| of results that are not corrected for the systematic error b."""
    return budget.expanded + abs(budget.value or 0.0)


def use_by_simulation(
    simulated_errors_mm: Sequence[float] | Floats, not_simulated: Sequence[BudgetLine] = (), coverage: float = 0.95
) -> Budget:
    """Uncertainty of using the machine, from simulated measurements of the task (ISO 15530-4:2008), mm.

    The value is the systematic error that the simulation found; see :func:`expanded_without_correction`.

    ``not_simulated``: lines of what the simulation leaves out; the standard asks that they be stated.
    """
    errors = np.asarray(simulated_errors_mm, dtype=np.float64)
    if len(errors) < 100:
        raise CmmUqError(f"{len(errors)} simulated measurements", fix="Simulate a hundred or more")
    scatter, dof = float(errors.std(ddof=1)), len(errors) - 1.0
    lines = [BudgetLine(say("simulated scatter"), scatter, SIMULATION, unit=unit("mm"), dof=dof), *not_simulated]
    bias, statement = float(errors.mean()), _use(say("ISO 15530-4, by simulation"))
    return Budget(say("error of the measurement task"), lines, bias, unit("mm"), coverage=coverage, statement=statement)


def _expansion(name: Text, u_cte_per_k: float, length_mm: float, temperature_c: float) -> BudgetLine:
    """L |t − 20 °C| u(α)."""
    slope = length_mm * abs(temperature_c - REFERENCE_TEMPERATURE)
    return BudgetLine(name, u_cte_per_k, JUDGEMENT, unit=unit("1/K"), sensitivity=slope)
