"""What a run along an axis is: where it goes, what is read along it, and which readings belong to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import direction_words
from cmm_uq.analysis.screening.shape import rows_by
from cmm_uq.artefacts.axis_runs.kind import APPROACHES, READ, TURN
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.units import METRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.recorded import refuse

ALONG, ACROSS, TURNING, CIRCLE = "along", "across", "turning", "circle"
READINGS = {False: "reading_um", True: "reading_arcsec"}  # by whether a rotation is read
# columns of the artefact's own points: whether one is the other end of an arm; the target along the run from its first, or
# outward on a circle, and where that is, or the circle's radius; the mean of the readings of one zero; mm
END, TARGET, START, ZERO = "_arm_end", "_target_mm", "_start_mm", "_zero_mm"
FACE, FACE_ANGLE = "face", "face_arcsec"  # columns: number of a polygon's face, and its certified deviation
STRAIGHTEDGE, SQUARE = "straightedge", "square"  # columns: +1, and −1 reversed; number of the setting
_UNIT, _SAME_MM = 0.01, 1e-6
_STILL_MM = 0.01  # by which carriages that stand still may be read otherwise while a table turns
_ALONG, _ACROSS = 0.999, 0.05  # cosines between what is read and the travel
_CUBIC = 5  # targets of which one lies between two on either side
_ROUND = 0.02  # of its radius, by which targets may be off a circle
_BEYOND = 2.0  # times the travel of an axis, from which on positions along it are in another unit


@dataclass(frozen=True, eq=False)
class Run:
    """The readings of one measurement: all repeats, in both directions."""

    measurement: int
    kind: str  # ALONG, ACROSS, TURNING or CIRCLE
    rows: Ints  # (k,) of the recording
    travel: Floats  # (3,) unit vector of the travel, in the sense of growing positions; the axis of a circle
    sense: Floats  # (3,) unit vector along which, or about which, the instrument reads; (k, 3) outward on a circle
    start: float  # where the first target is along the travel, mm
    positions: Floats  # (k,) of the targets along the travel, from the first, mm; angles on a circle, degrees
    directions: Floats  # (k,) −1 or +1, in which each position was approached; 0 where nobody says
    radius: float = 0.0  # of a circle, mm
    # letter of the rotary table that turned, where that is read: the carriages stand still, and positions are in degrees
    table: str = ""

    @property
    def axis(self) -> str:
        """The carriage that moves; empty where several do."""
        if self.kind == CIRCLE or self.table:
            return ""
        moved = np.flatnonzero(np.abs(self.travel) > _ALONG)
        return AXES[moved[0]] if len(moved) else ""

    @property
    def quantity(self) -> Text:
        """Name in VDI/VDE 2617 of the parametric error that it shows, as ``xtx``; its direction where it shows several.

        Of a rotary table the name by ISO 230-7, ``ECC``.
        """
        if self.table:
            return Verbatim(f"E{2 * self.table.upper()}")
        if self.kind == CIRCLE:
            about = np.flatnonzero(np.abs(self.travel) > _ALONG)
            return say("circle {plane}", plane=Verbatim(("YZ", "ZX", "XY")[about[0]] if len(about) else "–"))
        read = np.flatnonzero(np.abs(self.sense) > _ALONG)
        if self.axis and len(read):
            return Verbatim(f"{self.axis}{'r' if self.kind == TURNING else 't'}{AXES[read[0]]}")
        return direction_words(self.travel)


def scatter(run: Run, readings: Floats, repeat: Ints) -> tuple[float, int]:
    """Sum of squares of readings (k,) of a run about the means of targets and repeats, and its degrees of freedom."""
    where = np.column_stack([np.round(run.positions / _SAME_MM), run.directions])
    blocks = [
        np.unique(where, axis=0, return_inverse=True)[1].ravel(),
        np.unique(repeat, return_inverse=True)[1].ravel(),
    ]
    design = np.hstack([np.eye(block.max() + 1)[block] for block in blocks])
    fitted, _, rank, _ = np.linalg.lstsq(design, readings, rcond=None)
    return float(np.sum((readings - design @ fitted) ** 2)), len(readings) - int(rank)


def roughness(run: Run, readings: Floats, repeat: Ints) -> tuple[float, int]:
    """Sum of squares, and how many, of what readings (k,) of a run are off the cubic through two neighbours on either side.

    Each over what white noise of one makes of it, so that a bow is none.
    """
    squares, count = 0.0, 0
    groups = np.unique(np.column_stack([run.directions, repeat]), axis=0, return_inverse=True)[1].ravel()
    for own in rows_by(groups):
        order = own[np.argsort(run.positions[own], kind="stable")]
        at, read = run.positions[order], readings[order]
        if len(at) < _CUBIC or np.diff(at).min() < _SAME_MM:
            continue
        where = np.arange(2, len(at) - 2)
        near = where[:, None] + [-2, -1, 1, 2]
        off = at[near][:, :, None] - at[near][:, None, :]
        ahead = np.where(np.eye(4, dtype=bool), 1.0, at[where, None, None] - at[near][:, None, :])
        weight = np.prod(ahead / np.where(np.eye(4, dtype=bool), 1.0, off), axis=2)
        squares += float(
            np.sum((read[where] - np.sum(weight * read[near], axis=1)) ** 2 / (1 + np.sum(weight**2, axis=1)))
        )
        count += len(where)
    return squares, count


def reference_shape(run: Run, at: Floats) -> Floats:
    """What an error of 1 of the reference changes of readings at positions of a run: a scale, a rotation, a bow, a radius."""
    if run.kind == CIRCLE:
        return np.ones(len(at))
    part = (at - at.min()) / max(float(np.ptp(at)), _SAME_MM)
    return np.asarray(4 * part * (1 - part) if run.kind == ACROSS else part)


def _beside(points: Points, runs: tuple[Run, ...], column: str) -> dict[tuple[float, ...], list[Run]]:
    """Runs across the travel that a column says something of, by travel, what is read, and that."""
    found: dict[tuple[float, ...], list[Run]] = {}
    values = points.columns.get(column, np.zeros(len(points)))
    for run in runs:
        if run.kind == ACROSS and values[run.rows].any():
            found.setdefault((*run.travel.round(3), *run.sense.round(3), float(values[run.rows][0])), []).append(run)
    return found


def profiles(points: Points, runs: tuple[Run, ...]) -> Floats:
    """(n, q) freedoms of straightedges, whose profile less a line is read with the sign of ``straightedge`` (reversal)."""
    blocks, signs = [np.zeros((len(points), 0))], points.columns.get(STRAIGHTEDGE, np.zeros(len(points)))
    for own in {key[:6] for key in _beside(points, runs, STRAIGHTEDGE)}:
        both = [run for sign in (-1.0, 1.0) for run in _beside(points, runs, STRAIGHTEDGE).get((*own, sign), [])]
        rows = np.concatenate([run.rows for run in both])
        at = np.concatenate([run.positions + run.start for run in both])
        targets, index = np.unique(np.round(at, 3), return_inverse=True)
        line = np.column_stack([np.ones(len(targets)), targets - targets.mean()])
        shape = scipy.linalg.null_space(line.T)
        block = np.zeros((len(points), shape.shape[1]))
        block[rows] = signs[rows, None] * shape[index.ravel()]
        blocks.append(block)
    return np.hstack(blocks)


def reversed_profile(points: Points, runs: tuple[Run, ...], readings: Floats, where: str | None) -> Floats:
    """(n,) what of readings (n,) is the straightedge's: half the difference of its two positions, target by target."""
    found, sign = np.zeros(len(points)), points.columns.get(STRAIGHTEDGE, np.zeros(len(points)))
    whole = _beside(points, runs, STRAIGHTEDGE)
    for key, there in whole.items():
        back = whole.get((*key[:6], -1.0), [])
        if key[6] < 0 or not back:
            continue
        means = []
        for side in (there, back):
            at = np.round(np.concatenate([run.positions + run.start for run in side]), 3)
            flat = [
                readings[run.rows] - np.polyval(np.polyfit(run.positions, readings[run.rows], 1), run.positions)
                for run in side
            ]
            targets, index = np.unique(at, return_inverse=True)
            means.append((targets, np.bincount(index.ravel(), np.concatenate(flat)) / np.bincount(index.ravel())))
        common, *shared = np.intersect1d(means[0][0], means[1][0], return_indices=True)
        if not len(common):
            problem = f"measurement {there[0].measurement} and the straightedge turned over share no position"
            raise CmmUqError(problem, where=where or "recording", fix="Record both at the same targets")
        own = 0.5 * (means[0][1][shared[0]] - means[1][1][shared[1]])
        for run in (*there, *back):
            found[run.rows] = sign[run.rows] * np.interp(run.positions + run.start, common, own)
    return found


def squares(points: Points, runs: tuple[Run, ...], where: str | None) -> tuple[Floats, Floats]:
    """Runs along the two legs of a square: (n, q) the turn of each setting, per mm, and (n,) of its angle less 90°, per rad.

    The leg that the later run lies along carries the angle's error: with 90° + δ it leans by δ away from the other.
    """
    turns, angle = [np.zeros((len(points), 0))], np.zeros(len(points))
    settings = _beside(points, runs, SQUARE)
    for setting in sorted({key[6] for key in settings}):
        legs = [run for key, each in settings.items() if key[6] == setting for run in each]
        first, last = legs[0], next((run for run in legs if abs(run.travel @ legs[0].travel) < _ACROSS), legs[0])
        pairs = ((first, last), (last, first))
        lie = all(
            any(min(abs(run.travel @ leg.travel), abs(run.sense @ other.travel)) > _ALONG for leg, other in pairs)
            for run in legs
        )
        if first is last or not lie:
            problem = f"square {setting:g} has no runs along two legs, each read along the other"
            fix = "Give the runs along both legs of one setting the same number in the column square, 0 the others"
            raise CmmUqError(problem, where=where or "recording", fix=fix)
        normal, turn = np.cross(first.travel, last.travel), np.zeros((len(points), 1))
        for run in legs:
            along = run.positions + run.start
            turn[run.rows, 0] = (run.sense @ np.cross(normal, run.travel)) * along / METRE
            if abs(run.travel @ last.travel) > _ALONG:
                angle[run.rows] = (run.sense @ first.travel) * along
        turns.append(turn)
    return np.hstack(turns), angle


def kinds_of(runs: tuple[Run, ...], count: int) -> NDArray[Any]:
    """(n,) kind of each reading."""
    found = np.empty(count, dtype=object)
    for run in runs:
        found[run.rows] = run.kind
    return found


def tables_of(runs: tuple[Run, ...], count: int, where: str | None) -> Floats:
    """(n,) 1 where a rotary table is read, else 0; both in one recording are refused."""
    found = np.zeros(count)
    for run in runs:
        found[run.rows] = float(bool(run.table))
    if np.ptp(found) > 0:
        fix = "Record those of the table as a job of their own"
        raise CmmUqError("runs of carriages beside runs of a rotary table", where=where or "recording", fix=fix)
    return found


def senses_of(runs: tuple[Run, ...], count: int) -> tuple[Floats, Floats]:
    """(n, 3) along which each reading sees displacements, and (n, 3) the way along its arm, zero without one."""
    sense, arm = np.zeros((count, 3)), np.zeros((count, 3))
    for run in runs:
        sense[run.rows] = run.sense
        if run.kind == TURNING:
            arm[run.rows] = _arm(run)
            sense[run.rows] = np.cross(run.sense, _arm(run))
            if run.table:  # what stands on a table goes against its error as coordinates on it show that
                sense[run.rows] *= -1
    return sense, arm


def _arm(run: Run) -> Floats:
    """(3,) unit vector across the axis of a rotation: along the travel where that is across, of a roll any other."""
    along = run.travel - (run.travel @ run.sense) * run.sense
    if np.linalg.norm(along) < 0.5:
        along = np.cross(run.sense, np.eye(3)[int(np.argmin(np.abs(run.sense)))])
    return np.asarray(along / np.linalg.norm(along))


def vectors(points: Points, names: tuple[str, ...]) -> Floats:
    """(n, 3) of columns, those that are not there being zero."""
    return np.column_stack([points.columns.get(name, np.zeros(len(points))) for name in names])


def circle_axes(run: Run) -> Floats:
    """(3, 2) unit vectors in the plane of a circle: where its angles begin, and where they grow to."""
    first = np.eye(3)[(int(np.argmax(np.abs(run.travel))) + 1) % 3]
    first = first - (first @ run.travel) * run.travel
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(run.travel, first)])


def _circle(points: Points, number: int, rows: Ints, senses: Floats) -> Run | None:
    """A run read along the radii of a circle, by unit vectors (k, 3) outward; ``None`` where it is none."""
    off, turned = points.xyz[rows] - points.xyz[rows].mean(axis=0), senses - senses.mean(axis=0)
    radius = np.sum(off * turned) / np.sum(turned**2)
    axis = np.linalg.svd(senses, full_matrices=False)[2][2]
    axis = axis * np.sign(axis[int(np.argmax(np.abs(axis)))])
    unit = max(np.abs(np.linalg.norm(senses, axis=1) - 1).max(), np.abs(senses @ axis).max())
    senses = senses / np.linalg.norm(senses, axis=1)[:, None]
    if not radius > 0 or np.linalg.norm(off - radius * turned, axis=1).max() > _ROUND * radius or unit > _UNIT:
        return None
    run = Run(number, CIRCLE, rows, axis, senses, 0.0, np.zeros(0), np.zeros(0), round(float(radius), 4))
    if START in points.columns:
        run = replace(run, radius=float(points.columns[START][rows[0]]))
    along, across = (senses @ circle_axes(run)).T
    forward = np.sum(vectors(points, APPROACHES)[rows] * np.cross(axis, senses), axis=1)
    angles = np.round(np.degrees(np.arctan2(across, along)), 3) % 360
    return replace(run, positions=angles, directions=np.sign(np.round(forward, 9)))


def runs_of(points: Points, where: str | None) -> tuple[Run, ...]:
    """The runs of a recording; what is none is refused."""
    numbers = zip(np.unique(points.measurement).tolist(), rows_by(points.measurement), strict=True)
    return tuple(_run(points, number, rows, where) for number, rows in numbers)


def _run(points: Points, number: int, rows: Ints, where: str | None) -> Run:
    own, xyz, whose = points.measurement == number, points.xyz[rows], f"measurement {number}"

    def check(wrong: bool | NDArray[np.bool_], problem: str, fix: str) -> None:
        refuse(points, own & wrong, where, problem, fix)

    if (turned := _of_table(points, number, rows)) is not None:
        return turned
    travel = xyz[int(np.argmax(np.linalg.norm(xyz - xyz[0], axis=1)))] - xyz[0]
    length = float(np.linalg.norm(travel))
    still = f"{whose} stands still: all its positions are one"
    check(length < _SAME_MM, still, "Give the position of every reading as x_mm, y_mm, z_mm")
    far = np.ptp(xyz, axis=0) / np.ptp(points.machine.travel_mm, axis=1)
    beyond = f"{whose} goes {far.max():.3g} times the travel of {AXES[int(far.argmax())].upper()}"
    check(bool(far.max() > _BEYOND), beyond, "Give positions in mm, or mend travel_mm in [machine]")
    travel = travel / length
    travel = travel * np.sign(travel[int(np.argmax(np.abs(travel)))])
    read, turn = vectors(points, READ), vectors(points, TURN)
    turns = bool(np.any(turn[rows]))
    senses = turn[rows] if turns else read[rows]
    if not np.any(senses):
        senses = np.tile(travel, (len(rows), 1))
    both = "has both read_x … and turn_x …: a reading is one of them"
    check(np.any(turn != 0, axis=1) & np.any(read != 0, axis=1), both, "Put 0 into the three that are not read")
    if not turns and np.ptp(senses, axis=0).max() > _SAME_MM and (circle := _circle(points, number, rows, senses)):
        return circle
    sense, other = senses[0], np.zeros(len(points), dtype=bool)
    other[rows] = np.abs(senses - sense).max(axis=1) > _SAME_MM
    check(
        other,
        f"{whose} reads along several directions, which are no radii of a circle",
        "Number each quantity as a measurement of its own; on a circle give read_x … outward at each target",
    )
    no_unit = bool(abs(np.linalg.norm(sense) - 1) > _UNIT)
    check(no_unit, "what is read has no unit length", "Give read_x … or turn_x … as a unit vector")
    sense = sense / np.linalg.norm(sense)
    cosine = abs(float(sense @ travel))
    kind = TURNING if turns else ALONG if cosine > _ALONG else ACROSS
    slanting = f"{whose} reads neither along its travel nor across it"
    check(kind == ACROSS and cosine > _ACROSS, slanting, "Mend read_x, read_y, read_z, or the positions")
    along, known = xyz @ travel, points.columns
    start = float(known[START][rows[0]]) if START in known else float(along.min())
    positions = known[TARGET][rows] if TARGET in known else along - start
    targets = len(np.unique(np.round(positions / _SAME_MM)))
    few = f"{whose} has {targets} positions: a straightness needs three"
    check(kind == ACROSS and targets < 3, few, "Record more positions, or leave it out")
    directions = np.sign(np.round(vectors(points, APPROACHES)[rows] @ travel, 9))
    return Run(number, kind, rows, travel, sense, start, positions, directions)


def _of_table(points: Points, number: int, rows: Ints) -> Run | None:
    """A run of a rotary table, read about its axis while the carriages stand still; ``None`` where it is none."""
    machine, turn = points.machine, vectors(points, TURN)[rows]
    tables = machine.tables if isinstance(machine, RotaryMachine) else ()
    for table in tables if np.ptp(points.xyz[rows], axis=0).max() < _STILL_MM else ():
        about, zero = np.eye(3)[table.about], np.zeros(len(points))
        read = points.columns.get(table.column, zero)[rows]
        if np.ptp(read) > 0 and np.abs(np.abs(turn @ about) - 1).max() < _UNIT:
            sense = np.sign(turn[0] @ about) * about
            ways = np.sign(points.columns.get(f"{table.letter}_approach", zero)[rows])
            at = read - read.min()
            return Run(number, TURNING, rows, about, sense, float(read.min()), at, ways, table=table.letter)
    return None


def faces_of(
    points: Points, runs: tuple[Run, ...], readings: Floats, where: str | None, *, certified: bool
) -> tuple[Floats, Floats]:
    """(n,) what of readings (n,), ″, is the polygon's, by its certificate or by closure; and u of it, by closure alone.

    Of several settings of a polygon on the table each reading is the sum of what the table errs there, of its face's deviation
    from that of the first, and of a zero of the setting: least squares part them, or what they leave open is refused.
    """
    n, rows = len(points), np.concatenate([run.rows for run in runs])
    face = points.columns[FACE]
    if certified:
        known = points.columns.get(FACE_ANGLE, np.zeros(n))
        return np.where(np.isin(np.arange(n), rows), known - known[rows][np.argmin(face[rows])], 0.0), np.zeros(n)
    at, way, setting = np.zeros((3, n))
    for run in runs:
        at[run.rows], way[run.rows] = (run.positions + run.start) % 360, run.directions
        setting[run.rows] = run.measurement
    numbers, which = np.unique(face[rows], return_inverse=True)
    blocks = [np.eye(len(numbers))[which.ravel()][:, 1:]]
    for each in (np.column_stack([np.round(at, 3), way])[rows], setting[rows, None]):
        index = np.unique(each, axis=0, return_inverse=True)[1].ravel()
        blocks.append(np.eye(index.max() + 1)[index])
    design = np.hstack(blocks)
    inverse = np.linalg.pinv(design, rcond=1e-9)
    found = inverse @ readings[rows]
    q, rank = len(numbers) - 1, int(np.linalg.matrix_rank(design))
    dof = len(rows) - rank
    # all positions and all zeros are known but for a constant; of one setting of several that are planned they are not yet
    if len(points.lines) and (rank < design.shape[1] - 1 or not dof):
        raise CmmUqError(
            "the settings of the polygon do not part its faces from the table's errors",
            where=where or "recording",
            fix="Read all faces in two settings one face apart, or more, or give face_arcsec and u_polygon_arcsec",
        )
    s = np.sqrt(np.sum((readings[rows] - design @ found) ** 2) / max(dof, 1))
    profile, u = np.zeros(n), np.zeros(n)
    profile[rows] = blocks[0] @ found[:q]
    u[rows] = s * (blocks[0] @ np.linalg.norm(inverse[:q], axis=1))
    return profile, u
