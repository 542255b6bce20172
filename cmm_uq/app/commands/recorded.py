"""A recording screened and joined with the model that its job names: what every command asks of it alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.analysis.screening.finding import finding
from cmm_uq.analysis.screening.screened import Finding, screened
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.app.commands.modelled import FEWEST_LEFT, model_of
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.points import AXES
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.origin import MEASURED
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.display import NANOMETRE, display_step
from cmm_uq.machine.model.placings import LAST_DIGIT
from cmm_uq.machine.physics.catalogue import effects


def recorded_model(job: Job, *, placings: bool = False) -> tuple[MeasurementModel, tuple[Finding, ...]]:
    """The model that a job names, of what the screening leaves of its recording, and what it found.

    Parameters
    ----------
    placings : whether nothing but the placings is of interest, for which nominal coordinates serve as well.

    Raises
    ------
    CmmUqError : the recording is damaged, or does not fit the artefact or the model.
    """
    kind = kind_of(job)
    where, observe = job.recording_path, kind.observing("screened")
    acting = effects(job.facts.model.effects, where="job.toml [model] effects")
    recording = screened(
        job.points, job.facts.artefact, kind.offers("screen", Screening), observe,
        needed={column for effect in acting for column in effect.columns},
        set_aside=job.facts.recording.measurements_aside, where=where,
    )  # fmt: skip
    artefact = observe(job.facts.artefact, recording.points, where=where)
    model = model_of(job, artefact)
    if not placings:
        _refuse_exact(job, model)
    return model, (*recording.findings, *_unread(artefact))


def _refuse_exact(job: Job, model: MeasurementModel) -> None:
    """Refuse what is said to be measured and fits to the last digit, though its digits would show a nanometre.

    Raises
    ------
    CmmUqError : no machine reads so; the noise of one cannot be estimated from it.
    """
    found = model.estimate().least_squares
    if job.origin != MEASURED or found.degrees_of_freedom < FEWEST_LEFT:
        return
    if found.sigma_of_residuals < NANOMETRE and display_step(job.points.xyz, found.sigma_of_residuals) < NANOMETRE:
        raise CmmUqError(
            "the readings have no scatter at all: they agree with each other to below a nanometre, as computed or nominal "
            "values do, and no machine's", where=job.recording_path,
            fix='Record what the machine indicated; or, of a simulation, state origin = "simulated" in job.toml [job]',
        )  # fmt: skip


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
    """Refuse a damaged recording; one that holds planned coordinates, or none, is let through, and so are nominal ones.

    Raises
    ------
    CmmUqError : see :func:`recorded_model`.
    """
    if len(job.points) and not job.planned and kind_of(job).observe is not None:
        recorded_model(job, placings=True)
