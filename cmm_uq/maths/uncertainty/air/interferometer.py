"""Lengths by laser interferometer: wavelength compensation, dead path, alignment, and the workpiece at 20 °C.

The counter adds up half wavelengths. Between zeroing (air of index n₀ all along the way) and reading (index n) the optical
path difference changes by 2 [n (D + L) − n₀ D], where D is the dead path between the interferometer and the place of
zeroing; so with V the displacement as vacuum wavelengths count it,

    L = [V − D (n − n₀)] / (n cos θ)

where θ is the angle between beam and motion. A workpiece of temperature t is 1 + α (t − 20) longer than at 20 °C.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.maths.uncertainty.air.state import Air, check_range, equation_by_name, refractivity_of
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.distributions import Distribution, constant, normal
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel


@dataclass(frozen=True, eq=False)
class Interferometer:
    """What a displacement measured by laser rests on."""

    vacuum_mm: Distribution  # displacement in vacuum wavelengths; its uncertainty is that of resolution and noise
    air: Air  # at the time of the reading
    dead_path_mm: Distribution | None = None  # between the interferometer and the place of zeroing
    zero_refractivity: Distribution | None = None  # n₀ − 1 at zeroing; None means the air has not changed since
    angle_rad: Distribution | None = None  # between beam and motion
    material_c: Distribution | None = None  # temperature of what is measured; None leaves the length as it is
    cte_per_k: Distribution | None = None  # its expansion coefficient
    origins: Mapping[str, str] = field(default_factory=dict)  # of the figures, by the names of the model's inputs

    @property
    def labels(self) -> Labels:
        """Units and origins of the inputs and of the length."""
        units = {"vacuum_mm": "mm", "dead_path_mm": "mm", "zero_refractivity": "1", "angle_rad": "rad"}
        units |= {"material_c": "degC", "cte_per_k": "1/K", "length": "mm"}
        return Labels({**self.air.labels.units, **units}, {**self.air.labels.origins, **self.origins})


def interferometer_model(setup: Interferometer, equation: str = "ciddor") -> MeasurementModel:
    """Measurement model of the length, mm, at 20 °C where the material's temperature is given.

    The wavelength enters twice: through the count, as a relative error of V, and (hardly) through the dispersion of air.
    Raises :class:`CmmUqError` for an unknown equation, or air out of its range.
    """
    chosen = equation_by_name(equation)
    check_range(setup.air, chosen)
    nominal = setup.air.inputs["wavelength_nm"].mean
    names = ("vacuum_mm", "dead_path_mm", "zero_refractivity", "angle_rad", "material_c", "cte_per_k")
    inputs: dict[str, Distribution] = {name: given for name in names if (given := getattr(setup, name)) is not None}
    inputs |= {**setup.air.inputs, "equation": normal(0.0, chosen.u)}
    if setup.dead_path_mm is None:
        inputs["dead_path_mm"] = constant(0.0)

    def length(**values: Any) -> Any:
        refractivity = refractivity_of(chosen, values)
        counted = values["vacuum_mm"] * values["wavelength_nm"] / nominal
        changed = refractivity - values["zero_refractivity"] if "zero_refractivity" in values else 0.0
        along_beam = (counted - values["dead_path_mm"] * changed) / (1.0 + refractivity)
        straight = along_beam / np.cos(values["angle_rad"]) if "angle_rad" in values else along_beam
        if "material_c" not in values:
            return straight
        return straight / (1.0 + values["cte_per_k"] * (values["material_c"] - REFERENCE_TEMPERATURE))

    return MeasurementModel(length, inputs, ("length",))
