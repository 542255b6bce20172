"""``[plan] noise_from``: what the noise of an earlier recording was, by the results.json of its report."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.table import LARGEST_UM, SMALLEST_UM
from cmm_uq.jobs.plan import PlanFacts

_FIX = "Name the results.json that cmm-uq report wrote of an earlier recording of such an artefact"

_Size = Annotated[float, Field(ge=0, le=LARGEST_UM)]


class _Part(BaseModel):
    """Of a results.json only what is needed; further keys are none of this module's business."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


class _Quantity(_Part):
    value: _Size
    u: _Size

    @property
    def mean_square_root(self) -> float:
        """Root of the mean square: variances are what observations add, and their posterior mean is value² + u²."""
        return hypot(self.value, self.u)


class _Reading(_Part):
    value: Annotated[float, Field(ge=SMALLEST_UM, le=LARGEST_UM)]


class _Noise(_Part):
    coordinate_um: _Reading
    x_um: _Reading | None = None
    y_um: _Reading | None = None
    z_um: _Reading | None = None
    placing_um: _Quantity | None = None
    growth_um: _Quantity | None = None


class _Results(_Part):
    schema_: Annotated[Literal["cmm-uq/results/1"], Field(alias="schema")]
    noise: _Noise


@dataclass(frozen=True)
class FoundNoise:
    """The noise of a recording, µm.

    Parameters
    ----------
    reading_um : standard deviation of a reading along each axis.
    placing_um, growth_um : of a set-up offset and of growing noise; ``None`` where the recording could not show them.
    """

    reading_um: tuple[float, float, float]
    placing_um: float | None
    growth_um: float | None


def noise_file(plan: PlanFacts) -> str | None:
    """Name of the results.json that a plan names, itself or the folder in which it lies; ``None`` where it names none."""
    if plan.noise_from is None:
        return None
    name = plan.noise_from.removesuffix("/")
    return name if name.endswith(".json") else f"{name}/results.json"


def noise_found(content: bytes, where: str) -> FoundNoise:
    """The noise in a results.json.

    Parameters
    ----------
    content : of the file.
    where : the file, for messages.

    Raises
    ------
    CmmUqError : it is no results.json of a report, or has no noise.
    """
    try:
        found = _Results.model_validate_json(content).noise
    except ValidationError as error:
        first = error.errors()[0]
        at = ".".join(map(str, first["loc"]))
        told = f"{at}: {first['msg'][0].lower()}{first['msg'][1:]}" if at else "it is no JSON"
        raise CmmUqError(f"says nothing of the noise of a recording: {told}", where=where, fix=_FIX) from None
    x, y, z = (found.coordinate_um if axis is None else axis for axis in (found.x_um, found.y_um, found.z_um))
    placing, growth = (None if one is None else one.mean_square_root for one in (found.placing_um, found.growth_um))
    return FoundNoise((x.value, y.value, z.value), placing, growth)
