"""The calls: each computes what the command of its name computes, and writes nothing. A call imports what it alone needs."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.app.api.outcomes import DiagnosisOutcome, Part, PlanOutcome, ProofOutcome, Report
from cmm_uq.app.api.pictures import Export
from cmm_uq.app.commands.diagnose import diagnosis_outcome
from cmm_uq.app.commands.jobs import exchange
from cmm_uq.app.commands.jobs.check import JobCheck, check_job, check_read
from cmm_uq.app.commands.jobs.new import KEPT, PLAN, new_job, new_plan
from cmm_uq.app.commands.reading import compared_with, compared_with_frame, in_language, job_of, read_job
from cmm_uq.app.commands.report import report_outcome
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import as_toml, checked
from cmm_uq.base.languages.translation import Code
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.job import Job

if TYPE_CHECKING:
    import pandas as pd

    from cmm_uq.jobs.part.job import PartJob
    from cmm_uq.machine.physics.map_interpolation import Beyond
    from cmm_uq.maths.uncertainty.distributions import Distribution
    from cmm_uq.maths.uncertainty.evaluation import Evaluation


def read(folder: str | Path) -> Job:
    """Read and check a job.

    Parameters
    ----------
    folder : the job folder, or its job.toml. The recording may be missing for a job that is only to be planned.

    Raises
    ------
    CmmUqError : a file is missing or unreadable, or says something unknown or contradictory.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.read("examples/iota-1102-20C")
    <Job iota-1102-20C: ballbar on DEA Iota 1102, 40 points, measured>
    """
    return read_job(Path(folder), recorded=False)


def job(
    points: pd.DataFrame | None = None, *, machine: Mapping[str, Any] | str, artefact: Mapping[str, Any] | str,
    effects: Sequence[str], id: str = "job", date: dt.date | str | None = None,  # noqa: A002
    recording: Mapping[str, Any] | None = None, conformity: Sequence[Mapping[str, Any]] = (),
    effect: Sequence[Mapping[str, Any]] = (),
    files: Mapping[str, pd.DataFrame] | None = None, **tables: Mapping[str, Any],
) -> Job:  # fmt: skip
    """A job from DataFrames, checked as a job folder is. ``job.write(folder)`` makes it one.

    Parameters
    ----------
    points : the recording: one row a point, with the columns of a recording's CSV (mm, µm, °C as their names say).
    machine, artefact : the tables of job.toml; a text is the machine's name, or the artefact's kind.
    effects : names of the effects that the simulation is told about.
    id, date : of the job; without a date it has 1970-01-01 and says that none was given.
    recording : further keys of ``[recording]``, as ``u_coordinate_um``.
    conformity : a table for each statement of conformity.
    effect : a table for each effect of your own, with its formula.
    files : error maps and other tables that job.toml names, by name.
    tables : further tables of job.toml: ``job``, ``laboratory``, ``model``, ``plan``, ``test_uncertainty``,
        ``rated_conditions``, ``probe``.

    Raises
    ------
    CmmUqError : a table says something unknown, missing or contradictory: it names the key, or column and line.

    Examples
    --------
    >>> import cmm_uq, pandas
    >>> frame = pandas.read_csv("examples/iota-1102-20C/ballbar.csv")
    >>> cmm_uq.job(frame, machine="DEA Iota 1102", artefact="ballbar", effects=["squareness_xy"])
    <Job job: ballbar on DEA Iota 1102, 40 points, measured>
    """
    from cmm_uq.app.commands.reading import job_from_frames

    day = dt.date.fromisoformat(date) if isinstance(date, str) else date
    stated = {
        **tables, "job": {"id": id, "date": day, **tables.get("job", {})},
        "machine": {"name": machine} if isinstance(machine, str) else machine,
        "artefact": {"kind": artefact} if isinstance(artefact, str) else artefact,
        "recording": recording, "model": {"effects": list(effects), **tables.get("model", {})},
        "conformity": list(conformity), "effect": list(effect),
    }  # fmt: skip
    return job_from_frames(points, stated, files or {})


def read_export(file: str | Path, **keys: Any) -> Export:
    """Read an export of another program, and say what each of its columns was taken for.

    Parameters
    ----------
    file : a spreadsheet, CSV or text, or a report of PC-DMIS, Calypso, DMIS or QIF.
    keys : what the file leaves open, as in ``[recording]``: ``columns``, ``unit``, ``sheet``, ``decimal``, ``lines``, ….

    Raises
    ------
    CmmUqError : the file cannot be read one way alone; it names the key that settles it.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.read_export("docs/tutorial/ballbar-export.xlsx").columns.loc["x_mm"].tolist()
    ['X [mm]', 'mm']
    """
    where = "cmm_uq.read_export"
    return Export(exchange.read_export(Path(file), checked(as_toml(keys, where), Path(where), ImportKeys)))


def report(job: Job | str | Path, *, seed: int = 0, language: Code | None = None) -> Report:
    """Estimate the errors that a job names, decide, and diagnose what it leaves out.

    Parameters
    ----------
    job : a job, or its folder.
    seed : of everything random; the same seed gives the same figures.
    language : of the documents, instead of the job's.

    Raises
    ------
    CmmUqError : the job cannot be analysed as it stands.

    Examples
    --------
    >>> import cmm_uq
    >>> found = cmm_uq.report("examples/iota-1102-20C", seed=0)
    >>> found
    <Report of iota-1102-20C: 11 estimates, ASME B89.4.1-1997 fail, consistent>
    >>> found.figures.loc["b89_range_um", "value"].round(1)
    np.float64(339.9)
    """
    return Report(report_outcome(in_language(_job(job), language), seed=seed))


def diagnose(
    job: Job | str | Path, *, seed: int = 0, alpha: float = FALSE_ALARMS, against: pd.DataFrame | str | Path | None = None,
    language: Code | None = None,
) -> DiagnosisOutcome:  # fmt: skip
    """Say where recording and model differ, and what was left out.

    Parameters
    ----------
    job : a job, or its folder.
    seed : of everything random.
    alpha : rate of false alarms.
    against : what a simulation predicts for the recording, as a file or a DataFrame with the columns of one: the recording is
        then compared with that, whatever the job names.
    language : of the documents, instead of the job's.

    Raises
    ------
    CmmUqError : the job cannot be diagnosed as it stands, or the prediction is none of its recording.
    """
    read = in_language(_job(job), language)
    if isinstance(against, str | Path):
        read = compared_with(read, Path(against))
    elif against is not None:
        read = compared_with_frame(read, against)
    return DiagnosisOutcome(diagnosis_outcome(read, seed=seed, alpha=alpha))


def plan(job: Job | str | Path, *, power: bool = True, seed: int = 0, language: Code | None = None) -> PlanOutcome:
    """Say what placings of the artefact determine, and search for better ones.

    Parameters
    ----------
    job : a job, or its folder; its recording may be missing.
    power : whether to predict what the diagnosis would find, which takes most of the time.
    seed : of the recordings drawn for that.
    language : of the page, instead of the job's.

    Raises
    ------
    CmmUqError : the plan is impossible.
    """
    from cmm_uq.app.commands.plan import plan_outcome

    return PlanOutcome(plan_outcome(in_language(_job(job), language), power=power, seed=seed))


def part(
    job: PartJob | str | Path, *, seed: int = 0, trials: int | None = None, digits: int | None = None, rerun: bool = False,
    trust: Sequence[str | Path] | None = None, records: str | Path | None = None, language: Code | None = None,
) -> Part:  # fmt: skip
    """The uncertainty of what is measured on a part, and whether it conforms.

    Parameters
    ----------
    job : the job folder of a part, or such a job that was read.
    seed : of everything random.
    trials : number of virtual measurements; 200 000 where nothing is said.
    digits : of u that are to be known: then so many are made as that needs, ``trials`` at least.
    rerun : whether the machine's certificate is computed again from its inputs.
    trust : files and folders of certificates that are trusted: the machine's must then be signed.
    records : of the machine's history, from which its drift is known.
    language : of the page, instead of the job's.

    Raises
    ------
    CmmUqError : the job cannot be evaluated as it stands, or its machine's certificate does not hold.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.part("examples/part-plate-simulated")  # doctest: +SKIP
    <Part of part-plate-simulated: 5 characteristics, pass>
    """
    from cmm_uq.app.commands.parts.part import PartOptions, evaluate_part
    from cmm_uq.jobs.part.job import PartJob, read_part

    read = in_language(job if isinstance(job, PartJob) else read_part(Path(job)), language)
    trusted = None if trust is None else tuple(map(Path, trust))
    return Part(evaluate_part(read, PartOptions(seed, trials, digits, rerun, trusted, records)))


def prove(
    job: Job | str | Path, *, cases: int = 200, workers: int | None = None, seed: int = 0, alpha: float = FALSE_ALARMS,
    language: Code | None = None,
) -> ProofOutcome:  # fmt: skip
    """Try the diagnosis on sealed cases drawn with the set-ups, the artefact and the noise of a job.

    Parameters
    ----------
    job : a job, or its folder; its recording may be missing where its noise is stated.
    cases : how many to draw.
    workers : processes at once, as many as there are processors by default; the figures do not depend on it.
    seed : of the cases.
    alpha : rate of false alarms that the diagnosis is asked for.
    language : of the page, instead of the job's.

    Raises
    ------
    CmmUqError : the job has an analysis of its own, or neither recording nor stated noise.
    """
    from cmm_uq.app.commands.prove import ProofOptions, prove_outcome
    from cmm_uq.laboratory.schedule.processes import processes

    asked = ProofOptions(cases, processes() if workers is None else workers, seed, alpha)
    return ProofOutcome(prove_outcome(in_language(_job(job), language), asked))


def simulate(job: Job | str | Path, truth: Mapping[str, Any] | str | Path, *, seed: int | None = None) -> Job:
    """A job like this one whose recording is drawn from known errors; it is marked as simulated and has an id of its own.

    Parameters
    ----------
    job : a job, or its folder; its recording gives the placings.
    truth : path of a truth.toml, or what such a file says.
    seed : instead of the one in ``truth``.

    Raises
    ------
    CmmUqError : an unknown effect, parameter or size, or what an effect needs is missing.

    Examples
    --------
    >>> import cmm_uq
    >>> drawn = cmm_uq.simulate("examples/iota-1102-20C", {"seed": 1, "effects": {"scale_x": {"ppm": 12.0}}})
    >>> drawn.origin
    'simulated'
    """
    from cmm_uq.app.commands.jobs.simulate import simulated_job

    return simulated_job(_job(job), truth if isinstance(truth, Mapping) else Path(truth), seed=seed)


def compensate(job: Job | str | Path, *, beyond: Beyond = "refuse") -> Job:
    """A job like this one whose recording is corrected by the machine's error maps; marked, with an id of its own.

    Parameters
    ----------
    job : a job with error maps, or its folder.
    beyond : ``"refuse"`` points outside the maps, or ``"extrapolate"`` and flag them.

    Raises
    ------
    CmmUqError : the job has no error map, or it does not serve these points.
    """
    from cmm_uq.app.commands.jobs.compensate import compensated_job

    return compensated_job(_job(job), beyond=beyond)


def budget(
    model: str | Path | Callable[..., Any], inputs: Mapping[str, Distribution | tuple[float, float]] | None = None, *,
    outputs: Sequence[str] = ("y",), correlation: Mapping[tuple[str, str], float] | None = None, method: str = "auto",
    coverage: float = 0.95, digits: int = 2, seed: int | None = None,
) -> Evaluation:  # fmt: skip
    """The uncertainty of a measurement model: of a file, or of a function of its inputs by name.

    Parameters
    ----------
    model : path of a model file, which says all else but the seed; or a function written with NumPy's functions, which gives
        its output, or a mapping from the names of its outputs.
    inputs : of a function: a distribution (:mod:`cmm_uq.maths.uncertainty.distributions`), or value and standard uncertainty.
    outputs : names of the function's outputs.
    correlation : of a function's inputs, by pairs of names.
    method : ``"first"``, ``"second"``, ``"monte_carlo"``, or ``"auto"``: the simplest that Monte Carlo confirms.
    coverage : probability of the intervals.
    digits : significant digits of u that Monte Carlo must support.
    seed : of the random numbers; a file's own, or 0, by default.

    Raises
    ------
    CmmUqError : the model cannot be evaluated.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.budget(lambda a, b: a + b, {"a": (1.0, 0.3), "b": (2.0, 0.4)}, method="first")
    <Evaluation: y = 3.00, u = 0.50>
    """
    if not callable(model):
        if inputs is not None:
            raise CmmUqError("inputs belong to a function; a model file has its own", where=str(model),
                             fix="Leave them out")  # fmt: skip
        from cmm_uq.maths.uncertainty.models.model_file import read_model_file

        return read_model_file(Path(model)).evaluate(seed)
    if not inputs:
        raise CmmUqError("a function needs its inputs", where="budget",
                         fix='Give each a distribution, or value and u: {"a": (1.0, 0.1)}')  # fmt: skip
    from cmm_uq.maths.uncertainty.distributions import Distribution, normal
    from cmm_uq.maths.uncertainty.evaluation import Request, evaluate
    from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel

    known = {name: given if isinstance(given, Distribution) else normal(*given) for name, given in inputs.items()}
    asked = Request(method, coverage, digits, 0 if seed is None else seed)
    return evaluate(MeasurementModel(model, known, tuple(outputs), dict(correlation or {})), asked)


def _job(job: Job | str | Path) -> Job:
    return job if isinstance(job, Job) else read(job)


def new(kind: str, *, id: str = "job", **tables: Mapping[str, Any]) -> Job:  # noqa: A002
    """A new job of a kind, with a simulated recording at its usual set-ups; ``job.write(folder)`` makes it a folder.

    Parameters
    ----------
    kind : of measurement, ``"shift_plate"``, or ``"plan"`` for a job without a recording.
    id : of the job.
    tables : what job.toml is to say in place of what the kind begins with, by table: ``artefact={"length_mm": 500.0}``.

    Raises
    ------
    CmmUqError : no such kind, or what is given is refused by the readers of a job.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.new("ballbar", machine={"name": "Bridge 7"}, artefact={"length_mm": 300.0})
    <Job job: ballbar on Bridge 7, 40 points, simulated>
    """
    files = new_plan(tables, id=id) if kind == PLAN else new_job(kind, tables, id=id)
    return job_of({name: content for name, content in files.items() if name not in KEPT}, recorded=kind != PLAN)


def check(job: Job | str | Path) -> JobCheck:
    """All that is wrong with a job, without computing.

    Parameters
    ----------
    job : a job, or its folder.

    Examples
    --------
    >>> import cmm_uq
    >>> cmm_uq.check("examples/iota-1102-20C").sound
    True
    """
    return check_read(job) if isinstance(job, Job) else check_job(Path(job))
