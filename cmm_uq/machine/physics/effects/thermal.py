"""Temperature: expansion of the scales and of the artefact, bending of the table by a gradient.

The coefficients are what the compensation left out: a machine whose software corrects its scales has the coefficient of
thermal expansion zero here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.machine.physics.effect import Amount, Effect, Parameter, along
from cmm_uq.machine.physics.effects.rigid_body import turned

# coefficient of thermal expansion; glass 8, steel 11.5, aluminium 23 ppm/K bound what is possible.
EXPANSION = Parameter("cte_per_k", unit("1/K"), 12e-6, say("expansion"))


class ThermalScale(Effect):
    """Expansion of a scale."""

    formula = "e_a = α·(temp_a − 20 °C)·a"
    mechanism = "temperature"
    points_to = say("the scale expands and its temperature is not, or wrongly, compensated")

    coefficients = (EXPANSION,)

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"thermal_scale_{axis}"
        self.title = say("Thermal expansion of scale {axis}", axis=Verbatim(axis.upper()))
        self.columns = (f"temp_{axis}_c",)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "the scale of {axis} expands by {size} {more} than is compensated",
            axis=Verbatim(self.axis.upper()), size=amount.size, more=amount.more(say("more"), say("less")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        excess = points.column(f"temp_{self.axis}_c") - REFERENCE_TEMPERATURE
        return along(self.axis, excess * points.readings[self.axis])


class ThermalArtefact(Effect):
    """Expansion of the artefact.

    As a displacement it draws the points together about their middle to where they would lie at 20 °C.
    """

    name = "thermal_artefact"
    title = say("Thermal expansion of the artefact")
    formula = "length = length at 20 °C · (1 + α·(temp_artefact − 20 °C))"
    mechanism = "artefact"
    points_to = say("the artefact expands and its temperature is not, or wrongly, compensated")
    coefficients = (EXPANSION,)
    columns = ("temp_artefact_c",)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "the artefact expands by {size} {more} than is reckoned with",
            size=amount.size, more=amount.more(say("more"), say("less")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        excess = points.column("temp_artefact_c") - REFERENCE_TEMPERATURE
        return (-excess[:, None] * (points.xyz - points.group_means(points.xyz)))[:, :, None]


class ThermalGradient(Effect):
    """Table bent by a gradient: carriage x turns about y."""

    name = "thermal_gradient"
    title = say("Bending by the temperature gradient in the {what}", what=say("table"))
    formula = "e = ε × what carriage x carries, ε_y = k·(temp_table_top − temp_table_bottom)·(x − x0)"
    mechanism = "temperature"
    points_to = say("the table bends: top and bottom differ in temperature")
    coefficients = (Parameter("arcsec_per_m_k", unit("″/(m·K)"), 20.0),)
    columns = ("temp_table_top_c", "temp_table_bottom_c")

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, _ = points.machine.travel("x")
        gradient = points.column("temp_table_top_c") - points.column("temp_table_bottom_c")
        angle = ARCSECOND * gradient * (points.readings["x"] - low) / METRE
        return turned(points, "x", "y", angle)


SCALE_EXPANSION = MappingProxyType({a: ThermalScale(a) for a in AXES})  # by axis
EFFECTS: tuple[Effect, ...] = (*SCALE_EXPANSION.values(), ThermalArtefact(), ThermalGradient())
