"""``[prove]`` in job.toml: the figures by which a laboratory accepts the diagnosis on its own set-ups."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from cmm_uq.base.files.table import Table

Percent = Annotated[float, Field(ge=0, le=100)]


class ProveFacts(Table):
    """``[prove]``: what `cmm-uq prove` compares its figures with. It is sealed with the truth of the cases."""

    false_alarms_pct: Annotated[float, Field(gt=0, lt=100)] = 2.0
    """Largest rate of false alarms, in percent of the recordings that hide nothing."""
    coverage_pct: Annotated[list[Percent], Field(min_length=2, max_length=2)] = [93.0, 97.0]
    """Lowest and highest percentage of 95 % intervals that hold the truth."""
    wrong_names_pct: Annotated[float, Field(gt=0, lt=100)] | None = None
    """Largest percentage of recordings in which an effect is named that does not act."""
    found_pct: Percent | None = None
    """Least percentage of hidden effects that are found, of all strengths that are drawn."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        low, high = self.coverage_pct
        if not low < high:
            raise ValueError(f"coverage_pct = [{low:g}, {high:g}]: the first number must be the lower one")
        return self
