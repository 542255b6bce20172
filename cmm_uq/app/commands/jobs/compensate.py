"""Recordings and clouds, corrected by their machine's error maps, or by the errors of its rotary axes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmm_uq.analysis.machine.correction import FieldMap, field_map
from cmm_uq.analysis.machine.rotary_correction import RotaryCorrection
from cmm_uq.app.commands.certificates.further import together_of
from cmm_uq.app.commands.files import Stage, silent
from cmm_uq.app.commands.jobs import compensate_rotary
from cmm_uq.app.commands.jobs.simulate import recording
from cmm_uq.app.commands.model import refuse_planned
from cmm_uq.app.commands.reading import job_of, read_job, read_machine
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import Owner, sha256_of, staged
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.origin import FurtherCertificates, further_data
from cmm_uq.certificate.sections.regions import readings_data, readings_warnings
from cmm_uq.jobs.derived_job import IN_THE_RECORDING, PROGRAM, derived_toml, is_compensated, kept_inputs, recording_name
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.beside import log_of
from cmm_uq.jobs.reports import DescribedDigitizer, digitizer_of
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.identification import SIMULATED, first_line
from cmm_uq.machine.model.predicted_errors import maps_of
from cmm_uq.machine.physics.compensation import Compensation, machine_compensation
from cmm_uq.machine.physics.digitizer import POSE, DigitizedCloud, Digitizer, columns_for
from cmm_uq.machine.physics.error_map import ErrorMap, error_map_csv, error_map_text
from cmm_uq.machine.physics.kinematics import euler_313
from cmm_uq.machine.physics.map_interpolation import (
    Beyond,
    ErrorMaps,
    MapCovariance,
    SampledPoints,
    covariance_file,
    uncertain_map,
)
from cmm_uq.machine.physics.point_cloud import cloud_files, cloud_header, transform_cloud
from cmm_uq.machine.physics.stated import physics_of

NEW_MAP, COVARIANCE, MAP_KEYS = "error-map.csv", "error-map-covariance.npy", "error-map.toml"
POINTS_U = "points-u.csv"  # standard uncertainties of corrected coordinates
PROVENANCE = "compensation.json"  # how the coordinates were corrected, in the folder of a compensated job


def compensate_job(job: Job, *, beyond: Beyond = "refuse") -> tuple[Points, dict[str, object]]:
    """The recording of a job at the coordinates that its error maps make of it, and how it came about.

    ``beyond``: ``refuse`` points outside the maps, or extrapolate and flag them.
    """
    refuse_planned(job)
    compensation = compensate_rotary.RotaryCompensation.of(job, beyond)
    _refuse_map(job, job.points)
    if not job.facts.artefact.with_recording:
        raise kind_of(job).refused("compensated")
    log = log_of(job.facts.machine, job.inputs, job.folder)
    provenance = compensation.provenance()
    try:
        points = compensation.corrected(_prepared(job, compensation))
        if log is not None:  # which gave the temperatures of the scales
            times = job.points.columns["time_s"]
            provenance |= {"temperature_log": {
                "file": log.source, "rule": "mean of the thermocouples of each scale, linear in time",
                "largest_u_interpolation_k": round(float(log.u_at(times).max()), 6),
                "largest_spread_k": round(float(log.spread_at(times).max()), 6),
            }}  # fmt: skip
    except CmmUqError as error:
        where = ", ".join(part for part in (job.recording_path, error.where) if part)
        raise CmmUqError(error.problem, where=where, fix=error.fix) from error
    return points, provenance


def write_compensated(
    job: Path, out: Path, *, beyond: Beyond = "refuse", map_text_c: float | None = None, force: bool = False
) -> dict[str, Path]:
    """Write a job folder with the compensated recording, marked as such; its job.toml names no error map any more.

    map_text_c : temperature, °C, at which the error map is written beside it in the contractors' text form.
    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_job(job)
    _refuse(read)
    text: dict[str, bytes] = {}  # the error map at one temperature, by the name of its file
    if map_text_c is not None:
        name = f"error-map-{map_text_c:g}C.txt"
        if name in read.inputs:
            clash = f"has a file {name!r}, the name of the map to be written"
            raise CmmUqError(clash, where=str(read.folder), fix="Rename it")
        found = ErrorMaps(maps_of(read)).map_at(map_text_c, beyond=beyond)
        text[name] = error_map_text(found, name=name).encode()
    owner = Owner("compensate", read.facts.job.id, read.origin)
    expected = (*read.inputs, *text, POINTS_U, PROVENANCE)
    with staged(out, owner, inputs=read.paths, force=force, expected=expected) as place:
        return place.write(_files(read, beyond, text))


def write_new_map(
    job: Path, out: Path, *, seed: int = 0, force: bool = False, stage: Stage = silent
) -> tuple[dict[str, Path], FieldMap | RotaryCorrection]:
    """Write the error map of all errors that a calibration shows, its covariance, and what they are good for.

    Of a machine with rotary axes the errors themselves. Returns and raises as
    :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`, and what is written.
    """
    read = read_job(job)
    _refuse(read)
    refuse_planned(read)
    owner = Owner("compensate", read.facts.job.id, read.origin)
    rotary = _is_rotary(read)
    names = compensate_rotary.ROTARY_FILES if rotary else (NEW_MAP, COVARIANCE, MAP_KEYS)
    with staged(out, owner, inputs=read.paths, force=force, expected=(*names, PROVENANCE)) as place:
        if rotary:
            errors = compensate_rotary.errors_found(read, seed, stage)
            return place.write(
                compensate_rotary.error_files(read, errors, _made_of(read, "file of errors"), PROVENANCE)
            ), errors
        result, observe = compensate_rotary.estimated(read, "made an error map of", seed, stage)
        try:
            with physics_of(read):
                together = together_of(read, result.model, result.posterior, result.doubt, seed)()
                found = field_map(result.model, result.posterior, result.doubt, observe, seed, together.taken)
        except CmmUqError as error:
            raise CmmUqError(error.problem, where=error.where or str(read.folder), fix=error.fix) from error
        if found.agreement.disagree:
            names_of = ", ".join(dict.fromkeys(one.name for one in found.agreement.disagree))
            problem = f"all errors together say something else of {names_of} than is stated of it"
            fix = f"cmm-uq diagnose {read.folder} says what may be wrong"
            raise CmmUqError(f"{problem}: neither makes a map", where=str(read.folder), fix=fix)
        return place.write(_map_files(read, found, together.told)), found


def worth_of(found: FieldMap | RotaryCorrection) -> list[str]:
    """What a new map is good for, in sentences for who made it."""
    if isinstance(found, RotaryCorrection):
        return compensate_rotary.in_words(found)
    lines = compensate_rotary.worth_in_words("In the measuring range", found.range_um, found.held_out, "map")
    lines += [str(text) for text in readings_warnings(found.statements, {})]
    if found.omitted:
        lines.append(f"Neither in the map nor in its uncertainty: {', '.join(found.omitted)}")
    lines.append(f"{MAP_KEYS} holds the key by which [machine] of a job names it")
    return lines


def _map_files(read: Job, found: FieldMap, further: FurtherCertificates) -> dict[str, bytes]:
    error_map = found.error_map
    assert error_map.covariance is not None  # noqa: S101 - of its own making
    beside = [round(float(u) / MICROMETRE, 4) for u in error_map.covariance.beside]
    square = ", ".join(f"{pair} = {angle!r}" for pair, angle in error_map.squareness_arcsec.items())
    keys = (
        f'error_map = [{{ file = "{NEW_MAP}", temperature_c = {error_map.temperature!r}, squareness_arcsec = {{ {square} }}, '
        f'covariance = "{COVARIANCE}", u_beside_um = {beside} }}]\n'
    )
    told = {
        "software": PROGRAM, "recording": read.origin, "inputs_sha256": sha256(read.inputs),
        "chain": read.facts.machine.chain,
        "sign": "true = indicated + e", "errors_not_in_it": list(found.omitted),
        **({"axes": readings_data(read.points.machine, found.statements)} if found.statements else {}),
        **further_data(further.each),
        **compensate_rotary.worth_data(found.range_um, found.held_out),
    }  # fmt: skip
    return {
        NEW_MAP: (_made_of(read) + error_map_csv(error_map)).encode(),
        COVARIANCE: covariance_file(error_map.covariance, error_map),
        MAP_KEYS: ("# for [machine] of a job beside which the other files lie\n" + keys).encode(),
        PROVENANCE: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode(),
    }


def _is_rotary(read: Job) -> bool:
    return isinstance(read.points.machine, RotaryMachine)


def _made_of(read: Job, what: str = "error map") -> str:
    """The line that a new map begins with, by which the recording that it was made of is known."""
    return f"# {what} by {PROGRAM} of a {read.origin} recording, points {_digest(read.points)}; see {PROVENANCE}\n"


def _digest(points: Points) -> str:
    """Of the coordinates of a recording, whatever the order of its rows, their numbers and the form of its file."""
    xyz = np.round(points.xyz, 6) + 0.0  # no negative zeros
    return hashlib.sha256(np.ascontiguousarray(xyz[np.lexsort(xyz.T)]).tobytes()).hexdigest()


def compensated_job(job: Job, *, beyond: Beyond = "refuse") -> Job:
    """The job that :func:`write_compensated` writes, in memory."""
    _refuse(job)
    return job_of(_files(job, beyond, {}))


def _refuse(read: Job) -> None:
    if is_compensated(read):
        raise CmmUqError("is compensated already", where=f"{read.folder / 'job.toml'} [job] origin",
                         fix="Compensate the measured recording")  # fmt: skip
    if read.facts.recording.earlier is not None:
        raise CmmUqError("the recordings of two dates are not compensated together",
                         where=f"{read.folder / 'job.toml'} [recording] earlier",
                         fix="Compensate each as a job of its own, then name the earlier result")  # fmt: skip


def _refuse_map(job: Job, points: Points | None = None) -> None:
    """Refuse a map made of a simulated recording for a measured one, and for the points that it was made of.

    Corrected by it, these would seem to have smaller errors than they have.
    """
    for one in job.facts.machine.corrections:
        line, where = job.inputs[one.file].partition(b"\n")[0], str(job.folder / one.file)
        if b"of a simulated recording" in line and job.origin != SIMULATED:
            raise CmmUqError("was made of a simulated recording, and corrects no measured one", where=where,
                             fix="Make a map of a recording of the machine")  # fmt: skip
        if points is not None and _digest(points).encode() in line:
            fix = f"Compensate another recording of the machine; {PROVENANCE} beside the map says what it is worth to others"
            raise CmmUqError("was made of this very recording", where=where, fix=fix)


def _files(read: Job, beyond: Beyond, text: Mapping[str, bytes]) -> dict[str, bytes]:
    """Every file of the compensated job; ``text`` are maps written in the contractors' form."""
    points, provenance = compensate_job(read, beyond=beyond)
    compensation = compensate_rotary.RotaryCompensation.of(read, beyond)
    if compensation.has_uncertainty:
        probe = _prepared(read, compensation)
        u = compensation.standard_uncertainty(probe) / MICROMETRE
        places = np.column_stack([points.measurement, points.point, points.repeat])
        lines = [f"{m},{p},{r},{x:.4f},{y:.4f},{z:.4f}" for (m, p, r), (x, y, z) in zip(places, u, strict=True)]
        heads = "measurement,point,repeat,u_x_um,u_y_um,u_z_um"
        text = {**text, POINTS_U: ("\n".join([heads, *lines]) + "\n").encode()}
        provenance["distances"] = compensation.distances(probe, points.xyz)
    told = {"software": PROGRAM, "inputs_sha256": sha256(read.inputs), **provenance}
    files = {
        **kept_inputs(read),
        recording_name(read): first_line("compensate", PROGRAM, f"; see {PROVENANCE}").encode() + recording(points),
        **text,
        PROVENANCE: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode(),
    }
    toml = derived_toml(
        read, "compensate", files, without=("error_map", "squareness_arcsec", "rotary_errors", *IN_THE_RECORDING)
    )
    return {"job.toml": toml, **files}


def _prepared(job: Job, compensation: compensate_rotary.RotaryCompensation) -> Points:
    """The recording, with tip offsets where its kind finds them from what it recorded."""
    facts, points = job.facts.artefact, compensation.prepared(job.points, job.recording_path)
    if not facts.carries_probe or "tip_x_mm" in job.points.columns:
        return points
    tips = kind_of(job).observing("compensated")(facts, job.points, where=job.recording_path).tips()
    return replace(points, columns={**points.columns, **tips})


FORMS = (".csv", ".npy", ".parquet")  # endings of what is read and written; a folder of ``.npy`` files becomes one


def write_compensated_cloud(
    job: Path, cloud: Path, out: Path, *, beyond: Beyond = "refuse", force: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Path]:  # fmt: skip
    """Write the coordinates of a cloud, x, y, z in mm in the frame of the scales, and how they came about.

    job : of which ``[machine]`` names the error maps and describes the digitizer; its recording is not read.
    cloud : columns u_mm, v_mm in the scan plane and scale readings d_mm, e_mm, f_mm; pose, time_s, temp_x_c … where needed. Of
        a machine with rotary axes x_mm, y_mm, z_mm as in its recordings, and the angles.
    beyond : ``refuse`` points outside the maps, or extrapolate and flag them.
    Returns and raises as :func:`~cmm_uq.app.commands.jobs.simulate.write_simulation`.
    """
    read = read_machine(job)
    files = cloud_files(cloud)
    if cloud.suffix not in FORMS and not cloud.is_dir():
        raise CmmUqError("is no cloud by its ending", where=str(cloud), fix=f"Clouds are {', '.join(FORMS)}")
    _refuse_map(read)
    transform, told = _of_rotary(read, cloud, beyond) if _is_rotary(read) else _of_digitizer(read, cloud, beyond)
    name = f"{cloud.stem}-compensated{'.npy' if cloud.is_dir() else cloud.suffix}"
    owner = Owner("compensate", read.facts.job.id, read.origin)
    inputs = (*read.paths, *files)
    with staged(out, owner, inputs=inputs, force=force, expected=(name, PROVENANCE)) as place:
        mark = first_line("compensate", PROGRAM, f"; see {PROVENANCE}")
        count = transform_cloud(cloud, place.room(name), transform, columns=transform.columns, names=transform.names,
                                mark=mark, progress=progress)  # fmt: skip
        log = read.facts.machine.temperature_log
        told = {
            "software": PROGRAM, "origin": "compensated", "points": count,
            "inputs_sha256": sha256(read.inputs) | {file.name: sha256_of(file) for file in files},
            "columns": list(transform.columns), **told, "temperature_log": log.file if log is not None else None,
        }  # fmt: skip
        if not isinstance(transform, DigitizedCloud):
            told["distances"] = transform.distances()
        return place.write({PROVENANCE: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode()}, [name])


class _WithUncertainty:
    """A cloud's coordinates, beside them the standard uncertainty of each, mm, that the map's covariance makes."""

    def __init__(self, chain: DigitizedCloud, error_map: ErrorMap, covariance: MapCovariance) -> None:
        self._chain, self._map, self._covariance = chain, error_map, covariance
        self.columns, self.names = chain.columns, (*chain.names, *(f"u_{axis}_mm" for axis in AXES))
        self._sample = SampledPoints(200)
        (self._letters,) = {one.compensation.chain for one in chain.poses.values()}

    def __call__(self, rows: Floats) -> Floats:
        found = self._chain(rows)
        tips = np.empty((len(rows), 3))
        numbers = np.full(len(rows), min(self._chain.poses))
        if POSE in self.columns:
            numbers = rows[:, self.columns.index(POSE)]
        for number in np.unique(numbers):
            here, one = numbers == number, self._chain.poses[int(number)]
            tips[here] = one.tips(rows[here, :2])
        readings = rows[:, 2:5]
        u = self._covariance.standard_uncertainty(self._map, readings, tip=tips, chain=self._letters)
        self._sample.add(readings, found[:, :3], tips)
        return np.hstack([found, u])

    def distances(self) -> list[dict[str, float]]:
        return self._sample.distances(self._map, self._covariance, self._letters)


def _of_rotary(read: Job, cloud: Path, beyond: Beyond) -> tuple[compensate_rotary.RotaryCloud, dict[str, object]]:
    """How a cloud of a machine with rotary axes is corrected, and what is said of it."""
    if read.facts.machine.digitizer is not None:
        fix = "Leave it out, and give the cloud as x_mm, y_mm, z_mm with the angles"
        what = "a digitizer on a machine with rotary axes is not described"
        raise CmmUqError(what, where="job.toml [machine] digitizer", fix=fix)
    compensation = compensate_rotary.RotaryCompensation.of(read, beyond)
    return compensate_rotary.RotaryCloud(read, compensation, cloud_header(cloud), str(cloud)), compensation.provenance()


def _of_digitizer(
    read: Job, cloud: Path, beyond: Beyond
) -> tuple[DigitizedCloud | _WithUncertainty, dict[str, object]]:
    maps = ErrorMaps(maps_of(read))
    compensation = replace(machine_compensation(read.points, maps, beyond=beyond), origin=np.zeros(3))
    chain, digitizer = _chain(read, cloud, compensation)
    stated = uncertain_map(maps.maps)
    transform = chain if stated is None else _WithUncertainty(chain, *stated)
    return transform, {**compensation.provenance(), "digitizer": digitizer.as_data()}


def _chain(job: Job, cloud: Path, compensation: Compensation) -> tuple[DigitizedCloud, DescribedDigitizer]:
    digitizer = digitizer_of(job.facts.machine.digitizer, job.inputs, job.folder, job.origin)
    if digitizer is None:
        raise CmmUqError(
            "the job describes no digitizer",
            where="job.toml [machine] digitizer",
            fix="digitizer = { offset_mm = [U1, V1, W1], poses = [ { alpha_deg = …, beta_deg = …, gamma_deg = … } ] }, "
            'or { calibration = "FOLDER" }',
        )
    offset = np.array(digitizer.offset_mm)
    angles = {one.pose: np.radians([one.alpha_deg, one.beta_deg, one.gamma_deg]) for one in digitizer.poses}
    poses = {pose: Digitizer(euler_313(*each), offset, compensation) for pose, each in angles.items()}
    log = log_of(job.facts.machine, job.inputs, job.folder)
    columns = columns_for(cloud_header(cloud), len(poses), logged=log is not None, where=str(cloud))
    at = None if log is None else lambda times: log.at(times, lambda row: f"point {row + 1}")
    return DigitizedCloud(poses, columns, at, compensation.beyond == "extrapolate"), digitizer
