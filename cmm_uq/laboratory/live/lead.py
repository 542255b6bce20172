"""What comes next: the plan's set-ups in order, those that were left out or asked for again, and where a point belongs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.laboratory.live.story import Place, Point, Story

_ON_LINE = 1e-6  # of a set-up's length: what its points may lie off a line, for distances to be typed along it
Run = tuple[int, int]  # measurement and repeat


@dataclass(frozen=True, eq=False)
class PlannedPoint:
    """A point to be measured."""

    place: Place
    xyz: Floats  # (3,) where the plan has it, mm, in the coordinates that are recorded
    columns: Mapping[str, float]  # what the plan says of it besides: references, approach, normals


@dataclass(frozen=True, eq=False)
class Lead:
    """A plan, as it is followed; unmeasured columns say what will be measured, not what is known."""

    plan: Points  # nominal points, in the order in which they are measured
    titles: Mapping[int, Text]  # of measurements, in words, by their numbers
    unmeasured: frozenset[str] = frozenset({"time_s"})

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """Every planned measurement and repeat, in order."""
        return tuple(self.plan.run_of(group) for group in range(len(self.plan.rows_of_groups)))

    def all_runs(self, story: Story) -> list[Run]:
        found = list(self.runs)
        for run in story.asked:
            if run not in found:
                last = max(i for i, (measurement, _) in enumerate(found) if measurement == run[0])
                found.insert(last + 1, run)
        return [run for run in found if run not in story.skipped]

    def steps(self, run: Run) -> list[PlannedPoint]:
        """Points of a measurement and repeat; one that was asked for besides has those of the first."""
        if run not in self._steps:
            self._steps[run] = self._found(run)
        return self._steps[run]

    def _found(self, run: Run) -> list[PlannedPoint]:
        rows = self._rows(run)
        names = [name for name in self.plan.columns if name not in self.unmeasured]
        return [
            PlannedPoint(
                (run[0], int(self.plan.point[row]), run[1]), self.plan.xyz[row],
                {name: float(self.plan.columns[name][row]) for name in names},
            )
            for row in rows
        ]  # fmt: skip

    def missing(self, run: Run, story: Story) -> list[PlannedPoint]:
        """Points of it that are still to be measured."""
        return self._left(run, story.by_place)

    def next(self, story: Story, wanted: Run | None = None) -> PlannedPoint | None:
        """The point that comes next, of what is wanted, else begun, else the first; ``None`` when all is measured."""
        runs = self.all_runs(story)
        last = list(story.points.values())[-1].place if story.points else None
        begun = (last[0], last[2]) if last is not None else None
        first = [run for run in (wanted, begun) if run is not None and run in runs]
        taken = story.by_place
        for run in (*first, *runs):
            if left := self._left(run, taken):
                return left[0]
        return None

    def complete(self, story: Story) -> list[Run]:
        """Measurements and repeats of which every point is there."""
        taken = story.by_place
        known = {(measurement, repeat) for measurement, _, repeat in taken}
        return [run for run in self.all_runs(story) if run in known and not self._left(run, taken)]

    def progress(self, story: Story) -> tuple[int, int]:
        """Set-ups with their repeats that are complete, and all."""
        return len(self.complete(story)), len(self.all_runs(story))

    def more(self, run: Run, story: Story) -> Run:
        """The next repeat of a measurement that nobody has planned or asked for yet."""
        return run[0], 1 + max(repeat for measurement, repeat in (*self.runs, *story.asked) if measurement == run[0])

    def run_of(self, measurement: int, story: Story) -> Run:
        """The first measurement and repeat of a number that lacks a point."""
        of_it = [run for run in self.all_runs(story) if run[0] == measurement]
        for run in of_it:
            if self.missing(run, story):
                return run
        numbers = self.plan.measurement
        problem = f"measurement {measurement} is complete" if of_it else f"the plan has no measurement {measurement}"
        raise CmmUqError(
            problem, fix=f"It has {numbers.min()} to {numbers.max()}; repeat asks for one more of the last"
        )

    def places(
        self, story: Story, ahead: PlannedPoint | None, numbers: Sequence[Place | None]
    ) -> list[PlannedPoint] | Text:
        """Where a file's points belong, as far as the plan has room: by their numbers, else as it goes on; else why not."""
        runs, taken = self.all_runs(story), story.by_place
        start = runs.index((ahead.place[0], ahead.place[2])) if ahead is not None else 0
        left = [step for run in (*runs[start:], *runs[:start]) for step in self._left(run, taken)]
        if None in numbers:
            return left[: len(numbers)]
        by_place, found = {step.place: step for step in left}, []
        for place in numbers:
            if place is None or place not in by_place:
                m, p, r = place or (0, 0, 0)
                return say("measurement {m}, point {p}, repeat {r} is not open in the plan", m=m, p=p, r=r)
            found.append(by_place.pop(place))
        return found

    def at_distance(self, step: PlannedPoint, distance_mm: float, story: Story) -> list[tuple[PlannedPoint, Floats]]:
        """Where a point lies that is so far from the first of its set-up, and the first itself where that is not there yet."""
        run = (step.place[0], step.place[2])
        steps = self.steps(run)
        about = np.array([other.xyz for other in steps]) - steps[0].xyz
        far = about[int(np.argmax(np.linalg.norm(about, axis=1)))]
        length = float(np.linalg.norm(far))
        beside = about - np.outer(about @ far, far) / (length**2 or 1.0)
        if length == 0 or float(np.linalg.norm(beside, axis=1).max()) > _ON_LINE * length:
            raise CmmUqError("the points of this set-up lie on no line, so a distance does not say where",
                             fix="Type three coordinates: x y z")  # fmt: skip
        taken = story.by_place
        begun = taken.get(steps[0].place)
        start = steps[0].xyz if begun is None else np.array([begun.columns[f"{axis}_mm"] for axis in "xyz"])
        target = step if step.place != steps[0].place else steps[1]
        along = target.xyz - steps[0].xyz
        first = [] if begun is not None else [(steps[0], start)]
        return [*first, (target, start + distance_mm * along / np.linalg.norm(along))]

    def _left(self, run: Run, taken: Mapping[Place, Point]) -> list[PlannedPoint]:
        return [step for step in self.steps(run) if step.place not in taken]

    @cached_property
    def _steps(self) -> dict[Run, list[PlannedPoint]]:
        return {}

    def _rows(self, run: Run) -> Ints:
        for repeat in (run[1], None):
            same = self.plan.measurement == run[0]
            if repeat is None and same.any():
                return np.flatnonzero(same & (self.plan.repeat == self.plan.repeat[same].min()))
            if (rows := np.flatnonzero(same & (self.plan.repeat == run[1]))).size:
                return rows
        raise CmmUqError(f"the plan has no measurement {run[0]}", fix="Go on with one that it has")


def titles_of(measurements: Sequence[int], titles: Sequence[Text]) -> dict[int, Text]:
    """Titles by the number of their measurement, of those that have one."""
    return {number: title for number, title in zip(measurements, titles, strict=False) if title}
