"""What other methods say of a part's characteristics, beside the virtual measurement: figures, conditions, what each sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from cmm_uq.base.messages import Text
from cmm_uq.maths.uncertainty.budget import Budget

Method = Literal["virtual", "calibrated_part", "orientations"]
"""Virtual measurements; a calibrated part measured again and again; the part itself in several orientations."""

Seen = Literal["drawn", "varied", "systematic", "corrected", "stated", "unseen"]
"""How a method takes hold of a cause: *drawn* from what is known of it; as scatter, because it *varied* between repeats; in
the *systematic* error that was found; *corrected* by a standard, with the standard's uncertainty; *stated* from descriptions;
or *unseen*."""


@dataclass(frozen=True)
class Condition:
    """What a method asks of its test.

    Parameters
    ----------
    text : of what is asked, in words.
    met : whether it is met; ``None`` where the job does not say.
    """

    text: Text
    met: bool | None


@dataclass(frozen=True, eq=False)
class Figure:
    """One characteristic by one method, mm or rad.

    Parameters
    ----------
    name : of the characteristic.
    budget : of the method, with its k.
    value : of the part; ``None`` where the part was not measured.
    systematic : error that the method found and takes off; ``None`` where it looks for none.
    corrected : whether it is taken off; where not, its size is added to U.
    single : standard uncertainty of one measurement in one orientation, where ``budget`` is of the mean of all.
    zone : whether it is the width of a zone, which errors make larger on average where it is small.
    scatter, scatter_dof : standard deviation of one measurement among the repeats, and its degrees of freedom.
    """

    name: str
    budget: Budget
    value: float | None
    systematic: float | None = None
    corrected: bool = True
    single: float | None = None
    zone: bool = False
    scatter: float = 0.0
    scatter_dof: float = 1.0

    @property
    def angle(self) -> bool:
        """Whether it is one, in rad."""
        return self.budget.unit == "rad"

    @property
    def u(self) -> float:
        """Standard uncertainty, without a systematic error that is not corrected."""
        return self.budget.u

    @property
    def U(self) -> float:  # noqa: N802
        """Expanded uncertainty; a systematic error that is not corrected is added with its size."""
        return self.budget.expanded + (0.0 if self.corrected else abs(self.systematic or 0.0))


@dataclass(frozen=True, eq=False)
class ByMethod:
    """All that a method says of a part.

    Parameters
    ----------
    method : which.
    figures : one a characteristic; those that were not tested are missing.
    conditions : of the test.
    seen : by family of causes (:data:`cmm_uq.analysis.parts.in_words.FAMILIES`), how the method takes hold of it.
    """

    method: Method
    figures: tuple[Figure, ...]
    conditions: tuple[Condition, ...]
    seen: Mapping[str, Seen]

    def of(self, name: str) -> Figure | None:
        """The figure of a characteristic; ``None`` where it was not tested."""
        return next((one for one in self.figures if one.name == name), None)


@dataclass(frozen=True)
class Stating:
    """What one method states of a characteristic, mm or rad.

    Parameters
    ----------
    method : which.
    value : where there is one.
    u, U : its uncertainty.
    error : mean error that is taken off, of virtual measurements.
    """

    method: Method
    value: float | None
    u: float
    U: float
    error: float = 0.0


@dataclass(frozen=True)
class Pair:
    """Two methods on one characteristic: Eₙ = (x₁ − x₂)/√(U₁² + U₂²) (ISO/IEC 17043:2023)."""

    one: Method
    other: Method
    normalised: float


@dataclass(frozen=True)
class Compared:
    """One characteristic by all methods.

    Parameters
    ----------
    name : of the characteristic.
    stated : by each method that says something of it, the virtual measurement first.
    pairs : Eₙ of each two that have a value.
    why : they differ, in sentences that follow from the figures.
    """

    name: str
    stated: tuple[Stating, ...]
    pairs: tuple[Pair, ...]
    why: tuple[Text, ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The methods beside each other; what a part's page and its ``results.json`` say of them.

    Parameters
    ----------
    methods : the others, not the virtual measurement.
    characteristics : those that another method tested, in the order of the plan.
    """

    methods: tuple[ByMethod, ...]
    characteristics: tuple[Compared, ...]
