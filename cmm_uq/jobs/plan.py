"""``[plan]`` in job.toml: what may be measured, where, and what it should tell."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Criterion = Literal["separation", "D", "A", "worst"]

Positive = Annotated[float, Field(gt=0)]
Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Direction = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class FixtureFacts(_Table):
    """``[plan.fixtures]``: how the artefact may stand.

    ``directions``: of a bar or gauge along its length, of a plate or triangle across it, either way; any without them.
    ``heights_mm``: lowest and highest z reading of the artefact's middle.
    """

    directions: list[Direction] = []
    heights_mm: Range | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if any(not any(direction) for direction in self.directions):
            raise ValueError("directions: [0, 0, 0] points nowhere")
        if self.heights_mm is not None and not self.heights_mm[0] <= self.heights_mm[1]:
            raise ValueError(f"heights_mm = {self.heights_mm}: the first number must be the lower one")
        return self


class PlanFacts(_Table):
    """``[plan]``.

    ``ready`` names the plan to start from where there is no recording. With a ``criterion`` a better one is searched for:
    of ``number`` placings, or of ``more`` beside those that there are.
    """

    ready: str | None = None
    volume_mm: dict[Literal["x", "y", "z"], Range] = {}
    margin_mm: Annotated[float, Field(ge=0)] = 10.0
    fixtures: FixtureFacts = FixtureFacts()
    length_mm: Positive | None = None
    lengths_mm: list[Positive] = []
    pitch_mm: Positive | None = None
    grid: Annotated[list[Annotated[int, Field(ge=2)]], Field(min_length=2, max_length=2)] = [5, 5]
    both_ways: bool = False
    repeats: Annotated[int, Field(ge=1, le=20)] = 3
    rivals: list[str] | None = None
    columns: dict[str, float] = {}
    criterion: Criterion | None = None
    number: Annotated[int, Field(ge=1, le=200)] | None = None
    more: Annotated[int, Field(ge=1, le=50)] | None = None
    candidates: Annotated[int, Field(ge=1, le=2000)] = 300
    minutes_per_placing: Annotated[float, Field(ge=0)] = 5.0
    seconds_per_point: Annotated[float, Field(ge=0)] = 10.0
    budget_min: Positive | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for axis, (low, high) in self.volume_mm.items():
            if not low < high:
                raise ValueError(f"volume_mm: {axis} = [{low:g}, {high:g}]: the first number must be the lower one")
        if self.number is not None and self.more is not None:
            raise ValueError("number and more are both given: a plan of so many, or so many beside what there is")
        if self.criterion is None and (self.number is not None or self.more is not None):
            raise ValueError('number and more need a criterion: criterion = "separation", "D", "A" or "worst"')
        return self
