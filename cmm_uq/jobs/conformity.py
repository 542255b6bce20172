"""``[[conformity]]``: a standard, a limit, and the rule by which it is decided."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.jobs.table import Limit, Table, Uncertainty, at_least

Standard = Literal["ASME B89.4.1-1997", "ISO 10360-2:2009", "ISO 10360-5:2010", "VDI/VDE 2617"]

CHARACTERISTICS: Mapping[Standard, str] = {
    "ASME B89.4.1-1997": "volumetric performance", "ISO 10360-2:2009": "E0", "ISO 10360-5:2010": "P_FTU",
    "VDI/VDE 2617": "E0",
}  # fmt: skip
"""The characteristic that is decided of each standard, of all that it has."""

LENGTH_STANDARDS: tuple[Standard, ...] = ("ISO 10360-2:2009", "VDI/VDE 2617")
"""Standards that compare with calibrated lengths."""

FORM_STANDARD: Standard = "ISO 10360-5:2010"
"""Compares the form of a calibrated sphere."""


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

    standard: Standard
    characteristic: str | None = None
    limit_um: Limit | None = None
    mpe: MaximumPermissibleError | None = None
    rule: Rule = "ISO 14253-1"

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if (self.limit_um is None) == (self.mpe is None):
            raise ValueError("give either limit_um or mpe = { a_um = …, k = … }")
        return self

    @model_validator(mode="after")
    def _decided_here(self) -> Self:
        known = CHARACTERISTICS[self.standard]
        if self.characteristic not in (None, known):
            raise ValueError(
                f"characteristic = {self.characteristic!r} of {self.standard} is not decided here: only {known}"
            )
        return self

    def uncertainty_missing(self, artefact: ArtefactFacts) -> str | None:
        """The key of ``[artefact]`` whose uncertainty the rule needs and does not have; ``None`` when nothing is missing."""
        if self.rule == "simple":
            return None
        if self.standard in LENGTH_STANDARDS:
            return "u_um" if artefact.certified and not artefact.u_um else None
        key = artefact.form_key if self.standard == FORM_STANDARD else None
        return key if key is not None and not getattr(artefact, key) else None


def needed(key: str, wish: ConformityFacts) -> tuple[str, str]:
    """That a rule needs an uncertainty which ``[artefact]`` does not state, and how to mend it."""
    rule = wish.rule if isinstance(wish.rule, str) else next(iter(wish.rule.model_dump()))
    return (
        f"the rule {rule} needs the uncertainty of what {wish.standard} compares with, and [artefact] states no {key} above 0",
        f'Give {key} in [artefact], or rule = "simple", which takes no account of it',
    )
