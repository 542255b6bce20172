"""A recording less the errors that a simulation predicts for it: what the simulation leaves unexplained, as a recording.

A prediction is where the artefact was taken to stand, plus errors. Where it was taken to stand is no concern: the artefact is
placed as near to the predicted points as it goes, in the recording's frame, and what remains of them are the predicted errors
(as indicated, so with the sign opposite to e). Taken from the recorded points they leave

    true = (recorded − predicted errors) + e,   e: what the machine has and the simulation has not

which is a recording like any other: what its placings leave open stays open, and all that is asked of recordings can be asked
of this one. Predicted errors hold where the artefact was taken to stand; it must therefore be near to where it stood.

Known beforehand are also the error maps of a job's machine: what ``[machine] error_map`` names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.compared import KEY, Prediction
from cmm_uq.jobs.tables.machine import ErrorMapFile, SquarenessFacts
from cmm_uq.machine.model.artefact import Artefact, Placings
from cmm_uq.machine.model.recorded import display_step
from cmm_uq.machine.physics.error_map import ErrorMap, parse_map_file
from cmm_uq.machine.physics.map_interpolation import parse_covariance

# mm from where a point was recorded, within which it is taken to be predicted: no hand sets up much worse, and errors change
# by less than their own size over it
NEAR = 30.0
LARGEST_ERROR = 5.0  # mm: beyond, no machine's errors are predicted, but another artefact, or points numbered otherwise
_REACH = 0.5  # part of the artefact's size, from its middle, at which errors say by how much they stretch
_SAME = 1e-7  # mm, by which a prediction differs from a recording that it is a copy of: the digits of a file
# by how many times, and mm, the points must be nearer in a shifted or turned frame for that to be the prediction's
_ANOTHER_FRAME, _ROUGHLY = 3.0, 0.1
_UNITS = ((25.4, "inches"), (1000.0, "metres"), (10.0, "centimetres"), (1e-3, "micrometres"))
_LIKE_A_UNIT = 0.02


@dataclass(frozen=True, eq=False)
class Frame:
    """How predicted coordinates become those of the recording: ``turn`` (3, 3) times them, plus ``shift`` (3,), mm."""

    turn: Floats
    shift: Floats

    def of(self, xyz: Floats) -> Floats:
        """Predicted coordinates (n, 3), mm, in the recording's frame."""
        return np.asarray(xyz @ self.turn.T + self.shift, dtype=np.float64)

    @property
    def angle(self) -> float:
        return float(np.arccos(np.clip(0.5 * (np.trace(self.turn) - 1), -1.0, 1.0)))

    @property
    def is_the_same(self) -> bool:
        return bool(np.array_equal(self.turn, np.eye(3)) and not np.any(self.shift))


SAME = Frame(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PredictedErrors:
    errors: Floats  # (n, 3) indicated minus true, mm
    u: Floats  # (n,) standard uncertainty of a predicted coordinate, mm, as it is stated
    # (n,) what there is besides because the artefact was taken to lie in another direction than it did, mm
    turned: Floats
    frame: Frame  # of the prediction
    apart: float  # largest distance of a predicted point from where it was recorded, mm; 0 of lengths
    unused: int  # rows of the prediction that the recording has no point for
    of_lengths: bool = False  # whether only lengths are predicted
    step: float = 0.0  # mm, of which all predicted figures are multiples; 0 where they are of none that matters
    expansion: Floats | None = None  # (n,) size of the artefact at each point, as it was recorded, over that at 20 °C
    at: Callable[[Floats], Floats] | None = None  # errors (n, 3) of the same points, had the scales read (n, 3) mm
    # errors (n, 3) had tables of a map been read otherwise, in words and by name
    tables: Mapping[str, tuple[Text, Floats]] = field(default_factory=dict)


def predicted_errors(
    artefact: Artefact, prediction: Prediction, where: str, *, length_mm: float | None = None,
    taken: Artefact | None = None, exact: bool = False,
) -> PredictedErrors:  # fmt: skip
    """The errors that a prediction contains, at the points of a recording.

    ``length_mm``: of the artefact, as the simulation took it; that of the artefact by default. ``taken``: the artefact as warm
    as it took it; by default as it was recorded. ``exact``: whether a recording without any noise may be predicted.
    """
    rows, unused = _matched(artefact.points, prediction, where)
    sizes = _sizes(artefact, length_mm)
    if prediction.of_lengths:
        errors, u = _of_lengths(artefact, prediction, rows, sizes, taken or artefact, exact)
        return PredictedErrors(
            errors, u, np.zeros_like(u), SAME, 0.0, unused, True, display_step(prediction.length, 0.0)
        )
    recorded = artefact.points.xyz
    frame = _frame(prediction, rows, recorded)
    predicted = frame.of(prediction.xyz[rows])
    apart = float(np.linalg.norm(predicted - recorded, axis=1).max())
    seen = artefact.project(recorded, (recorded - predicted)[:, :, None])
    if not exact and np.abs(seen).max() < _SAME:
        raise _copied(prediction)
    errors = predicted - (taken or artefact).fit(predicted, sizes)
    _refuse_absurd(errors, prediction, rows)
    # uncertainty (n,), mm, of errors predicted for an artefact that lay in another direction by up to a degree or so
    placings = Placings.of(artefact.points.measurement)
    aside = artefact.points.xyz - predicted
    turned, reach = (np.linalg.norm(v - placings.means(v), axis=1) for v in (aside, artefact.points.xyz))
    own = np.linalg.norm(errors - placings.means(errors), axis=1)
    far = reach > _REACH * reach.max(initial=0.0)
    turned = np.asarray(2 * float((own[far] / reach[far]).max(initial=0.0)) * turned)
    return PredictedErrors(
        errors, prediction.u[rows], turned, frame, apart, unused, step=display_step(prediction.xyz, 0.0)
    )


def _sizes(artefact: Artefact, length_mm: float | None) -> Floats:
    sizes = np.array([size.nominal for size in artefact.sizes])
    if length_mm is None:
        return sizes
    if not sizes.size or artefact.sizes[0].name != "length_mm":
        raise CmmUqError(
            f"a {artefact.title.lower()} has no length_mm", where=f"job.toml {KEY} length_mm", fix="Leave it out"
        )
    sizes[0] = length_mm
    return sizes


def _matched(points: Points, prediction: Prediction, where: str) -> tuple[Ints, int]:
    """Row (n,) of the prediction for each recorded point, and how many rows are for none."""
    of_lengths, repeated = prediction.of_lengths, prediction.repeat is not None
    point = np.zeros(len(points), dtype=np.int64) if of_lengths else points.point
    repeat = points.repeat if repeated else np.ones(len(points), dtype=np.int64)
    given = np.ones_like(prediction.point) if prediction.repeat is None else prediction.repeat
    keys = zip(prediction.measurement.tolist(), prediction.point.tolist(), given.tolist(), strict=True)
    known = {key: i for i, key in enumerate(keys)}
    wanted = list(zip(points.measurement.tolist(), point.tolist(), repeat.tolist(), strict=True))
    for i, key in enumerate(wanted):
        if key not in known:
            line = f" line {points.lines[i]}" if len(points.lines) else ""
            which = f"{'' if of_lengths else f', point {key[1]}'}{f', repeat {key[2]}' if repeated else ''}"
            fix = "Number the prediction as the recording, and predict every point"
            problem = f"measurement {key[0]}{which}, {where}{line}, is not predicted"
            raise CmmUqError(problem, where=prediction.where, fix=fix)
    rows = np.array([known[key] for key in wanted], dtype=np.int64)
    return rows, len(known) - len(set(wanted))


def _of_lengths(
    artefact: Artefact, prediction: Prediction, rows: Ints, sizes: Floats, taken: Artefact, exact: bool
) -> tuple[Floats, Floats]:
    """Errors (n, 3) along each length, half at each end, and their uncertainty (n,)."""
    ends = artefact.rows
    if artefact.lengths() is None or ends.shape[1] != 2 or len(np.unique(ends)) < ends.size:
        raise CmmUqError(f"predicts lengths, and a recording of this {artefact.title.lower()} has more than lengths",
                         where=prediction.where, fix="Predict coordinates: measurement, point, x_mm, y_mm, z_mm")  # fmt: skip
    points = artefact.points
    placed = taken.fit(points.xyz, sizes)
    bars = placed[ends[:, 1]] - placed[ends[:, 0]]
    nominal = np.linalg.norm(bars, axis=1)
    predicted, u = prediction.length[rows[ends[:, 0]]], prediction.u[rows[ends[:, 0]]]
    recorded = np.linalg.norm(points.xyz[ends[:, 1]] - points.xyz[ends[:, 0]], axis=1)
    if not exact and np.abs(recorded - predicted).max() < _SAME:
        raise _copied(prediction)
    half = 0.5 * (predicted - nominal)[:, None] * bars / nominal[:, None]
    errors, each = np.zeros_like(points.xyz), np.zeros(len(points))
    errors[ends[:, 0]], errors[ends[:, 1]] = -half, half
    each[ends.ravel()] = np.repeat(u / np.sqrt(2.0), 2)
    _refuse_absurd(errors, prediction, rows)
    return errors, each


def _frame(prediction: Prediction, rows: Ints, recorded: Floats) -> Frame:
    """The frame of the prediction: the recording's own, or one shifted, or shifted and turned, against it."""
    predicted = prediction.xyz[rows]
    frames = (SAME, Frame(np.eye(3), np.median(recorded - predicted, axis=0)), _turned(predicted, recorded))
    far = [np.linalg.norm(frame.of(predicted) - recorded, axis=1) for frame in frames]
    usual = min(float(np.sqrt(np.mean(distance**2))) for distance in far)
    for frame, distance in zip(frames, far, strict=True):
        if distance.max() <= NEAR and np.sqrt(np.mean(distance**2)) <= _ANOTHER_FRAME * usual + _ROUGHLY:
            return frame
    spread = float(np.linalg.norm(predicted - predicted.mean(axis=0)))
    ratio = float(np.linalg.norm(recorded - recorded.mean(axis=0))) / spread if spread else 0.0
    for factor, unit in _UNITS:
        if abs(ratio / factor - 1) < _LIKE_A_UNIT:
            fix = f"Convert them (times {factor:g}), or give unit in job.toml {KEY}"
            raise CmmUqError(f"the coordinates look like {unit}, not mm", where=prediction.where, fix=fix)
    mirrored = predicted * [1, 1, -1]
    if np.linalg.norm(_turned(mirrored, recorded).of(mirrored) - recorded, axis=1).max() <= NEAR:
        raise CmmUqError("its frame is mirrored against the recording's: one axis has the other sign, or two are exchanged",
                         where=prediction.where,
                         fix="Name each column rightly, or turn the sign of one round, in both alike")  # fmt: skip
    best = min(far, key=lambda distance: float(np.median(distance)))
    row = rows[int(np.argmax(best))]
    raise CmmUqError(
        f"measurement {prediction.measurement[row]}, point {prediction.point[row]} is predicted {best.max():.4g} mm "
        "from where it was recorded",
        where=f"{prediction.where} line {prediction.lines[row]}",
        fix=f"Number it as the recording, and predict places within {NEAR:g} mm, all in one frame",
    )


def _turned(predicted: Floats, recorded: Floats) -> Frame:
    """The frame by least squares over all points (Kabsch 1976)."""
    middle, other = predicted.mean(axis=0), recorded.mean(axis=0)
    U, _, Vt = np.linalg.svd((recorded - other).T @ (predicted - middle))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    turn = U @ Vt
    return Frame(turn, other - turn @ middle)


def _copied(prediction: Prediction) -> CmmUqError:
    return CmmUqError("agrees with the recording to below 0.1 nm throughout: it is a copy, for nothing predicts the noise",
                      where=prediction.where, fix="Name the file that the simulation wrote")  # fmt: skip


def _refuse_absurd(errors: Floats, prediction: Prediction, rows: Ints) -> None:
    size = np.linalg.norm(errors, axis=1)
    i = int(np.argmax(size))
    if size[i] > LARGEST_ERROR:
        point = "" if prediction.of_lengths else f", point {prediction.point[rows[i]]},"
        raise CmmUqError(
            f"measurement {prediction.measurement[rows[i]]}{point} is predicted {size[i]:.3g} mm off the artefact, more than "
            "any machine's error",
            where=f"{prediction.where} line {prediction.lines[rows[i]]}",
            fix=f"Check its numbering and unit, and the artefact that was simulated (length_mm in {KEY})",
        )


WHERE = "job.toml [machine] error_map"


def maps_of(job: Job) -> list[ErrorMap]:
    """The error maps that a job names, each with its squareness: its own, or that of the machine."""
    machine = job.facts.machine
    if not machine.error_map:
        raise CmmUqError("the job has no error map", where=WHERE,
                         fix='Name it: error_map = [ { file = "map.csv", temperature_c = 20.0 } ]')  # fmt: skip
    return maps_named(job, machine.error_map, machine.squareness_arcsec, WHERE)


def maps_named(
    job: Job, named: Sequence[ErrorMapFile], squareness: SquarenessFacts | None, where: str
) -> list[ErrorMap]:
    maps, without = [], []
    for given in named:
        path = str(job.folder / given.file)
        found, has_squareness = parse_map_file(job.inputs[given.file], path, temperature=given.temperature_c)
        square = given.squareness_arcsec or squareness
        if square and has_squareness:
            raise CmmUqError("states its squareness, and the job gives it squareness_arcsec as well", where=path,
                             fix=f"Leave squareness_arcsec out in {where}")  # fmt: skip
        if not (square or has_squareness):
            without.append(path)
        source = replace(found, source=given.file)  # as the job names it, wherever its folder lies
        if square:
            source = source.with_squareness_arcsec(square.xy, square.yz, square.zx)
        if given.covariance is not None:
            content, file = job.inputs[given.covariance], str(job.folder / given.covariance)
            beside = MICROMETRE * np.array(given.u_beside_um)
            source = replace(source, covariance=parse_covariance(content, file, source, beside))
        maps.append(source)
    if without and len(without) < len(maps):
        raise CmmUqError("has no squareness, and another map has: between them it would fall to zero", where=without[0],
                         fix=f"Give it squareness_arcsec in {where}")  # fmt: skip
    return maps


_MICRORADIANS = 1e-6 / ARCSECOND  # of a rotation that was read as ″


def tables_otherwise(maps: Sequence[ErrorMap]) -> dict[str, tuple[Text, list[ErrorMap]]]:
    """The maps with tables read in each other's place, of other signs or in another unit, in words and by name."""

    def read(change: Callable[[ErrorMap, int], Floats]) -> list[ErrorMap]:
        """With other errors (m, 6) of each carriage."""
        found = []
        for m in maps:
            x, y, z = (replace(axis, errors=change(m, i)) for i, axis in enumerate(m.axes))
            found.append(replace(m, axes=(x, y, z)))
        return found

    def crossed(one: int, other: int, m: ErrorMap, i: int) -> Floats:
        errors = m.axes[i].errors.copy()
        if i in (one, other):
            j = one + other - i
            errors[:, j] = np.interp(m.axes[i].positions, m.axes[j].positions, m.axes[j].errors[:, i])
        return errors

    def rotated(factor: float) -> list[ErrorMap]:
        return read(lambda m, i: m.axes[i].errors * np.repeat([1.0, factor], 3))

    square = [replace(m, squareness=-m.squareness) for m in maps]
    found: dict[str, tuple[Text, list[ErrorMap]]] = {
        "rotations_sign": (say("the map's rotations have the other sign"), rotated(-1.0)),
        "rotations_unit": (say("the map's rotations are in µrad, and were read as ″"), rotated(_MICRORADIANS)),
        "squareness_sign": (say("the map's squareness has the other sign"), square),
    }
    for one, other in ((0, 1), (1, 2), (0, 2)):
        first, second = AXES[one], AXES[other]
        title = say(
            "the map's straightness of {one} along {other} and of {other} along {one} are exchanged",
            one=Verbatim(first.upper()),
            other=Verbatim(second.upper()),
        )
        found[f"crossed_{first}{second}"] = title, read(partial(crossed, one, other))
    return found
