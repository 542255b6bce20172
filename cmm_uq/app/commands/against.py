"""A recording compared with what a simulation predicts for it, as a model of what the simulation leaves unexplained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, in_a_row, plural, say, signed
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.result import SimulatedTwin
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.prediction import KEY, SimulationFacts
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Observe
from cmm_uq.machine.model.machine_maps import maps_named
from cmm_uq.machine.model.predicted_errors import SAME, PredictedErrors, predicted_errors
from cmm_uq.machine.physics.catalogue import effects

_FAR = 1.0  # mm from a recorded point to the predicted one, from which on it is said
_NO_NOISE = 1e-7  # mm: residuals below it are digits of the files
_LEAST_WEIGHT = 0.05  # least noise of a point over that of all together: nothing is known without limit
_STEP = 0.05  # of the logarithm of that ratio: points that are about as uncertain are sampled together


@dataclass(frozen=True, eq=False)
class Against:
    """What is left of a recording once its simulation is taken off.

    model : of the difference; its effects are those that are fitted anew.
    findings : of the screening, and what is odd about the prediction.
    observe : makes the artefact of points, with the uncertainty of what is predicted.
    stated_um : of a coordinate of the difference, where the job states it for the recording.
    simulated : for the page.
    """

    model: RecordingModel
    findings: tuple[Finding, ...]
    observe: Observe
    stated_um: float | None
    simulated: SimulatedTwin


def against_simulation(job: Job, facts: SimulationFacts) -> Against:
    """Join what the simulation leaves of a recording with the model of what it could lack."""
    recorded, findings = recorded_model(job)
    artefact, where = recorded.artefact, job.recording_path
    if facts.map:
        found = _of_maps(job, facts, artefact.points)
    elif job.prediction is not None:
        found = predicted_errors(artefact, job.prediction, where, length_mm=facts.length_mm)
    else:
        raise CmmUqError(
            "the prediction was not read", where=f"job.toml {KEY} file", fix="Read the job with its recording"
        )
    points = artefact.points.at(artefact.points.xyz - found.errors)
    named = effects(facts.effects, where=f"job.toml {KEY} effects")
    observe = kind_of(job).observing("compared with a simulation")
    plain = replace(
        recorded, artefact=observe(job.facts.artefact, points, where=where), effects=named if facts.refit else ()
    )
    if plain.estimate().least_squares.sigma_of_residuals < _NO_NOISE:
        raise CmmUqError(
            "prediction and recording differ by no noise at all: one of them is made of the other",
            where=f"job.toml {KEY}" if job.prediction is None else job.prediction.where,
            fix="Name the file that the simulation wrote, and the recording that the machine made",
        )  # fmt: skip
    stated = job.facts.recording.u_coordinate_um
    every = np.hypot(found.u, found.turned)
    u = float(np.sqrt(np.mean(every**2)))
    ratio = _ratios(plain, every, u, stated)
    weighed = _weighing(observe, points, ratio, facts.u_common_um * MICROMETRE)
    # repeats share what is predicted wrongly: their mean is no better known
    places = np.unique(np.column_stack([points.measurement, points.point]), axis=0)
    least = u * float(np.sqrt(len(points) / len(places)))
    together = None if stated is None else float(np.hypot(stated, least / MICROMETRE))
    model = replace(
        plain, artefact=weighed(job.facts.artefact, points, where=where), least_noise=least,
        sigma=None if together is None else together * MICROMETRE,
    )  # fmt: skip
    simulated = SimulatedTwin.of(facts, job, found, named, recorded)
    return Against(model, (*findings, *_odd(found)), weighed, together, simulated)


def _of_maps(job: Job, facts: SimulationFacts, points: Points) -> PredictedErrors:
    """The errors that maps give at the recorded positions."""
    from cmm_uq.machine.physics.compensation import compensate_points, machine_compensation
    from cmm_uq.machine.physics.map_interpolation import ErrorMaps

    where = f"job.toml {KEY} map"
    compensation = machine_compensation(points, ErrorMaps(maps_named(job, facts.map, None, where)))
    try:
        errors = points.xyz - compensate_points(points, compensation).xyz
    except CmmUqError as error:
        at = ", ".join(part for part in (job.recording_path, error.where) if part)
        raise CmmUqError(error.problem, where=at, fix=error.fix) from error
    exact = np.zeros(len(points))
    return PredictedErrors(errors, exact + facts.u_um * MICROMETRE, exact, SAME, 0.0, 0)


def _ratios(model: RecordingModel, u: Floats, usual: float, stated_um: float | None) -> Floats:
    """Uncertainty (n,) of each point, recorded and predicted, over that of a typical one."""
    if np.ptp(u) == 0:
        return np.ones(len(u))
    residual = model.estimate().least_squares.sigma_of_residuals
    own = np.sqrt(max(residual**2 - usual**2, 0.0)) if stated_um is None else stated_um * MICROMETRE
    ratio = np.maximum(np.hypot(own, u) / np.hypot(own, usual), _LEAST_WEIGHT)
    return np.asarray(np.exp(_STEP * np.round(np.log(ratio) / _STEP)))


def _weighing(observe: Observe, points: Points, ratio: Floats, u_common: float) -> Observe:
    """Makes artefacts whose observations are as uncertain as recorded and predicted points are together."""
    keys = zip(points.measurement.tolist(), points.point.tolist(), points.repeat.tolist(), strict=True)
    known: Mapping[tuple[int, int, int], float] = dict(zip(keys, ratio.tolist(), strict=True))

    def made(facts: ArtefactFacts, some: Points, *, where: str | None = None) -> Artefact:
        artefact = observe(facts, some, where=where)
        own = artefact.points
        keys = zip(own.measurement.tolist(), own.point.tolist(), own.repeat.tolist(), strict=True)
        each = np.array([known.get(key, 1.0) for key in keys])
        artefact.noise_scale = artefact.noise_scale * np.sqrt(np.mean(each[artefact.rows] ** 2, axis=1))
        if u_common and artefact.sizes and artefact.sizes[0].certified:
            first = replace(artefact.sizes[0], sd=float(np.hypot(artefact.sizes[0].sd, u_common)))
            artefact.sizes = (first, *artefact.sizes[1:])
        return artefact

    return made


def _odd(found: PredictedErrors) -> list[Finding]:
    """What must be known of a prediction before it is believed."""
    told: list[Text] = []
    if found.unused:
        told.append(plural(
            found.unused,
            one=say("one row of the prediction is of no point of the recording, and was not used"),
            many=say("{count} rows of the prediction are of no point of the recording, and were not used", count=found.unused),
        ))  # fmt: skip
    if not found.frame.is_the_same:
        told.append(say(
            "the prediction is in another frame; it was turned by {angle:.3g}° and shifted by {shift} mm",
            angle=float(np.degrees(found.frame.angle)),
            shift=in_a_row(signed(float(one), ".2f") for one in found.frame.shift),
        ))  # fmt: skip
    if found.apart > _FAR:
        turned = float(found.turned.max()) / MICROMETRE
        told.append(say(
            "points were recorded up to {apart:.1f} mm from where they are predicted; that the artefact was turned counts "
            "as a standard uncertainty of up to {turned:.2g} µm", apart=found.apart, turned=turned,
        ))  # fmt: skip
    return [Finding("simulation", (), (), text) for text in told]
