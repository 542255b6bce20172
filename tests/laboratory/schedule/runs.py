"""Scheduled runs whose reports cost nothing: a report writes what a real one does, or fails as it is told to."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cmm_uq.base.output import Owner, staged
from cmm_uq.laboratory.schedule.jobs import JobFolder, JobReporting
from cmm_uq.laboratory.schedule.notices import Notice, Outbox
from cmm_uq.laboratory.schedule.run import RunClock, ScheduledRun
from cmm_uq.laboratory.schedule.settings import RunTable
from cmm_uq.laboratory.schedule.state import FolderState, RecordsState
from tests.laboratory.schedule.told import Kept

JOB = '[job]\nid = "{id}"\n[recording]\nfile = "points.csv"\n'


def made(root: Path, name: str, recording: str = "1,2\n", id: str = "") -> Path:  # noqa: A002
    folder = root / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "job.toml").write_text(JOB.format(id=id or name))
    (folder / "points.csv").write_text(recording)
    return folder


@dataclass(eq=False)
class Jobs:
    root: Path
    channel: Kept = field(default_factory=Kept)
    before: Callable[[JobFolder], None] = lambda job: None
    settings: dict[str, Any] = field(default_factory=dict)
    now: dt.datetime = field(default_factory=lambda: dt.datetime.now(dt.UTC) + dt.timedelta(minutes=10))
    state: FolderState | None = None
    due: Callable[[dt.date], Iterable[Notice]] = lambda on: ()
    folders: list[Path] = field(default_factory=list)
    reported: list[str] = field(default_factory=list)
    slept: list[float] = field(default_factory=list)
    lines: list[dict[str, Any]] = field(default_factory=list)
    logged: list[str] = field(default_factory=list)
    name: str = "reports"  # of the folder of the reports
    told: bool = True  # by the channel; else by exit codes alone
    asleep: Callable[[], None] = lambda: None

    @property
    def out(self) -> Path:
        return self.root / self.name

    def report(self, job: JobFolder) -> bytes:
        self.before(job)
        inputs = {name: (job.folder / name).read_bytes() for name in ("job.toml", "points.csv")}
        word = inputs["points.csv"].decode().strip()
        decision = word if word in ("fail", "incomplete") else "pass"
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()}
        data = {"job": {"id": job.id, "machine": "CMM 3", "inputs_sha256": hashes},
                "conformity": [{"standard": "S", "characteristic": "E0", "decision": decision}],
                "diagnosis": {"verdict": "explained" if word == "mismatch" else "consistent"}}  # fmt: skip
        results = json.dumps(data).encode()
        with staged(self.out / job.id, Owner("report", job.id)) as place:
            place.write({"results.json": results, "certificate.html": word.encode()})
        self.reported.append(job.id)
        return results

    def run(self, *, dry: bool = False, strict: bool = False) -> int:
        self.lines.clear()
        self.reported.clear()
        state = self.state or FolderState(self.out)
        clock = RunClock(lambda: self.now, lambda: sum(self.slept), self._sleep)
        outbox = Outbox(self.out, [self.channel] if self.told else [], state, clock.moment)
        settings = RunTable(**{"back_off_s": 1.0, **self.settings})
        work = JobReporting(self.out, state, self.report, outbox.announce)
        tell, log, folders = self.lines.append, self.logged.append, self.folders or [self.root]
        return ScheduledRun(folders, settings, work, outbox, self.due, tell, log, clock, dry, strict).through()

    def _sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.asleep()

    def states(self) -> dict[str, str]:
        return {line["job"] or Path(line["folder"]).name: line["state"] for line in self.lines if "state" in line}


class FolderResults:
    """The state of records, of reports that are made up and not recorded: those are found in their folder."""

    def __init__(self, state: RecordsState) -> None:
        self.sent, self.add_sent, self.claim = state.sent, state.add_sent, state.claim
        folder = FolderState(state.out)
        self.results, self.released, self.is_draft = folder.results, folder.released, folder.is_draft
