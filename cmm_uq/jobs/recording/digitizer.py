"""``[machine] digitizer`` as a job describes it: by its own numbers, or by the results.json of the digitizer's calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LISTED
from cmm_uq.jobs.reports import ResultsFile, ResultsPart, read_results, results_named
from cmm_uq.jobs.tables.machine import DigitizerFacts, Pose
from cmm_uq.jobs.tables.origin import SIMULATED, Origin

KEY = "[machine] digitizer"
_FIX = "Name the results.json that cmm-uq report wrote of a job of kind digitizer"


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


class _Job(ResultsPart):
    id: str
    origin: Origin


class _Results(ResultsFile):
    job: _Job
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
    results = read_results(_Results, inputs[name], str(folder / name), "is no calibration of a digitizer", _FIX)
    if results.job.origin == SIMULATED and origin != SIMULATED:
        raise CmmUqError(f"is of a simulated recording, job {results.job.id!r}", where=str(folder / name),
                         fix="Measure the digitizer: a simulated calibration serves simulated jobs only")  # fmt: skip
    calibrated, offset = results.digitizer, results.digitizer.offset_mm
    poses = tuple(facts.poses) or tuple(Pose(**pose.model_dump()) for pose in calibrated.poses)
    return DescribedDigitizer((offset.U1.value, offset.V1.value, offset.W1.value), poses,
                              tuple(map(_three, calibrated.covariance_mm2)), name, results.job.id)  # fmt: skip


def _three(values: Sequence[float]) -> Three:
    u, v, w = values
    return u, v, w
