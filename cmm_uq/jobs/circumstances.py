"""``[test_uncertainty]``, ``[rated_conditions]`` and ``[probe]``: the circumstances of a standard's test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cmm_uq.jobs.laboratory import Capability
from cmm_uq.jobs.short_gauge import ShortGauge
from cmm_uq.jobs.table import Table, Temperature, Uncertainty


class TestUncertainty(Table):
    """``[test_uncertainty]``: what a test value is uncertain by beside the calibration of the artefact (ISO/TS 23165).

    Attributes
    ----------
    u_cte_per_k : of the artefact's coefficient of expansion, 1/K.
    u_temperature_k : of its temperature, K.
    u_alignment_um, u_fixturing_um : of a length, by misalignment and by what the clamping does to it, µm.
    u_form_um : of the calibrated form deviation of a test sphere, µm.
    u_repeat_um : of a range or a difference of repeated readings, by what of the artefact changed between them, µm.
    """

    __test__ = False  # no test of pytest's

    u_cte_per_k: Annotated[float, Field(ge=0, le=1e-3)] = 0.0
    """Standard uncertainty of the artefact's coefficient of expansion, 1/K."""
    u_temperature_k: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Standard uncertainty of the artefact's temperature."""
    u_alignment_um: Uncertainty = 0.0
    """Standard uncertainty of a length by misalignment of the artefact."""
    u_fixturing_um: Uncertainty = 0.0
    """Standard uncertainty of a length by what the clamping does to it."""
    u_form_um: Uncertainty = 0.0
    """Standard uncertainty of the calibrated form deviation of a test sphere."""
    u_repeat_um: Uncertainty = 0.0
    """Standard uncertainty of a range or difference of repeated readings, by what of the artefact changed between
    them."""

    @property
    def of_artefact(self) -> bool:
        """Whether anything is stated of the artefact's temperature, expansion, alignment or fixturing."""
        return any((self.u_cte_per_k, self.u_temperature_k, self.u_alignment_um, self.u_fixturing_um))


TEST_KEYS = tuple(TestUncertainty.model_fields)

Limits = Annotated[list[Temperature], Field(min_length=2, max_length=2)]
Kelvins = Annotated[float, Field(gt=0, le=1000)]


class RatedConditions(Table):
    """``[rated_conditions]``: under which the limits of the machine hold, by its data sheet.

    Attributes
    ----------
    temperature_c : lowest and highest temperature, °C.
    change_k_per_h : largest change in an hour, K/h.
    difference_k : largest difference between places at one time, K.
    probe, stylus : for which the limits hold, as ``[probe]`` names them.
    """

    temperature_c: Limits | None = None
    """Lowest and highest temperature."""
    change_k_per_h: Kelvins | None = None
    """Largest change of temperature in an hour."""
    difference_k: Kelvins | None = None
    """Largest difference of temperature between places at one time."""
    probe: str | None = None
    """Probe for which the limits hold, as `[probe]` names it."""
    stylus: str | None = None
    """Stylus for which the limits hold, as `[probe]` names it."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.temperature_c is not None and not self.temperature_c[0] < self.temperature_c[1]:
            raise ValueError(f"temperature_c = {self.temperature_c}: the first number must be the lower one")
        return self


class ProbeFacts(Table):
    """``[probe]``: with what the recording was made; ``sensing`` says whether it touches."""

    sensing: Literal["contacting", "optical"] | None = None
    """Whether the probe touches; standards are for one or the other."""
    name: str = ""
    """Name of the probe."""
    stylus: str = ""
    """Name of the stylus."""


@dataclass(frozen=True)
class Circumstances:
    """What a test must know of the job beside its recording.

    Parameters
    ----------
    uncertainty, rated, probe : as the job states them.
    cte_per_k : coefficient of expansion of the artefact, 1/K; ``None`` where it is not stated.
    short_gauge : recorded beside lengths that are not bidirectional by themselves.
    cmc : of the laboratory, below which no test value is said to be known.
    set_aside : measurements that the laboratory leaves out of the estimates, each with its reason.
    """

    uncertainty: TestUncertainty = field(default_factory=TestUncertainty)
    rated: RatedConditions = field(default_factory=RatedConditions)
    probe: ProbeFacts = field(default_factory=ProbeFacts)
    cte_per_k: float | None = None
    short_gauge: ShortGauge | None = None
    cmc: Capability | None = None
    set_aside: Mapping[int, str] = field(default_factory=dict)
