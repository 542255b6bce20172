"""Machines with rotary axes corrected by what a calibration found of them: its file of errors, recordings and clouds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial

import numpy as np

from cmm_uq.analysis.machine.correction import HeldOutCorrection
from cmm_uq.analysis.machine.rotary_correction import RotaryCorrection, rotary_correction
from cmm_uq.analysis.machine.state import of_machine
from cmm_uq.app.commands.files import Stage
from cmm_uq.app.commands.report import evaluate_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.derived_job import PROGRAM
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.machines import in_coordinates
from cmm_uq.jobs.source import sha256
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.predicted_errors import maps_of
from cmm_uq.machine.physics.compensation import (
    Compensation,
    RotaryErrors,
    blocks,
    circumstances,
    compensate_points,
    machine_compensation,
    parse_rotary_errors,
)
from cmm_uq.machine.physics.map_interpolation import (
    Beyond,
    ErrorMaps,
    SampledPoints,
    factor_file,
    uncertain_distances,
    uncertain_map,
)
from cmm_uq.machine.physics.point_cloud import COORDINATES
from cmm_uq.machine.physics.stated import physics_of

ROTARY_FILES = ERRORS, COVARIANCE, KEYS = "rotary-errors.csv", "rotary-errors-covariance.npy", "rotary-errors.toml"
_KEY = "job.toml [machine] rotary_errors"
_LITTLE = 0.5  # part of the error that a correction leaves from which on it corrects little


@dataclass(frozen=True, eq=False)
class RotaryCompensation:
    """How points of a machine with rotary axes are corrected: by maps of its carriages, by errors of its axes, or by both."""

    maps: Compensation | None
    rotary: RotaryErrors | None

    @classmethod
    def of(cls, job: Job, beyond: Beyond) -> RotaryCompensation:
        """Raises ``CmmUqError`` where the job names neither maps nor errors, or errors of another machine."""
        named, facts = job.facts.machine.rotary_errors, job.facts.machine
        maps = None
        if facts.error_map or named is None:
            maps = machine_compensation(job.points, ErrorMaps(maps_of(job)), beyond=beyond)
        if named is None:
            return cls(maps, None)
        where, at = (str(job.folder / name) for name in (named.file, named.covariance))
        rotary = parse_rotary_errors(job.inputs[named.file], job.inputs[named.covariance], where, at, named.file)
        if wrong := next(filter(None, (effect.unfit(job.points) for effect in rotary.effects)), None):
            raise CmmUqError(wrong.problem, where=where, fix=f"Mend [machine] chain, or {_KEY}")
        return cls(maps, rotary)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that say from which side an axis came, where that matters."""
        own = () if self.rotary is None else self.rotary.columns
        return tuple(name for name in own if not name.endswith("_deg"))

    def corrected(self, points: Points) -> Points:
        return compensate_points(points, self.maps, self.rotary)

    def prepared(self, points: Points, where: str) -> Points:
        """Points with axes at 0 that were not recorded; refused without the side from which an axis with play came."""
        machine, columns = points.machine, dict(points.columns)
        for axis in machine.rotary if isinstance(machine, RotaryMachine) else ():
            columns.setdefault(axis.column, np.zeros(len(points)))
        if missing := next((name for name in self.columns if name not in columns), None):
            fix = f"Record {missing}, 0 where nobody knows; or make a file of errors that does not go by it"
            raise CmmUqError(f"the errors go by {missing}, which is not there", where=where, fix=fix)
        return replace(points, columns=columns)

    def uncertain(self, points: Points) -> tuple[Floats, Floats]:
        """R (n, 3, r), mm, of what all points share, and (n, 3, 3) of each alone, along the axes of the coordinates."""
        n = len(points)
        roots, beside = [np.zeros((n, 3, 0))], np.zeros((n, 3, 3))
        stated = None if self.maps is None else uncertain_map(self.maps.maps.maps)
        if stated is not None and self.maps is not None:
            tip, chain = circumstances(points).tip, self.maps.chain
            roots.append(points.on_artefact(stated[1].root(stated[0], points.carriages, tip=tip, chain=chain)))
            beside = points.on_artefact(np.broadcast_to(np.diag(stated[1].beside), (n, 3, 3)))
        if self.rotary is not None:
            roots.append(self.rotary.root(points))
        return np.concatenate(roots, axis=2), beside

    def standard_uncertainty(self, points: Points) -> Floats:
        """(n, 3), mm, of each coordinate as it is recorded."""
        found, machine = [np.zeros((0, 3))], points.machine
        for rows in blocks(len(points)):
            some = points.select(rows)
            root, beside = self.uncertain(some)
            if isinstance(machine, RotaryMachine) and machine.recorded_in_machine:
                root, beside = (machine.turned(each, some.columns) for each in (root, beside))
            found.append(np.sqrt(np.sum(root**2, axis=2) + np.sum(beside**2, axis=2)))
        return np.concatenate(found)

    def distances(self, points: Points, xyz: Floats) -> list[dict[str, float]]:
        """Standard uncertainty, µm, of distances between some points where they are found to be, ``xyz`` (n, 3)."""
        sample = SampledPoints(200)
        sample.keep(np.arange(len(points), dtype=np.float64)[:, None])
        rows = sample.kept.astype(np.int64).ravel()
        return uncertain_distances(*self.uncertain(points.select(rows)), xyz[rows]) if len(rows) > 1 else []

    @property
    def has_uncertainty(self) -> bool:
        return self.rotary is not None or (self.maps is not None and uncertain_map(self.maps.maps.maps) is not None)

    def provenance(self) -> dict[str, object]:
        told = {} if self.maps is None else self.maps.provenance()
        if self.rotary is None:
            return told
        rotary = self.rotary
        told["rotary_errors"] = {
            "file": rotary.source,
            "sha256": rotary.sha256,
            "effects": [effect.name for effect in rotary.effects],
        }
        if self.maps is not None and uncertain_map(self.maps.maps.maps) is None:
            told["u"] = "of the rotary errors alone: the map has no covariance"
        return {**told, "sign": "true = indicated + e"}


class RotaryCloud:
    """A cloud's coordinates corrected, beside them the standard uncertainty of each, mm."""

    def __init__(self, job: Job, by: RotaryCompensation, header: Sequence[str] | None, where: str) -> None:
        machine = job.points.machine
        assert isinstance(machine, RotaryMachine)  # noqa: S101 - of whoever calls
        self._facts, self._machine, self._by, self._where = job.facts.machine, machine, by, where
        asked = (*(axis.column for axis in machine.rotary), *by.columns)
        optional = (*(axis.column for axis in machine.rotary), *(f"tip_{a}_mm" for a in AXES))
        known = (*(name for name in optional if header is not None and name in header), *by.columns)
        self.columns = (*COORDINATES, *(asked if header is None else known))
        marked = ("extrapolated",) if by.maps is not None and by.maps.beyond == "extrapolate" else ()
        u = tuple(f"u_{a}_mm" for a in AXES) if by.has_uncertainty else ()
        self.names, self._marked, self._sample = (*COORDINATES, *marked, *u), bool(marked), SampledPoints(200)

    def __call__(self, rows: Floats) -> Floats:
        points = self._points(rows)
        found = self._by.corrected(points)
        columns = [self._machine.as_recorded(found.xyz, points.columns)]
        if self._marked:
            columns.append(found.columns.get("extrapolated", np.zeros(len(rows)))[:, None])
        if self._by.has_uncertainty:
            columns.append(self._by.standard_uncertainty(points))
        self._sample.keep(rows)
        return np.hstack(columns)

    def _points(self, rows: Floats) -> Points:
        one, columns = np.ones(len(rows), dtype=np.int64), dict(zip(self.columns[3:], rows[:, 3:].T, strict=True))
        number = np.arange(1, len(rows) + 1)
        points = Points(rows[:, :3], one, number, one, self._machine, columns, number)
        return self._by.prepared(in_coordinates(points, self._facts, self._where), self._where)

    def distances(self) -> list[dict[str, float]]:
        """Standard uncertainty, µm, of distances between some of its points."""
        if not self._by.has_uncertainty or not len(self._sample.kept):
            return []
        points = self._points(self._sample.kept)
        return self._by.distances(points, self._by.corrected(points).xyz)


def estimated(read: Job, made: str, seed: int, stage: Stage) -> tuple[Result, Observed]:
    """What a calibration finds of a machine's named errors, and how its artefact is observed; other jobs are refused."""
    stage("Estimating the errors", 0.0)
    result, kind = evaluate_job(read, seed=seed), kind_of(read)
    if not isinstance(result, Result) or not any(map(of_machine, result.model.effects)):
        raise kind.refused(made)
    stage("Drawing all errors together", 0.4)
    return result, partial(kind.observing("reported"), read.facts.artefact, where=read.recording_path)


def errors_found(read: Job, seed: int, stage: Stage) -> RotaryCorrection:
    """Of a calibration with rotary axes."""
    if read.further:
        raise CmmUqError(
            "further certificates are not taken together with rotary axes",
            where="job.toml [machine] further",
            fix="Leave them out",
        )
    result, observe = estimated(read, "made a file of errors of", seed, stage)
    with physics_of(read):
        found = rotary_correction(result.model, result.posterior, result.doubt, observe, seed)
    if found.agreement.disagree:
        names = ", ".join(dict.fromkeys(one.name for one in found.agreement.disagree))
        problem = f"all errors together say something else of {names} than is stated of it"
        fix = f"cmm-uq diagnose {read.folder} says what may be wrong"
        raise CmmUqError(f"{problem}: neither corrects the machine", where=str(read.folder), fix=fix)
    return found


def error_files(read: Job, found: RotaryCorrection, made_of: str, provenance: str) -> dict[str, bytes]:
    told = {
        "software": PROGRAM,
        "recording": read.origin,
        "inputs_sha256": sha256(read.inputs),
        "chain": read.facts.machine.chain,
        "sign": "true = indicated + e",
        "errors_not_in_it": list(found.omitted),
        **worth_data(found.range_um, found.held_out),
    }
    keys = f'rotary_errors = {{ file = "{ERRORS}", covariance = "{COVARIANCE}" }}\n'
    return {
        ERRORS: (made_of + found.errors.csv()).encode(),
        COVARIANCE: factor_file(found.errors.factor),
        KEYS: ("# for [machine] of a job beside which the other files lie\n" + keys).encode(),
        provenance: (json.dumps(told, indent=2, ensure_ascii=False) + "\n").encode(),
    }


def worth_data(range_um: tuple[float, float], held: HeldOutCorrection | None) -> dict[str, object]:
    """What a correction is worth, for the file beside it."""
    both, tried = ("uncorrected", "corrected"), None
    if held is not None:
        errors = {"uncorrected": held.uncorrected, "named_errors": held.named, "corrected": held.corrected}
        tried = {"left_out": str(held.unseen), **{name: _figure(error) for name, error in errors.items()}}
        tried["predicted"] = dict(zip(both, map(_figure, held.predicted), strict=True))
    return {"range_rms_um": dict(zip(both, map(_figure, range_um), strict=True)), "held_out_rms_um": tried}


def worth_in_words(where: str, range_um: tuple[float, float], held: HeldOutCorrection | None, what: str) -> list[str]:
    """The same in sentences; ``where`` errors are off by so much, ``what`` corrects them."""
    before, after = range_um
    lines = [f"{where} a coordinate is off by {before:.3g} µm rms, corrected by {after:.3g} µm"]
    if after > _LITTLE * before:
        lines.append(
            f"The recording leaves most of that open: correct nothing by this {what} where it was not recorded"
        )
    if held is None:
        lines.append(f"Too little is recorded to hold some of it out: what the {what} is worth was not tried")
        return lines
    lines.append(
        f"{str(held.unseen).capitalize()} held out are off by {held.uncorrected:.3g} µm rms (predicted: "
        f"{held.predicted[0]:.3g}), corrected by {held.corrected:.3g} ({held.predicted[1]:.3g}), by the named errors "
        f"alone {held.named:.3g}"
    )
    if held.corrected > held.uncorrected:
        lines.append(f"The {what} makes them worse: correct nothing by it")
    return lines


def in_words(found: RotaryCorrection) -> list[str]:
    """What a file of errors is good for, in sentences for who made it."""
    where = "At the recorded places, at any angle in the recorded ranges,"
    lines = worth_in_words(where, found.range_um, found.held_out, "file")
    if found.omitted:
        lines.append(
            f"Neither corrected nor in its uncertainty: {', '.join(found.omitted)}, whose columns are not recorded"
        )
    return [*lines, f"{KEYS} holds the key by which [machine] of a job names it"]


def _figure(value: float) -> float:
    return float(f"{value:.4g}")
