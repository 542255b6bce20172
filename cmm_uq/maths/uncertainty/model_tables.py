"""The keys of a measurement model's file with what each is: readers take their names from here, editors their sentences."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cmm_uq.base.files.table import Table
from cmm_uq.maths.uncertainty.evaluation import METHODS
from cmm_uq.maths.uncertainty.input_keys import KINDS, NUMERIC
from cmm_uq.maths.uncertainty.ready_model import READY

Figure = float | str
"""A number, or a text of a number and its unit, such as ``"25 nm"``."""


class ModelTable(Table):
    """``[model]``."""

    outputs: dict[str, str] = {}
    """Each output's expression in the names of the inputs: `+ - * / **`, brackets, `pi`, `sqrt exp log log10 sin cos tan
    asin acos atan atan2 abs`."""
    ready: Literal[tuple(READY)] | None = None  # type: ignore[valid-type]
    """Name of a ready model, in place of `outputs`."""
    coverage: Annotated[float, Field(gt=0, lt=1)] = 0.95
    """Probability of the intervals."""
    method: Literal[tuple(METHODS)] = "auto"  # type: ignore[valid-type]
    """How it is evaluated; `auto` takes the simplest way that Monte Carlo confirms."""
    digits: Annotated[int, Field(ge=1, le=4)] = 2
    """Significant digits of u that Monte Carlo must support."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random numbers."""
    title: str = ""
    """Title of the page; the file's name where it is left out."""
    units: dict[str, str] = {}
    """Unit of each output; derived where the expression determines it."""


class InputTable(Table):
    """``[inputs.NAME]``: which of the figures belong together says the distribution."""

    distribution: Literal[tuple(KINDS)] | None = None  # type: ignore[valid-type]
    """Distribution of JCGM 101:2008 table 1, `sampled` or `constant`; `t` where only samples are given."""
    value: Figure | None = None
    """Estimate: mean, middle of the limits, or count."""
    u: Figure | None = None
    """Standard uncertainty."""
    dof: float | None = None
    """Degrees of freedom of u; finite ones say how well u itself is known."""
    expanded: Figure | None = None
    """Expanded uncertainty of a certificate, in place of `u`; needs `coverage_factor`."""
    coverage_factor: float | None = None
    """Coverage factor of `expanded`."""
    low: Figure | None = None
    """Lower limit."""
    high: Figure | None = None
    """Upper limit."""
    half_width: Figure | None = None
    """Half the distance of the limits, with `value`."""
    limit: Figure | None = None
    """How far each limit of `rectangular_uncertain` is in doubt."""
    beta: float | None = None
    """Ratio of top to base of a trapezoid, or doubt of the limits over the half-width."""
    samples: list[Figure] | None = None
    """Repeated readings, or draws of an earlier analysis (`sampled`)."""
    unit: str = ""
    """Unit in which the model takes the input."""
    source: str = ""
    """Where the figures come from, for the budget."""
    description: str = ""
    """What the input is, for the page."""
    simultaneous: str = ""
    """The same word for inputs that were read together: their correlation comes from the samples."""


class ModelFileTable(Table):
    """A measurement model of one's own."""

    model: ModelTable
    """What is evaluated, and how."""
    inputs: dict[str, InputTable]
    """What is known of each input, by its name."""
    correlation: dict[str, float] = {}
    """Correlation of two inputs, as `"x1,x2" = 0.9`."""


TOP, MODEL = tuple(ModelFileTable.model_fields), tuple(ModelTable.model_fields)
TEXTS = tuple(name for name in InputTable.model_fields if name not in NUMERIC)
