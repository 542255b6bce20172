"""results.json of a shift job: the curve with its uncertainty, the scale, and what the shifts leave open."""

from __future__ import annotations

from typing import Any

from cmm_uq.artefacts.shift_axis.analysis import ShiftResult
from cmm_uq.artefacts.shift_axis.curve import Curve
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.results.contents import covariance_data, head
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.jobs.verdicts import NO_VERDICTS
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.inference.ensembles import Chains


def shift_results(result: ShiftResult) -> dict[str, Any]:
    """A result as plain data, in the layout of the schema ``cmm-uq/results/1``; no diagnosis, no accuracy of lengths."""
    job, estimate = result.job, result.estimate
    axis = result.axis
    estimates = {f"linearity_{axis}": {"peak_to_valley_um": quantity_data(result.linearity)}}
    if result.scale is not None:
        estimates[SCALE[axis].name] = {"ppm": quantity_data(result.scale)}
    before, after = result.disagreement_um
    joint, distances = result.beside_integrations, result.distances
    return {
        **head(job, effects=False),
        "estimates": estimates,
        "covariance": covariance_data(result.covariance),
        "observations": len(estimate.series.reading),
        "noise": {
            "stated_coordinate_um": job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(result.repeatability),
        },
        "sampling": sampling_data(estimate.chains, estimate.seed, len(estimate.sigma)),
        "curves": {f"linearity_{axis}": curve_data(estimate.curve, result.stated_along(estimate.curve), MICROMETRE, "um")},
        "integrations": {
            method: {"position_mm": curve.position.tolist(), "error_um": _um(curve.error), "u_um": _um(curve.u)}
            for method, curve in result.integrated.items()
        },
        "beside_integrations": None if joint is None else curve_data(joint, joint.expanded, MICROMETRE, "um"),
        "artefact": {"point": estimate.series.numbers.tolist(),
                     "distance_mm": None if distances is None else distances[0].tolist(),
                     "u_um": None if distances is None else _um(distances[1]),
                     "U_mm": None if distances is None else distances[2].tolist()},
        "shifts": [
            {"nominal_mm": nominal, "mm": quantity_data(shift)}
            for nominal, shift in zip(estimate.series.shifts.tolist(), result.shifts, strict=True)
        ],
        "identifiability": {
            "scale_determined": estimate.scale_known,
            "period_not_seen_mm": result.undetermined.period,
            "patterns_not_seen": [
                {"position_mm": estimate.series.positions.tolist(), "weight": pattern.tolist()}
                for pattern in result.undetermined.patterns.T
            ],
        },
        "improvement": {"rms_before_um": before, "rms_after_um": after},
        "conformity": [],
        "verdicts": NO_VERDICTS.data(),
    }  # fmt: skip


def sampling_data(chains: Chains, seed: int, draws: int) -> dict[str, Any]:
    """How the sampling went."""
    return {
        "sampler": chains.sampler, "seed": seed, "draws": draws, "ess_min": chains.ess_min, "rhat_max": chains.rhat_max,
        "steps": chains.steps, "autocorrelation_time": chains.autocorrelation_time, "converged": chains.converged,
    }  # fmt: skip


def curve_data(curve: Curve, expanded: Floats, unit: float, suffix: str) -> dict[str, Any]:
    """A curve with its uncertainty, U as it is stated, in a unit with that suffix."""
    low, high = curve.interval95
    return {
        "position_mm": curve.position.tolist(), f"error_{suffix}": (curve.error / unit).tolist(),
        f"u_{suffix}": (curve.u / unit).tolist(),
        f"interval95_{suffix}": [(low / unit).tolist(), (high / unit).tolist()],
        f"U_{suffix}": (expanded / unit).tolist(), f"band_{suffix}": (curve.band / unit).tolist(),
        "simultaneous_factor95": curve.simultaneous_factor,
    }  # fmt: skip


def _um(values: Floats) -> list[float]:
    found: list[float] = (values / MICROMETRE).tolist()
    return found
