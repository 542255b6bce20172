"""What the reader of a part's page must know of its machine: drafts, dates, temperatures, probes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, day, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.certificate.part.found import Standing
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.origin import COMPENSATED, MEASURED, SIMULATED
from cmm_uq.jobs.part.job import PartJob

_ORIGINS = {SIMULATED: say("simulated"), COMPENSATED: say("compensated")}

NORMAL_C = 20.0
"""°C to which lengths are referred (ISO 1)."""


def temperatures(job: Job | None) -> Floats | None:
    """What the calibration recorded of the temperatures of the scales, °C."""
    if job is None:
        return None
    columns = [f"temp_{axis}_c" for axis in AXES if f"temp_{axis}_c" in job.points.columns]
    return np.concatenate([job.points.columns[name] for name in columns]) if columns else None


def machine_warnings(job: PartJob, standing: Standing, calibrated: Job | None) -> Iterable[Text]:
    """What the reader must know of the machine.

    Parameters
    ----------
    job : of the part.
    standing : of the machine's certificate.
    calibrated : job of the calibration, where it is at hand.
    """
    if standing.origin != MEASURED:
        origin = _ORIGINS.get(standing.origin, Verbatim(standing.origin))
        yield say("The machine's calibration is {origin}: nobody measured this machine.", origin=origin)
    if standing.draft:
        yield say("The machine's certificate is a draft: it does not state all that ISO/IEC 17025:2017 asks for.")
    if standing.source == "results":
        yield say(
            "The machine is taken from its figures and draws alone: its recording is not at hand and was not verified."
        )
    if standing.valid_until is None:
        yield say("The machine's certificate of {date} does not say until when it holds.", date=day(standing.date))
    yield from _thermal(job, calibrated)
    if calibrated is not None and calibrated.facts.circumstances.probe.sensing == "optical" and _touches(job):
        yield say(
            "The machine was calibrated with a probe that does not touch; the noise of one that does may be another."
        )


def _touches(job: PartJob) -> bool:
    return any(stylus.diameter_mm > 0 for stylus in job.facts.stylus)


def _thermal(job: PartJob, calibrated: Job | None) -> Iterable[Text]:
    """Temperatures of the scales beside those of the calibration, and those for which the machine is rated."""
    given, known = job.facts.environment.scales_c, temperatures(calibrated)
    low, high = min(given), max(given)
    if known is not None and (low < known.min() or high > known.max()):
        yield say(
            "The scales were at {low:.4g} to {high:.4g} °C, and at {coldest:.4g} to {warmest:.4g} °C when the machine was "
            "calibrated: how its errors change between is not known.",
            low=low, high=high, coldest=float(known.min()), warmest=float(known.max()),
        )  # fmt: skip
    elif known is None and (low, high) != (NORMAL_C, NORMAL_C):
        yield say(
            "The scales were at {low:.4g} to {high:.4g} °C; the temperature of the calibration is not known.",
            low=low, high=high,
        )  # fmt: skip
    rated = None if calibrated is None else calibrated.circumstances.rated.temperature_c
    if rated is not None and (low < rated[0] or high > rated[1]):
        yield say(
            "The scales were at {low:.4g} to {high:.4g} °C, outside of the {coldest:.4g} to {warmest:.4g} °C for which the "
            "machine is rated.", low=low, high=high, coldest=rated[0], warmest=rated[1],
        )  # fmt: skip
