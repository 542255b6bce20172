"""``[plan]`` in job.toml: what may be measured, where, and what it should tell."""

from __future__ import annotations

from math import hypot
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from cmm_uq.files.limits import COLUMNS, LISTED
from cmm_uq.jobs.table import AnyFloat, Column, Duration, Length, Names, Range, Table, Uncertainty, at_least

Criterion = Literal["separation", "D", "A", "worst"]

_SHORTEST = 1e-6
"""Length of a direction below which it is none."""

Direction = Annotated[list[Annotated[float, Field(ge=-1e6, le=1e6)]], Field(min_length=3, max_length=3)]


class FixtureFacts(Table):
    """``[plan.fixtures]``: how the artefact may stand.

    ``directions``: of a bar or gauge along its length, of a plate or triangle across it, either way; any without them.
    ``heights_mm``: lowest and highest z reading of the artefact's middle.
    """

    directions: Annotated[list[Direction], Field(max_length=LISTED.most)] = []
    heights_mm: Range | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if any(not any(direction) for direction in self.directions):
            raise ValueError("directions: [0, 0, 0] points nowhere")
        if any(hypot(*direction) < _SHORTEST for direction in self.directions):
            raise ValueError(f"directions: one is shorter than {_SHORTEST:g}")
        if self.heights_mm is not None and not self.heights_mm[0] <= self.heights_mm[1]:
            raise ValueError(f"heights_mm = {self.heights_mm}: the first number must be the lower one")
        return self


class PlanFacts(Table):
    """``[plan]``.

    ``ready`` names the plan to start from where there is no recording. With a ``criterion`` a better one is searched for:
    of ``number`` placings, or of ``more`` beside those that there are. The noise is that of ``noise_from``, the results.json
    of an earlier recording, or has the set-up offset and growth that are stated.
    """

    ready: str | None = None
    volume_mm: dict[Literal["x", "y", "z"], Range] = {}
    margin_mm: Annotated[float, Field(ge=0, le=1e6)] = 10.0
    fixtures: FixtureFacts = FixtureFacts()
    length_mm: Length | None = None
    lengths_mm: Annotated[list[Length], Field(max_length=LISTED.most)] = []
    pitch_mm: Length | None = None
    grid: Annotated[list[Annotated[int, Field(ge=2, le=100)]], Field(min_length=2, max_length=2)] = [5, 5]
    both_ways: bool | None = None
    repeats: Annotated[int, Field(ge=1, le=20)] = 3
    rivals: Names | None = None
    columns: Annotated[dict[Column, AnyFloat], Field(max_length=COLUMNS.most)] = {}
    criterion: Criterion | None = None
    number: Annotated[int, Field(ge=1, le=200)] | None = None
    more: Annotated[int, Field(ge=1, le=50)] | None = None
    candidates: Annotated[int, Field(ge=1, le=2000)] = 300
    minutes_per_placing: Duration = 5.0
    seconds_per_point: Duration = 10.0
    noise_from: str | None = None
    placing_um: Uncertainty | None = None
    growth_um: Uncertainty | None = None
    budget_min: Annotated[float, Field(gt=0, le=1e6), at_least(1e-3)] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for axis, (low, high) in self.volume_mm.items():
            if not low < high:
                raise ValueError(f"volume_mm: {axis} = [{low:g}, {high:g}]: the first number must be the lower one")
        if self.number is not None and self.more is not None:
            raise ValueError("number and more are both given: a plan of so many, or so many beside what there is")
        if self.noise_from is not None and (self.placing_um is not None or self.growth_um is not None):
            raise ValueError(
                "noise_from and placing_um or growth_um are both given: name the recording, or state the sizes"
            )
        if self.criterion is None and (self.number is not None or self.more is not None):
            raise ValueError('number and more need a criterion: criterion = "separation", "D", "A" or "worst"')
        return self
