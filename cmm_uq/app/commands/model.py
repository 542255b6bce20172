"""The measurement model of a job, of its recording or of what a simulation leaves of that; and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from cmm_uq.analysis.diagnosis.simulated import SimulatedTwin
from cmm_uq.analysis.screening.columns import Finding, finding
from cmm_uq.analysis.screening.screening import counted_with, screen_recording
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import FREEDOMS, OBSERVATIONS
from cmm_uq.base.messages import Text, Verbatim, in_a_row, plural, say, signed
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.result import OwnAnalysis, Recipe
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.compared import KEY, SimulationFacts
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import LAST_DIGIT, Artefact
from cmm_uq.machine.model.kind import Kind, Observe
from cmm_uq.machine.model.predicted_errors import SAME, PredictedErrors, maps_named, predicted_errors, tables_otherwise
from cmm_uq.machine.model.recorded import NANOMETRE, display_step, expansion
from cmm_uq.machine.physics.catalogue import effects, every
from cmm_uq.machine.physics.kinematics import SQUARENESSES
from cmm_uq.maths.inference.linear_model import RANK_TOLERANCE, Freedoms

# observations that the noise is estimated from, beside those that sizes and set-ups could explain
FEWEST_LEFT = 3

_UNNAMED = 0.03  # rad: a lean beyond this the diagnosis does not find by itself where a recording is taken about it

OVERFLOW_FIX = (  # where figures leave the range of numbers
    "Look for a number that no measurement gives: in the columns of the recording, u_coordinate_um, u_um or travel_mm"
)


def model_of(job: Job, artefact: Artefact) -> RecordingModel:
    if len(artefact.noise_scale) > OBSERVATIONS.most:
        many = f"{len(artefact.noise_scale)} observations are more than are estimated from at once"
        thin_out = f"{OBSERVATIONS.most} are the most: thin out the recording"
        raise CmmUqError(many, where=job.recording_path, fix=thin_out)
    if (count := Freedoms.of(artefact.placing(artefact.points.xyz)).count) > FREEDOMS.most:
        many = (
            f"the placings have {count} freedoms together, more than are estimated beside the machine's errors at once"
        )
        raise CmmUqError(many, where=job.recording_path, fix=f"{FREEDOMS.most} are the most: split the recording")
    stated, aside = job.facts.recording.u_coordinate_um, job.facts.recording.measurements_aside
    if unknown := set(aside) - set(job.points.measurement.tolist()):
        raise CmmUqError(f"there is no measurement {min(unknown)}", where="job.toml [recording] set_aside",
                         fix="Name measurements that the recording has")  # fmt: skip
    group, rows = artefact.points.group, artefact.rows[:, 0]
    copies = group[counted_with(artefact.points, aside)[rows]] != group[rows]
    used = ~(np.isin(artefact.measurement, aside) | copies | artefact.unread())
    if not used.any():
        where = "job.toml [recording] set_aside" if aside else job.recording_path
        raise CmmUqError("no observation is left to estimate from", where=where,
                         fix="Set fewer measurements aside, or record what the machine reads")  # fmt: skip
    named = effects(job.facts.model.effects, where="job.toml [model] effects")
    if unfit := next(filter(None, (effect.unfit(artefact.points) for effect in named)), None):
        raise unfit
    unnamed = {
        plane: f"{np.degrees(abs(lean)):.1f}° ({plane[0].upper()} and {plane[1].upper()})"
        for plane, lean in zip(SQUARENESSES, artefact.leans, strict=True)
        if abs(lean) > _UNNAMED and plane not in {effect.plane for effect in named}
    }
    if unnamed:
        lacking = [name for name, one in every().items() if one.everywhere and one.plane in unnamed]
        raise CmmUqError(
            f"the {artefact.title.lower()} fits only on axes that are out of square by {', '.join(unnamed.values())}",
            where=job.recording_path,
            fix=f"Name {', '.join(lacking)} in job.toml [model] effects, or adjust the machine and measure again",
        )
    model = RecordingModel(artefact, named, None if stated is None else stated * MICROMETRE, used)
    _refuse_undetermined(model, job.recording_path)
    return model


def _refuse_undetermined(model: RecordingModel, where: str) -> None:
    """Refuse what leaves open, whatever the machine's errors, what the measurement is made for, or shows no noise."""
    roles = [size.role for size in model.artefact.sizes]
    sought = [i for i, role in enumerate(roles) if role == "sought"]
    if sought and _rank(replace(model, effects=()), sought)[0] < len(sought):
        names = ", ".join(model.artefact.sizes[i].title for i in sought)
        raise CmmUqError(f"the measurements that are used leave a combination of {names} open", where=where,
                         fix="Set fewer measurements aside, or record more")  # fmt: skip
    if model.sigma is None and "set-up" in roles:
        rank, count = _rank(model)
        if (left := count - rank) < FEWEST_LEFT:
            raise CmmUqError(
                f"what is in doubt about each set-up explains all but {left} of {count} observations, so the noise "
                "of a coordinate does not show", where=where,
                fix="State u_coordinate_um in job.toml [recording], or record more points in each measurement",
            )  # fmt: skip


def _rank(model: RecordingModel, columns: Sequence[int] | slice = slice(None)) -> tuple[int, int]:
    """Rank of some columns of the design, and how many observations there are, what is of no interest projected out."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    design = (linear.reduced.design * np.array([unknown.scale for unknown in model.unknowns]))[:, columns]
    return int(np.linalg.matrix_rank(design, tol=RANK_TOLERANCE * np.linalg.norm(design, 2))), linear.reduced.count


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
    if not placings and job.origin == MEASURED:
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
) -> Recipe:
    """How a job is analysed: in its kind's own way, or as observations that named effects explain."""
    refuse_unmeasured(job)
    kind = kind_of(job)
    offered = kind.offers("own", OwnAnalysis)
    if offered is not None and (recipe := own(offered)) is not None:
        return recipe
    kind.observing(what)
    return usual(kind)


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
    predicted : the errors that were taken off, of the points that follow.
    """

    model: RecordingModel
    findings: tuple[Finding, ...]
    observe: Observe
    stated_um: float | None
    simulated: SimulatedTwin
    predicted: PredictedErrors
    of: Points


def against_simulation(job: Job, facts: SimulationFacts) -> Against:
    """Join what the simulation leaves of a recording with the model of what it could lack."""
    recorded, findings = recorded_model(job)
    artefact, where, exact = recorded.artefact, job.recording_path, job.origin != MEASURED
    if facts.map:
        found = _of_maps(job, facts, artefact.points)
    elif job.prediction is not None:
        found = predicted_errors(
            artefact,
            job.prediction,
            where,
            length_mm=facts.length_mm,
            exact=exact,
            taken=_as_simulated(job, facts, artefact),
        )
        if facts.temperature_c is None:
            found = replace(found, expansion=expansion(job.facts.artefact, artefact.points))
    else:
        unread = "the prediction was not read"
        raise CmmUqError(unread, where=f"job.toml {KEY} file", fix="Read the job with its recording")
    points = artefact.points.at(artefact.points.xyz - found.errors)
    named = effects(facts.effects, where=f"job.toml {KEY} effects")
    observe = kind_of(job).observing("compared with a simulation")
    left = observe(job.facts.artefact, points, where=where)
    plain = replace(recorded, artefact=left, effects=named if facts.refit else ())
    same = plain.estimate().least_squares.sigma_of_residuals < _NO_NOISE
    if same and not exact:
        alike = "prediction and recording differ by no noise at all: one of them is made of the other"
        place = f"job.toml {KEY}" if job.prediction is None else job.prediction.where
        fix = "Name the file that the simulation wrote, and the recording that the machine made"
        raise CmmUqError(alike, where=place, fix=fix)
    stated = job.facts.recording.u_coordinate_um
    each = np.hypot(found.u, found.turned)
    u = float(np.sqrt(np.mean(each**2)))
    ratio = np.ones(len(each))  # of each point's uncertainty, recorded and predicted, over that of a typical one
    if np.ptp(each) > 0:
        residual = plain.estimate().least_squares.sigma_of_residuals
        own = np.sqrt(max(residual**2 - u**2, 0.0)) if stated is None else stated * MICROMETRE
        ratio = np.maximum(np.hypot(own, each) / np.hypot(own, u), _LEAST_WEIGHT)
        ratio = np.exp(_STEP * np.round(np.log(ratio) / _STEP))
    weighed = _weighing(observe, points, ratio, facts.u_common_um * MICROMETRE)
    # repeats share what is predicted wrongly: their mean is no better known
    places = np.unique(np.column_stack([points.measurement, points.point]), axis=0)
    least = u * float(np.sqrt(len(points) / len(places)))
    together = None if stated is None else float(np.hypot(stated, least / MICROMETRE))
    model = replace(
        plain, artefact=weighed(job.facts.artefact, points, where=where), least_noise=least,
        sigma=None if together is None else together * MICROMETRE,
    )  # fmt: skip
    hashes, contains = sha256(job.inputs), tuple(effect.name for effect in named)
    shown = artefact.project(artefact.points.xyz, found.errors[:, :, None])[recorded.used, 0]
    simulated = SimulatedTwin(
        {name: hashes[name] for name in ([one.file for one in facts.map] if facts.file is None else [facts.file])},
        facts.program, bool(facts.map), _rms_um(found.u), facts.u_common_um, _rms_um(found.turned), contains,
        contains if facts.refit else (), tuple(float(v) for v in found.frame.shift), float(np.degrees(found.frame.angle)),
        found.apart, _rms_um(shown),
    )  # fmt: skip
    return Against(model, (*findings, *_odd(found, same=same)), weighed, together, simulated, found, artefact.points)


def _rms_um(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) / MICROMETRE


def _of_maps(job: Job, facts: SimulationFacts, points: Points) -> PredictedErrors:
    from cmm_uq.machine.physics.compensation import Compensation, circumstances, compensate_points, machine_compensation
    from cmm_uq.machine.physics.map_interpolation import ErrorMaps

    where = f"job.toml {KEY} map"
    maps = maps_named(job, facts.map, None, where)
    compensation = machine_compensation(points, ErrorMaps(maps))
    try:
        errors = points.xyz - compensate_points(points, compensation).xyz
    except CmmUqError as error:
        at = ", ".join(part for part in (job.recording_path, error.where) if part)
        raise CmmUqError(error.problem, where=at, fix=error.fix) from error
    exact, when = np.zeros(len(points)), circumstances(points)
    beyond = replace(compensation, beyond="extrapolate")

    def shown(by: Compensation, readings: Floats) -> Floats:
        return -points.on_artefact(by.error_at(readings, when)[0][:, :, None])[:, :, 0]

    otherwise = {
        name: (title, shown(replace(beyond, maps=ErrorMaps(read)), points.carriages))
        for name, (title, read) in tables_otherwise(maps).items()
    }
    return PredictedErrors(
        errors,
        exact + facts.u_um * MICROMETRE,
        exact,
        SAME,
        0.0,
        0,
        tables=otherwise,
        at=lambda readings: shown(beyond, readings),
    )


def _as_simulated(job: Job, facts: SimulationFacts, artefact: Artefact) -> Artefact:
    """The artefact as warm as the simulation took it, and as it then expands."""
    own, points, where = job.facts.artefact, artefact.points, f"job.toml {KEY}"
    if facts.cte_per_k is None and facts.temperature_c is None:
        return artefact
    cte = own.cte_per_k if facts.cte_per_k is None else facts.cte_per_k
    if facts.temperature_c is not None:
        if not cte:
            raise CmmUqError(
                "temperature_c says nothing of an artefact whose expansion nobody states",
                where=where,
                fix="Give cte_per_k in [artefact], or leave it out",
            )
        points = replace(
            points, columns={**points.columns, "temp_artefact_c": np.full(len(points), facts.temperature_c)}
        )
    elif "temp_artefact_c" not in points.columns:
        raise CmmUqError(
            "cte_per_k says nothing without a temperature of the artefact",
            where=where,
            fix="Give temperature_c, or record temp_artefact_c; or leave it out",
        )
    return kind_of(job).observing("compared with a simulation")(
        own.model_copy(update={"cte_per_k": cte}), points, where=job.recording_path
    )


def _weighing(observe: Observe, points: Points, ratio: Floats, u_common: float) -> Observe:
    """Makes artefacts whose observations are as uncertain as recorded and predicted points are together."""

    def keys(of: Points) -> Iterator[tuple[int, int, int]]:
        return zip(of.measurement.tolist(), of.point.tolist(), of.repeat.tolist(), strict=True)

    known = dict(zip(keys(points), ratio.tolist(), strict=True))

    def made(facts: ArtefactFacts, some: Points, *, where: str | None = None) -> Artefact:
        artefact = observe(facts, some, where=where)
        each = np.array([known.get(key, 1.0) for key in keys(artefact.points)])
        artefact.noise_scale = artefact.noise_scale * np.sqrt(np.mean(each[artefact.rows] ** 2, axis=1))
        if u_common and artefact.sizes and artefact.sizes[0].certified:
            first = replace(artefact.sizes[0], sd=float(np.hypot(artefact.sizes[0].sd, u_common)))
            artefact.sizes = (first, *artefact.sizes[1:])
        return artefact

    return made


def _odd(found: PredictedErrors, *, same: bool) -> list[Finding]:
    told: list[Text] = []
    if same:
        told.append(
            say(
                "prediction and recording differ by no noise at all: one of them is made of the other, and says nothing of it"
            )
        )
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
