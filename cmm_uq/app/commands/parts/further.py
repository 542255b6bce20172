"""Further certificates of the machine that measured a part, whose recordings are taken together with that of its calibration.

Each is verified as the machine's own certificate is, must be of the same machine, and brings its recording along. One whose
recording contradicts the machine as the others have it, by more than all uncertainties allow, is not used.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from cmm_uq.analysis.diagnosis.held_out import quantities, thin_out
from cmm_uq.analysis.machine.conditional import further_recording, given_recording, own_noise
from cmm_uq.analysis.machine.recordings import FurtherRecording
from cmm_uq.analysis.machine.state import Change, MachineState, changes
from cmm_uq.app.commands.certificates.verification import Verification, examine_certificate, verify_given
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import with_noise
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, day, number, say
from cmm_uq.certificate.part.measurement import FurtherCertificate
from cmm_uq.certificate.verify.given import given_of
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.stated import with_own_physics
from cmm_uq.maths.inference.posterior import Doubt

# quantities of a recording, with their repeats, by which a machine's errors are drawn: time grows with the cube of what they
# show of errors left out. Those of all further recordings together.
MOST, _MOST_FURTHER = 200, 150
# chance of a recording that contradicts a machine as much, below which it is taken to be of another state of the machine
CONTRADICTED = 1e-3


@dataclass(frozen=True, eq=False)
class VerifiedCertificate:
    """A further certificate that verifies, and the job of its inputs."""

    certificate: FurtherCertificate
    job: Job
    corrected: bool  # whether the machine then corrected what its calibration found


def verify_further(
    job: PartJob, *, rerun: bool = False, trust: Iterable[Path] | None = None
) -> Iterable[tuple[str, Verification]]:
    """The verification of each further certificate of a part's job, by the name of its file."""
    trusted = None if trust is None else tuple(trust)
    for name in job.further:
        yield name, verify_given(given_of({name: job.inputs[name]}), examine_certificate, rerun=rerun, trust=trusted)


def further_certificates(
    job: PartJob, calibrated: Job | None, found: Iterable[tuple[str, Verification]]
) -> tuple[VerifiedCertificate, ...]:
    """Further certificates of a part's job; raises what is wrong with one. ``calibrated``: of the machine's calibration."""
    verified, seen = list[VerifiedCertificate](), {_recording(calibrated)} if calibrated is not None else set()
    facts = job.facts.machine_state.further
    for one, (name, result) in zip(facts, found, strict=True):
        refuse = partial(CmmUqError, where=f"job.toml [[machine_state.further]] certificate = {one.certificate!r}")
        if wrong := result.inquiry.findings:
            first = ": ".join(filter(None, (wrong[0].file, wrong[0].place, wrong[0].problem)))
            raise refuse(
                f"does not verify: {first}", fix="cmm-uq verify says all that is wrong; ask for it as it was issued"
            )
        if calibrated is None:
            problem = "stands beside a certificate without its recording, with which it cannot be taken together"
            raise refuse(problem, fix="Give the machine's own certificate as PDF")
        own, results = result.job, result.given.results
        if own is None or results is None:
            raise refuse("has no recording inside", fix="Give the certificate as PDF, as cmm-uq report wrote it")
        _refuse_other(own, calibrated, job.facts.job.date, refuse)
        if not kind_of(own).by_effects:
            problem = f"is of a {own.facts.artefact.kind}, which by itself shows no errors of a machine"
            raise refuse(problem, fix="Leave it out")
        if (recording := _recording(own)) in seen:
            raise refuse("is of a recording that is reckoned with already", fix="Leave it out")
        seen.add(recording)
        said = own.facts.job
        named, by, of = str(said.number or said.id), own.facts.laboratory.name, own.facts.artefact.name
        origin, word = str(results[1]["job"]["origin"]), result.inquiry.word
        certificate = FurtherCertificate(name, named, by, of, said.date, word, one.corrected, origin)
        verified.append(VerifiedCertificate(certificate, own, one.corrected))
    return tuple(verified)


def _recording(job: Job) -> bytes:
    return job.inputs[job.facts.recording.file]


def _refuse_other(own: Job, calibrated: Job, on: dt.date, refuse: Callable[..., CmmUqError]) -> None:
    """Refuse the certificate of another machine, or of another day than those that may be reckoned with."""
    here, there = own.facts.machine, calibrated.facts.machine
    facts = {"name": "name", "serial": "serial number", "chain": "chain", "travel_mm": "travel", "origin_mm": "origin"}
    for key, what in (facts | {"error_map": "error map"}).items():
        if (one := getattr(here, key)) != (other := getattr(there, key)):
            problem = f"is of another {what}: {one}, where the machine's certificate has {other}"
            raise refuse(problem, fix="Give certificates of the machine that measured the part")
    if own.facts.job.date > on:
        raise refuse(f"is of {own.facts.job.date}, after the part was measured on {on}", fix="Leave it out")


def refuse_adjusted(further: Iterable[VerifiedCertificate], adjusted: Iterable[dt.date], calibrated: dt.date) -> None:
    """Refuse a certificate between which and the machine's calibration records have an adjustment."""
    for one in further:
        low, high = sorted((one.certificate.date, calibrated))
        if (between := max((day for day in adjusted if low < day <= high), default=None)) is not None:
            raise CmmUqError(
                f"is of {one.certificate.date}, and the machine, calibrated on {calibrated}, was adjusted on {between}",
                where=f"job.toml [[machine_state.further]] {one.certificate.file}",
                fix="Leave it out: it states the machine before its adjustment",
            )


@with_own_physics
def recording_of(job: Job, seed: int, most: int = MOST) -> tuple[RecordingModel, RecordingModel]:
    """The model of a calibration's recording, and that of no more than so many of its quantities."""
    model, _ = screened_model(job)
    model, _, _ = with_noise(model)
    most = most * int(model.used.sum()) // max(quantities(model), 1)
    observe = partial(kind_of(job).observing("the machine of a part"), job.facts.artefact, where=job.recording_path)
    return model, thin_out(model, observe, seed, most)


def given_together(
    state: MachineState,
    alone: MachineState,
    model: RecordingModel,
    doubt: Doubt,
    further: Sequence[VerifiedCertificate],
    change: Change | None,
    seed: int,
) -> tuple[MachineState, tuple[FurtherCertificate, ...], tuple[Text, ...]]:
    """The machine given all recordings; what became of each certificate, and what the reader must know of it.

    ``state``: as its own certificate states it. ``alone``: given the recording of that one, of which ``doubt`` is what is
    stated to be in doubt. ``change``: by the records.
    """
    taken, told, warned = list[FurtherRecording](), list[FurtherCertificate](), list[Text]()
    if not further:
        return alone, (), ()
    known, most = alone, _MOST_FURTHER // len(further)
    first = FurtherRecording(model, own_noise(model, state.unmodelled, seed))
    keys = [(effect.name, one.name) for effect in state.effects for one in effect.coefficients]
    for one in further:
        _, other = recording_of(one.job, seed, most)
        causes = causes_of(other.artefact, one.job.circumstances)
        days = abs((one.certificate.date - state.calibrated).days) if state.calibrated else 0
        each = [size for effect in state.effects for size in changes(effect, days, change)]
        found = replace(
            further_recording(first, other, state.unmodelled, seed, causes=causes),
            change={key: size for key, size in zip(keys, each, strict=True) if size},
            corrections=dict(zip(keys, state.corrects.tolist(), strict=True)) if one.corrected else {},
        )
        chance = found.contradiction(known)
        used = chance >= CONTRADICTED
        told.append(replace(one.certificate, observations=int(found.model.used.sum()), chance=chance, used=used))
        named = Verbatim(one.certificate.number)
        if one.certificate.origin != MEASURED:
            warned.append(say("The recording of the further certificate {number} was not measured.", number=named))
        if not used:
            why = say(
                "The recording of the further certificate {number} contradicts the machine as its other certificates have it "
                "(chance of as much {chance}): it is not used, and the machine may have changed.",
                number=named,
                chance=number(chance, ".1g"),
            )
            warned.append(why)
            continue
        if days and None in each:
            unknown = say(
                "Nothing is known of what changed on the machine between its calibration and {date}, the day of the further "
                "certificate {number}: it is taken as unchanged, which its recording does not contradict.",
                date=day(one.certificate.date),
                number=named,
            )
            warned.append(unknown)
        taken.append(found)
        known = given_recording(state, model, seed=seed, doubt=doubt, beside=taken)
    return known, tuple(told), tuple(warned)
