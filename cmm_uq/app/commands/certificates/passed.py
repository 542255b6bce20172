"""Tests of lengths that a machine passed, as a part's job states them, taken together with its recordings."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.machine.passed import LengthsUnderTest, passed_test, prescribed
from cmm_uq.analysis.machine.recordings import CONTRADICTED, FurtherRecordings
from cmm_uq.analysis.machine.state import Change, MachineState
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, day, number, say
from cmm_uq.base.points import AXES, Floats, Machine, beyond_travel
from cmm_uq.base.units import METRE, MICROMETRE
from cmm_uq.certificate.origin import PassedTest
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.measurement import RecordingModel

if TYPE_CHECKING:
    from cmm_uq.jobs.job import Job
    from cmm_uq.jobs.part.job import PartJob
    from cmm_uq.jobs.part.machine_state import PassedFacts


def refuse_passed(
    job: PartJob,
    machine: Machine,
    calibrated: tuple[str, dt.date],
    further: Iterable[str],
    adjusted: Sequence[dt.date] = (),
) -> None:
    """Refuse a test that another machine or state of it passed, or whose recording is reckoned with already.

    ``calibrated``: number and date of the machine's certificate; ``further``: numbers of further ones. ``adjusted``: by the
    records.
    """
    number, since = calibrated
    known = {number, *further}
    for one in job.facts.machine_state.passed:
        refuse = partial(CmmUqError, where=f"job.toml [[machine_state.passed]] certificate = {one.certificate!r}")
        if one.certificate in known:
            problem = "is a certificate whose recording is reckoned with already, which says more"
            raise refuse(problem, fix="Leave the test out")
        if one.date > (on := job.facts.job.date):
            raise refuse(f"is of {one.date}, after the part was measured on {on}", fix="Leave it out")
        low, high = sorted((one.date, since))
        if between := [day for day in adjusted if low < day <= high]:
            problem = f"is of {one.date}, and the machine, calibrated on {since}, was adjusted on {max(between)}"
            raise refuse(problem, fix="Leave it out: another state of the machine passed it")
        read = _ends_of(one, machine).reshape(-1, 3) + machine.origin_mm
        for axis, row in beyond_travel(read, machine.travel_mm):
            problem = f"readings_mm: {AXES[axis].upper()} would read {read[row, axis]:g} mm, beyond its travel"
            raise refuse(problem, fix="Give scale readings of both ends, x, y, z, x, y, z")


def _ends_of(passed: PassedFacts, machine: Machine) -> Floats:
    """(m, 2, 3) of the tested lengths, in the frame of the machine's recordings."""
    if not passed.readings_mm:
        return prescribed(machine)
    return machine.coordinates(np.reshape(passed.readings_mm, (-1, 3)).astype(np.float64)).reshape(-1, 2, 3)


def tests_passed(
    given: Callable[[FurtherRecordings], MachineState],
    model: RecordingModel,
    job: Job,
    beside: FurtherRecordings,
    passed: Iterable[PassedFacts],
    change: Change | None,
) -> tuple[FurtherRecordings, tuple[PassedTest, ...], tuple[Text, ...]]:
    """What recordings say together with tests that the machine passed; those are left out that it could not have passed."""
    told, warned = list[PassedTest](), list[Text]()
    for one in passed:
        state, machine = given(beside), model.artefact.points.machine
        artefact = LengthsUnderTest(_ends_of(one, machine), machine, bidirectional=one.bidirectional)
        u = one.u_um + one.u_um_per_m * artefact.nominal / METRE
        limit, sigma = MICROMETRE * one.mpe.at(artefact.nominal), float(np.sqrt(np.mean(state.noise.usual_mm**2)))
        alone = passed_test(model, artefact, limit, MICROMETRE * u, sigma, one.repeats)
        found, known = alone.on_its_day(state, one.date, change, corrected=one.corrected)
        chance, named = found.passing(state), Verbatim(one.certificate)
        told.append(PassedTest(one, len(u), chance, chance >= CONTRADICTED))
        if chance < CONTRADICTED:
            text = say(
                "By its recordings the machine cannot have passed the test of {certificate} (least chance of a length to "
                "keep its limit {chance}): it is not used, and the machine may have changed.",
                certificate=named,
                chance=number(chance, ".1g"),
            )
            warned.append(text)
            continue
        if not known:
            unknown = say(
                "Nothing is known of what changed on the machine between its calibration and {date}, the day of the test "
                "of {certificate}: it is taken as unchanged.",
                date=day(one.date),
                certificate=named,
            )
            warned.append(unknown)
        beside = FurtherRecordings((*beside.recordings, found), partial(causes_of, circumstances=job.circumstances))
    return beside, tuple(told), tuple(warned)
