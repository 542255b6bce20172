"""The measurement model of a job: its recording screened, joined with artefact, effects and noise; and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.analysis.screening.columns import Finding, finding
from cmm_uq.analysis.screening.screening import counted_with, screen_recording
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import FREEDOMS, OBSERVATIONS
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.outcome import OwnAnalysis, Recipe
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.origin import MEASURED
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import LAST_DIGIT, Artefact
from cmm_uq.machine.model.kind import Kind
from cmm_uq.machine.model.recorded import NANOMETRE, display_step
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.least_squares import RANK_TOLERANCE
from cmm_uq.maths.inference.linear_model import Freedoms

# observations that the noise is estimated from, beside those that sizes and set-ups could explain
FEWEST_LEFT = 3

OVERFLOW_FIX = (  # where figures leave the range of numbers
    "Look for a number that no measurement gives: in the columns of the recording, u_coordinate_um, u_um or travel_mm"
)


def model_of(job: Job, artefact: Artefact) -> RecordingModel:
    """The model that the job names."""
    if len(artefact.noise_scale) > OBSERVATIONS.most:
        raise CmmUqError(
            f"{len(artefact.noise_scale)} observations are more than are estimated from at once",
            where=job.recording_path, fix=f"{OBSERVATIONS.most} are the most: thin out the recording",
        )  # fmt: skip
    if (count := Freedoms.of(artefact.placing(artefact.points.xyz)).count) > FREEDOMS.most:
        raise CmmUqError(
            f"the placings have {count} freedoms together, more than are estimated beside the machine's errors at once",
            where=job.recording_path, fix=f"{FREEDOMS.most} are the most: split the recording",
        )  # fmt: skip
    stated, aside = job.facts.recording.u_coordinate_um, job.facts.recording.measurements_aside
    if unknown := set(aside) - set(job.points.measurement.tolist()):
        raise CmmUqError(f"there is no measurement {min(unknown)}", where="job.toml [recording] set_aside",
                         fix="Name measurements that the recording has")  # fmt: skip
    group, rows = artefact.points.group, artefact.rows[:, 0]
    copies = group[counted_with(artefact.points, aside)[rows]] != group[rows]
    used = ~(np.isin(artefact.measurement, aside) | copies | artefact.unread())
    if not used.any():
        raise CmmUqError(
            "no observation is left to estimate from", where="job.toml [recording] set_aside" if aside else job.recording_path,
            fix="Set fewer measurements aside, or record what the machine reads",
        )  # fmt: skip
    named = effects(job.facts.model.effects, where="job.toml [model] effects")
    if unfit := next(filter(None, (effect.unfit(artefact.points) for effect in named)), None):
        raise unfit
    model = RecordingModel(artefact, named, None if stated is None else stated * MICROMETRE, used)
    _refuse_open_sizes(model, job.recording_path)
    _refuse_hidden_noise(model, job.recording_path)
    return model


def _refuse_open_sizes(model: RecordingModel, where: str) -> None:
    """Refuse measurements that leave open, whatever the machine's errors, what the measurement is made for."""
    sought = [i for i, size in enumerate(model.artefact.sizes) if size.role == "sought"]
    if not sought:
        return
    rank, _ = _rank(replace(model, effects=()), sought)
    if rank < len(sought):
        names = ", ".join(model.artefact.sizes[i].title for i in sought)
        raise CmmUqError(f"the measurements that are used leave a combination of {names} open", where=where,
                         fix="Set fewer measurements aside, or record more")  # fmt: skip


def _rank(model: RecordingModel, columns: Sequence[int] | slice = slice(None)) -> tuple[int, int]:
    """Rank of some columns of the design, and how many observations there are, what is of no interest projected out."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    design = (linear.reduced.design * np.array([unknown.scale for unknown in model.unknowns]))[:, columns]
    return int(np.linalg.matrix_rank(design, tol=RANK_TOLERANCE * np.linalg.norm(design, 2))), linear.reduced.count


def _refuse_hidden_noise(model: RecordingModel, where: str) -> None:
    """Refuse to estimate the noise where what is in doubt about each set-up could explain every residual."""
    if model.sigma is not None or all(size.role != "set-up" for size in model.artefact.sizes):
        return
    rank, count = _rank(model)
    left = count - rank
    if left < FEWEST_LEFT:
        raise CmmUqError(
            f"what is in doubt about each set-up explains all but {left} of {count} observations, so the noise "
            "of a coordinate does not show", where=where,
            fix="State u_coordinate_um in job.toml [recording], or record more points in each measurement",
        )  # fmt: skip


def recorded_model(job: Job, *, placings: bool = False) -> tuple[RecordingModel, tuple[Finding, ...]]:
    """The model that a job names, of what the screening leaves of its recording, and what it found."""
    kind = kind_of(job)
    where, observe = job.recording_path, kind.observing("screened")
    acting = effects(job.facts.model.effects, where="job.toml [model] effects")
    recording = screen_recording(
        job.points, job.facts.artefact, kind.offers("screen", Screening), observe,
        needed={column for effect in acting for column in effect.columns},
        set_aside=job.facts.recording.measurements_aside, where=where,
    )  # fmt: skip
    artefact = observe(job.facts.artefact, recording.points, where=where)
    model = model_of(job, artefact)
    if placings or job.origin != MEASURED:
        return model, (*recording.findings, *_unread(artefact))
    found = model.estimate().least_squares
    scatter = found.sigma_of_residuals
    # what is said to be measured fits to the last digit, though its digits would show a nanometre
    if found.degrees_of_freedom >= FEWEST_LEFT and max(scatter, display_step(job.points.xyz, scatter)) < NANOMETRE:
        raise CmmUqError(
            "the readings have no scatter at all: they agree with each other to below a nanometre, as computed or nominal "
            "values do, and no machine's", where=job.recording_path,
            fix='Record what the machine indicated; or, of a simulation, state origin = "simulated" in job.toml [job]',
        )  # fmt: skip
    return model, (*recording.findings, *_unread(artefact))


def _unread(artefact: Artefact) -> list[Finding]:
    """Coordinates that stood still where the artefact observes them, here or in the recording that it is compared with."""
    points, rows = artefact.points, np.unique(artefact.rows[artefact.unread(), 0])
    found = []
    for number in np.unique(points.measurement[rows]).tolist():
        own = rows[points.measurement[rows] == number]
        still = np.flatnonzero(np.ptp(points.xyz[own], axis=0) <= LAST_DIGIT)
        column = f"{AXES[still[0]]}_mm" if len(still) else None
        what = say("a coordinate stood still earlier")
        if column is not None:
            what = say("{column} is {value:g}", column=Verbatim(column), value=points.xyz[own[0], still[0]])
        why = say(
            "in all of measurement {number} {what}: nobody read it, and it says nothing", number=number, what=what
        )
        found.append(replace(finding("stuck", points, own, why, column), set_aside=True))
    return found


def refuse_unfit(job: Job) -> None:
    """Refuse a damaged recording; one that holds planned coordinates, or none, is let through, and so are nominal ones."""
    if len(job.points) and not job.planned and kind_of(job).observe is not None:
        recorded_model(job, placings=True)


def refuse_planned(job: Job) -> None:
    """Refuse a recording that only holds the coordinates of a plan; it can be simulated, and nothing else."""
    if job.planned:
        raise CmmUqError("holds planned coordinates: nothing is measured", where=f"{job.recording_path} line 1",
                         fix="Put in what the machine indicated, then remove that line")  # fmt: skip


def refuse_unmeasured(job: Job) -> None:
    """Refuse a job of which nothing is measured: a plan's coordinates, or no recording at all where its kind has one."""
    refuse_planned(job)
    if job.facts.artefact.with_recording and not len(job.points):
        raise CmmUqError("is not there: nothing is measured", where=job.recording_path,
                         fix="Record what the machine indicated; cmm-uq plan says where")  # fmt: skip


def recipe_of(
    job: Job, own: Callable[[OwnAnalysis], Recipe | None], usual: Callable[[Kind], Recipe], what: str
) -> Recipe:  # fmt: skip
    """How a job is analysed: in its kind's own way, or as observations that named effects explain."""
    refuse_unmeasured(job)
    kind = kind_of(job)
    offered = kind.offers("own", OwnAnalysis)
    recipe = None if offered is None else own(offered)
    if recipe is not None:
        return recipe
    kind.observing(what)
    return usual(kind)
