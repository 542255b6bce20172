"""results.json of other reports: what a job that names one, or a file of another format, needs of it.

``[machine] digitizer`` is described by its own numbers, or by the results.json of the digitizer's calibration.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from math import hypot
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import LARGEST_UM, SMALLEST_UM
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.source import RESULTS
from cmm_uq.jobs.tables.identification import SIMULATED, Origin
from cmm_uq.jobs.tables.machine import DigitizerFacts, Pose
from cmm_uq.jobs.verdicts import Verdicts


class ResultsPart(BaseModel):
    """Of a results.json only what is needed; further keys are no business of its reader."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


class ResultsFile(ResultsPart):
    schema_: Annotated[Literal["cmm-uq/results/1"], Field(alias="schema")]


Results = TypeVar("Results", bound=ResultsPart)


def results_named(name: str | None) -> str | None:
    """Name of the results.json: itself, or in the folder that is named; ``None`` where the job names none."""
    if name is None:
        return None
    name = name.removesuffix("/")
    return name if name.endswith(".json") else f"{name}/{RESULTS}"


def read_results(part: type[Results], content: bytes, where: str, lack: str, fix: str) -> Results:
    """What is needed of a results.json; ``lack`` says what it is not where it does not have that."""
    try:
        return part.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        at = ".".join(map(str, first["loc"]))
        why = f"{at}: {first['msg'][0].lower()}{first['msg'][1:]}" if at else "it is no JSON"
        raise CmmUqError(f"{lack}: {why}", where=where, fix=fix) from None


class EstimateFigure(ResultsPart):
    value: float
    u: float


class EstimateWithInterval(EstimateFigure):
    interval95: Annotated[list[float], Field(min_length=2, max_length=2)]


class _Identifiability(ResultsPart):
    undetermined: list[dict[str, float]] = []


AS_FOUND = "[job] as_found"
_FIX = "Name the results.json that cmm-uq report wrote of the machine as it was found, or the folder it lies in"


class ConformityDecision(ResultsPart):
    standard: str
    characteristic: str = ""
    decision: str


class _JobOfResults(ResultsPart):
    id: str
    origin: Origin
    date: Annotated[dt.date, Field(strict=False)] | None = None
    machine: str = ""
    serial: str = ""


class AsFound(ResultsFile):
    """What a machine showed before it was adjusted: estimates, figures of lengths, and decisions."""

    job: _JobOfResults
    estimates: dict[str, dict[str, EstimateWithInterval]]
    accuracy_uncertainty: dict[str, EstimateWithInterval] = {}
    conformity: list[ConformityDecision] = []
    tolerances: dict[str, dict[str, float | str]] = {}
    verdicts: dict[str, Any] | None = None
    identifiability: _Identifiability = _Identifiability.model_construct()

    @property
    def stated(self) -> Verdicts:
        return Verdicts.of_results(self.model_dump())

    def figure(self, group: str, name: str) -> EstimateWithInterval | None:
        """An estimate, or of the group ``accuracy`` a figure of the lengths; ``None`` where nothing determined it."""
        if group == "accuracy":
            return self.accuracy_uncertainty.get(name)
        free = any(f"{group}.{name}" in combination for combination in self.identifiability.undetermined)
        return None if free else self.estimates.get(group, {}).get(name)


def as_found_of(
    name: str | None, inputs: Mapping[str, bytes], folder: Path, origin: Origin, machine: str, serial: str
) -> AsFound | None:
    """The results.json ``name`` among the inputs of a job; refused where it is of another machine or origin."""
    if name is None:
        return None
    where = str(folder / name)
    before = read_results(AsFound, inputs[name], where, "is no results.json of a report", _FIX)
    for what, then, now in (("machine", before.job.machine, machine), ("serial number", before.job.serial, serial)):
        if then and now and then != now:
            raise CmmUqError(f"is of {what} {then!r}, and this job of {now!r}", where=where, fix=_FIX)
    if before.job.origin != origin:
        raise CmmUqError(f"is of a {before.job.origin} recording, and this one is {origin}", where=where, fix=_FIX)
    return before


_Size = Annotated[float, Field(ge=0, le=LARGEST_UM)]


class _NoiseComponent(ResultsPart):
    value: _Size
    u: _Size


class _Reading(ResultsPart):
    value: Annotated[float, Field(ge=SMALLEST_UM, le=LARGEST_UM)]


class _Noise(ResultsPart):
    coordinate_um: _Reading
    x_um: _Reading | None = None
    y_um: _Reading | None = None
    z_um: _Reading | None = None
    placing_um: _NoiseComponent | None = None
    growth_um: _NoiseComponent | None = None


class _ResultsWithNoise(ResultsFile):
    noise: _Noise


@dataclass(frozen=True)
class EarlierNoise:
    """Standard deviations, µm, of a reading along each axis, and of set-up offset and growth, where it shows them."""

    reading_um: tuple[float, float, float]
    placing_um: float | None
    growth_um: float | None


def noise_found(content: bytes, where: str) -> EarlierNoise:
    """``[plan] noise_from``: the noise of an earlier recording by the results.json of its report."""
    fix = "Name the results.json that cmm-uq report wrote of an earlier recording of such an artefact"
    noise = read_results(_ResultsWithNoise, content, where, "says nothing of the noise of a recording", fix).noise
    x, y, z = (noise.coordinate_um if axis is None else axis for axis in (noise.x_um, noise.y_um, noise.z_um))
    # root of the mean square: variances are what observations add, and their posterior mean is value² + u²
    placing, growth = (hypot(one.value, one.u) if one else None for one in (noise.placing_um, noise.growth_um))
    return EarlierNoise((x.value, y.value, z.value), placing, growth)


class ErrorOfTest(ResultsPart):
    measurement: int | None = None
    repeat: int | None = None
    length_mm: float | None = None
    error_um: float
    u_um: float | None = None
    limit_um: float
    outcome: str
    position: str | None = None


class ConformityStatement(ResultsPart):
    standard: str
    characteristic: str | None = None
    decision: str
    errors: list[ErrorOfTest] = []


class _JobReported(ResultsPart):
    id: str
    origin: str
    date: str
    machine: str
    inputs_sha256: dict[str, str]


class _Software(ResultsPart):
    version: str


class ReportResults(ResultsFile):
    """What files of other formats take of a report: decisions of standards, and error factors."""

    software: _Software
    job: _JobReported
    conformity: list[ConformityStatement] = []
    estimates: dict[str, dict[str, EstimateFigure]] = {}
    tolerances: dict[str, dict[str, float | str]] = {}
    verdicts: dict[str, Any] | None = None
    identifiability: _Identifiability = _Identifiability.model_construct()


_CALIBRATION = "Name the results.json that cmm-uq report wrote of a job of kind digitizer"


class _Component(ResultsPart):
    value: float


class _Offset(ResultsPart):
    U1: _Component
    V1: _Component
    W1: _Component


class _Pose(ResultsPart):
    pose: int
    alpha_deg: float
    beta_deg: float
    gamma_deg: float


Three = tuple[float, float, float]
_Row = Annotated[list[float], Field(min_length=3, max_length=3)]


class _Digitizer(ResultsPart):
    offset_mm: _Offset
    covariance_mm2: Annotated[list[_Row], Field(min_length=3, max_length=3)]
    poses: Annotated[list[_Pose], Field(min_length=1, max_length=LISTED.most)]


class _DigitizerResults(ResultsFile):
    job: _JobOfResults
    digitizer: _Digitizer


@dataclass(frozen=True)
class DescribedDigitizer:
    """A digitizer ready for use: offset [U1 V1 W1], mm, its covariance (3, 3), poses by number; where it was calibrated."""

    offset_mm: Three
    poses: tuple[Pose, ...]
    covariance_mm2: tuple[Three, ...] | None = None
    file: str | None = None
    job: str | None = None

    def as_data(self) -> dict[str, Any]:
        """For the provenance of what was compensated with it."""
        data = {"offset_mm": list(self.offset_mm), "poses": [pose.model_dump() for pose in self.poses]}
        if self.file is None or self.covariance_mm2 is None:
            return data
        return data | {
            "calibration": self.file, "calibration_job": self.job,
            "offset_covariance_mm2": [list(row) for row in self.covariance_mm2],
        }  # fmt: skip


def calibration_file(facts: DigitizerFacts | None) -> str | None:
    """Name of the results.json that a job names, itself or the folder in which it lies; ``None`` where it names none."""
    return None if facts is None else results_named(facts.calibration)


def digitizer_of(
    facts: DigitizerFacts | None, inputs: Mapping[str, bytes], folder: Path, origin: Origin
) -> DescribedDigitizer | None:
    """The digitizer that a job describes; ``None`` where it describes none."""
    if facts is None:
        return None
    name = calibration_file(facts)
    if name is None or facts.offset_mm is not None:
        return DescribedDigitizer(_three(facts.offset_mm or []), tuple(facts.poses))
    results = read_results(
        _DigitizerResults, inputs[name], str(folder / name), "is no calibration of a digitizer", _CALIBRATION
    )
    if results.job.origin == SIMULATED and origin != SIMULATED:
        raise CmmUqError(f"is of a simulated recording, job {results.job.id!r}", where=str(folder / name),
                         fix="Measure the digitizer: a simulated calibration serves simulated jobs only")  # fmt: skip
    calibrated, offset = results.digitizer, results.digitizer.offset_mm
    poses = tuple(facts.poses) or tuple(Pose(**pose.model_dump()) for pose in calibrated.poses)
    covariance = tuple(map(_three, calibrated.covariance_mm2))
    mount = offset.U1.value, offset.V1.value, offset.W1.value
    return DescribedDigitizer(mount, poses, covariance, name, results.job.id)


def _three(values: Sequence[float]) -> Three:
    u, v, w = values
    return u, v, w
