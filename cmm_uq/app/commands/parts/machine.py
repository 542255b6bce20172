"""The machine that a part was measured on: its certificate verified, refused where it does not hold, then its state."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.machine.recordings import FurtherRecordings
from cmm_uq.analysis.machine.regions import with_readings
from cmm_uq.analysis.machine.state import MachineState, machine_stated, with_bounds
from cmm_uq.app.commands.certificates.again import compute_machine_again
from cmm_uq.app.commands.certificates.further import (
    further_certificates,
    given_recordings,
    refuse_adjusted,
    verify_further,
)
from cmm_uq.app.commands.certificates.passed import refuse_passed
from cmm_uq.app.commands.certificates.verification import Verification, examine_certificate, verify_given
from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.app.commands.parts.drift import FILE as HISTORY, known_of, with_drift
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, say
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.clauses import draft
from cmm_uq.certificate.part.measurement import CertificateStatus, Source, VerificationCheck
from cmm_uq.certificate.sections.agreement import against_certificate
from cmm_uq.certificate.sections.regions import readings_warnings
from cmm_uq.certificate.verify.given import CHECKS, Given, given_of
from cmm_uq.jobs.job import CIRCULAR, Job
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.source import sha256 as hashes
from cmm_uq.jobs.tables.identification import COMPENSATED, MEASURED, SIMULATED
from cmm_uq.jobs.tables.machine import stated_axes
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.physics.stated import physics_of
from cmm_uq.maths.inference.draws import Draws

_ORIGINS = {SIMULATED: say("simulated"), COMPENSATED: say("compensated")}
NORMAL_C = 20.0  # °C to which lengths are referred (ISO 1)


def temperatures(job: Job | None) -> Floats | None:
    """What the calibration recorded of the temperatures of the scales, °C."""
    if job is None:
        return None
    columns = [f"temp_{axis}_c" for axis in AXES if f"temp_{axis}_c" in job.points.columns]
    return np.concatenate([job.points.columns[name] for name in columns]) if columns else None


def machine_warnings(job: PartJob, standing: CertificateStatus, calibrated: Job | None) -> Iterable[Text]:
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
    touches = any(stylus.diameter_mm > 0 for stylus in job.facts.stylus)
    if calibrated is not None and calibrated.facts.circumstances.probe.sensing == "optical" and touches:
        yield say(
            "The machine was calibrated with a probe that does not touch; the noise of one that does may be another."
        )


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


WHERE = "job.toml [machine_state]"
# before the names of inputs of the machine's own job, where they are attached to a part's report
CALIBRATION = "machine-job/"


@dataclass(frozen=True, eq=False)
class StatedMachine:
    """A machine, and how it is known."""

    state: MachineState  # its errors and noise on the day of the part's measurement
    standing: CertificateStatus  # of its certificate
    job: Job | None  # of its calibration, where the inputs are at hand
    warnings: tuple[Text, ...]  # what the reader must know of it
    history: bytes | None = None  # that its changes since follow from; ``None`` where no records were asked
    without: MachineState | None = None  # its state without the tests that it passed, where some are reckoned with
    recordings: tuple[RecordingModel, FurtherRecordings] | None = None  # that all of its errors follow from


@dataclass(frozen=True, eq=False)
class _Stated:
    """What states the machine, once it is known to hold."""

    source: Source
    files: tuple[str, ...]
    results: Mapping[str, Any]
    draws: Mapping[str, Floats]
    job: Job | None
    verdict: str
    checked: tuple[VerificationCheck, ...]
    again: bool = False
    not_again: Text = NOTHING


def state_machine(
    job: PartJob, *, rerun: bool = False, trust: Iterable[Path] | None = None, records: str | Path | None = None,
    history: bytes | None = None, seed: int = 0, stage: Stage = silent,
    fits: Callable[[Machine], None] = lambda machine: None,
) -> StatedMachine:  # fmt: skip
    """The machine of a part's job.

    ``rerun``: whether the certificate's figures are computed again from its inputs. ``trust``: files and folders of
    certificates that are trusted; ``None`` for nobody, and then nothing need be signed. ``records``: of the machine's
    history, for its drift; ``None`` for none. ``fits``: refuses a machine on which the part cannot be measured, before
    anything is computed.
    """
    if job.facts.machine_state.job is not None:
        stated = _analysed(job, seed, stage)
    else:
        stage("Verifying the machine's certificate", 0.02)
        stated = _certified(job, verified(job, rerun=rerun, trust=trust), rerun=rerun)
    standing = _standing(job, stated, trusted=trust is not None)
    machine = _machine(job, stated.job)
    fits(machine)
    with physics_of(stated.job):
        state = machine_stated(stated.results, stated.draws, machine, corrected=job.facts.machine_state.corrected)
    stated_bounds = {name: one.largest_um for one in job.facts.machine_state.bound for name in one.errors}
    state = with_bounds(state, stated_bounds)
    state = replace(state, unmodelled=with_readings(state.unmodelled, machine))
    # where the calibration modelled the scales' expansion, their errors are those of 20 °C
    expanding = any(column.startswith("temp_") for effect in state.effects for column in effect.columns)
    known_at = None if expanding else standing.temperature_c
    state = replace(state, calibrated=standing.date, valid_until=standing.valid_until, temperature_c=known_at)
    serial = standing.serial or standing.machine
    since = with_drift(state, serial, job.facts.job.date, records, _where(job), kept=history)
    state = since.state
    stage("The machine's errors, given the recording of its calibration", 0.15)
    more = further_certificates(
        job, stated.job, verify_further(job, compute_machine_again if rerun else None, trust=trust)
    )
    known = None if since.history is None else known_of(since.history)
    adjusted = known.adjusted if known else ()
    refuse_adjusted(more, adjusted, standing.date)
    refuse_passed(job, machine, (standing.number, standing.date), (one.certificate.number for one in more), adjusted)
    passed, change = job.facts.machine_state.passed, known.change if known else None
    found = given_recordings(state, stated.job, more, passed, change, seed)
    state, further = found.state, found.further
    circular = standing.circular or any(one.job.facts.certified_on_this_machine for one in more)
    against = against_certificate(stated.results, found.drawn, found.causes)
    standing = replace(standing, circular=circular, drift=since.told, changes=since.changes, further=further.each)
    standing = replace(
        standing, path=found.path, given_recording=found.given, passed=found.passed, against=tuple(against)
    )
    told = [*against, *further.warnings, *machine_warnings(job, standing, stated.job)]
    told += readings_warnings(state.statements, state.scales)
    if passed and not found.given:
        told.append(
            say("Tests that the machine passed are not reckoned with: they are taken together with its recording.")
        )
    if rerun and stated.not_again:
        told = [stated.not_again, *told]
    return StatedMachine(state, standing, stated.job, tuple(told), since.history, found.without, found.recordings)


def refuse_machine(job: PartJob, fits: Callable[[Machine], None] = lambda machine: None) -> None:
    """Refuse what :func:`state_machine` refuses of a certificate, without its errors; a job to be analysed is read alone."""
    calibrated: Job | None
    if job.facts.machine_state.job is not None:
        calibrated = read_job(_machines_folder(job))
        said = calibrated.facts.job
        named = str(said.number or said.id), said.date
    else:
        stated = _certified(job, verified(job), rerun=False)
        standing, calibrated = _standing(job, stated, trusted=False), stated.job
        named = standing.number, standing.date
    more, machine = further_certificates(job, calibrated, verify_further(job)), _machine(job, calibrated)
    refuse_passed(job, machine, named, (one.certificate.number for one in more))
    fits(machine)


def standing_of(job: PartJob, found: Verification) -> CertificateStatus:
    """The machine's certificate on the day of the part's measurement, without what its errors then are."""
    stated = _certified(job, found, rerun=False)
    _machine(job, stated.job)
    return _standing(job, stated, trusted=False)


def verified(job: PartJob, *, rerun: bool = False, trust: Iterable[Path] | None = None) -> Verification:
    """The verification of the certificate that states the machine of a part's job."""
    where = _where(job)
    given = given_of(job.machine_files)
    if given.results is None:
        raise CmmUqError("states too little: neither draws of the machine's errors nor its recording are inside", where=where,
                         fix="Give certificate.pdf, or the folder that cmm-uq report wrote")  # fmt: skip
    if given.of_part:
        raise CmmUqError("is of a part, and states no machine", where=where,
                         fix="Give the certificate of the machine that measured the part")  # fmt: skip
    return verify_given(given, partial(examine_certificate, computing=compute_machine_again), rerun=rerun, trust=trust)


def _certified(job: PartJob, found: Verification, *, rerun: bool) -> _Stated:
    given, where = found.given, _where(job)
    if wrong := found.inquiry.findings:
        more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        first = ": ".join(filter(None, (wrong[0].file, wrong[0].place, wrong[0].problem)))
        raise CmmUqError(f"the machine's certificate does not verify: {first}{more}", where=where,
                         fix="cmm-uq verify says all that is wrong; ask for the certificate as it was issued")  # fmt: skip
    results = {} if given.results is None else given.results[1]
    read = found.job
    source: Source = "results" if read is None else "certificate"
    again, made = rerun and "again" in found.inquiry.done, str(results["software"]["version"])
    not_again = say("The machine's certificate was to be computed again and was not: cmm-uq verify says why.")
    if made != __version__:
        not_again = say(
            "The machine's certificate was to be computed again and was not: version {made} made it, and this is {here}. "
            "Verify it with the version that made it, or issue it anew.", made=Verbatim(made), here=Verbatim(__version__),
        )  # fmt: skip
    done = found.inquiry.done
    checked = [VerificationCheck(what, done[name]) for name, what in CHECKS.items() if done.get(name)]
    checked += [VerificationCheck(left.what, 0, left.why) for left in found.inquiry.unchecked]
    return _Stated(source, job.stated_by, results, _drawn(job, given, results, where), read, found.inquiry.word,
                   tuple(checked), again, NOTHING if again else not_again)  # fmt: skip


def _drawn(job: PartJob, given: Given, results: Mapping[str, Any], where: str) -> dict[str, Floats]:
    """Draws of the posterior, of the file whose hash results.json has."""
    entry = results.get("posterior")
    if not isinstance(entry, dict):
        raise CmmUqError("states too little: it has no draws of the machine's errors", where=where,
                         fix="Give the certificate of a report whose errors are a list of effects")  # fmt: skip
    named = str(entry["file"])
    content = given.files.get(named) or job.inputs.get(job.facts.machine_state.posterior)
    if content is None:
        raise CmmUqError(f"states too little: {named} is not there", where=where,
                         fix="Put it beside results.json, or give the certificate as PDF")  # fmt: skip
    if sha256(content).hexdigest() != entry["sha256"]:
        raise CmmUqError(f"{named} is not the file whose hash results.json has", where=where,
                         fix="Give both as the same report wrote them")  # fmt: skip
    return Draws.of_npz(content, named).flat()


def _analysed(job: PartJob, seed: int, stage: Stage) -> _Stated:
    from cmm_uq.app.commands.report import evaluate_job, outcome_of
    from cmm_uq.certificate.origin import as_json

    named = str(job.facts.machine_state.job)
    attached = attached_calibration(job)
    if job.folder == Path() and not attached:
        raise CmmUqError("a part's job in memory has no other job beside it", where=f"{WHERE} job",
                         fix="Give the machine's certificate, or read the job from its folder")  # fmt: skip
    stage("Analysing the machine's job", 0.02)
    read = job_of(attached) if attached else read_job(_machines_folder(job))
    if denied := next(read.denials(), None):
        raise CmmUqError(f"its {denied[0]} was not in calibration: {denied[1]}", where=f"{WHERE} job = {named!r}",
                         fix=f"Mend {denied[2]} of that job, or calibrate the machine anew")  # fmt: skip
    found = evaluate_job(read, seed=seed)
    outcome = outcome_of(found, seed)
    if outcome.draws is None:
        raise CmmUqError("states too little: its analysis draws no errors of the machine", where=f"{WHERE} job = {named!r}",
                         fix="Name a job whose errors are a list of effects")  # fmt: skip
    results = json.loads(as_json(outcome.results))
    return _Stated("job", (named,), results, outcome.draws.flat(), read, "ANALYSED", ())


def _machines_folder(job: PartJob) -> Path:
    folder = job.folder / str(job.facts.machine_state.job)
    if folder.resolve() == job.folder.resolve():
        raise CmmUqError("is the part's own job", where=f"{WHERE} job = {job.facts.machine_state.job!r}",
                         fix="Name the folder of the machine's job, or its certificate")  # fmt: skip
    return folder


def attached_calibration(job: PartJob) -> dict[str, bytes]:
    """Inputs of the machine's own job, of a part's report that has them inside; by their names in that job."""
    if job.facts.machine_state.job is None:
        return {}
    own = {name: content for name, content in job.inputs.items() if name.startswith(CALIBRATION)}
    return {name.removeprefix(CALIBRATION): content for name, content in own.items()}


def with_calibration(job: PartJob, calibration: Job | None) -> PartJob:
    """A part's job with the inputs of its machine's job among its own, where that was analysed in place of a certificate."""
    if job.facts.machine_state.job is None or calibration is None:
        return job
    named = {f"{CALIBRATION}{name}": content for name, content in calibration.inputs.items()}
    return replace(job, inputs={**job.inputs, **named})


def with_history(job: PartJob, kept: bytes | None) -> PartJob:
    """A part's job with the machine's history among its inputs, where its changes were read from records."""
    return job if kept is None else replace(job, inputs={**job.inputs, HISTORY: kept})


def _standing(job: PartJob, stated: _Stated, *, trusted: bool) -> CertificateStatus:
    said, facts, on = stated.results["job"], job.facts.machine_state, job.facts.job.date
    date = dt.date.fromisoformat(said["date"])
    where = _where(job)
    if date > on:
        raise CmmUqError(f"the machine was calibrated on {date}, after the part was measured on {on}", where=where,
                         fix="Give the certificate that held on that day, or mend [job] date")  # fmt: skip
    own = None if stated.job is None else stated.job.facts
    until = facts.valid_until or (None if own is None else own.job.recalibration_agreed)
    if until is not None and on > until:
        raise CmmUqError(f"the machine's certificate has expired: it held until {until}, and the part was measured on {on}",
                         where=where, fix="Calibrate the machine, or give the certificate that held on that day")  # fmt: skip
    recorded = temperatures(stated.job)
    return CertificateStatus(
        stated.source, stated.files, number=str(said.get("number") or (own and own.job.number) or said["id"]),
        laboratory="" if own is None else own.laboratory.name, machine=str(said["machine"]),
        serial=str(said.get("serial") or ""), origin=str(said["origin"]), date=date, age=on - date, valid_until=until,
        verdict=stated.verdict, checked=stated.checked, again=stated.again, trusted=trusted,
        draft=stated.job is not None and draft(stated.job),
        given_recording=False, path=NOTHING, drift=NOTHING, interim=bool(said.get("interim")),
        temperature_c=None if recorded is None else float(np.mean(recorded)),
        inputs_sha256=dict(said["inputs_sha256"]) if stated.job is None else hashes(stated.job.inputs),
        circular=own.certified_on_this_machine if own is not None else any(
            one["key"] == CIRCULAR[1] and one["status"] == "missing" for one in stated.results.get("iso17025") or ()
        ),
    )  # fmt: skip


def _where(job: PartJob) -> str:
    """What states the machine, for messages."""
    facts = job.facts.machine_state
    key, named = ("certificate", facts.certificate) if facts.job is None else ("job", facts.job)
    return f"{WHERE} {key} = {named!r}"


def _machine(job: PartJob, calibrated: Job | None) -> Machine:
    """Chain, travel and origin: as the job says, else as the calibration has them."""
    facts, own = job.facts.machine_state, None if calibrated is None else calibrated.facts.machine
    chain, origin = facts.chain, facts.origin_mm
    if own is not None and own.joint:
        raise CmmUqError(
            "the machine's certificate is of an arm, and parts are evaluated of machines of three carriages",
            where=_where(job),
            fix="Give the certificate of the machine that measured it",
        )
    if own is not None and "chain" not in facts.model_fields_set:
        chain = own.chain
    if own is not None and "origin_mm" not in facts.model_fields_set:
        origin = own.origin_mm
    if own is not None and chain != own.chain:
        raise CmmUqError(f"the machine's certificate is of chain {own.chain}, and the job says {chain}",
                         where=f"{WHERE} chain", fix="Leave it out, or give the certificate of this machine")  # fmt: skip
    travel = np.full((3, 2), np.nan)
    for i, axis in enumerate(AXES):
        here, there = getattr(facts.travel_mm, axis), None if own is None else getattr(own.travel_mm, axis)
        if here is not None and there is not None and list(here) != list(there):
            raise CmmUqError(
                f"the machine's certificate has a travel of {axis} of {there[0]:g} to {there[1]:g} mm, and the job says "
                f"{here[0]:g} to {here[1]:g} mm", where=f"{WHERE} travel_mm",
                fix="Leave it out, or give the certificate of this machine",
            )  # fmt: skip
        given = here or there
        if given is None:
            raise CmmUqError(f"nothing says how far axis {axis} goes, by which errors of guideways are told", where=WHERE,
                             fix=f"Give travel_mm = {{ {axis} = [lowest, highest] }}, or the certificate as PDF")  # fmt: skip
        travel[i] = given
    name, read_by = "" if own is None else own.name, stated_axes([] if own is None else own.axes)
    for axis, one in stated_axes(facts.axes).items():
        if read_by.setdefault(axis, one).model_copy(update={"names": one.names}) != one:
            raise CmmUqError(f"the machine's certificate says otherwise of how axis {axis} is read", where=f"{WHERE} axes",
                             fix="Leave it out, or mend the job that is wrong")  # fmt: skip
    return Machine(name, chain, travel, np.array(origin, dtype=np.float64), read_by=read_by)
