"""Quantities with an uncertainty not below the laboratory's calibration and measurement capability (ILAC-P14:09/2020)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmm_uq.base.messages import Text, at_key, say
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.laboratory import Capability
from cmm_uq.maths.uncertainty.quantity import Quantity

AtLeast = Callable[..., tuple[float, float]]
"""U and k of a figure as a certificate states them; see :meth:`Stating.raised_to`."""


def as_evaluated(
    name: str, expanded: float, factor: float, unit: str, length_mm: float | None = None
) -> tuple[float, float]:
    """Nothing raised."""
    return expanded, factor


CAPABILITY_FACTOR = 2.0
"""Coverage factor of a calibration and measurement capability (ILAC-P14:09/2020)."""


@dataclass(frozen=True)
class Stating:
    """States quantities of one certificate, and keeps what was raised.

    Parameters
    ----------
    capability : of the laboratory, if it gives one.
    length_mm : that the capability of lengths is taken at.
    raised : by name, U as evaluated and as stated.
    """

    capability: Capability | None
    length_mm: float
    raised: dict[str, dict[str, float]] = field(default_factory=dict)

    @classmethod
    def of(cls, job: Job, length_mm: float = 0.0) -> Stating:
        """For a job; without a length at the longest travel of the machine."""
        spans = np.ptp(job.points.machine.travel_mm, axis=1)
        longest = float(np.nanmax(spans)) if np.isfinite(spans).any() else 0.0
        return cls(job.facts.laboratory.cmc, length_mm or longest)

    def stated(self, name: str, quantity: Quantity) -> Quantity:
        """The quantity with U not below the capability; ``name`` as in results.json."""
        least = self.capability.least(quantity.unit, self.length_mm) if self.capability else 0.0
        if quantity.expanded < least:
            self.raised[name] = {"evaluated_U": quantity.expanded, "U": least}
        return quantity.at_least(least)

    def raised_to(
        self, name: str, expanded: float, factor: float, unit_: str, length_mm: float | None = None
    ) -> tuple[float, float]:
        """U and k of a figure that is no :class:`Quantity`, U not below the capability, k = 2 where it is that.

        Parameters
        ----------
        name : as in results.json.
        expanded, factor : as evaluated; U in ``unit_``.
        length_mm : that the capability is taken at; without it that of the certificate.
        """
        least = (
            self.capability.least(unit_, self.length_mm if length_mm is None else length_mm) if self.capability else 0.0
        )
        if expanded >= least:
            return expanded, factor
        self.raised.setdefault(name, {"evaluated_U": expanded, "U": least})
        return least, CAPABILITY_FACTOR

    def all(self, group: str, quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
        """Quantities of one group, each under ``group.name``."""
        return {name: self.stated(f"{group}.{name}", one) for name, one in quantities.items()}

    def warnings(self) -> list[Text]:
        """That U was raised, and of what."""
        if not self.raised:
            return []
        return [
            say(
                "U is stated as the laboratory's calibration and measurement capability (k = 2){key} where that is larger "
                "than what was evaluated{names}.",
                names=at_key(", ".join(self.raised)),
                key=at_key("[laboratory.cmc]"),
            )
        ]

    def data(self) -> dict[str, Any]:
        """For results.json, where anything was raised."""
        return {"cmc": {"length_mm": self.length_mm, "raised": self.raised}} if self.raised else {}
