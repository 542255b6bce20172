"""``[by_calibrated_part]`` and ``[by_orientations]``: other ways to the part's uncertainty, from recordings."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.limits import INPUTS
from cmm_uq.base.files.table import Length, Limit, Table, Temperature, Uncertainty
from cmm_uq.base.units import REFERENCE_TEMPERATURE

SmallExpansion = Annotated[float, Field(ge=0, le=1e-4)]
Name = Annotated[str, Field(min_length=1, max_length=100)]
Seconds = Annotated[float, Field(gt=0, le=1e6)]


class CalibratedFacts(Table):
    """One ``[[by_calibrated_part.characteristic]]``."""

    name: Name
    """Name of the characteristic, as in `[[characteristic]]`."""
    value_mm: Annotated[float, Field(ge=-1e7, le=1e7)] | None = None
    """Its value on the calibrated part, of lengths and zones."""
    u_um: Limit | None = None
    """Standard uncertainty of that value."""
    value_deg: Annotated[float, Field(ge=-360, le=360)] | None = None
    """Its value on the calibrated part, of angles."""
    u_arcsec: Seconds | None = None
    """Standard uncertainty of that angle."""
    u_part_um: Uncertainty = 0.0
    """Standard uncertainty by what differs between parts: form, roughness, elasticity."""
    u_part_arcsec: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """The same, of an angle."""

    @model_validator(mode="after")
    def _one_unit(self) -> Self:
        length, angle = (self.value_mm, self.u_um), (self.value_deg, self.u_arcsec)
        if None in length and None in angle:
            raise ValueError("give value_mm and u_um, or value_deg and u_arcsec of an angle, of its certificate")
        if any(one is not None for one in length) and any(one is not None for one in angle):
            raise ValueError("give either value_mm and u_um, or value_deg and u_arcsec")
        return self

    @property
    def angle(self) -> bool:
        """Whether it is stated as one."""
        return self.value_deg is not None


class CalibratedPartFacts(Table):
    """``[by_calibrated_part]``: a calibrated part like this one, measured again and again (ISO 15530-3)."""

    file: Name
    """CSV with the column `cycle` (1, 2, …: the set-up), and `characteristic` with `value_mm` or `value_deg`, or else
    `feature`, `point`, `x_mm`, `y_mm`, `z_mm`; with `repeat` where a set-up was measured several times."""
    characteristic: Annotated[list[CalibratedFacts], Field(min_length=1, max_length=INPUTS.most)]
    """What the certificate of the calibrated part states."""
    certificate: str = ""
    """Number of that certificate, and whose it is."""
    corrected: bool = True
    """Whether results of the part are corrected by the systematic error that the calibrated part shows."""
    temperature_c: Temperature = REFERENCE_TEMPERATURE
    """Mean temperature of the calibrated part."""
    u_cte_per_k: SmallExpansion = 0.0
    """Standard uncertainty of its coefficient of expansion, 1/K."""
    same_procedure: bool | None = None
    """Whether it was measured as the part is: the same points, styli, speeds, clamping."""
    similar: bool | None = None
    """Whether it is like the part: size within 10 % (25 mm below 250 mm), angles within 5°, form, roughness and material
    alike."""
    conditions_varied: bool | None = None
    """Whether the repeats lie far enough apart to show what varies in use: times of day, temperatures, operators."""
    substitution: bool | None = None
    """Whether the part is measured in place of the calibrated part: where it lay, turned as it was, soon after it."""
    place_varied: bool = False
    """Whether it lay in another place in each set-up, as parts do."""
    qualified_anew: bool = False
    """Whether the styli were qualified anew for each set-up."""


class LengthStandardFacts(Table):
    """``[by_orientations.length_standard]``."""

    length_mm: Length
    """Calibrated length."""
    u_um: Limit
    """Standard uncertainty of the calibrated length."""
    file: Name
    """CSV with the columns `orientation`, `repeat`, `length_mm`: the standard as it was measured, best along directions of the
    part's lengths."""
    certificate: str = ""
    """Number of its certificate, and whose it is."""
    temperature_c: Temperature = REFERENCE_TEMPERATURE
    """Its mean temperature."""
    u_cte_per_k: SmallExpansion = 0.0
    """Standard uncertainty of its coefficient of expansion, 1/K."""


class ProbeStandardFacts(Table):
    """One ``[[by_orientations.probe_standard]]``."""

    stylus: str = ""
    """Name of the stylus that measured it; may be left out where there is one."""
    diameter_mm: Length
    """Calibrated diameter."""
    u_um: Limit
    """Standard uncertainty of the calibrated diameter."""
    inner: bool = False
    """Whether it is a ring; else a sphere or a plug."""
    file: Name
    """CSV with the columns `orientation`, `repeat`, `diameter_mm`."""
    certificate: str = ""
    """Number of its certificate, and whose it is."""


class OrientationsFacts(Table):
    """``[by_orientations]``: the part in several orientations, with standards beside it (ISO/DTS 15530-2 as described)."""

    file: Name
    """CSV with the columns `orientation`, `repeat`, and `characteristic` with `value_mm` or `value_deg`, or else `feature`,
    `point`, `x_mm`, `y_mm`, `z_mm` in the frame of the part."""
    length_standard: LengthStandardFacts | None = None
    """A calibrated length: what all orientations have in common, the scale of the machine, is taken from it."""
    probe_standard: Annotated[list[ProbeStandardFacts], Field(max_length=INPUTS.most)] = []
    """A calibrated ring, sphere or plug for each stylus: the size of the tip is taken from it."""
    points_varied: bool = False
    """Whether contact points were others in each orientation, so that the part's form is seen."""
    place_varied: bool = True
    """Whether the part lay in other places too."""
    qualified_anew: bool = False
    """Whether the styli were qualified anew for each orientation."""
