"""``[laboratory]``: who answers for the certificate, and the least uncertainty that it may state."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cmm_uq.base.files.table import Limit, Table, at_least

_LENGTHS = {"mm": 1e-3, "µm": 1.0}
"""Units of lengths, and how many of each a micrometre is."""

_RATIOS, _ANGLES = ("ppm", "µm/m"), ("″",)


class LengthCapability(Table):
    """U = A + L/K of a length, L in mm and U in µm; without ``k`` the same for every length."""

    a_um: Limit
    """A of U = A + L/K."""
    k: Annotated[float, Field(gt=0, le=1e12), at_least(1e-3)] | None = None
    """K of U = A + L/K, with L in mm and U in µm; without it U is the same for every length."""


class Capability(Table):
    """``[laboratory.cmc]``: calibration and measurement capability, the least U (95 %, k = 2) that a certificate may state.

    Attributes
    ----------
    length : of what is stated in mm or µm.
    scale_ppm : of what is stated in ppm or µm/m.
    angle_arcsec : of what is stated in ″.
    """

    length: LengthCapability | None = None
    """Least U of what is stated in mm or µm."""
    scale_ppm: Limit | None = None
    """Least U of what is stated in ppm or µm/m."""
    angle_arcsec: Limit | None = None
    """Least U of what is stated in ″."""

    def least(self, unit: str, length_mm: float) -> float:
        """The least U of a quantity in its own unit; 0 where none is given for it.

        Parameters
        ----------
        unit : as printed.
        length_mm : that the quantity is of, or rests on.
        """
        if unit in _LENGTHS and self.length is not None:
            per_length = length_mm / self.length.k if self.length.k else 0.0
            return (self.length.a_um + per_length) * _LENGTHS[unit]
        if unit in _RATIOS:
            return self.scale_ppm or 0.0
        return (self.angle_arcsec or 0.0) if unit in _ANGLES else 0.0


class Laboratory(Table):
    """``[laboratory]``: who answers for the certificate."""

    name: str = ""
    """Name of the laboratory (7.8.2.1 b)."""
    address: str = ""
    """Address of the laboratory (7.8.2.1 b)."""
    country: Annotated[str, Field(pattern=r"^([A-Z]{2})?$")] = ""
    """Country of the laboratory, two capital letters of ISO 3166-1; the digital certificate asks for it."""
    accreditation: str = ""
    """Accreditation as it is printed, with its number."""
    signatory: str = ""
    """Who authorises the certificate (7.8.2.1 o)."""
    signatory_role: str = ""
    """Function of who authorises it."""
    logo: str = ""
    """File of its logo, SVG or PNG, beside job.toml: it stands at the head of certificates."""
    four_eyes: bool = False
    """Whether two persons, neither of them the operator, must release a certificate before it is released."""
    cmc: Capability | None = None
    """Calibration and measurement capability: the least U (95 %, k = 2) that a certificate may state."""
