"""Points on their way into the recording: kept, then shown as accepted, judged, and written with their set-up."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cmm_uq.base.errors import OutputError
from cmm_uq.base.messages import Text, Verbatim, commas, say, signed
from cmm_uq.laboratory.live.journal import Moment
from cmm_uq.laboratory.live.judging import Judge, PointJudgement
from cmm_uq.laboratory.live.lead import Lead, PlannedPoint, Run
from cmm_uq.laboratory.live.recorder import COORDINATES, Recorder
from cmm_uq.laboratory.live.story import Story
from cmm_uq.laboratory.live.table import LiveRecording, rows_of


class Accepting:
    """What happens to a point: kept, shown, judged, written."""

    def __init__(
        self,
        recorder: Recorder,
        lead: Lead,
        judge: Judge,
        table: LiveRecording,
        repeats_most: int,
        tell: Callable[[Text], None],
    ) -> None:
        self._recorder, self._lead, self._judge, self._table = recorder, lead, judge, table
        self._repeats_most, self._tell = repeats_most, tell
        self._due: list[Run] = []
        self._waiting: list[PlannedPoint] = []
        self._written = -1
        self.judged = PointJudgement()

    @property
    def story(self) -> Story:
        return self._recorder.story

    def accept(
        self,
        points: Sequence[tuple[PlannedPoint, Mapping[str, float]]],
        moment: Moment,
        how: str,
        of: Mapping[str, Any],
    ) -> None:
        """Keep points, and say so; where there is no room they wait, and it is said when they are kept."""
        for step, columns in points:
            self._recorder.accept(step.place, columns, moment, how, of=of)
        self._waiting += [step for step, _ in points]
        if self._recorder.commit(streams=False):
            self._accepted()

    def kept(self) -> None:
        """Go on, now that everything is on the disk."""
        self._accepted()
        if self._written == self.story.changes:
            return
        self._written = self.story.changes
        self._judge_complete()
        self.write()

    def write(self) -> None:
        """Write the recording where it grew."""
        try:
            self._table.write(self.story, self._lead)
        except OutputError as error:
            self._written = -1
            why = Verbatim(str(error))
            self._tell(say("the recording could not be written, the journal has it all: {why}", why=why))

    def _accepted(self) -> None:
        """Say it, now that they are on the disk, and what is to be said of them."""
        steps, self._waiting = self._waiting, []
        for step in steps:
            if (point := self.story.by_place.get(step.place)) is None:
                continue
            told = commas(signed(point.columns[name], ".4f") for name in COORDINATES)
            self._tell(say("accepted: measurement {m}, point {p}, repeat {r}: {at}", m=step.place[0], p=step.place[1],
                           r=step.place[2], at=told))  # fmt: skip
            self.judged = self._judge.point(step, self.story, self._lead)
            for text in self.judged.shown:
                self._tell(text)
            self._warn(self.judged)
            run = (step.place[0], step.place[2])
            if not self._lead.missing(run, self.story) and run not in self._due:
                self._due.append(run)

    def _judge_complete(self) -> None:
        rows = rows_of(self.story, self._lead)
        there = {(row.point.place[0], row.point.place[2]) for row in rows}
        for run in [run for run in self._due if run in there]:
            self._due.remove(run)
            judged = self._judge.run(run, rows, repeats_most=self._repeats_most)
            self.judged = PointJudgement((*self.judged.shown, *judged.shown), (), judged.again)
            for text in judged.shown:
                self._tell(text)
            self._warn(judged)
            if judged.again is not None:
                self._tell(say("REPEAT? {why} (repeat does)", why=judged.again))

    def _warn(self, judged: PointJudgement) -> None:
        for warning in judged.warnings:
            self._tell(say("WARNING: {why}", why=warning))
