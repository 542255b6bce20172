"""``[[effect]]``: physics that a laboratory states in its own job, as a formula with its parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from cmm_uq.base.files.table import JobTable, at_least, key, required
from cmm_uq.base.messages import Text, Verbatim

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Size = Annotated[float, Field(gt=0, le=1e12), at_least(1e-12)]  # in a unit that only the table itself says
SHAPES = 2  # parameters that shape an effect, at most


class EffectParameter(JobTable):
    """A number that says how large an effect is, or that shapes it."""

    unit: str = required(
        "Its unit: `µm`, `µm/m`, `µm/m²`, `ppm`, `″`, `″/m`, `µm/K`, `µm/h`, `h`, …; `1` for a mere number."
    )
    prior: Size | None = key(None, "Standard deviation that physics allows, about zero, in its unit.")
    low: Size | None = key(
        None, "Least value of one that shapes the effect, in place of `prior`: a length, a time constant."
    )
    high: Size | None = key(None, "Largest value of it.")

    def problems(self) -> Iterator[str]:
        if self.prior is None and (self.low is None or self.high is None or self.low >= self.high):
            yield "a parameter has a prior, or a low below a high: give one or the other"
        if self.prior is not None and not self.low is self.high is None:
            yield "a parameter has a prior, or low and high: leave one of them out"


class EffectFacts(JobTable):
    """An effect of the laboratory's own."""

    name: Name = required("Its name, by which `[model] effects`, truth.toml and results.json call it.")
    formula: str | Annotated[list[str], Field(min_length=1, max_length=3)]
    """The error in mm by the rule *true = indicated + e*, `e_x = k*x*(y - 500)/1000`; several with `;` between, or a list."""
    title: str = key("", "In a few words, for documents; its name where it is left out.")
    unit: str | None = key(None, "Unit of `k`, where that is the only parameter.")
    prior: Size | None = key(None, "Standard deviation of `k` that physics allows, about zero, in its unit.")
    parameters: Annotated[dict[Name, EffectParameter], Field(max_length=10)] = {}
    """Parameters by name, where there are others than `k`: `{ bow = { unit = "µm", prior = 5 }, tau = { unit = "h", low = 0.2,
    high = 20 } }`."""
    points_to: str = ""
    """What a technician should look at where it is found, to follow "What it points to:", without a full stop."""

    def problems(self) -> Iterator[str]:
        alone = self.unit is not None and self.prior is not None
        if bool(self.parameters) == alone or (self.unit is None) != (self.prior is None):
            yield "give unit and prior of k, or a table of parameters"
        if sum(one.low is not None for one in self.parameters.values()) > SHAPES:
            yield f"more than {SHAPES} parameters have low and high: a diagnosis tries all their values with each other"

    @property
    def parts(self) -> tuple[str, ...]:
        """The formula, an equation each."""
        text = [self.formula] if isinstance(self.formula, str) else self.formula
        return tuple(part.strip() for one in text for part in one.split(";") if part.strip())

    @property
    def each(self) -> dict[str, EffectParameter]:
        """The parameters by name."""
        return self.parameters or {"k": EffectParameter(unit=self.unit or "1", prior=self.prior)}

    @property
    def words(self) -> Text:
        return Verbatim(self.title or self.name.replace("_", " ").capitalize())
