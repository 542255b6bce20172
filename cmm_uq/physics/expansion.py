"""Thermal expansion: a length brought to 20 °C, with its uncertainty, and a table bent by a temperature gradient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.units import REFERENCE_TEMPERATURE


@dataclass(frozen=True)
class Body:
    """What is known of the expansion of a scale or an artefact.

    Parameters
    ----------
    cte : coefficient of linear thermal expansion, 1/K.
    u_cte : its standard uncertainty, 1/K.
    temperature : °C.
    u_temperature : its standard uncertainty, K.
    """

    cte: float = 0.0
    u_cte: float = 0.0
    temperature: float = REFERENCE_TEMPERATURE
    u_temperature: float = 0.0

    @property
    def excess(self) -> float:
        """Temperature above 20 °C, K."""
        return self.temperature - REFERENCE_TEMPERATURE

    @property
    def growth(self) -> float:
        """Length over length at 20 °C."""
        return 1 + self.cte * self.excess


UNMOVED = Body()
"""A scale that reads right as it is: at 20 °C, or compensated for its temperature already."""


@dataclass(frozen=True)
class StandardisedLength:
    """A length at 20 °C (ISO 1).

    Parameters
    ----------
    length : mm.
    u : standard uncertainty, mm.
    contributions : name and standard uncertainty in mm of each line. Without correlations their squares add up to u².
    """

    length: float
    u: float
    contributions: tuple[tuple[str, float], ...]


def standardised_length(
    indicated: float,
    artefact: Body,
    scale: Body = UNMOVED,
    *,
    u_indicated: float = 0.0,
    cte_correlation: float = 0.0,
    temperature_correlation: float = 0.0,
) -> StandardisedLength:
    """Length of an artefact at 20 °C from what a scale indicates: L·(1 + αs·(Ts − 20)) / (1 + αa·(Ta − 20)).

    The uncertainty is of first order (JCGM 100:2008 eq. 13), and the products of the uncertainties of coefficient and
    temperature are added (the note to 5.1.2): near 20 °C nothing else is left of the coefficient.

    Parameters
    ----------
    indicated : mm.
    artefact, scale : their expansion.
    u_indicated : standard uncertainty of the indicated length, mm.
    cte_correlation, temperature_correlation : between scale and artefact; one thermometer for both correlates their
        temperatures.

    Raises
    ------
    CmmUqError : a correlation outside −1 … 1, or a negative uncertainty.
    """
    uncertainties = (u_indicated, artefact.u_cte, artefact.u_temperature, scale.u_cte, scale.u_temperature)
    if min(uncertainties) < 0 or not np.isfinite(uncertainties).all():
        raise CmmUqError(
            "a standard uncertainty is negative or no number", fix="Give standard uncertainties of 0 or more"
        )
    for correlation in (cte_correlation, temperature_correlation):
        if not -1 <= correlation <= 1:
            raise CmmUqError(f"a correlation of {correlation}", fix="Correlations lie between -1 and 1")
    length = indicated * scale.growth / artefact.growth
    at_scale, at_artefact = length / scale.growth, -length / artefact.growth
    cte = np.array([at_scale * scale.excess * scale.u_cte, at_artefact * artefact.excess * artefact.u_cte])
    temperature = np.array(
        [at_scale * scale.cte * scale.u_temperature, at_artefact * artefact.cte * artefact.u_temperature]
    )
    product = np.array(
        [at_scale * scale.u_cte * scale.u_temperature, at_artefact * artefact.u_cte * artefact.u_temperature]
    )
    reading = length / indicated * u_indicated if indicated else u_indicated
    variance = (
        reading**2
        + _squared_sum(cte, cte_correlation)
        + _squared_sum(temperature, temperature_correlation)
        + _squared_sum(product, cte_correlation * temperature_correlation)
    )
    names = ("scale", "artefact")
    lines = [("indicated length", abs(reading))]
    for what, values in (
        ("expansion coefficient", cte),
        ("temperature", temperature),
        ("coefficient × temperature", product),
    ):
        lines += [(f"{what} of {name}", float(abs(value))) for name, value in zip(names, values, strict=True)]
    return StandardisedLength(length, float(np.sqrt(variance)), tuple(lines))


@dataclass(frozen=True)
class Table:
    """A table whose top and bottom are not at one temperature.

    Parameters
    ----------
    cte : 1/K (granite about 6.5e-6).
    thickness : mm.
    """

    cte: float
    thickness: float

    def __post_init__(self) -> None:
        if not self.thickness > 0:
            raise CmmUqError(f"a table {self.thickness} mm thick", fix="Give its thickness in mm")

    def rotation(self, distance: float, top_less_bottom: float) -> float:
        """Rotation about y of a carriage that has gone ``distance`` mm along x, rad: positive for a warmer top.

        This is the parameter of the effect ``thermal_gradient``, which is this table's cte over its thickness.
        """
        return self.cte * top_less_bottom / self.thickness * distance

    def bow(self, length: float, top_less_bottom: float) -> float:
        """Height of the middle above the ends over a length, mm: positive for a warmer top."""
        return self.cte * top_less_bottom / self.thickness * length**2 / 8


def _squared_sum(values: np.ndarray[tuple[int], np.dtype[np.float64]], correlation: float) -> float:
    """Variance of the sum of two contributions with a correlation."""
    return float(np.sum(values**2) + 2 * correlation * values[0] * values[1])
