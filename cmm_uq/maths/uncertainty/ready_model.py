"""Ready measurement models of a model file: ``[model] ready = "length_at_20"`` in place of outputs.

The inputs of the file are those of the model, by their names; what is said of each, and of their correlations, stays the
file's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from inspect import Parameter, signature
from types import MappingProxyType
from typing import Any

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import Text, say
from cmm_uq.maths.uncertainty.air.interferometer import Interferometer, interferometer_model
from cmm_uq.maths.uncertainty.air.state import Air
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.budgets.temperature import labels as temperature_labels
from cmm_uq.maths.uncertainty.budgets.temperature import length_at_20, scale_error
from cmm_uq.maths.uncertainty.budgets.triangle import triangle_angles
from cmm_uq.maths.uncertainty.correlation import Correlations
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel

Built = tuple[MeasurementModel, Labels]


@dataclass(frozen=True)
class ReadyModel:
    """A model by its name.

    Parameters
    ----------
    title : what it gives, in words.
    inputs : names, and whether each is needed.
    build : of the inputs and the correlations: the model, and units and origins of its quantities.
    """

    title: Text
    inputs: Mapping[str, bool]
    build: Callable[[Mapping[str, Distribution], Correlations], Built]

    def of(self, given: Mapping[str, Distribution], correlation: Correlations) -> Built:
        """The model of these inputs.

        Raises
        ------
        CmmUqError : an input is missing, or not one of its.
        """
        for name in given:
            if name not in self.inputs:
                raise CmmUqError(f"{name!r} is no input of this model", fix=suggestion(name, self.inputs))
        for name, needed in self.inputs.items():
            if needed and name not in given:
                raise CmmUqError(f"the input {name!r} is missing", fix=f"Describe it in a table [inputs.{name}]")
        return self.build(given, correlation)


def _by(function: Callable[..., MeasurementModel], found: Labels) -> Callable[..., Built]:
    return lambda given, correlation: (function(**given, correlation=dict(correlation)), found)


def _of_signature(function: Callable[..., MeasurementModel]) -> dict[str, bool]:
    return {
        name: parameter.default is Parameter.empty
        for name, parameter in signature(function).parameters.items()
        if name != "correlation"
    }


def _interferometer(given: Mapping[str, Distribution], correlation: Correlations) -> Built:
    of_air = {field.name for field in fields(Air)}
    air = Air(**{name: known for name, known in given.items() if name in of_air})  # type: ignore[arg-type]
    own = {name: known for name, known in given.items() if name not in of_air}
    setup = Interferometer(own.pop("vacuum_mm"), air, **own)  # type: ignore[arg-type]
    model = interferometer_model(setup)
    return MeasurementModel(model.function, model.inputs, model.outputs, dict(correlation)), setup.labels


_INTERFEROMETER = {
    "vacuum_mm": True, "temperature_c": True, "pressure_pa": False, "humidity_pct": False, "dew_point_c": False,
    "co2_ppm": False, "wavelength_nm": False, "dead_path_mm": False, "zero_refractivity": False, "angle_rad": False,
    "material_c": False, "cte_per_k": False,
}  # fmt: skip

_ANGLES = Labels({"a_mm": "mm", "b_mm": "mm", "c_mm": "mm", "alpha": "rad", "beta": "rad", "gamma": "rad"})

READY: Mapping[str, ReadyModel] = MappingProxyType({
    "length_at_20": ReadyModel(
        say("Length at 20 °C"), _of_signature(length_at_20), _by(length_at_20, temperature_labels())
    ),
    "scale_error": ReadyModel(
        say("Relative error of a scale"), _of_signature(scale_error), _by(scale_error, temperature_labels())
    ),
    "triangle_angles": ReadyModel(
        say("Angles of a triangle from its sides"), _of_signature(triangle_angles), _by(triangle_angles, _ANGLES)
    ),
    "interferometer": ReadyModel(say("Length by laser interferometer"), _INTERFEROMETER, _interferometer),
})  # fmt: skip
"""By name."""


def ready_model(
    model: Mapping[str, Any], inputs: Mapping[str, Distribution], units: Mapping[str, str], correlation: Correlations
) -> Built:
    """The ready model that ``[model]`` of a file names.

    Parameters
    ----------
    model : ``[model]``.
    inputs, units : of the file, by name; a unit may be left out.
    correlation : of the inputs.

    Raises
    ------
    CmmUqError : there is no such model, the inputs are not its, or ``[model]`` has outputs as well.
    """
    for key in ("outputs", "units"):
        if key in model:
            raise CmmUqError(
                f"{key} is given, and the ready model has its own", where="[model] ready", fix="Leave one of them out"
            )
    name = model["ready"]
    if not isinstance(name, str) or name not in READY:
        raise CmmUqError(f"there is no ready model {name!r}", where="[model] ready", fix=suggestion(str(name), READY))
    whole, labels = READY[name].of(inputs, correlation)
    for key, unit in units.items():
        if unit and unit != labels.units[key]:
            raise CmmUqError(
                f"{key} is taken in {labels.units[key]}", where=f"[inputs.{key}] unit",
                fix=f"Give it in {labels.units[key]}, or leave the unit out",
            )  # fmt: skip
    return whole, labels
