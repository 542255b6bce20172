"""results.json of a shift job: the curve with its uncertainty, the scale, and what the shifts leave open."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from cmm_uq import __version__
from cmm_uq.analysis.shifting import ShiftResult
from cmm_uq.certificate.results_file import SCHEMA
from cmm_uq.conformity.quantity import Quantity
from cmm_uq.jobs.reading import sha256
from cmm_uq.points import Floats
from cmm_uq.selfcalibration.curve import Curve
from cmm_uq.units import MICROMETRE


def shift_results(result: ShiftResult) -> dict[str, Any]:
    """A result as plain data, in the layout of the schema ``cmm-uq/results/1``; no diagnosis, no accuracy of lengths."""
    job, estimate = result.job, result.estimate
    chains, axis = estimate.chains, result.axis
    estimates = {f"linearity_{axis}": {"peak_to_valley_um": _quantity(result.linearity)}}
    if result.scale is not None:
        estimates[f"scale_{axis}"] = {"ppm": _quantity(result.scale)}
    before, after = estimate.residuals
    return {
        "schema": SCHEMA,
        "software": {"name": "cmm-uq", "version": __version__},
        "job": {"id": job.facts.job.id, "inputs_sha256": sha256(job.inputs)},
        "estimates": estimates,
        "noise": {
            "stated_coordinate_um": job.facts.recording.u_coordinate_um,
            "coordinate_um": _quantity(result.repeatability),
        },
        "sampling": {
            "sampler": chains.sampler, "seed": estimate.seed, "draws": len(estimate.sigma), "ess_min": chains.ess_min,
            "rhat_max": chains.rhat_max, "steps": chains.steps,
            "autocorrelation_time": chains.autocorrelation_time, "converged": chains.converged,
        },
        "curves": {f"linearity_{axis}": _curve(estimate.curve)},
        "integrations": {
            method: {"position_mm": _plain(curve.position), "error_um": _um(curve.error), "u_um": _um(curve.u)}
            for method, curve in result.integrated.items()
        },
        "artefact": {"point": estimate.series.numbers.tolist(),
                     "distance_mm": _plain(estimate.artefact.mean(axis=0)) if estimate.scale_known else None,
                     "u_um": _um(estimate.artefact.std(axis=0, ddof=1)) if estimate.scale_known else None},
        "identifiability": {
            "scale_determined": estimate.scale_known,
            "period_not_seen_mm": result.undetermined.period,
            "patterns_not_seen": [
                {"position_mm": _plain(estimate.series.positions), "weight": _plain(pattern)}
                for pattern in result.undetermined.patterns.T
            ],
        },
        "improvement": {"rms_before_um": _rms(before), "rms_after_um": _rms(after)},
        "conformity": [],
    }  # fmt: skip


def _quantity(quantity: Quantity) -> dict[str, Any]:
    return {key: value for key, value in asdict(quantity).items() if key != "unit"}


def _curve(curve: Curve) -> dict[str, Any]:
    low, high = curve.interval95
    return {
        "position_mm": _plain(curve.position), "error_um": _um(curve.error), "u_um": _um(curve.u),
        "interval95_um": [_um(low), _um(high)], "simultaneous_factor95": curve.simultaneous_factor,
    }  # fmt: skip


def _plain(values: Floats) -> list[float]:
    return [float(v) for v in values]


def _um(values: Floats) -> list[float]:
    return _plain(values / MICROMETRE)


def _rms(values: Floats) -> float:
    return float((values @ values / len(values)) ** 0.5) / MICROMETRE
