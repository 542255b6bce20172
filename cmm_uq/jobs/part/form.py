"""``[form]`` and a feature's own ``form``: what the part's surface does between the points that are probed."""

from __future__ import annotations

import re
from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.limits import INPUTS
from cmm_uq.base.files.table import Length, Table, Uncertainty

_COUNT = re.compile(r"[1-9][0-9]{0,3}")
FEWEST_UNDULATIONS = 2
"""One undulation per revolution is a shift, none a change of size."""


class FormFacts(Table):
    """What is known of a surface about its nominal one, along its normals."""

    field_um: Uncertainty = 0.0
    """Standard deviation of a form that nobody knows, as a random field on the surface."""
    correlation_mm: Length = 10.0
    """Distance on the surface over which the correlation of that field falls to exp(−½)."""
    harmonics_um: Annotated[dict[str, Uncertainty], Field(max_length=INPUTS.most)] = {}
    """Standard deviations of lobes of any phase about a feature's axis, by their number: `{ 2 = 1.0, 3 = 0.5 }`; heeded by
    circles, cylinders and cones."""
    surface_points: Annotated[int, Field(ge=0, le=5000)] = 0
    """Points, spread over the whole surface, by which a feature with its form is true; 0 where it is true by its nominal, and
    all of its form is an error."""
    roughness_um: Uncertainty = 0.0
    """Standard deviation of a contact point by roughness, from point to point on its own."""

    @model_validator(mode="after")
    def _numbers_of_lobes(self) -> Self:
        for key in self.harmonics_um:
            if not _COUNT.fullmatch(key) or int(key) < FEWEST_UNDULATIONS:
                raise ValueError(
                    f"harmonics_um has {key!r}: give numbers of lobes from {FEWEST_UNDULATIONS}, as {{ 3 = 0.5 }}"
                )
        return self
