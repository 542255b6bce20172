"""From a job folder to a :class:`~cmm_uq.jobs.job.Job`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import create_model

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.limits import JOB_BYTES, LOGO_BYTES, MAP_BYTES, TABLE_BYTES, Limit, text_of
from cmm_uq.base.files.toml_file import checked, toml_of
from cmm_uq.base.output import finish_interrupted
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.acquired import Provenance, provenance_name, provenance_of
from cmm_uq.jobs.derived_job import files_of, prediction_of
from cmm_uq.jobs.importing.cells.encodings import begins_with
from cmm_uq.jobs.importing.format import DCC, HEAD, Recognition
from cmm_uq.jobs.job import Job, JobFile, Tables, job_file_of
from cmm_uq.jobs.logo import checked_logo
from cmm_uq.jobs.machines import in_coordinates, machine_of
from cmm_uq.jobs.recording import compared
from cmm_uq.jobs.recording.beside import LOG, SHORT_GAUGE, ShortGauge, log_of, short_gauge_of, with_logged
from cmm_uq.jobs.recording.compared import EXPANDED, OF_POINTS, reference_file
from cmm_uq.jobs.recording.own import read_recording_file
from cmm_uq.jobs.reports import as_found_of, calibration_file, results_named
from cmm_uq.jobs.source import FilesInFolder, FilesInMemory, JobFiles, check_distinct
from cmm_uq.jobs.tables import identification
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
from cmm_uq.jobs.tables.conformity import ClausesForm, ConformityFacts, Standards, needed, uncertainty_missing
from cmm_uq.jobs.tables.identification import NO_DATE, REPLACED, altered, check_examples, check_mark, is_planned
from cmm_uq.jobs.tables.machine import FurtherFacts, MachineFacts

if TYPE_CHECKING:
    from cmm_uq.jobs.recording.certified import CertifiedValues

WHOLE = (".pdf", ".xml")  # a certificate with its inputs inside
_ORIGINS = ("", f"-{identification.SIMULATED}", f"-{identification.COMPENSATED}")
CERTIFICATES = tuple(f"certificate{origin}.pdf" for origin in _ORIGINS)
PART = "part"  # the table by which the job of a part is told from others; see :mod:`cmm_uq.jobs.part`


def is_part(content: bytes) -> bool:
    """Whether a job.toml is of a part."""
    try:
        return PART in toml_of(text_of(content, ""), "")
    except (CmmUqError, ValueError):
        return False


@dataclass(frozen=True)
class Nameable:
    """What a job may name: tables and names of the kinds of measurement, standards of conformity."""

    tables: Tables
    kinds: Callable[[], Sequence[str]]
    standards: Standards


def read_job(folder: Path, nameable: Nameable, *, recorded: bool = True) -> Job:
    """Read and check a job; one still to be measured has no points, where it need not be ``recorded``."""
    return _read(in_folder(folder), nameable, recorded=recorded)


def job_of(files: Mapping[str, bytes], nameable: Nameable, *, recorded: bool = True) -> Job:
    """Read and check a job that lies in no folder yet."""
    return _read(FilesInMemory(files), nameable, recorded=recorded)


def in_folder(folder: Path) -> FilesInFolder:
    """Files of a job by its folder, or by its job.toml, once what a process that is no more left there is settled."""
    if folder.suffix != ".toml" and folder.is_file():
        problem = "is an export, not a job: which artefact and which limits, it does not say"
        fix = "cmm-uq new KIND my-job --from FILE makes a job of it, cmm-uq import FILE shows how it is read"
        if folder.suffix.lower() in WHOLE:
            problem = "is a certificate or the like, not a job"
            fix = "cmm-uq verify FILE checks it, cmm-uq read FILE prints a digital one"
        raise CmmUqError(problem, where=str(folder), fix=fix)
    path = folder if folder.suffix == ".toml" else folder / "job.toml"
    finish_interrupted(path.parent)
    return FilesInFolder(path)


def _read(source: JobFiles, nameable: Nameable, *, recorded: bool) -> Job:
    """With what the records had of the certificate that it replaces, where that lies beside it: its last input."""
    job = _read_alone(source, nameable, recorded=recorded)
    replaces = job.facts.job.replaces
    if replaces is None or replaces.results is not None or not source.has(REPLACED):
        return job
    return replace(job, inputs={**job.inputs, **_contents(source, [REPLACED], TABLE_BYTES, written=True)})


def _refuse_unfit_earlier(facts: JobFile, path: Path) -> None:
    """Refuse an earlier recording of a kind that compares none, and one that is later."""
    recorded, when = facts.recording, facts.job.date
    if recorded.earlier is not None and not facts.artefact.with_earlier:
        problem = f"earlier compares two recordings at two dates, which a job of kind {facts.artefact.kind!r} has not"
        raise CmmUqError(problem, where=f"{path}: [recording] earlier", fix="Leave it out")
    if recorded.earlier_date is not None and NO_DATE != when < recorded.earlier_date:
        problem = f"{recorded.earlier_date} lies after the recording's date, {when}"
        fix = "Exchange both recordings, or mend a date"
        raise CmmUqError(problem, where=f"{path}: [recording] earlier_date", fix=fix)


def _read_alone(source: JobFiles, nameable: Nameable, *, recorded: bool) -> Job:
    path, folder = source.toml, source.toml.parent
    content, facts, says = _facts(source, nameable)
    inputs = {"job.toml": content}
    earlier = facts.recording.earlier
    _refuse_unfit_earlier(facts, path)
    machine = machine_of(facts.machine)
    maps, logs, calibrations = _of_the_machine(facts.machine)
    predicted, predicting_maps = files_of(facts, path)
    certificate = reference_file(facts.artefact)
    logo = [facts.laboratory.logo] if facts.laboratory.logo else []
    recordings = [facts.recording.file] if earlier is None else [facts.recording.file, earlier]
    recordings += [facts.short_gauge.file] if facts.short_gauge else []
    forms = list(dict.fromkeys(wish.clauses for wish in facts.conformity if wish.clauses is not None))
    check_distinct(
        [*recordings, *maps, *logs, *calibrations, *certificate, *predicted, *predicting_maps, *logo, *forms], str(path)
    )
    before = results_named(facts.job.as_found)
    named = None if facts.job.replaces is None else results_named(facts.job.replaces.results)
    others = [*calibrations, *(one for one in (before, named) if one is not None)]
    beside = further_named(facts.machine.further, source)
    inputs |= _contents(source, [*others, *beside], TABLE_BYTES, written=True) | _contents(source, forms, JOB_BYTES)
    clauses = _forms(facts.conformity, inputs, folder, nameable.standards)
    if says is not None:
        inputs |= _contents(source, certificate, TABLE_BYTES)
    inputs |= (pictures := _contents(source, logo, LOGO_BYTES))
    for name, picture in pictures.items():
        checked_logo(picture, str(folder / name))
    if not facts.artefact.with_recording:
        _refuse_what_needs_a_recording(facts, path)
        check_examples(content, facts.job.origin, str(path))
        return Job(folder, facts, _no_points(machine), inputs | _contents(source, maps, MAP_BYTES))
    noise = results_named(facts.plan.noise_from)
    if noise is not None:
        inputs |= _contents(source, [noise], TABLE_BYTES, written=True)
    if not recorded and not source.has(facts.recording.file):
        return Job(folder, facts, _no_points(machine), inputs)
    derived = facts.job.derived_from
    inputs |= _contents(source, [*recordings, *logs, *certificate, *predicted], TABLE_BYTES)
    inputs |= _contents(source, [*maps, *predicting_maps], MAP_BYTES)
    if derived is not None:
        others = [name for name in derived.files if name not in inputs]
        inputs |= _contents(source, others, TABLE_BYTES, written=True)
    where = str(folder / facts.recording.file)
    check_mark(folder, facts.job.origin, inputs[facts.recording.file], where)
    check_examples(content, facts.job.origin, str(path))
    acquired = _acquired(facts, source, inputs)
    points, recognised = read_recording_file(
        inputs[facts.recording.file], where, machine, facts.recording, acquired.without if acquired else ()
    )
    points = facts.recording.with_constant(points, path)
    points = replace(
        in_coordinates(points, facts.machine, where), in_seconds=acquired is not None and not acquired.changed
    )
    told = [recognised, None if says is None else says.recognised]
    facts, points, further = _certified_points(facts, points, inputs, source, says, told)
    told.append(further)
    _refuse_unstated(facts, points, nameable.standards, path)
    planned = is_planned(inputs[facts.recording.file])
    if not planned:  # a plan has no times yet
        points = with_logged(points, log_of(facts.machine, inputs, folder), path, where)
    if earlier is not None:
        then, recognised = read_recording_file(inputs[earlier], str(folder / earlier), machine, facts.recording)
        then = in_coordinates(then, facts.machine, str(folder / earlier))
        told.append(recognised)
        compared.refuse_copy(points, then, planned, f"{path}: [recording] earlier")
        points = compared.against_earlier(points, then, facts.artefact.cte_per_k, where)
    found = as_found_of(before, inputs, folder, facts.job.origin, facts.machine.name, facts.machine.serial)
    gauge = _short_gauge(facts, inputs, folder, machine)
    prediction = prediction_of(facts.simulation, inputs, folder)
    return Job(folder, facts, points, inputs, altered(derived, inputs), planned, found, gauge, prediction, acquired=acquired,
               imported=tuple(filter(None, told)), certified={} if says is None else says.table, clauses=clauses,
               further=beside)  # fmt: skip


def _forms(
    wishes: Sequence[ConformityFacts], inputs: Mapping[str, bytes], folder: Path, standards: Standards
) -> dict[str, ClausesForm]:
    """The forms that a job names, by their file."""
    forms: dict[str, ClausesForm] = {}
    for i, wish in enumerate(wishes, 1):
        if wish.clauses is None:
            continue
        path = folder / wish.clauses
        form = forms[wish.clauses] = checked(inputs[wish.clauses], path, ClausesForm)
        if form.standard != wish.standard:
            problem = f"is the form of {form.standard}, and [[conformity]] {i} states {wish.standard}"
            fix = f'cmm-uq standards "{wish.standard}" --form FILE writes the one that belongs to it'
            raise CmmUqError(problem, where=str(path), fix=fix)
        asked = standards.named(wish.standard)
        known = () if asked is None else asked.clause_names
        for name in (name for name in form.clauses if name not in known):
            problem = f"{wish.standard} has no clause {name!r} here"
            raise CmmUqError(problem, where=f"{path}: [clauses.{name}]", fix=suggestion(name, known))
    return forms


def _certified_points(
    facts: JobFile, points: Points, inputs: Mapping[str, bytes], source: JobFiles, says: CertifiedValues | None,
    told: Sequence[Recognition | None],
) -> tuple[JobFile, Points, Recognition | None]:  # fmt: skip
    """A recording with certified values and their uncertainties, the job with covariances, how their file was read."""
    folder, recognised, artefact = source.toml.parent, None, facts.artefact
    where = str(folder / facts.recording.file)
    if not artefact.with_references:
        if any(name in points.columns for name in (*OF_POINTS, EXPANDED)):
            raise CmmUqError(f"has uncertainties of certified points, which a job of kind {artefact.kind!r} has not",
                             where=where, fix="Give U_um and k in [artefact], and leave the column out")  # fmt: skip
        return facts, points, None
    if reference_file(artefact):
        points, recognised = compared.with_references(points, artefact, inputs, folder, where)
    if says is not None and says.places is not None:
        points, artefact = says.places.beside(points, artefact)
        facts = facts.model_copy(update={"artefact": artefact})
    if recognised is not None:
        where = str(folder / recognised.file)
    read = (recognised,) if recognised is not None else told
    unread = [heading for one in read if one is not None for heading in one.unused]
    points = compared.with_uncertainties(points, artefact, where, unread)
    stated = [float(points.columns[name].max()) for name in OF_POINTS if name in points.columns]
    if stated and isinstance(artefact, ReferencedFacts):
        facts = facts.model_copy(update={"artefact": artefact.with_largest(max(stated))})
    return facts, points, recognised


def _refuse_unstated(facts: JobFile, points: Points, standards: Standards, path: Path) -> None:
    """That a rule needs an uncertainty which neither the job nor its certified values state."""
    artefact = facts.artefact
    if not artefact.with_references or artefact.u_um is not None or not points.columns.keys().isdisjoint(OF_POINTS):
        return
    for wish in facts.conformity:
        if key := uncertainty_missing(wish, artefact, facts.test_uncertainty, standards):
            problem, fix = needed(key, wish)
            raise CmmUqError(problem, where=f"{path}: [[conformity]]", fix=fix)


def _acquired(facts: JobFile, source: JobFiles, inputs: dict[str, bytes]) -> Provenance | None:
    """How the recording was taken live, where a file beside it says so, which is an input then."""
    name = provenance_name(facts.recording.file)
    if not source.has(name):
        return None
    inputs |= _contents(source, [name], TABLE_BYTES, written=True)
    return provenance_of(inputs[name], inputs[facts.recording.file], facts.job.origin, str(source.toml.parent / name))


def _short_gauge(facts: JobFile, inputs: Mapping[str, bytes], folder: Path, machine: Machine) -> ShortGauge | None:
    """What was recorded of it, under the same mark of origin as the recording itself."""
    if facts.short_gauge is None:
        return None
    content, where = inputs[facts.short_gauge.file], str(folder / facts.short_gauge.file)
    check_mark(folder, facts.job.origin, content, where)
    return short_gauge_of(facts.short_gauge, content, where, machine)


def _refuse_what_needs_a_recording(facts: JobFile, path: Path) -> None:
    """That a job of a kind without a recording has none, nor anything to be joined to one."""
    none = f"a job of kind {facts.artefact.kind!r} has no recording of points"
    for given, key, fix in (
        (facts.recording.file, "[recording] file", "Leave [recording] out, and name what is measured under [machine]"),
        (facts.machine.temperature_log, LOG, "Leave the log out"),
        (facts.machine.further, "[[machine.further]]", "Leave the certificates out"),
        (facts.short_gauge, SHORT_GAUGE, "Leave the short gauge out"),
    ):
        if given:
            raise CmmUqError(none, where=f"{path}: {key}", fix=fix)


def read_machine(folder: Path, nameable: Nameable) -> Job:
    """A job for its machine alone: job.toml, error maps and temperature log, whatever its recording is."""
    source = in_folder(folder)
    content, facts, _ = _facts(source, nameable)
    maps, logs, calibrations = _of_the_machine(facts.machine)
    check_distinct([*maps, *logs, *calibrations], str(source.toml))
    inputs = {"job.toml": content} | _contents(source, maps, MAP_BYTES) | _contents(source, logs, TABLE_BYTES)
    inputs |= _contents(source, calibrations, TABLE_BYTES, written=True)
    return Job(source.toml.parent, facts, _no_points(machine_of(facts.machine)), inputs)


def _facts(source: JobFiles, nameable: Nameable) -> tuple[bytes, JobFile, CertifiedValues | None]:
    """job.toml: its bytes, what it says with the digital certificate of its artefact, and what that says alone."""
    content = source.job_file(JOB_BYTES, "A job is a folder with a job.toml and the recording that it names")
    says: list[CertifiedValues] = []

    def beside(data: dict[str, Any]) -> dict[str, Any]:
        if (found := _certified(data, source, nameable)) is None:
            return data
        says.append(found)
        return found.beside(data)

    model_for = partial(_model_for, nameable=nameable, path=source.toml)
    facts = checked(content, source.toml, model_for, nameable.standards, beside=beside)
    places = says[0].places if says else None
    if places is not None and isinstance(facts.artefact, ReferencedFacts):
        largest = max(float(values.max()) for values in places.u.values())
        facts = facts.model_copy(update={"artefact": facts.artefact.with_largest(largest)})
    return content, facts, says[0] if says else None


def _certified(data: dict[str, Any], source: JobFiles, nameable: Nameable) -> CertifiedValues | None:
    """What the digital certificate of the artefact says, where the job names one."""
    artefact = data.get("artefact")
    if not isinstance(artefact, dict) or not isinstance(artefact.get("certificate"), dict):
        return None
    name, kind = artefact["certificate"].get("file"), artefact.get("kind")
    table = nameable.tables(kind) if isinstance(kind, str) else None
    if not isinstance(name, str) or table is None:
        return None
    content = source.content(name, TABLE_BYTES, f"Put it beside job.toml, or mend its name in {source.toml}")
    if begins_with(content[:HEAD], DCC):
        from cmm_uq.jobs.recording.certified import certified  # the model of a certificate is made for who has one

        return certified(content, str(source.toml.parent / name), data, table)
    if table.with_references:
        return None
    problem = f"a recording of kind {kind!r} has no certified values of single points"
    fix = "Name a digital certificate (DCC), or leave file out and give the keys of [artefact]"
    raise CmmUqError(problem, where=f"{source.toml}: [artefact] certificate.file", fix=fix)


def _of_the_machine(facts: MachineFacts) -> tuple[list[str], list[str], list[str]]:
    """Files of its error maps and their covariance, of its temperature log, and of its digitizer's calibration."""
    calibration, log = calibration_file(facts.digitizer), facts.temperature_log
    maps = [name for given in facts.corrections for name in (given.file, given.covariance) if name is not None]
    return maps, [log.file] if log else [], [calibration] if calibration else []


def further_named(further: Iterable[FurtherFacts], source: JobFiles) -> tuple[str, ...]:
    """Files of further certificates, which must have their recordings inside; of a folder that which a report wrote."""
    found = []
    for name in (one.certificate.removesuffix("/") for one in further):
        each = [name] if name.lower().endswith(WHOLE) else [f"{name}/{one}" for one in CERTIFICATES]
        found.append(next((one for one in each if len(each) == 1 or source.has(one, written=True)), each[0]))
    return tuple(found)


def _model_for(data: dict[str, Any], nameable: Nameable, path: Path) -> type[JobFile]:
    """What a job.toml must say for the kind that it names."""
    if PART in data and "artefact" not in data:
        raise CmmUqError("is the job of a part, not of a machine", where=f"{path}: [{PART}]",
                         fix="cmm-uq part JOB reports it; cmm-uq check JOB says what it lacks")  # fmt: skip
    artefact = data.get("artefact")
    kind = artefact.get("kind") if isinstance(artefact, dict) else None
    if not isinstance(kind, str):
        return JobFile
    table = nameable.tables(kind)
    if table is None:
        names: Any = Literal[tuple(nameable.kinds())]
        table = create_model("ArtefactFacts", __base__=ArtefactFacts, kind=(names, ...))
    return job_file_of(table)


def _contents(source: JobFiles, names: Sequence[str], limit: Limit, *, written: bool = False) -> dict[str, bytes]:
    fix, found, wrong = f"Put it beside job.toml, or mend its name in {source.toml}", dict[str, bytes](), Gathered()
    for name in names:
        with wrong.going_on():
            found[name] = source.content(name, limit, fix, written=written)
    wrong.refuse()
    return found


def _no_points(machine: Machine) -> Points:
    none = np.zeros(0, dtype=np.int64)
    return Points(np.zeros((0, 3)), none, none, none, machine)
