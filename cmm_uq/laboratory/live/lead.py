"""What comes next: the plan's set-ups in order, those that were left out or asked for again, and where a point belongs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.laboratory.live.story import Place, Point, Story

_ON_LINE = 1e-6  # of a set-up's length: what its points may lie off a line, for distances to be typed along it
Run = tuple[int, int]  # measurement and repeat


@dataclass(frozen=True, eq=False)
class PlannedPoint:
    place: Place
    xyz: Floats  # (3,) where the plan has it, mm, in the coordinates that are recorded
    columns: Mapping[str, float]  # what the plan says of it besides: references, approach, normals

    @property
    def run(self) -> Run:
        return self.place[0], self.place[2]


@dataclass(frozen=True, eq=False)
class Lead:
    """A plan, as it is followed; unmeasured columns say what will be measured, not what is known."""

    plan: Points  # nominal points, in the order in which they are measured
    titles: Mapping[int, Text]  # of measurements, in words, by their numbers
    unmeasured: frozenset[str] = frozenset({"time_s"})
    _steps: dict[Run, list[PlannedPoint]] = field(default_factory=dict)

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """Every planned measurement and repeat, in order."""
        return tuple(self.plan.run_of(group) for group in range(len(self.plan.rows_of_groups)))

    def all_runs(self, story: Story) -> list[Run]:
        """Those planned and asked for, without those left out."""
        runs = list(self.runs)
        for run in story.asked:
            if run not in runs:
                last = max(i for i, (measurement, _) in enumerate(runs) if measurement == run[0])
                runs.insert(last + 1, run)
        return [run for run in runs if run not in story.skipped]

    def steps(self, run: Run) -> list[PlannedPoint]:
        """Points of a measurement and repeat; one that was asked for besides has those of the first."""
        if run not in self._steps:
            plan = self.plan
            same = plan.measurement == run[0]
            if not same.any():
                raise CmmUqError(f"the plan has no measurement {run[0]}", fix="Go on with one that it has")
            rows = np.flatnonzero(same & (plan.repeat == run[1]))
            if not rows.size:
                rows = np.flatnonzero(same & (plan.repeat == plan.repeat[same].min()))
            columns = {name: values for name, values in plan.columns.items() if name not in self.unmeasured}
            self._steps[run] = [
                PlannedPoint((run[0], int(plan.point[row]), run[1]), plan.xyz[row],
                             {name: float(values[row]) for name, values in columns.items()})
                for row in rows
            ]  # fmt: skip
        return self._steps[run]

    def missing(self, run: Run, story: Story) -> list[PlannedPoint]:
        """Points of it that are still to be measured."""
        return self._left(run, story.by_place)

    def next(self, story: Story, begin_with: Run | None = None) -> PlannedPoint | None:
        """The point that comes next, of a run, else of the one begun, else the first; ``None`` when all is measured."""
        runs, taken = self.all_runs(story), story.by_place
        last = next(reversed(story.points.values()), None)
        first = [begin_with, None if last is None else (last.place[0], last.place[2])]
        for run in (*(run for run in first if run in runs), *runs):
            if run is not None and (left := self._left(run, taken)):
                return left[0]
        return None

    def complete(self, story: Story) -> list[Run]:
        """Measurements and repeats of which every point is there."""
        taken = story.by_place
        begun = {(measurement, repeat) for measurement, _, repeat in taken}
        return [run for run in self.all_runs(story) if run in begun and not self._left(run, taken)]

    def more(self, run: Run, story: Story) -> Run:
        """The next repeat of a measurement that nobody has planned or asked for yet."""
        return run[0], 1 + max(repeat for measurement, repeat in (*self.runs, *story.asked) if measurement == run[0])

    def run_of(self, measurement: int, story: Story) -> Run:
        """The first measurement and repeat of a number that lacks a point."""
        runs = [run for run in self.all_runs(story) if run[0] == measurement]
        for run in runs:
            if self.missing(run, story):
                return run
        numbers = self.plan.measurement
        problem = f"measurement {measurement} is complete" if runs else f"the plan has no measurement {measurement}"
        fix = f"It has {numbers.min()} to {numbers.max()}; repeat asks for one more of the last"
        raise CmmUqError(problem, fix=fix)

    def places(
        self, story: Story, ahead: PlannedPoint | None, numbers: Sequence[Place | None]
    ) -> list[PlannedPoint] | Text:
        """Where a file's points belong, as far as the plan has room: by their numbers, else as it goes on; else why not."""
        runs, taken = self.all_runs(story), story.by_place
        start = runs.index(ahead.run) if ahead is not None else 0
        left = [step for run in (*runs[start:], *runs[:start]) for step in self._left(run, taken)]
        if None in numbers:
            return left[: len(numbers)]
        open_steps, steps = {step.place: step for step in left}, []
        for m, p, r in (place or (0, 0, 0) for place in numbers):
            if (m, p, r) not in open_steps:
                return say("measurement {m}, point {p}, repeat {r} is not open in the plan", m=m, p=p, r=r)
            steps.append(open_steps.pop((m, p, r)))
        return steps

    def at_distance(self, step: PlannedPoint, distance_mm: float, story: Story) -> list[tuple[PlannedPoint, Floats]]:
        """Where a point lies that is so far from the first of its set-up, and the first itself where that is not there yet."""
        steps = self.steps(step.run)
        first = steps[0]
        about = np.array([other.xyz for other in steps]) - first.xyz
        far = about[int(np.argmax(np.linalg.norm(about, axis=1)))]
        length = float(np.linalg.norm(far))
        beside = about - np.outer(about @ far, far) / (length**2 or 1.0)
        if length == 0 or float(np.linalg.norm(beside, axis=1).max()) > _ON_LINE * length:
            fix = "Type three coordinates: x y z"
            raise CmmUqError("the points of this set-up lie on no line, so a distance does not say where", fix=fix)
        begun = story.by_place.get(first.place)
        start = first.xyz if begun is None else np.array([begun.columns[f"{axis}_mm"] for axis in "xyz"])
        target = step if step.place != first.place else steps[1]
        along = target.xyz - first.xyz
        end = (target, start + distance_mm * along / np.linalg.norm(along))
        return [end] if begun is not None else [(first, start), end]

    def _left(self, run: Run, taken: Mapping[Place, Point]) -> list[PlannedPoint]:
        return [step for step in self.steps(run) if step.place not in taken]


def titles_of(measurements: Sequence[int], titles: Sequence[Text]) -> dict[int, Text]:
    """Titles by the number of their measurement, of those that have one."""
    return {number: title for number, title in zip(measurements, titles, strict=False) if title}
