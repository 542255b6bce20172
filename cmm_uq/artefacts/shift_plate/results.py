"""results.json of a plate shifted and turned in a plane: curves, scales, squareness, the plate, and what stays open."""

from __future__ import annotations

from typing import Any

from cmm_uq.artefacts.shift_axis.results import curve_data, sampling_data
from cmm_uq.artefacts.shift_plate.analysis import PlaneShiftResult
from cmm_uq.base.points import AXES
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.certificate.results.contents import covariance_data, head
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.jobs.verdicts import NO_VERDICTS


def plane_shift_results(result: PlaneShiftResult) -> dict[str, Any]:
    """A result as plain data, in the layout of the schema ``cmm-uq/results/1``; no diagnosis, no accuracy of lengths."""
    job, estimate = result.job, result.estimate
    plate, free = estimate.plate, estimate.free
    before, after = result.disagreement_um
    balls, u, U = result.balls
    u_um = u / MICROMETRE
    return {
        **head(job, effects=False),
        "estimates": {
            name: {parameter: quantity_data(q) for parameter, q in parameters.items()}
            for name, parameters in result.scalars.items()
        },
        "covariance": covariance_data(result.covariance),
        "observations": len(plate.ball),
        "noise": {
            "stated_coordinate_um": job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(result.repeatability),
        },
        "sampling": sampling_data(estimate.chains, estimate.seed, len(estimate.sigma)),
        "curves": {
            **{name: curve_data(curve, result.stated_along(curve), MICROMETRE, "um") for name, curve in result.curves.items()},
            **{
                name: curve_data(curve, result.stated_along(curve, ARCSECOND, "″"), ARCSECOND, "arcsec")
                for name, curve in result.rotations.items()
            },
        },
        "artefact": {
            "point": plate.numbers.tolist(), "first_mm": balls[:, 0].tolist(), "second_mm": balls[:, 1].tolist(),
            "u_first_um": u_um[:, 0].tolist(), "u_second_um": u_um[:, 1].tolist(), "U_first_mm": U[:, 0].tolist(),
            "U_second_mm": U[:, 1].tolist(), "size_determined": free.size_known,
        },
        "placings": [
            {"measurement": int(number), "turned_deg": float(turn), "middle_mm": middle.tolist(),
             "balls": int(count)}
            for number, turn, middle, count in zip(
                plate.placings, plate.turned_deg, plate.middles, plate.counts, strict=True
            )
        ],
        "identifiability": {
            "not_determined": [list(combination) for combination in free.combinations],
            "period_not_seen_mm": {AXES[axis]: p for axis, p in zip(plate.axes, free.periods, strict=True)},
        },
        "improvement": {"rms_before_um": before, "rms_after_um": after},
        "conformity": [],
        "verdicts": NO_VERDICTS.data(),
    }  # fmt: skip
