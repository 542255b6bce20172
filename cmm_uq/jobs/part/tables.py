"""The other tables of a part's job: the part, the machine, styli, alignment, placing, surroundings, form, decision."""

from __future__ import annotations

import datetime as dt
from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import Table, Temperature, Triple, Uncertainty
from cmm_uq.jobs.conformity import Prior, Rule, needs_prior
from cmm_uq.jobs.identification import Identification
from cmm_uq.jobs.machine import Travel, check_carriages
from cmm_uq.jobs.origin import MEASURED, Origin
from cmm_uq.jobs.part.feature import Count

Expansion = Annotated[float, Field(ge=-1e-4, le=1e-3)]
"""A coefficient of expansion, 1/K: steel has 11.5e-6."""

SmallExpansion = Annotated[float, Field(ge=0, le=1e-4)]
Kelvins = Annotated[float, Field(ge=0, le=100)]
Uncertainties = Annotated[list[Uncertainty], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Annotated[float, Field(ge=-360, le=360)]], Field(min_length=3, max_length=3)]
SmallAngles = Annotated[list[Annotated[float, Field(ge=0, le=10)]], Field(min_length=3, max_length=3)]
Lengths = Annotated[list[Annotated[float, Field(ge=0, le=1e6)]], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(min_length=1, max_length=100)]


class PartJobFacts(Identification):
    """``[job]``: identification, and free text for the certificate."""

    origin: Origin = MEASURED
    """Where measured points come from; all that is made from points that were not measured says so."""


class PartFacts(Table):
    """``[part]``: what is measured."""

    name: Name
    """Name of the part."""
    drawing: str = ""
    """Number of the drawing, with its revision."""
    serial: str = ""
    """Serial number of the part."""
    owner: str = ""
    """Owner of the part."""
    material: str = ""
    """Material."""
    cte_per_k: Expansion = 0.0
    """Coefficient of thermal expansion of the part, 1/K."""
    u_cte_per_k: SmallExpansion = 0.0
    """Standard uncertainty of that coefficient, 1/K."""
    not_measured: Annotated[list[Name], Field(max_length=LISTED.most)] = []
    """What the drawing asks for besides and this job leaves out; the certificate says so."""


class MachineStateFacts(Table):
    """``[machine_state]``: the machine as its certificate states it, and where its axes go."""

    certificate: Name | None = None
    """The certificate (PDF), its `results.json`, or the folder with it, inside the job's."""
    posterior: str = ""
    """Draws of the machine's errors (`posterior.npz`), where they do not lie beside `results.json`."""
    job: Name | None = None
    """In place of a certificate the folder of the machine's job, from this job's folder on; it is analysed anew."""
    valid_until: dt.date | None = None
    """Last day on which the certificate holds; where it is left out, the day that it names for the next calibration."""
    travel_mm: Travel = Travel()
    """Lowest and highest scale reading of each axis; as the certificate says where left out. A part outside is refused."""
    chain: Annotated[str, Field(pattern=r"^[XYZF]{3,4}$")] = "XYZ"
    """Carriages from the table to the ram, with F for the frame where the workpiece moves; as the certificate says where it is
    left out."""
    origin_mm: Triple = [0.0, 0.0, 0.0]
    """Scale reading of the origin of the coordinates that `[placing]` speaks of."""
    corrected: bool = True
    """Whether the machine corrects the errors that its calibration found."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.certificate is None) == (self.job is None):
            raise ValueError("give either certificate or job: what states the machine's errors")
        if self.job is not None and self.posterior:
            raise ValueError("a job is analysed anew and needs no posterior: leave it out")
        return self

    @model_validator(mode="after")
    def _three_carriages(self) -> Self:
        check_carriages(self.chain)
        return self


class StylusFacts(Table):
    """One ``[[stylus]]``: a tip, and what its qualification left uncertain."""

    name: Name
    """Name by which features name it."""
    diameter_mm: Annotated[float, Field(ge=0, le=1000)]
    """Diameter of the tip; 0 where a sensor does not touch."""
    offset_mm: Triple = [0.0, 0.0, 0.0]
    """Centre of the tip from the ram's reference point, along the axes of the machine."""
    u_diameter_um: Uncertainty = 0.0
    """Standard uncertainty of the tip's effective diameter, as qualified."""
    u_offset_um: Uncertainties = [0.0, 0.0, 0.0]
    """Standard uncertainties of the tip's offset against the tip to which the others are referred; 0 of that tip."""
    qualified_at_mm: Triple | None = None
    """Coordinates of the machine where the reference sphere stood; what the machine's errors do there, they do not do to the
    part again."""
    lobing_um: Uncertainty = 0.0
    """Standard deviation of the pre-travel over directions of probing, size and offset taken out of it."""


class AlignmentFacts(Table):
    """``[alignment]``: how coordinates of the part follow from measured points."""

    datums: Annotated[list[Name], Field(max_length=6)] = []
    """Names of features in order: each fixes what those before it left free (3-2-1). `"A-B"` is a common datum on both."""
    best_fit: bool = False
    """By least squares of all points from the nominal surfaces instead."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.best_fit and self.datums:
            raise ValueError("give either datums or best_fit = true")
        return self


class PlacingFacts(Table):
    """``[placing]``: where the part lies in the machine."""

    origin_mm: Triple | None = None
    """Where the part's origin lies, in coordinates of the machine; where left out, the part is in the middle of the travel."""
    rotation_deg: Angles = [0.0, 0.0, 0.0]
    """How the part is turned about the axes of the machine: first about x, then y, then z."""
    u_origin_mm: Lengths = [0.0, 0.0, 0.0]
    """Standard deviations of where it is put, where its place is not the same each time."""
    u_rotation_deg: SmallAngles = [0.0, 0.0, 0.0]
    """Standard deviations of how it is turned, about the axes of the machine."""
    u_fixture_um: Uncertainty = 0.0
    """Standard uncertainty of each point by what clamping does to the part."""


class ProbingFacts(Table):
    """``[probing]``: in which order, how fast and how often."""

    order: Annotated[list[Name], Field(max_length=LISTED.most)] = []
    """Names of all features in the order in which they are probed; as they stand where it is left out."""
    seconds_per_point: Annotated[float, Field(ge=0, le=1e5)] = 0.0
    """Time from a point to the next, for noise that wanders; 0 where it is not known."""
    repeats: Count = 1
    """How often each point is probed; its mean counts."""
    u_operator_um: Uncertainty = 0.0
    """Standard uncertainty of each coordinate of each point by who measures and how, common to its repeats."""


class EnvironmentFacts(Table):
    """``[environment]``: temperatures while the part is measured, and what is known of them."""

    part_c: Temperature = 20.0
    """Temperature of the part."""
    scales_c: Annotated[list[Temperature], Field(min_length=3, max_length=3)] = [20.0, 20.0, 20.0]
    """Temperatures of the scales of x, y, z."""
    compensated: bool = True
    """Whether the machine computes lengths at 20 °C from these temperatures and the coefficients of expansion."""
    u_part_k: Kelvins = 0.0
    """Standard uncertainty of the part's temperature."""
    u_scales_k: Kelvins = 0.0
    """Standard uncertainty of each scale's temperature, on its own."""
    scales_cte_per_k: Expansion = 0.0
    """Coefficient of expansion of the scales, 1/K."""
    u_scales_cte_per_k: SmallExpansion = 0.0
    """Standard uncertainty of that coefficient, 1/K."""
    u_gradient_k_per_m: Annotated[list[Kelvins], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    """Standard uncertainties of the gradient of the part's temperature along the axes of the machine, K/m."""
    u_drift_k: Kelvins = 0.0
    """Standard uncertainty of how much part and scales have warmed from the first point to the last."""


class DecisionFacts(Table):
    """``[decision]``: by which rule conformity with the drawing is decided."""

    rule: Rule = "ISO 14253-1"
    """Decision rule, by name or by its figure."""
    prior: Prior | None = None
    """What is known of such parts beforehand, for rules that go by it (JCGM 106:2012, 7.2)."""

    @model_validator(mode="after")
    def _prior_where_needed(self) -> Self:
        if needs_prior(self.rule) and self.prior is None:
            raise ValueError(
                "this rule goes by what is known of such parts beforehand: "
                "give prior = { sd_um = … } or { share_of_limit = … }"
            )
        return self


class MeasuredFacts(Table):
    """``[recording]``: the points as they were measured."""

    file: Name
    """CSV with the columns `feature`, `point` (1, 2, … in the order of the plan), `x_mm`, `y_mm`, `z_mm`: contact points in
    the frame of the part, the tip's radius taken off."""
