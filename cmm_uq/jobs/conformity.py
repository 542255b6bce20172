"""``[[conformity]]``: a standard, a limit, and the rule by which it is decided."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from cmm_uq.errors import suggestion
from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.table import Limit, Table, Uncertainty, at_least


class MaximumPermissibleError(Table):
    """``mpe``: E = A + L/K, with L in mm and E in µm."""

    a_um: Uncertainty
    k: Annotated[float, Field(gt=0, le=1e12), at_least(1e-3)]


class GuardBand(Table):
    """A guard band of so many expanded uncertainties (ILAC-G8:09/2019, 4.2.2)."""

    guard_band: Annotated[float, Field(ge=0, le=100)]


class FalseAccept(Table):
    """Accept only when the probability of not conforming is at most this."""

    max_false_accept: Annotated[float, Field(gt=0, lt=1), at_least(1e-12)]


Rule = Literal["simple", "ISO 14253-1"] | GuardBand | FalseAccept


class ConformityFacts(Table):
    """One ``[[conformity]]``: a standard, a limit and a decision rule."""

    standard: str
    characteristic: str | None = None
    limit_um: Limit | None = None
    mpe: MaximumPermissibleError | None = None
    rule: Rule = "ISO 14253-1"

    @field_validator("standard")
    @classmethod
    def _known(cls, name: str, info: ValidationInfo) -> str:
        standards = standards_in(info)
        if standards is not None and standards.named(name) is None:
            raise ValueError(f"no such standard is decided. {suggestion(name, standards.names())}")
        return name

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if (self.limit_um is None) == (self.mpe is None):
            raise ValueError("give either limit_um or mpe = { a_um = …, k = … }")
        return self

    @model_validator(mode="after")
    def _decided_here(self, info: ValidationInfo) -> Self:
        if asked := _asked(self, standards_in(info)):
            asked.characteristic(self.characteristic)
        return self


class Asked(Protocol):
    """What the check of a job must know of a standard."""

    def characteristic(self, name: str | None) -> object:
        """One that it decides; ``ValueError`` for a name that it does not."""
        ...

    def uncertainty_missing(self, wish: ConformityFacts, artefact: ArtefactFacts) -> str | None:
        """The key of ``[artefact]`` whose uncertainty the rule needs and does not have; ``None`` when nothing is missing."""
        ...


@dataclass(frozen=True)
class Standards:
    """The standards that a job may name: what is asked of each, and their names."""

    named: Callable[[str], Asked | None]
    names: Callable[[], Sequence[str]]


def standards_in(info: ValidationInfo) -> Standards | None:
    """The standards that a job is checked against; ``None`` for a table that is made by itself, without a job."""
    return info.context if isinstance(info.context, Standards) else None


def uncertainty_missing(wish: ConformityFacts, artefact: ArtefactFacts, standards: Standards | None) -> str | None:
    """See :meth:`Asked.uncertainty_missing`; ``None`` where there is nothing to check against."""
    asked = _asked(wish, standards)
    return asked.uncertainty_missing(wish, artefact) if asked else None


def _asked(wish: ConformityFacts, standards: Standards | None) -> Asked | None:
    return None if standards is None else standards.named(wish.standard)


def needed(key: str, wish: ConformityFacts) -> tuple[str, str]:
    """That a rule needs an uncertainty which ``[artefact]`` does not state, and how to mend it."""
    rule = wish.rule if isinstance(wish.rule, str) else next(iter(wish.rule.model_dump()))
    return (
        f"the rule {rule} needs the uncertainty of what {wish.standard} compares with, and [artefact] states no {key} above 0",
        f'Give {key} in [artefact], or rule = "simple", which takes no account of it',
    )
