"""What a run along an axis is: where it goes, what is read along it, and which readings belong to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import direction_words
from cmm_uq.analysis.screening.shape import rows_by
from cmm_uq.artefacts.kinds import APPROACHES, READ, TURN
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.machine.model.recorded import place

ALONG, ACROSS, TURNING = "along", "across", "turning"
READINGS = {False: "reading_um", True: "reading_arcsec"}  # by whether a rotation is read
# columns of the artefact's own points: whether one is the other end of an arm; the target along the run from its first, and
# where that is; the mean of the readings of one zero; mm
END, TARGET, START, ZERO = "_arm_end", "_target_mm", "_start_mm", "_zero_mm"
_UNIT, _SAME_MM = 0.01, 1e-6
_ALONG, _ACROSS = 0.999, 0.05  # cosines between what is read and the travel


@dataclass(frozen=True, eq=False)
class Run:
    """The readings of one measurement: all repeats, in both directions."""

    measurement: int
    kind: str  # ALONG, ACROSS or TURNING
    rows: Ints  # (k,) of the recording
    travel: Floats  # (3,) unit vector of the travel, in the sense of growing positions
    sense: Floats  # (3,) unit vector along which, or about which, the instrument reads
    start: float  # where the first target is along the travel, mm
    positions: Floats  # (k,) of the targets along the travel, from the first, mm
    directions: Floats  # (k,) −1 or +1, in which each position was approached; 0 where nobody says

    @property
    def axis(self) -> str:
        """The carriage that moves; empty where several do."""
        moved = np.flatnonzero(np.abs(self.travel) > _ALONG)
        return AXES[moved[0]] if len(moved) else ""

    @property
    def quantity(self) -> Text:
        """Name in VDI/VDE 2617 of the parametric error that it shows, as ``xtx``; its direction where it shows several."""
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


def kinds_of(runs: tuple[Run, ...], count: int) -> NDArray[Any]:
    """(n,) kind of each reading."""
    found = np.empty(count, dtype=object)
    for run in runs:
        found[run.rows] = run.kind
    return found


def senses_of(runs: tuple[Run, ...], count: int) -> tuple[Floats, Floats]:
    """(n, 3) along which each reading sees displacements, and (n, 3) the way along its arm, zero without one."""
    sense, arm = np.zeros((count, 3)), np.zeros((count, 3))
    for run in runs:
        sense[run.rows] = run.sense
        if run.kind == TURNING:
            arm[run.rows] = _arm(run)
            sense[run.rows] = np.cross(run.sense, _arm(run))
    return sense, arm


def _arm(run: Run) -> Floats:
    """(3,) unit vector across the axis of a rotation: along the travel where that is across, of a roll any other."""
    along = run.travel - (run.travel @ run.sense) * run.sense
    if np.linalg.norm(along) < 0.5:
        along = np.cross(run.sense, np.eye(3)[int(np.argmin(np.abs(run.sense)))])
    return np.asarray(along / np.linalg.norm(along))


def refuse(points: Points, rows: NDArray[np.bool_], where: str | None, problem: str, fix: str) -> None:
    if np.any(rows):
        raise CmmUqError(problem, where=place(points, rows, where), fix=fix)


def _vectors(points: Points, names: tuple[str, ...]) -> Floats:
    """(n, 3) of columns, those that are not there being zero."""
    return np.column_stack([points.columns.get(name, np.zeros(len(points))) for name in names])


def runs_of(points: Points, where: str | None) -> tuple[Run, ...]:
    """The runs of a recording; what is none is refused."""
    read, turn = _vectors(points, READ), _vectors(points, TURN)
    found = []
    for number, rows in zip(np.unique(points.measurement).tolist(), rows_by(points.measurement), strict=True):
        own = points.measurement == number
        far = rows[int(np.argmax(np.linalg.norm(points.xyz[rows] - points.xyz[rows[0]], axis=1)))]
        travel = points.xyz[far] - points.xyz[rows[0]]
        length = float(np.linalg.norm(travel))
        if length < _SAME_MM:
            refuse(
                points,
                own,
                where,
                f"measurement {number} stands still: all its positions are one",
                "Give the position of every reading as x_mm, y_mm, z_mm",
            )
        travel = travel / length
        travel = travel * np.sign(travel[int(np.argmax(np.abs(travel)))])
        turns = bool(np.any(turn[rows]))
        senses = turn[rows] if turns else read[rows]
        if not turns and not np.any(senses):
            senses = np.tile(travel, (len(rows), 1))
        both = own & np.any(turn != 0, axis=1) & np.any(read != 0, axis=1)
        refuse(
            points,
            both,
            where,
            "has both read_x … and turn_x …: a reading is one of them",
            "Put 0 into the three that are not read",
        )
        sense, other = senses[0], np.zeros(len(points), dtype=bool)
        other[rows] = np.abs(senses - sense).max(axis=1) > _SAME_MM
        refuse(
            points,
            other,
            where,
            f"measurement {number} reads along several directions",
            "Number each quantity as a measurement of its own",
        )
        if abs(np.linalg.norm(sense) - 1) > _UNIT:
            refuse(points, own, where, "what is read has no unit length", "Give read_x … or turn_x … as a unit vector")
        sense = sense / np.linalg.norm(sense)
        cosine = abs(float(sense @ travel))
        kind = TURNING if turns else ALONG if cosine > _ALONG else ACROSS
        if kind == ACROSS and cosine > _ACROSS:
            refuse(
                points,
                own,
                where,
                f"measurement {number} reads neither along its travel nor across it",
                "Mend read_x, read_y, read_z, or the positions",
            )
        along = points.xyz[rows] @ travel
        start = float(points.columns[START][rows[0]]) if START in points.columns else float(along.min())
        positions = points.columns[TARGET][rows] if TARGET in points.columns else along - start
        targets = np.unique(np.round(positions / _SAME_MM))
        if kind == ACROSS and len(targets) < 3:
            refuse(
                points,
                own,
                where,
                f"measurement {number} has {len(targets)} positions: a straightness needs three",
                "Record more positions, or leave it out",
            )
        directions = np.sign(np.round(_vectors(points, APPROACHES)[rows] @ travel, 9))
        found.append(Run(number, kind, rows, travel, sense, start, positions, directions))
    return tuple(found)
