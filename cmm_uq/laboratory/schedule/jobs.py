"""Job folders of a schedule: found, whether they changed, reported where nobody else is at them, and what came of it.

Whether a job changed is decided by the content of job.toml and of every file that it names. Times of files say only whether
somebody is at them: they may lie, and where they cannot be right two looks at the folder decide.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.files.limits import JOB_BYTES, check_file, content_of, text_of
from cmm_uq.base.files.toml_file import toml_of
from cmm_uq.base.output import finish_interrupted, sha256_of
from cmm_uq.base.plugins import told_with_package
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.source import device_name
from cmm_uq.jobs.tables.identification import is_planned
from cmm_uq.laboratory.schedule import state as states
from cmm_uq.laboratory.schedule.notices import Notice, decisions, of_results
from cmm_uq.laboratory.schedule.state import PRIVATE, FolderState, inputs_of

JOB_FILE = "job.toml"

Snapshot = frozenset[tuple[str, int, int, int]]
"""Name, size, and times of change in nanoseconds of every file in a folder."""

_ID = re.compile(r"[A-Za-z0-9._-]{1,100}")
_HEAD = 200  # bytes of a recording that say whether it is a plan still to be measured


@dataclass(frozen=True)
class JobFolder:
    folder: Path
    root: Path  # folder of the schedule that it lies in
    id: str = ""  # of the job; empty where job.toml cannot be read, which its report will say
    recording: str = ""  # name of the file that is recorded; empty where none is named
    planned: bool = False  # whether the recording is still to be made


def job_folders(root: Path, leave_out: Path | None = None) -> Iterator[JobFolder]:
    """Job folders in a folder and below it, in the order of their names; none inside another job, none that is hidden."""
    if not root.is_dir():
        what = "is a file, not a folder" if root.exists() else "no such folder"
        raise CmmUqError(what, where=str(root), fix="Mend its name; if it is on another machine, is it mounted?")
    without = None if leave_out is None else leave_out.resolve()
    for folder, below, files in os.walk(root, onerror=_refuse):
        here = Path(folder)
        if JOB_FILE in files:
            below.clear()
            yield _read(here, root)
        below[:] = sorted(name for name in below if not name.startswith(".") and (here / name).resolve() != without)


def differing(job: JobFolder, inputs: Mapping[str, str]) -> list[str]:
    """Names of the files that are not what they were, by the SHA-256 of every file that was read."""
    changed = [name for name, digest in inputs.items() if sha256_of(job.folder / name) != digest]
    if job.recording:
        beside = provenance_name(job.recording)
        if beside not in inputs and os.path.lexists(job.folder / beside):
            changed.append(beside)  # of a recording taken live: read where it is there
    return changed


def snapshot(folder: Path) -> Snapshot:
    """What lies in a folder now; empty where it is gone."""
    found = []
    for here, below, files in os.walk(folder):
        below[:] = [name for name in below if not name.startswith(".")]
        for name in files:
            path = os.path.join(here, name)  # noqa: PTH118 - of many files
            try:
                status = os.stat(path)  # noqa: PTH116
            except OSError:
                continue
            found.append((path, status.st_size, status.st_mtime_ns, status.st_ctime_ns))
    return frozenset(found)


def quiet_since(seen: Snapshot, now_s: float) -> float:
    """Seconds for which no file of a folder was changed, by their own times; negative where one lies in the future."""
    newest = max((max(changed, moved) for _, _, changed, moved in seen), default=0)
    return now_s - newest / 1e9


def _refuse(error: OSError) -> None:
    raise CmmUqError(f"cannot be read: {error.strerror}", where=str(error.filename), fix="Mend its permissions")


def _read(folder: Path, root: Path) -> JobFolder:
    path = folder / JOB_FILE
    try:
        data = toml_of(text_of(content_of(path, JOB_BYTES, ""), str(path)), str(path))
        identity, name = data["job"]["id"], data.get("recording", {}).get("file", "")
    except (CmmUqError, tomllib.TOMLDecodeError, KeyError, TypeError, AttributeError):
        return JobFolder(folder, root)
    # what is wrong with an id that a job may not have, reading the job says
    if not (isinstance(identity, str) and isinstance(name, str) and _ID.fullmatch(identity)) or (
        set(identity) == {"."} or device_name(identity)
    ):
        return JobFolder(folder, root)
    try:
        planned = "plan" in data
        if (recording := folder / name).exists():
            check_file(recording, "")  # a pipe would be waited for
            with recording.open("rb") as file:
                planned = is_planned(file.read(_HEAD))
    except (CmmUqError, OSError, ValueError):
        planned = False
    return JobFolder(folder, root, identity, name, planned)


Report = Callable[[JobFolder], bytes]
"""Reports a job into its folder below ``out``, and returns contents of results.json."""

REPORTED, UNCHANGED, WAITING, BUSY, GONE = "reported", "unchanged", "waiting", "busy", "gone"
REFUSED, FAILED, WOULD = "refused", "failed", "would report"  # what came of a job


@dataclass(frozen=True)
class JobOutcome:
    job: JobFolder
    state: str  # one of the words above
    why: str = ""
    error: CmmUqError | None = None
    results: Mapping[str, Any] = field(default_factory=dict)  # contents of results.json where it was reported
    notices: Sequence[Notice] = ()  # of what a person must hear of the certificate
    seconds: float = 0.0

    @classmethod
    def refused(cls, job: JobFolder, error: CmmUqError) -> JobOutcome:
        """Of a job that an error stopped."""
        return cls(job, FAILED if isinstance(error, OutputError) else REFUSED, str(error), error)

    @property
    def name(self) -> str:
        """Id of the job, or its folder where it has none."""
        return self.job.id or str(self.job.folder)

    @property
    def events(self) -> list[str]:
        """What a person must hear of."""
        return [notice.event for notice in self.notices] if self.error is None else ["error"]

    @property
    def code(self) -> int:
        """Exit code for this alone: 0 well, 1 needs a person, 2 bad input, 3 no output possible."""
        if self.error is not None:
            return 3 if isinstance(self.error, OutputError) else 2
        return int(bool(self.notices))

    def line(self) -> dict[str, Any]:
        """What is told of it, for a program."""
        error, results = self.error, self.results
        told = {
            "job": self.job.id or None, "folder": str(self.job.folder), "state": self.state, "why": self.why or None,
            "decisions": decisions(results), "verdict": (results.get("diagnosis") or {}).get("verdict"),
            "events": self.events, "seconds": round(self.seconds, 3), "exit_code": self.code,
        }  # fmt: skip
        if error is not None:
            told["error"] = {"problem": error.problem, "where": error.where, "fix": error.fix}
        return told


@dataclass(frozen=True)
class JobReporting:
    out: Path  # folder with a folder for each job
    state: FolderState  # what earlier runs have done
    report: Report
    queue: Callable[[Sequence[Notice]], object]  # lets notices go out, before a job counts as done
    further: Callable[[JobFolder], Iterable[Notice]] = lambda job: ()  # of the machine, after a report
    still: Callable[[JobFolder], Iterable[Notice]] = lambda job: ()  # and later, of its newest certificate
    seen: dict[str, Mapping[str, Any] | None] = field(default_factory=dict)  # results of the last job looked at

    def lock_of(self, job: JobFolder) -> Path:
        """Its lock file; one for two ids that some systems take for one."""
        return self.out / PRIVATE / "locks" / f"{job.id.casefold()}.lock"

    def was_left(self, job: JobFolder) -> bool:
        """Whether the last run ended in this job."""
        return bool(job.id) and states.was_left(self.lock_of(job))

    def reason(self, job: JobFolder) -> str:
        """Why a job is to be reported; empty where its certificate stands."""
        self.seen.clear()
        if job.id:
            self.seen[job.id] = self.state.results(job.id)
        known = inputs_of(self.seen.get(job.id))
        if known is None:
            return "new"  # one without an id is refused when it is read
        changed = differing(job, known)
        if changed and self.state.released(job.id):
            raise CmmUqError(f"{', '.join(changed)} changed after the certificate was released", where=str(job.folder),
                             fix="Give the new recording a job id of its own, or withdraw the certificate")  # fmt: skip
        return f"changed: {', '.join(changed)}" if changed else ""

    def standing(self, job: JobFolder) -> list[Notice]:
        """What a person must hear of the certificate of an unchanged job until it is released, withdrawn or replaced."""
        results = self.seen.get(job.id)
        found = [] if results is None else [*self._notices(job, results), *self.still(job)]
        return found if found and self.state.is_draft(job.id) else []

    def _notices(self, job: JobFolder, results: Mapping[str, Any]) -> list[Notice]:
        inputs = json.dumps(results.get("job", {}).get("inputs_sha256", {}), sort_keys=True)
        return of_results(results, hashlib.sha256(inputs.encode()).hexdigest(), str(self.out / job.id))

    def take(self, job: JobFolder) -> JobOutcome:
        """Report a job unless it has its certificate, or another run is at it."""
        begun, where = time.monotonic(), str(job.folder)
        try:
            ended = self._alone(job)
        except Exception as error:  # whatever a job makes break, the next one is to be reported
            refusal = error if isinstance(error, CmmUqError) else told_with_package(error)
            if isinstance(error, MemoryError):
                refusal = CmmUqError("the memory does not suffice for this input", where=where)
            elif refusal is None:
                problem = f"a fault of the program: {type(error).__name__}: {error}"
                refusal = CmmUqError(problem, where=where, fix="Please report it with the input")
            ended = JobOutcome.refused(job, refusal)
            if not (job.folder / JOB_FILE).exists() and job.root.is_dir():
                ended = JobOutcome(job, GONE, "the folder went away meanwhile")
        return replace(ended, seconds=time.monotonic() - begun)

    def _alone(self, job: JobFolder) -> JobOutcome:
        if not job.id:
            self.report(job)
            return JobOutcome(job, WAITING, "was changed while it was read: left for the next run")
        folder = self.out / job.id
        with states.turn(self.lock_of(job)) as turn:
            if turn is None:
                return JobOutcome(job, BUSY, "another run is at it")
            finish_interrupted(folder)
            why = self.reason(job)  # asked again: another run may have been through with it
            if not why:  # what it leaves to do is said by every run
                return JobOutcome(job, UNCHANGED)
            results = json.loads(self.report(job))
            turn.through = False  # until its messages wait to be sent, the next run has to look at it again
            notices = [*self._notices(job, results), *self.further(job)]
            self.queue(notices)
            turn.through = True
            return JobOutcome(job, REPORTED, why, results=results, notices=notices)
