"""A recording taken live: a job, its plan and its instruments made into a session that a screen runs.

Instruments from the command line: ready profiles, one tried at its port, a new one from an example line.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import tomlkit

from cmm_uq.analysis.planning.setting import ASSUMED_NOISE_UM
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError, OutputError, suggestion
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.output.manifest import write_new
from cmm_uq.base.output.staging import replace_file
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.columns import REQUIRED
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.own import is_own, read_recording
from cmm_uq.jobs.source import inside
from cmm_uq.jobs.tables.identification import MEASURED, SIMULATED
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.conducting import Conductor
from cmm_uq.laboratory.live.instruments import library
from cmm_uq.laboratory.live.instruments.instrument import open_source
from cmm_uq.laboratory.live.instruments.ipp_machine import IppMachine
from cmm_uq.laboratory.live.instruments.simulated_line import SPEAKERS, WAYS, SimulatedLine
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Clock, Event, LiveSource, Moment
from cmm_uq.laboratory.live.journal import made_folder
from cmm_uq.laboratory.live.judging import Judge
from cmm_uq.laboratory.live.lead import Lead, LiveRecording, SimulatedMachine, simulated
from cmm_uq.laboratory.live.recorder import Recorder
from cmm_uq.laboratory.live.running import Acquisition, DroppedFile, WatchedFolder
from cmm_uq.laboratory.live.story import FOLDER, Story, begin, read_story
from cmm_uq.machine.model.kind import Observe
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.stated import physics_of, with_own_physics


def _take(file: DroppedFile, job: Job, watched: WatchedFolder, conductor: Conductor, clock: Clock) -> None:
    """Take a file that stands still: keep its bytes beside the journal, and read its points as any import does."""
    try:
        rows = _rows(file, job)
    except CmmUqError as error:
        conductor.tell(Verbatim(str(error)))
        return
    try:
        folder = job.folder / FOLDER / "files"
        made_folder(folder)
        path = folder / f"{1 + sum(1 for _ in folder.iterdir()):04d}-{file.path.name}"
        replace_file(path, file.content)
    except OutputError as error:
        conductor.tell(Verbatim(str(error)))
        watched.again(file.path)
        return
    age = clock.utc_ns() - file.utc_ns
    conductor.file(file.path.name, file.content, Moment(file.utc_ns, clock.monotonic_ns() - age), rows, path.name)


def _rows(file: DroppedFile, job: Job) -> list[dict[str, float]]:
    """Points of a file; measurement, point and repeat only where the file itself numbers them."""
    where, machine = str(file.path), job.points.machine
    keys = job.facts.recording
    if not keys.asked and is_own(file.content):
        points = read_recording(file.content, where, machine)
        columns = {"measurement": points.measurement, "point": points.point, "repeat": points.repeat,
                   **dict(zip(("x_mm", "y_mm", "z_mm"), points.xyz.T, strict=True)), **points.columns}  # fmt: skip
    else:
        found = _imported(file.content, where, keys)
        columns = dict(found.columns)
        if "measurement" not in found.recognised.columns:
            for name in ("measurement", "point", "repeat"):
                columns.pop(name, None)
    columns.pop("time_s", None)  # by another clock
    names = list(columns)
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns.values(), strict=True)]


def _imported(content: bytes, where: str, keys: ImportKeys) -> ImportedTable:
    """As any import; where nothing says which points belong together, they come in the order of the plan."""
    try:
        return imported(content, where, keys)
    except CmmUqError:
        if keys.points_per_measurement is not None:
            raise
        return imported(content, where, keys.model_copy(update={"points_per_measurement": "all"}))


@naming_package()
def begin_acquisition(
    folder: Path, *, simulate: bool = False, seed: int = 0, skip_damaged: bool = False, clock: Clock = SYSTEM
) -> Acquisition:
    """Begin a session, the first of a job or a further one."""
    job = read_job(folder, recorded=False)
    _check_origin(job, simulate=simulate)
    sessions = job.folder / FOLDER
    story = read_story(sessions, skip_damaged=skip_damaged)
    plan, titles = _plan(job, story)
    table = LiveRecording(Path(job.recording_path), sessions, simulated=simulate)
    with physics_of(job):
        lead, judge = _lead(job, plan, titles), _judge(job)
    _check_columns(job)
    facts = job.facts.acquire
    watched = None if facts.folder is None or simulate else WatchedFolder(job.folder / facts.folder, clock)
    sources, machine = _sources(job, simulate=simulate, seed=seed, clock=clock)
    try:
        now, beginning = Moment.now(clock), _said(job, plan, titles, simulate, first=not story.sessions)
        journals = begin(sessions, beginning, now, skip_damaged=skip_damaged)
    except BaseException:
        for source in sources:
            source.close()
        raise
    recorder = Recorder(journals, facts.source, max_gap_s=facts.max_gap_s, clock=clock)
    recorder.settle_earlier()
    conductor = Conductor(
        recorder, lead, judge, table, facts, soak_k_per_h=facts.soak_k_per_h or job.facts.rated_conditions.change_k_per_h,
        machine=None if machine is None else machine.measure,
        clear=[source.clear_errors for source in sources if isinstance(source, IppMachine)],
    )  # fmt: skip
    conductor.tick()
    if watched is None:
        return Acquisition(conductor, sources, clock, journals, job.folder)
    dropped = partial(_take, job=job, watched=watched, conductor=conductor, clock=clock)
    return Acquisition(conductor, sources, clock, journals, job.folder, watched, dropped)


def plan_file(job: Job) -> dict[str, bytes]:
    """The plan that a job names in a file, by its name, once it can be read; empty where it names none."""
    name = job.facts.acquire.plan
    if name is None:
        return {}
    path = inside(job.folder, name, f"{job.folder / 'job.toml'}: [acquire] plan")
    content = content_of(path, TABLE_BYTES, "cmm-uq plan writes plan.csv; name it in [acquire] plan")
    read_recording(content, str(job.folder / name), job.points.machine)
    return {name: content}


def _check_origin(job: Job, *, simulate: bool) -> None:
    where = f"{job.folder / 'job.toml'} [job] origin"
    if not job.facts.artefact.with_recording:
        kind = job.facts.artefact.kind
        problem = f"a job of kind {kind!r} has no recording of points"
        raise CmmUqError(problem, where=where, fix="Nothing is taken for it")
    if simulate and job.origin != SIMULATED:
        raise CmmUqError(f"a simulated recording would pass for {job.origin}", where=where,
                         fix="Give --out FOLDER: a copy of the job is made there, and marked")  # fmt: skip
    if not simulate and job.origin != MEASURED:
        raise CmmUqError(f"the recording of this job is {job.origin}, not measured", where=where,
                         fix="Give --simulate, or take the instruments to a job of its own")  # fmt: skip


def _check_columns(job: Job) -> None:
    """That the recording which comes of it could be read: no column given twice, or in another unit than its name says."""
    where = f"{job.folder / 'job.toml'}: [[acquire.source]] values"
    columns = [column for source in job.facts.acquire.source for column in source.values.values()]
    twice = next((column for column in columns if columns.count(column) > 1), None)
    if twice is not None:
        raise CmmUqError(f"two quantities go into the column {twice}", where=where, fix="Give each a column of its own")
    further = [column for column in columns if column not in REQUIRED]
    trial = ",".join([*REQUIRED, *further]) + "\n" + ",".join("1" for _ in (*REQUIRED, *further)) + "\n"
    try:
        read_recording(trial.encode(), where, job.points.machine)
    except CmmUqError as error:
        raise CmmUqError(error.problem, where=where, fix=error.fix) from None


@with_own_physics
def _plan(job: Job, story: Story) -> tuple[str, list[str]]:
    """The plan as CSV, and the titles of its measurements: as the first session had it, as a file says, or as planned now."""
    if story.sessions:
        said = story.sessions[0].said
        return said["plan"], said["titles"]
    if job.facts.acquire.plan is not None:
        (content,) = plan_file(job).values()
        return content.decode("utf-8-sig"), []
    from cmm_uq.app.commands.plan import recording_to_be
    from cmm_uq.app.commands.planning import make_plan

    try:
        plan = make_plan(job, power=False)
    except CmmUqError as error:
        fix = f"{error.fix or 'Mend [plan]'}; or name a plan of your own in [acquire] plan"
        raise CmmUqError(error.problem, where=error.where, fix=fix) from None
    return recording_to_be(plan).decode(), [str.__str__(placing.title) for placing in plan.to_measure]


def _lead(job: Job, plan: str, titles: Sequence[str]) -> Lead:
    points: Points = read_recording(plan.encode(), "the plan", job.points.machine)
    numbers = list(dict.fromkeys(points.measurement.tolist()))
    unmeasured = {"time_s", *job.facts.plan.columns, *(name for name in points.columns if name.startswith("temp_"))}
    shown = {number: Verbatim(title) for number, title in zip(numbers, titles, strict=False) if title}
    return Lead(points, shown, frozenset(unmeasured))


def _judge(job: Job) -> Judge:
    kind, stated = kind_of(job), job.facts.recording.u_coordinate_um
    observe: Observe | None = None
    if kind.by_effects:
        observe = kind.observing("judged")
    return Judge(
        job.facts.artefact, kind.offers("screen", Screening), observe, job.points.machine,
        tuple(effects(job.facts.model.effects, where="job.toml [model] effects")),
        None if stated is None else stated * MICROMETRE, job.recording_path,
    )  # fmt: skip


def _sources(job: Job, *, simulate: bool, seed: int, clock: Clock) -> tuple[list[LiveSource], SimulatedMachine | None]:
    declared = job.facts.acquire.source
    if simulate:
        stated = job.facts.recording.u_coordinate_um
        found, machine = simulated(declared, clock=clock, seed=seed, noise_mm=(stated or ASSUMED_NOISE_UM) * MICROMETRE)
        return list(found), machine
    with ExitStack() as opened:
        sources = []
        for source in declared:
            sources.append(open_source(source, clock=clock, folder=job.folder))
            opened.callback(sources[-1].close)
        opened.pop_all()
    return sources, None


def _said(job: Job, plan: str, titles: Sequence[str], simulate: bool, *, first: bool) -> dict[str, Any]:
    """What a session begins with; the plan stands in the first."""
    return {
        "program": PROGRAM, "job": job.facts.job.id, "recording": job.facts.recording.file, "simulated": simulate,
        "sources": json.loads(json.dumps([source.model_dump() for source in job.facts.acquire.source])),
        "max_gap_s": job.facts.acquire.max_gap_s,
        **({"plan": plan, "titles": list(titles)} if first else {}),
    }  # fmt: skip


def write_trial(folder: Path, out: Path) -> Path:
    """A copy of a job in which recordings are simulated, to be tried without instruments."""
    job = read_job(folder, recorded=False)
    if (out / "job.toml").exists():
        if read_job(out, recorded=False).origin != SIMULATED:
            fix = "Name another folder with --out"
            raise CmmUqError("is a job whose recording is measured", where=str(out), fix=fix)
        return out
    document: Any = tomlkit.parse(job.inputs["job.toml"].decode("utf-8-sig"))
    document["job"]["id"] = f"{job.facts.job.id}-trial"
    document["job"]["origin"] = SIMULATED
    left_out = {"job.toml", job.facts.recording.file, provenance_name(job.facts.recording.file)}
    files = {**job.inputs, **plan_file(job)}
    made_folder(out)
    for name, content in files.items():
        if name not in left_out:
            made_folder((out / name).parent)
            replace_file(out / name, content)
    replace_file(out / "job.toml", tomlkit.dumps(document).encode())
    return out


def ready_profiles() -> list[tuple[str, str, str]]:
    """Name, title and what it was tried on, of each."""
    profiles = map(library.profile_named, library.ready())
    return [(profile.name, profile.title, profile.facts.tried) for profile in profiles]


def declared(what: str, port: str, job: Path | None) -> tuple[DeclaredSource, Path]:
    """The source that is meant, and the folder that its files lie in.

    port : at which it is; empty where the job says it.
    """
    if job is None:
        name = re.sub(r"[^A-Za-z0-9._-]", "_", Path(what).name.removesuffix(library.ENDING))
        return DeclaredSource.model_construct(name=name or "instrument", profile=what, port=port), Path()
    read = read_job(job, recorded=False)
    sources = {source.name: source for source in read.facts.acquire.source}
    if what not in sources:
        raise CmmUqError(f"the job has no source {what!r}", where=f"{job}: [acquire]", fix=suggestion(what, sources))
    source = sources[what]
    return (source.model_copy(update={"port": port}) if port else source), read.folder


class Attempt:
    """An instrument that is open, and what came of it so far.

    what, port, job : see :func:`declared`.
    """

    def __init__(self, what: str, port: str, job: Path | None) -> None:
        source, folder = declared(what, port, job)
        profile = library.profile_of_source(source, folder)
        self.trial = library.Trial(profile, source.port)
        self.source: LiveSource = open_source(source, folder=folder)
        self._stop = threading.Event()

    def events(self, seconds: float | None) -> Iterator[Event]:
        """What comes, for some time or until nobody asks any more."""
        timer = threading.Timer(seconds, self._stop.set) if seconds is not None else None
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            for event in self.source.events(self._stop):
                self.trial.take(event)
                yield event
        finally:
            if timer is not None:
                timer.cancel()
            self.source.close()


def write_profile(out: Path, wanted: library.ProfileDraft) -> None:
    if out.suffix != library.ENDING:
        raise CmmUqError("a profile's file ends in .toml", where=str(out), fix=f"Name it {out.stem or 'my-gauge'}.toml")
    content = library.drafted(wanted)
    library.profile_of(content, out)
    write_new(out, content)


@contextlib.contextmanager
def simulated_instrument(profile: str, way: str) -> Iterator[str]:
    """A simulated instrument, at the port that is given, until it is left.

    way : ``pty``, ``socket`` or ``rfc2217``; empty for the usual one.
    """
    if library.profile_named(profile).protocol == "ipp":
        from cmm_uq.laboratory.live.instruments.ipp_server import SimulatedIppServer as SimulatedMachine

        machine = SimulatedMachine()
        try:
            yield machine.url
        finally:
            machine.close()
        return
    if profile not in SPEAKERS:
        raise CmmUqError(f"there is no simulation of {profile!r}", fix=suggestion(profile, SPEAKERS))
    usual = "socket" if os.name == "nt" else "pty"
    chosen = next((one for one in WAYS if one == (way or usual)), None)
    if chosen is None or (chosen == "pty" and os.name == "nt"):
        raise CmmUqError(f"{way!r} is no way to a simulated instrument here", where="--way", fix=suggestion(way, WAYS))
    own = SPEAKERS[profile]()
    with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder, SimulatedLine(own, chosen, Path(folder)) as line:
        yield line.port
