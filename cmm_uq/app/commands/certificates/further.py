"""Further certificates of a machine, whose recordings are taken together with that of its calibration.

Each is verified as the machine's own certificate is, must be of the same machine, and brings its recording along. One whose
recording contradicts the machine as the others have it, by more than all uncertainties allow, is not used.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.analysis.diagnosis.held_out import with_quantities
from cmm_uq.analysis.machine.agreement import RecordedDraws
from cmm_uq.analysis.machine.conditional import further_recording, given_recording, own_noise
from cmm_uq.analysis.machine.recordings import ALONE, CONTRADICTED, FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.regions import other_errors
from cmm_uq.analysis.machine.state import Change, MachineState, StatedNoise, of_machine, with_curves
from cmm_uq.app.commands.certificates.passed import tests_passed
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import doubt_of, with_noise
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, after, day, number, say
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.origin import NO_FURTHER, FurtherCertificate, FurtherCertificates, PassedTest
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import MEASURED, SIMULATED
from cmm_uq.jobs.tables.machine import FurtherFacts
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.stated import with_own_physics
from cmm_uq.maths.inference.draws import evenly
from cmm_uq.maths.inference.family_sizes import BRIEF
from cmm_uq.maths.inference.posterior import Cause, Doubt, NoisyPosterior

if TYPE_CHECKING:
    from cmm_uq.app.commands.certificates.verification import Computing, Verification
    from cmm_uq.jobs.part.job import PartJob
    from cmm_uq.jobs.part.machine_state import PassedFacts

# quantities of a recording, with their repeats, by which a machine's errors are drawn: time grows with the cube of what they
# show of errors left out. Those of all further recordings together.
MOST, MOST_FURTHER = 200, 150
_HELD = 400  # draws by which it is looked at whether they agree with a recording


@dataclass(frozen=True, eq=False)
class VerifiedCertificate:
    """A further certificate that verifies, and the job of its inputs."""

    certificate: FurtherCertificate
    job: Job
    corrected: bool  # whether the machine then corrected what its calibration found


@dataclass(frozen=True, eq=False)
class JointRecordings:
    """Recordings that are taken together with that of a machine's calibration, and what became of each certificate."""

    taken: FurtherRecordings = ALONE  # that do not contradict it
    told: FurtherCertificates = NO_FURTHER


def verify_further(
    job: PartJob | Job, computing: Computing | None = None, *, trust: Iterable[Path] | None = None
) -> Iterable[tuple[str, Verification]]:
    """The verification of each further certificate of a job, by the name of its file; ``computing``: again, if at all."""
    if not job.further:
        return
    from cmm_uq.app.commands.certificates.verification import examine_certificate, verify_given
    from cmm_uq.certificate.verify.given import given_of

    trusted, examine = None if trust is None else tuple(trust), partial(examine_certificate, computing=computing)
    for name in job.further:
        given = given_of({name: job.inputs[name]})
        yield name, verify_given(given, examine, rerun=computing is not None, trust=trusted)


def further_certificates(
    job: PartJob | Job, calibrated: Job | None, found: Iterable[tuple[str, Verification]]
) -> tuple[VerifiedCertificate, ...]:
    """Further certificates of a job, of a part's those of its machine's calibration besides; raises what is wrong with one.

    ``calibrated``: the job of the machine's calibration. ``found``: the verification of each.
    """
    if isinstance(job, Job):
        return _certificates("machine", job.facts.machine.further, found, calibrated, job, ())
    own = further_certificates(calibrated, calibrated, verify_further(calibrated)) if calibrated is not None else ()
    return own + _certificates("machine_state", job.facts.machine_state.further, found, calibrated, job, own)


def _certificates(
    table: str,
    facts: Iterable[FurtherFacts],
    found: Iterable[tuple[str, Verification]],
    calibrated: Job | None,
    job: PartJob | Job,
    beside: Iterable[VerifiedCertificate],
) -> tuple[VerifiedCertificate, ...]:
    verified, seen = list[VerifiedCertificate](), {_recording(one.job) for one in beside}
    seen |= {_recording(calibrated)} if calibrated is not None else set()
    for one, (name, result) in zip(facts, found, strict=True):
        refuse = partial(CmmUqError, where=f"job.toml [[{table}.further]] certificate = {one.certificate!r}")
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
        _refuse_other(own, calibrated, job, refuse)
        if kind_of(own).observe is None:
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
    """Its readings, however ordered, numbered and written down: the same ones again say nothing more."""
    points = job.points
    read = [points.columns[name] for name in sorted(points.columns) if name.startswith("reading_")]
    rows = np.column_stack([points.xyz, *read]) + 0.0
    return rows[np.lexsort(rows.T)].tobytes()


def _refuse_other(own: Job, calibrated: Job, job: PartJob | Job, refuse: Callable[..., CmmUqError]) -> None:
    """Refuse the certificate of another machine, or of another day than those that may be reckoned with."""
    here, there = own.facts.machine, calibrated.facts.machine
    facts = {"name": "name", "serial": "serial number", "chain": "chain", "travel_mm": "travel", "origin_mm": "origin"}
    for key, what in (facts | {"error_map": "error map"}).items():
        if (one := getattr(here, key)) != (other := getattr(there, key)):
            problem = f"is of another {what}: {one}, where the machine's certificate has {other}"
            raise refuse(problem, fix="Give certificates of the machine that measured the part")
    if own.facts.job.date > (on := job.facts.job.date) and not isinstance(job, Job):
        raise refuse(f"is of {own.facts.job.date}, after the part was measured on {on}", fix="Leave it out")
    if own.origin != calibrated.origin and SIMULATED in (own.origin, calibrated.origin):
        problem = f"is of a recording that is {own.origin}, and that of the machine is {calibrated.origin}"
        raise refuse(problem, fix="Take recordings together that were all measured, or all simulated")


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
    observe = partial(kind_of(job).observing("the machine of a part"), job.facts.artefact, where=job.recording_path)
    return model, with_quantities(model, observe, seed, most)


def given_together(
    state: MachineState,
    given: Callable[[FurtherRecordings], MachineState],
    model: RecordingModel,
    job: Job,
    further: Sequence[VerifiedCertificate],
    change: Change | None,
    seed: int,
) -> JointRecordings:
    """Further recordings of a machine, those left out that contradict it as its others have it.

    ``state``: as its own certificate states it; ``given``: the same by the recording of ``job``, its calibration, with
    others. ``change``: by the records.
    """
    taken, told, warned = list[FurtherRecording](), list[FurtherCertificate](), list[Text]()
    if not further:
        return JointRecordings()
    beside, most = ALONE, MOST_FURTHER // len(further)
    first = FurtherRecording(model, own_noise(model, state.unmodelled, seed))
    for one in further:
        _, other = recording_of(one.job, seed, most)
        causes = causes_of(other.artefact, one.job.circumstances)
        alone = further_recording(first, other, state.unmodelled, seed, causes=causes)
        found, known = alone.on_its_day(state, one.certificate.date, change, corrected=one.corrected)
        chance = found.contradiction(given(beside))
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
        if not known:
            unknown = say(
                "Nothing is known of what changed on the machine between its calibration and {date}, the day of the further "
                "certificate {number}: it is taken as unchanged, which its recording does not contradict.",
                date=day(one.certificate.date),
                number=named,
            )
            warned.append(unknown)
        taken.append(found)
        beside = FurtherRecordings(tuple(taken), partial(causes_of, circumstances=job.circumstances))
    return JointRecordings(beside, FurtherCertificates(tuple(told), tuple(warned)))


def once_each(given: Callable[..., MachineState]) -> Callable[[FurtherRecordings], MachineState]:
    """The machine given other recordings beside its calibration's, computed once for the same ones."""
    return cache(lambda beside: given(beside=beside))


def together_of(
    job: Job, model: RecordingModel, posterior: NoisyPosterior, doubt: Doubt, seed: int
) -> Callable[[], JointRecordings]:
    """What takes a calibration's recording together with those of its further certificates, once it is first asked for.

    These are verified at once. ``model``: of the calibration; its ``posterior`` knows of no errors beside the named ones.
    """
    further = further_certificates(job, job, verify_further(job))

    @cache
    def together() -> JointRecordings:
        if not further:
            return JointRecordings()
        acting = [(effect, of_machine(effect)) for effect in model.effects]
        own = np.flatnonzero([machine for effect, machine in acting for _ in effect.coefficients])
        state = MachineState(
            model.artefact.points.machine,
            tuple(effect for effect, machine in acting if machine),
            posterior.draws[:, own],
            StatedNoise(np.full(3, float(np.median(posterior.sigma)))),
            unmodelled=tuple(other_errors(model)),
            calibrated=job.facts.job.date,
        )
        observe = partial(kind_of(job).observing("reported"), job.facts.artefact, where=job.recording_path)
        thinned = with_quantities(model, observe, seed, MOST)
        given = once_each(partial(given_recording, state, thinned, seed=seed, doubt=doubt, effort=BRIEF))
        return given_together(state, given, thinned, job, further, None, seed)

    return together


@dataclass(frozen=True, eq=False)
class GivenRecordings:
    """A machine's state given the recordings that are at hand, and how it became so."""

    state: MachineState
    path: Text  # how its errors are drawn, in a sentence
    given: bool = False  # whether together, by the recording of its calibration
    further: FurtherCertificates = NO_FURTHER
    passed: tuple[PassedTest, ...] = ()
    # the state without the tests that it passed; ``None`` where none is reckoned with
    without: MachineState | None = None
    # of its calibration, and those that are taken together with it, where all of its errors follow from these
    recordings: tuple[RecordingModel, FurtherRecordings] | None = None
    # some of the draws of its errors, and what is in doubt about its recording, by which these are held against each other
    drawn: RecordedDraws | None = None
    causes: tuple[Cause, ...] = ()


def given_recordings(
    state: MachineState,
    job: Job | None,
    more: Sequence[VerifiedCertificate],
    passed: Sequence[PassedFacts],
    change: Change | None,
    seed: int,
) -> GivenRecordings:
    apart = say("errors that it did not model are each drawn on its own, which makes most uncertainties too large")
    if job is None:
        return GivenRecordings(state, say("The recording of the calibration is not at hand: {apart}.", apart=apart))
    if not kind_of(job).by_effects:
        told = say("The calibration is of another sort than one by named errors: {apart}.", apart=apart)
        return GivenRecordings(state, told)
    try:
        whole, model = recording_of(job, seed)
        estimate, count, curved = whole.estimate(), int(whole.used.sum()), with_curves(state)
        sigma = float(np.sqrt(np.mean(state.noise.usual_mm**2))) or estimate.least_squares.sigma_of_residuals
        doubt = doubt_of(whole, estimate, sigma, causes_of(whole.artefact, job.circumstances))
        given = once_each(partial(given_recording, curved, model, seed=seed, doubt=doubt))
        others = given_together(curved, given, model, job, more, change, seed)
        taken, tests, warned = tests_passed(given, model, job, others.taken, passed, change)
        without, together = given(others.taken), given(taken)
    except CmmUqError as error:
        why = Verbatim(error.problem)
        told = say("The errors could not be drawn given the recording ({why}): {apart}.", why=why, apart=apart)
        return GivenRecordings(state, told)
    text: Text = say(
        "All errors are drawn together, given the recording of the calibration, those included that it did not model."
    )
    if together.scales:
        text = after(text, say("Errors of each kind are as large as the recording shows that kind to be."))
    if (some := int(model.used.sum())) < count:
        text = after(text, say("{some} of its {count} observations are reckoned with.", some=some, count=count))
    further = replace(others.told, warnings=(*others.told.warnings, *warned))
    text = after(text, others.told.together)
    passing = taken is not others.taken
    beside = FurtherRecordings(others.taken.recordings, partial(causes_of, circumstances=job.circumstances))
    alone = without if passing else None
    causes = tuple(one.at(model.used) for one in causes_of(model.artefact, job.circumstances))
    own, drawn = None if passing else (model, beside), _drawn(together, model, sigma)
    return GivenRecordings(together, text, True, further, tests, alone, own, drawn, causes)


def _drawn(state: MachineState, model: RecordingModel, sigma_mm: float) -> RecordedDraws | None:
    """Some of the draws of a machine's errors given a recording, those of its named errors before others."""
    if state.given is None:
        return None
    named, some = state.given.before.effects, evenly(len(state.draws), _HELD)
    keys = {(one.name, each.name) for one in named for each in one.coefficients}
    which, draws = np.flatnonzero([one.key in keys for one in model.unknowns]), state.draws[some]
    own, further = draws[:, : len(which)], draws[:, len(which) :]
    return RecordedDraws(
        model, which, own, state.effects[len(named) :], further, state.given.sizes.noise.at(some), sigma_mm
    )
