"""Indicated lengths of a bar at 20 °C against the length that they are compared with, one by one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.result import Result


@dataclass(frozen=True, eq=False)
class Lengths:
    """Every recorded length, used or not.

    Parameters
    ----------
    measurement, repeat : (m,).
    length : (m,) as indicated, at 20 °C, mm.
    reference : that it is compared with, mm.
    residual_um : (m,) what the fitted model leaves, µm.
    expanded_um, coverage_factor : U of each for the noise of its points, µm, and its k.
    used, flagged : (m,) whether the error factors rest on it, and whether the screening found its measurement odd.
    """

    measurement: Ints
    repeat: Ints
    length: Floats
    reference: float
    residual_um: Floats
    expanded_um: float
    coverage_factor: float
    used: NDArray[np.bool_]
    flagged: NDArray[np.bool_]

    @property
    def deviation_um(self) -> Floats:
        """(m,) from the reference, µm."""
        return np.asarray((self.length - self.reference) / MICROMETRE, dtype=np.float64)

    def as_data(self) -> dict[str, Any]:
        """For results.json."""
        return {
            "reference_mm": self.reference,
            "U_um": self.expanded_um,
            "k": self.coverage_factor,
            "each": [
                {"measurement": int(m), "repeat": int(r), "length_mm": length, "deviation_um": deviation,
                 "residual_um": residual, "used": bool(used), "flagged": bool(flagged)}
                for m, r, length, deviation, residual, used, flagged in zip(
                    self.measurement, self.repeat, self.length.tolist(), self.deviation_um.tolist(),
                    self.residual_um.tolist(), self.used, self.flagged, strict=True,
                )
            ],
        }  # fmt: skip


def lengths_of(result: Result, length: Floats, reference: float) -> Lengths:
    """Of a result.

    Parameters
    ----------
    length : (m,) of every observation at 20 °C, mm.
    reference : that it is compared with, mm.
    """
    artefact = result.artefact
    noise = result.noise
    expanded, factor = result.at_least(
        "lengths.U_um", noise.expanded * float(artefact.noise_scale[0]), noise.coverage_factor, unit("µm"), reference
    )
    return Lengths(
        artefact.measurement, artefact.repeat, length, reference, result.residuals / MICROMETRE, expanded,
        factor, result.model.used, result.flagged,
    )  # fmt: skip
