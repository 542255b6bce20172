"""Lengths and temperature: standardisation to 20 °C, and the error of a scale against a reference.

Near 20 °C the product of expansion coefficient and temperature is flat in one or the other, so that first order loses
what second order or Monte Carlo keeps (JCGM 100:2008 H.1.7): evaluate these models with method ``auto``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.correlation import Correlations
from cmm_uq.maths.uncertainty.distributions import Distribution, constant
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel

UNITS: Mapping[str, str] = {
    "indicated_mm": "mm",
    "reference_mm": "mm",
    "workpiece_c": "degC",
    "workpiece_cte_per_k": "1/K",
    "scale_c": "degC",
    "scale_cte_per_k": "1/K",
    "length": "mm",
    "scale_error": "1",
}


def labels(origins: Mapping[str, str] | None = None) -> Labels:
    """Units of both models' quantities, and the origins given."""
    return Labels(UNITS, origins or {})


def _stretch(cte_per_k: Any, temperature_c: Any) -> Any:
    return 1.0 + cte_per_k * (temperature_c - REFERENCE_TEMPERATURE)


def length_at_20(
    indicated_mm: Distribution,
    workpiece_c: Distribution,
    workpiece_cte_per_k: Distribution,
    scale_c: Distribution | None = None,
    scale_cte_per_k: Distribution | None = None,
    correlation: Correlations | None = None,
) -> MeasurementModel:
    """Length at 20 °C (ISO 1) of a workpiece measured warm by a scale that may be warm too.

    Parameters
    ----------
    scale_c, scale_cte_per_k : of the scale; left out where the machine compensates its scales.
    correlation : such as that of the two temperatures, which one thermometer may have measured.
    """
    inputs = {
        "indicated_mm": indicated_mm,
        "workpiece_c": workpiece_c,
        "workpiece_cte_per_k": workpiece_cte_per_k,
        "scale_c": scale_c or constant(REFERENCE_TEMPERATURE),
        "scale_cte_per_k": scale_cte_per_k or constant(0.0),
    }

    def length(
        indicated_mm: Any, workpiece_c: Any, workpiece_cte_per_k: Any, scale_c: Any, scale_cte_per_k: Any
    ) -> Any:
        return indicated_mm * _stretch(scale_cte_per_k, scale_c) / _stretch(workpiece_cte_per_k, workpiece_c)

    return MeasurementModel(length, inputs, ("length",), correlation or {})


def scale_error(
    indicated_mm: Distribution,
    reference_mm: Distribution,
    workpiece_c: Distribution,
    workpiece_cte_per_k: Distribution,
    correlation: Correlations | None = None,
) -> MeasurementModel:
    """Relative scale error s, true = indicated · (1 + s), from a reference length calibrated at 20 °C."""
    inputs = {
        "indicated_mm": indicated_mm,
        "reference_mm": reference_mm,
        "workpiece_c": workpiece_c,
        "workpiece_cte_per_k": workpiece_cte_per_k,
    }

    def error(indicated_mm: Any, reference_mm: Any, workpiece_c: Any, workpiece_cte_per_k: Any) -> Any:
        return reference_mm * _stretch(workpiece_cte_per_k, workpiece_c) / indicated_mm - 1.0

    return MeasurementModel(error, inputs, ("scale_error",), correlation or {})
